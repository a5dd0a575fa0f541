//! Writing into an SDF: the new values can be read, and all other bytes stay.

use dynident_model::{
    Body, InertialParameters, JointChange, LinkChange, Mat3, Model, Vec3, link_changes, load_robot, read_sdf,
    rewrite_sdf,
};
use dynident_testing::repository;

/// The model with only the own link of every moving body: fixed links keep their inertial.
fn own_links(model: &Model) -> Model {
    let own = |body: &Body| Body { links: vec![body.links[0].clone()] };
    let bodies = model.bodies().iter().map(own).collect();
    Model::new(model.name(), model.base().clone(), model.joints().to_vec(), bodies).unwrap()
}

/// Physically consistent bodies of no particular robot.
fn other_inertials(count: usize) -> Vec<InertialParameters> {
    let of = |k: usize| {
        let place = Vec3([0.02 + 0.01 * k as f64, -0.03, 0.05]);
        let inertia = Mat3([[0.03, 0.001, -0.002], [0.001, 0.02, 0.0005], [-0.002, 0.0005, 0.025]]);
        InertialParameters::from_centre_of_mass(0.25 + 0.125 * k as f64, place, &inertia)
    };
    (0..count).map(of).collect()
}

/// Every model of `golden/sdf` accepts new bodies and drives; without a change all bytes stay.
#[test]
fn every_model_takes_new_bodies_and_drives() {
    let mut written = 0;
    for entry in std::fs::read_dir(repository("golden/sdf")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "sdf") {
            continue;
        }
        let (name, text) = (path.display().to_string(), std::fs::read_to_string(&path).unwrap());
        let model = read_sdf(&text).unwrap().model;
        assert_eq!(rewrite_sdf(&text, &[], &[]).unwrap(), text, "{name}");
        let inertials = other_inertials(model.dof());
        let links = link_changes(&own_links(&model), &inertials).unwrap();
        let drive = |name: &str| JointChange {
            joint: name.to_owned(),
            damping: Some(0.125),
            friction: Some(1.0 / 3.0),
            drive_inertia: Some(0.0625),
            stiffness: None,
        };
        let joints: Vec<JointChange> = model.joints().iter().map(|joint| drive(&joint.name)).collect();
        let new = rewrite_sdf(&text, &links, &joints).unwrap();
        let again = read_sdf(&new).unwrap().model;
        for (found, expected) in own_links(&again).bodies().iter().zip(&inertials) {
            let found = found.links[0].inertial.unwrap();
            let scale = expected.0.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            // Transform to the link's origin, to the centre of mass and back: about ten roundings of lengths of a
            // metre.
            assert!((0..10).all(|k| (found.0[k] - expected.0[k]).abs() <= 1e-12 * scale.max(1.0)), "{name}: {found:?}");
        }
        for (new, old) in again.joints().iter().zip(model.joints()) {
            assert_eq!((new.damping, new.friction), (Some(0.125), Some(1.0 / 3.0)), "{name}: {}", new.name);
            assert_eq!((&new.placement, &new.axis, &new.limits), (&old.placement, &old.axis, &old.limits), "{name}");
        }
        for (new, old) in again.bodies().iter().zip(model.bodies()) {
            assert_eq!(new.links[1..], old.links[1..], "{name}");
        }
        // The same change again has no effect.
        assert_eq!(rewrite_sdf(&new, &links, &joints).unwrap(), new, "{name}");
        written += 1;
    }
    assert!(written >= 22, "{written}");
}

const ARM: &str = "<?xml version='1.0'?>\r\n<sdf version=\"1.9\">\r\n  <model name='a'>\r\n    <!-- mine -->\r\n    <link name='base'/>\r\n    \
                   <link name='rod'>\r\n      <pose>0 0 1 0 0 0</pose>\r\n      <inertial auto=\"true\"><density>3</density></inertial>\r\n    </link>\r\n    \
                   <joint name='j' type='revolute'>\r\n      <pose>0.5 0 0 0 0 0</pose>\r\n      <parent>base</parent>\r\n      <child>rod</child>\r\n      \
                   <axis>\r\n        <xyz>0 1 0</xyz>\r\n        <dynamics><damping>3</damping></dynamics>\r\n      </axis>\r\n    </joint>\r\n  </model>\r\n</sdf>\r\n";

fn set(inertial: InertialParameters) -> LinkChange {
    LinkChange::Set { link: "rod".to_owned(), inertial, note: Some("a -- b".to_owned()) }
}

#[test]
fn only_inertials_and_drives_change() {
    // The link's frame is at the joint, half a metre along x.
    let inertial = InertialParameters::from_centre_of_mass(2.0, Vec3([0.25, 0.0, 0.0]), &Mat3::IDENTITY);
    let joint = JointChange {
        joint: "j".to_owned(),
        damping: Some(0.5),
        friction: Some(0.25),
        drive_inertia: None,
        stiffness: None,
    };
    let written = rewrite_sdf(ARM, &[set(inertial)], &[joint]).unwrap();
    let new = "<inertial><!-- a - - b --><pose>0.75 0.0 0.0 0 0 0</pose><mass>2.0</mass><inertia><ixx>1.0</ixx><ixy>0.0</ixy><ixz>0.0</ixz><iyy>1.0</iyy>\
               <iyz>0.0</iyz><izz>1.0</izz></inertia><density>3</density></inertial>";
    let expected = ARM
        .replace("<inertial auto=\"true\"><density>3</density></inertial>", new)
        .replace("<dynamics><damping>3</damping>", "<dynamics><friction>0.25</friction><damping>0.5</damping>");
    assert_eq!(written.replace("\r\n          ", "").replace("\r\n        </dyn", "</dyn"), expected);
}

#[test]
fn invalid_changes_are_refused() {
    let good = InertialParameters::from_centre_of_mass(2.0, Vec3([0.25, 0.0, 0.0]), &Mat3::IDENTITY);
    let refused =
        |links: &[LinkChange], joints: &[JointChange]| rewrite_sdf(ARM, links, joints).unwrap_err().to_string();
    let joint = |name: &str, damping| JointChange {
        joint: name.to_owned(),
        damping: Some(damping),
        friction: None,
        drive_inertia: None,
        stiffness: None,
    };
    assert!(refused(&[set(InertialParameters::ZERO)], &[]).contains("`rod` are not physically consistent"));
    let mut broken = good;
    broken.0[3] = f64::NAN;
    assert!(refused(&[set(broken)], &[]).contains("link `rod` are not all finite"));
    assert!(refused(&[set(good), set(good)], &[]).contains("two changes to link `rod`"));
    let remove = LinkChange::Remove { link: "rod".to_owned() };
    assert!(refused(&[remove], &[]).contains("default is 1 kg"));
    let ghost = LinkChange::Set { link: "j".to_owned(), inertial: good, note: None };
    assert!(refused(&[ghost], &[]).contains("no link `j`"));
    assert!(refused(&[], &[joint("rod", 1.0)]).contains("no joint `rod`"));
    assert!(refused(&[], &[joint("j", f64::NAN)]).contains("joint `j` are not all finite"));
    assert!(refused(&[], &[joint("j", 1.0), joint("j", 1.0)]).contains("two changes to joint `j`"));
    assert!(rewrite_sdf("<sdf", &[], &[]).is_err());
}

/// The writer gives exactly the file that Drake has loaded and computed with (`golden/sdf.py`).
#[test]
fn the_written_model_is_the_one_that_drake_has_read() {
    let robot = load_robot(repository("golden/sdf/rules_poses.sdf")).unwrap();
    let inertials = other_inertials(robot.model.dof());
    let links = link_changes(&own_links(&robot.model), &inertials).unwrap();
    let first = robot.model.joints()[0].name.clone();
    let joint =
        JointChange { joint: first, damping: Some(0.75), friction: Some(1.5), drive_inertia: None, stiffness: None };
    let written = rewrite_sdf(&robot.text, &links, &[joint]).unwrap();
    let expected = repository("golden/sdf/written_rules_poses.sdf");
    assert_eq!(written, std::fs::read_to_string(expected).unwrap());
}
