//! A robot described by an MJCF, from the log to the MJCF with identified values.

use super::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident_model::{DescriptionFormat, load_robot};

/// A UR5e with other masses and drives: the written MJCF has the bodies and drives of the result, and the additional
/// URDF has the same bodies.
#[test]
fn the_users_mjcf_gets_the_identified_values() {
    let description = repository("golden/mjcf/robosuite_ur5e.xml");
    let mut random = Random(5);
    let truth = Truth::other(&description, &mut random);
    let dof = truth.drive.len();
    let folder = tempfile::tempdir().unwrap();
    let motion = Motion::new(dof, 12);
    write_log(&folder.path().join("log.csv"), &truth, &motion, (200.0, 15.0), &header(dof), |q, tau| {
        let tau: Vec<f64> = tau.iter().map(|tau| tau + 0.05 * random.normal()).collect();
        [q.to_vec(), tau].concat()
    });
    let study = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\ndrive.drive_inertia = true\n[format]\ntime = {{ column = \"t\" }}\n\
         position = {{ columns = \"q{{1..{dof}}}\" }}\ntorque = {{ columns = \"tau{{1..{dof}}}\" }}\n",
        description.display().to_string(),
    );
    let found = Job::new(folder.path(), &study).identify();
    let (mjcf, urdf) = (found.mjcf.expect("an MJCF"), found.urdf.expect("a URDF"));
    assert!(found.table.is_none() && found.result.no_mjcf.is_none());
    assert!(mjcf.starts_with("<!-- dynident "), "{}", &mjcf[..80]);
    let mut sums = Vec::new();
    for (name, text) in [("identified.xml", &mjcf), ("identified.urdf", &urdf)] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let robot = load_robot(&path).unwrap();
        for (read, found) in robot.model.inertials().iter().zip(&found.inertials) {
            let scale = found.0.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            // To the centre of mass and back: about ten roundings.
            assert!((0..10).all(|k| (read.0[k] - found.0[k]).abs() <= 1e-12 * scale), "{name}: {read:?} {found:?}");
        }
        let is_mjcf = robot.format == DescriptionFormat::Mjcf;
        let rotors: Vec<Option<f64>> = robot.model.joints().iter().map(|joint| joint.drive_inertia).collect();
        assert!(rotors.iter().all(|rotor| rotor.is_some() == is_mjcf), "{name}: {rotors:?}");
        sums.push(rotors.into_iter().flatten().sum::<f64>());
    }
    let form = found.result.forms.iter().find(|form| form.forms.contains(&"mjcf".to_owned())).unwrap();
    let terms = form.terms.iter().filter(|term| term.symbol.starts_with("Ia"));
    let expected: f64 = terms.map(|term| term.value).sum();
    assert!((sums[0] - expected).abs() < 1e-12 && expected > 0.0, "{sums:?} {expected}");
}

/// A spring at the elbow that is softer than described: identified and written back.
#[test]
fn a_spring_of_the_description_is_identified() {
    const STIFFNESS: f64 = 25.0;
    let mut text = std::fs::read_to_string(repository("golden/mjcf/robosuite_ur5e.xml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let description = folder.path().join("arm.xml");
    let elbow = load_robot(repository("golden/mjcf/robosuite_ur5e.xml")).unwrap().model.joints()[2].name.clone();
    let at = text.find(&format!("name=\"{elbow}\"")).unwrap();
    text.insert_str(at, "stiffness=\"30\" springref=\"0.2\" ");
    std::fs::write(&description, text).unwrap();
    let mut random = Random(6);
    let truth = Truth::other(&description, &mut random);
    let dof = truth.drive.len();
    let motion = Motion::new(dof, 12);
    write_log(&folder.path().join("log.csv"), &truth, &motion, (200.0, 15.0), &header(dof), |q, tau| {
        let mut tau: Vec<f64> = tau.iter().map(|tau| tau + 0.05 * random.normal()).collect();
        tau[2] += STIFFNESS * (q[2] - 0.2);
        [q.to_vec(), tau].concat()
    });
    let study = format!(
        "robot.file = \"arm.xml\"\nlog = [{{ file = \"log.csv\" }}]\ndrive.drive_inertia = true\n[format]\ntime = {{ column = \"t\" }}\n\
         position = {{ columns = \"q{{1..{dof}}}\" }}\ntorque = {{ columns = \"tau{{1..{dof}}}\" }}\n"
    );
    let found = Job::new(folder.path(), &study).identify();
    let name = format!("k_{elbow}");
    let spring = found.result.joints[2].terms.iter().find(|term| term.symbol == name).unwrap();
    let std = spring.std.unwrap();
    // One of 300 robots is off by three standard deviations.
    assert!((spring.value - STIFFNESS).abs() < 3.0 * std && std < 0.5, "{} ± {std}", spring.value);
    let written = folder.path().join("identified.xml");
    std::fs::write(&written, found.mjcf.unwrap()).unwrap();
    let joint = &load_robot(&written).unwrap().model.joints()[2].clone();
    let (read, reference) = joint.spring.map(|spring| (spring.stiffness, spring.reference)).unwrap();
    assert_eq!((read, reference), (spring.value, 0.2));
}
