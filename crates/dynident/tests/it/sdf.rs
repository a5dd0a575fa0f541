//! A robot described by an SDF, from the log to the SDF with identified values.

use super::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident_model::{DescriptionFormat, load_robot};

fn identified(description: &std::path::Path) -> dynident::IdentificationOutcome {
    let mut random = Random(5);
    let truth = Truth::other(description, &mut random);
    let dof = truth.drive.len();
    let folder = tempfile::tempdir().unwrap();
    let motion = Motion::new(dof, 12);
    write_log(&folder.path().join("log.csv"), &truth, &motion, (200.0, 15.0), &header(dof), |q, tau| {
        let tau: Vec<f64> = tau.iter().map(|tau| tau + 0.05 * random.normal()).collect();
        [q.to_vec(), tau].concat()
    });
    let study = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\n[format]\ntime = {{ column = \"t\" }}\n\
         position = {{ columns = \"q{{1..{dof}}}\" }}\ntorque = {{ columns = \"tau{{1..{dof}}}\" }}\n",
        description.display().to_string(),
    );
    Job::new(folder.path(), &study).identify()
}

/// A UR5 with other masses: the written SDF and URDF have the bodies of the result.
#[test]
fn the_users_sdf_gets_the_identified_values() {
    let found = identified(&repository("golden/sdf/urdf_ur5.sdf"));
    assert!(found.table.is_none() && found.mjcf.is_none());
    let (sdf, urdf) = (found.sdf.expect("an SDF"), found.urdf.expect("a URDF"));
    assert!(sdf.contains("<!-- dynident ") && found.result.no_sdf.is_none(), "{}", &sdf[..200]);
    let folder = tempfile::tempdir().unwrap();
    for (name, text, format) in
        [("identified.sdf", &sdf, DescriptionFormat::Sdf), ("identified.urdf", &urdf, DescriptionFormat::Urdf)]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let robot = load_robot(&path).unwrap();
        assert_eq!(robot.format, format);
        for (read, found) in robot.model.inertials().iter().zip(&found.inertials) {
            let scale = found.0.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            // To the centre of mass and back: about ten roundings.
            assert!((0..10).all(|k| (read.0[k] - found.0[k]).abs() <= 1e-12 * scale), "{name}: {read:?} {found:?}");
        }
    }
}

/// SDF assumes 1 kg for a fixed link without mass: no SDF has the result's bodies, and the reason is reported.
#[test]
fn a_fixed_link_of_unknown_mass_is_named() {
    let text = std::fs::read_to_string(repository("golden/sdf/urdf_ur5.sdf")).unwrap();
    let tool = "<link name='tool'/><joint name='mount' type='fixed'><parent>wrist_3_link</parent><child>tool</child></joint></model>";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("with_tool.sdf");
    std::fs::write(&path, text.replace("</model>", tool)).unwrap();
    let found = identified(&path);
    assert!(found.sdf.is_none() && found.urdf.is_some());
    let reason = found.result.no_sdf.unwrap();
    assert!(reason.contains("`tool` has no mass, for which SDF assumes 1 kg"), "{reason}");
}
