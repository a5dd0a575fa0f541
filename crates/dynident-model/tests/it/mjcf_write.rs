//! Writing into an MJCF: the new values can be read, and all other bytes stay.

use crate::common::assert_same_inertials;
use dynident_model::mjcf::included_from;
use dynident_model::{
    DescriptionFormat, InertialParameters, JointChange, LinkChange, Mat3, Model, Vec3, link_changes, load_robot,
    read_mjcf, read_mjcf_with, rewrite_mjcf,
};
use dynident_testing::repository;

fn no_files(_: &str) -> Result<String, String> {
    Err("no files".to_owned())
}

/// Physically consistent bodies: those of the description plus a point mass.
fn other_bodies(model: &Model) -> Vec<InertialParameters> {
    let beside = |(k, inertial): (usize, &InertialParameters)| {
        let place = Vec3([0.02 + 0.01 * k as f64, -0.03, 0.05]);
        let ball = Mat3::IDENTITY.scale(0.001);
        inertial.plus(&InertialParameters::from_centre_of_mass(0.25 + 0.125 * k as f64, place, &ball))
    };
    model.inertials().iter().enumerate().map(beside).collect()
}

/// Every model of `golden/mjcf` accepts new bodies and drives or is rejected with a known reason; without a change all
/// bytes stay.
#[test]
fn published_models_take_new_bodies_and_drives() {
    let mut written = 0;
    for entry in std::fs::read_dir(repository("golden/mjcf")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "xml") {
            continue;
        }
        let robot = load_robot(&path).unwrap();
        assert_eq!(robot.format, DescriptionFormat::Mjcf);
        let (model, text) = (&robot.model, &robot.text);
        let mut files = included_from(path.parent().unwrap());
        assert_eq!(rewrite_mjcf(text, &mut files, &[], &[]).unwrap(), *text);
        let bodies = other_bodies(model);
        let links = link_changes(model, &bodies).unwrap();
        let joints: Vec<JointChange> = model
            .joints()
            .iter()
            .map(|joint| JointChange {
                joint: joint.name.clone(),
                damping: Some(0.125),
                friction: Some(1.0 / 3.0),
                drive_inertia: Some(0.0625),
                stiffness: None,
            })
            .collect();
        match rewrite_mjcf(text, &mut files, &links, &joints) {
            Ok(new) => {
                let again = read_mjcf_with(&new, &mut files).unwrap().model;
                let name = path.display().to_string();
                assert_same_inertials(&again, &bodies, &name);
                for (new, old) in again.joints().iter().zip(model.joints()) {
                    let drive = (new.damping, new.friction, new.drive_inertia);
                    assert_eq!(drive, (Some(0.125), Some(1.0 / 3.0), Some(0.0625)), "{name}");
                    assert_eq!((&new.placement, &new.axis, &new.limits), (&old.placement, &old.axis, &old.limits));
                }
                written += 1;
            }
            // Two joints in one body, or a compiler setting that changes masses.
            Err(error) => {
                let message = error.to_string();
                let known = ["is between two joints", "of <compiler> changes the masses"];
                assert!(known.iter().any(|known| message.contains(known)), "{}: {message}", path.display());
            }
        }
    }
    assert!(written >= 15, "{written}");
}

/// The writer gives exactly the file that MuJoCo has loaded and computed with (`golden/mjcf.py`).
#[test]
fn the_written_panda_is_the_one_that_mujoco_has_read() {
    let robot = load_robot(repository("golden/mjcf/robosuite_panda.xml")).unwrap();
    let bodies = other_bodies(&robot.model);
    let links = link_changes(&robot.model, &bodies).unwrap();
    let joint = JointChange {
        joint: "joint4".to_owned(),
        damping: Some(0.75),
        friction: Some(1.5),
        drive_inertia: Some(0.25),
        stiffness: None,
    };
    let written = rewrite_mjcf(&robot.text, &mut no_files, &links, &[joint]).unwrap();
    let expected = repository("golden/mjcf/written_panda.xml");
    assert_eq!(written, std::fs::read_to_string(expected).unwrap());
    assert_same_inertials(&load_robot(repository("golden/mjcf/written_panda.xml")).unwrap().model, &bodies, "panda");
}

const ARM: &str = "<mujoco>\r\n  <!-- mine -->\r\n  <worldbody>\r\n    <body name='a' pos=\"0 0 1\">\r\n      <joint name=\"j\" \
                   damping = '3' pos=\"0.5 0 0\"/>\r\n      <frame pos=\"0 0 1\">\r\n        <inertial pos=\"0 0 0\" mass=\"1\" \
                   diaginertia=\"1 1 1\"/>\r\n      </frame>\r\n      <geom size=\"1\"/>\r\n      <body name=\"tip\">\r\n        \
                   <geom size=\"0.1\"/>\r\n      </body>\r\n    </body>\r\n  </worldbody>\r\n</mujoco>\r\n";

#[test]
fn only_inertials_and_drives_change() {
    let model = read_mjcf(ARM).unwrap().model;
    // The link's frame is at the hinge, half a metre along x.
    let inertial = InertialParameters::from_centre_of_mass(2.0, Vec3([0.25, 0.0, 0.0]), &Mat3::IDENTITY);
    let links = link_changes(&model, &[inertial]).unwrap();
    let joint = JointChange {
        joint: "j".to_owned(),
        damping: Some(0.5),
        friction: None,
        drive_inertia: Some(0.1),
        stiffness: None,
    };
    let written = rewrite_mjcf(ARM, &mut no_files, &links, &[joint]).unwrap();
    let expected = ARM
        .replace("'3'", "'0.5'")
        .replace("<joint", "<joint armature=\"0.1\"")
        .replace("\r\n        <inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>", "")
        .replace(
            "pos=\"0 0 1\">\r\n      <joint",
            "pos=\"0 0 1\">\r\n      <inertial pos=\"0.75 0.0 0.0\" mass=\"2.0\" fullinertia=\"1.0 1.0 1.0 0.0 0.0 0.0\"><!-- includes the \
             links fixed to this one, whose inertials were removed: tip --></inertial>\r\n      <joint",
        )
        .replace(
            "<body name=\"tip\">",
            "<body name=\"tip\">\r\n        <inertial pos=\"0 0 0\" mass=\"0\" diaginertia=\"0 0 0\"/>",
        );
    assert_eq!(written, expected);
}

#[test]
fn values_that_mujoco_rejects_or_changes_are_refused() {
    let set = |link: &str, inertial| LinkChange::Set { link: link.to_owned(), inertial, note: None };
    let ball = InertialParameters::from_centre_of_mass(1.0, Vec3::ZERO, &Mat3::IDENTITY);
    let refused =
        |text: &str, link: LinkChange| rewrite_mjcf(text, &mut no_files, &[link], &[]).unwrap_err().to_string();
    assert!(refused(ARM, set("b", ball)).contains("the MJCF has no body `b`"));
    for faulty in [
        InertialParameters::ZERO,
        InertialParameters::from_centre_of_mass(-1.0, Vec3::ZERO, &Mat3::IDENTITY),
        InertialParameters::from_centre_of_mass(
            1.0,
            Vec3::ZERO,
            &Mat3([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]]),
        ),
        InertialParameters::from_centre_of_mass(1.0, Vec3::ZERO, &Mat3::ZERO),
    ] {
        assert!(refused(ARM, set("a", faulty)).contains("not physically consistent"), "{faulty:?}");
    }
    let mut infinite = ball;
    infinite.0[3] = f64::INFINITY;
    assert!(refused(ARM, set("a", infinite)).contains("not all finite"));
    for (setting, value) in
        [("settotalmass", "3"), ("inertiafromgeom", "true"), ("boundmass", "2"), ("boundinertia", "5")]
    {
        let text = ARM.replace("  <worldbody>", &format!("  <compiler {setting}=\"{value}\"/>\r\n  <worldbody>"));
        let message = refused(&text, set("a", ball));
        assert!(message.starts_with(&format!("`{setting}` of <compiler> changes the masses")), "{message}");
    }
    let two = ARM.replace("<joint ", "<joint name=\"i\"/><joint ");
    assert!(refused(&two, set("a/i", ball)).contains("`a/i` is between two joints"));
    let joint = |joint: &str, damping| JointChange {
        joint: joint.to_owned(),
        damping: Some(damping),
        friction: None,
        drive_inertia: None,
        stiffness: None,
    };
    let refused = |joints: &[JointChange]| rewrite_mjcf(ARM, &mut no_files, &[], joints).unwrap_err().to_string();
    assert!(refused(&[joint("k", 1.0)]).contains("the MJCF has no joint `k`"));
    assert!(refused(&[joint("j", f64::NAN)]).contains("not all finite"));
    assert!(refused(&[joint("j", 1.0), joint("j", 2.0)]).contains("two changes to joint `j`"));
    let both = [set("a", ball), set("a", ball)];
    assert!(rewrite_mjcf(ARM, &mut no_files, &both, &[]).unwrap_err().to_string().contains("two changes to body `a`"));
    let main = "<mujoco><include file=\"arm.xml\"/></mujoco>";
    let mut arm = |_: &str| Ok(ARM.to_owned());
    let error = rewrite_mjcf(main, &mut arm, &[set("a", ball)], &[]).unwrap_err().to_string();
    assert!(error.contains("body `a` is in an included file"), "{error}");
}
