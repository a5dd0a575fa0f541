//! JSON, ROS 2 parameters and SDF. `.ci/export.py` shows that PyYAML, jsonschema and libsdformat read them, and that
//! Pinocchio computes the same torques from the numbers.

use super::common::{TOLERANCE, all_terms, expected, tree};
use dynident_export::{ModelFile, NearestFriction, RobotModel, Target, export};
use dynident_model::terms::{CoulombShape, LoadFriction, MaxwellSlip, TorqueTerm};
use dynident_model::{InertialParameters, read_urdf};
use serde_json::Value;

/// Torque of a term at its joint's velocity, computed from the file alone.
fn law(term: &Value, dq: f64) -> f64 {
    let constants = &term["constants"];
    let number = |name: &str| {
        let units = ["", "_rad_s", "_m_s", "_s_per_rad", "_s_per_m"];
        let found = units.iter().find_map(|unit| constants[format!("{name}{unit}")].as_f64());
        found.unwrap_or_else(|| panic!("{name}: {term}"))
    };
    let step = |dq: f64| match constants["shape"].as_str().unwrap() {
        "smooth" => (dq / number("width")).tanh(),
        "sign" if dq.abs() > number("dead_band") => dq.signum(),
        "sign" => 0.0,
        other => panic!("{other}"),
    };
    let part = |x: f64| if constants["direction"] == "+" { x.max(0.0) } else { x.min(0.0) };
    let function = match term["kind"].as_str().unwrap() {
        "viscous" => dq,
        "coulomb" => step(dq),
        "directional-viscous" => part(dq),
        "directional-coulomb" => part(step(dq)),
        "stribeck" => (-(dq / number("speed")).abs().powf(number("exponent"))).exp() * step(dq),
        "sigmoid" => {
            let logistic = |v: f64| 1.0 / (1.0 + (-number("steepness") * (v + number("offset_speed"))).exp());
            logistic(dq) - logistic(0.0)
        }
        "power" => dq * dq.hypot(number("rounding")).powf(number("exponent") - 1.0),
        "offset" => 1.0,
        // Acceleration is zero, temperature is at its reference, and position-dependent torque is not friction.
        "drive-inertia" | "temperature-viscous" | "declared" => 0.0,
        other => panic!("{other}"),
    };
    term["value"].as_f64().unwrap() * function
}

/// Friction torque of a coupling on both joints.
fn coupled(term: &Value, dq: [f64; 2]) -> [f64; 2] {
    let ratios = [0, 1].map(|k| term["constants"]["ratios"][k].as_f64().unwrap());
    let value = term["value"].as_f64().unwrap();
    match term["constants"]["effect"].as_str().unwrap() {
        "inertia" => [0.0; 2],
        "viscous" => [dq[1], dq[0]].map(|other| value * ratios[0] * ratios[1] * other),
        "coulomb" => {
            let (felt, band) = (ratios[0] * dq[0] + ratios[1] * dq[1], &term["constants"]["dead_band_rad_s"]);
            let sign = if felt.abs() > band.as_f64().unwrap() { felt.signum() } else { 0.0 };
            ratios.map(|ratio| value * ratio * sign)
        }
        other => panic!("{other}"),
    }
}

#[test]
fn json_friction_equals_the_core() {
    for robot in [all_terms("ur10.urdf"), tree()] {
        let text = export(&robot, Target::Json, &["From here.".to_owned()]).unwrap().text;
        let file: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(dynident_testing::schema::differences("model", &file), Vec::<String>::new());
        let joints = file["joints"].as_array().unwrap();
        let place = |name: &Value| joints.iter().position(|joint| joint["name"] == *name).unwrap();
        for state in expected(&robot) {
            let mut friction: Vec<f64> = joints
                .iter()
                .zip(&state.dq)
                .map(|(joint, &dq)| joint["terms"].as_array().unwrap().iter().map(|term| law(term, dq)).sum())
                .collect();
            for term in file["couplings"].as_array().unwrap() {
                let [a, b] = [0, 1].map(|k| place(&term["joints"][k]));
                let [tau_a, tau_b] = coupled(term, [state.dq[a], state.dq[b]]);
                friction[a] += tau_a;
                friction[b] += tau_b;
            }
            let scale = friction.iter().fold(1.0, |most: f64, tau| most.max(tau.abs()));
            for (found, expected) in friction.iter().zip(&state.outputs[3]) {
                assert!((found - expected).abs() < TOLERANCE * scale, "{found} {expected}");
            }
        }
    }
}

#[test]
fn json_keeps_every_bit_of_the_robot() {
    let robot = tree();
    let text = export(&robot, Target::Json, &[]).unwrap().text;
    let back: ModelFile = serde_json::from_str(&text).unwrap();
    assert_eq!(back, ModelFile::of(&robot, &[]));
    assert_eq!(back.gravity_m_s2, robot.model().gravity().0);
    for (joint, (found, inertial)) in
        robot.model().joints().iter().zip(back.joints.iter().zip(robot.model().inertials()))
    {
        assert_eq!((&found.name, found.body.parameters, found.axis), (&joint.name, inertial.0, joint.axis.0));
        assert_eq!(found.placement.rotation, joint.placement.rotation.0);
    }
    assert_eq!(back.joints[2].parent.as_deref(), Some("slide"));
    // Units of a prismatic joint.
    let stribeck = back.joints[1].terms.iter().find(|term| term.kind == "stribeck").unwrap();
    assert_eq!(stribeck.unit, "N");
    let names: Vec<&str> = stribeck.constants.keys().map(String::as_str).collect();
    assert_eq!(names, ["dead_band_m_s", "exponent", "shape", "speed_m_s"]);
    let units: Vec<&str> = back.joints[1].terms.iter().map(|term| term.unit.as_str()).collect();
    assert!(units.contains(&"N s/m") && units.contains(&"kg"), "{units:?}");
}

#[test]
fn json_and_yaml_contain_terms_that_code_cannot() {
    let load = TorqueTerm::Load(LoadFriction { joint: 1, shape: CoulombShape::Smooth { width: 0.1 } });
    let slip = TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: 0.01 });
    let robot = RobotModel::new(tree().model().clone(), vec![load, slip], vec![0.2, 3.0]).unwrap();
    let json = export(&robot, Target::Json, &[]).unwrap().text;
    let yaml = export(&robot, Target::Ros2Yaml, &[]).unwrap().text;
    for said in ["\"maxwell-slip\"", "yield_displacement_rad", "\"load\"", "width_m_s"] {
        assert!(json.contains(said), "{said}: {json}");
        assert!(yaml.contains(said), "{said}: {yaml}");
    }
    assert!(yaml.contains("      slip1_0_01:\n"), "{yaml}");
}

#[test]
fn parameters_of_ros() {
    let robot = tree();
    let exported = export(&robot, Target::Ros2Yaml, &["one\nline\u{2028}only".to_owned()]).unwrap();
    let (text, nearest) = (&exported.text, NearestFriction::of(&robot, 1));
    for said in [
        "# one\\u000aline\\u2028only\n",
        "/**:\n  ros__parameters:\n    robot: \"2 branches\"\n    joints: [\"turn\", \"slide\", \"wrist\", \"swing\"]\n",
        "    gravity_m_s2: [0.0, 0.0, -9.81]\n",
        "      slide:\n",
        "        link: \"left\"\n        mass_kg: 2.5\n",
        "        drive_inertia_kg: 0.7",
        &format!("        coulomb_n: {:?}\n        viscous_n_s_per_m: {:?}\n", nearest.coulomb, nearest.viscous),
        "    couplings:\n      Ia_a:\n        kind: \"coupling\"\n        value: 0.2\n",
        "        joints: [\"turn\", \"swing\"]\n",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
    // Renamed parts, here because of a dot, are reported.
    let dotted = robot_named("arm.1/joint");
    let exported = export(&dotted, Target::Ros2Yaml, &[]).unwrap();
    assert!(exported.text.contains("      arm_1_joint:\n") && exported.text.contains("joints: [\"arm.1/joint\"]"));
    assert!(exported.notes.iter().any(|note| note == "Joint arm.1/joint is under dynamics.arm_1_joint."));
}

/// One link on one joint, both with this name.
fn robot_named(name: &str) -> RobotModel {
    let text = format!(
        r#"<robot name="world"><link name="base"/><link name="{name}"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="{name}" type="continuous"><parent link="base"/><child link="{name}"/><axis xyz="0 1 0"/></joint></robot>"#
    );
    RobotModel::new(read_urdf(&text).unwrap().model, Vec::new(), Vec::new()).unwrap()
}

#[test]
fn sdf_notes_unsupported_contents() {
    let exported = export(&tree(), Target::Sdf, &[]).unwrap();
    for said in ["SDF has no drive inertia: Ia1 = 0.7 kg m² is left out.", "Ia_a = 0.2", "off by"] {
        assert!(exported.notes.iter().any(|note| note.contains(said)), "{said}: {:#?}", exported.notes);
        assert!(exported.text.contains(said), "{said}");
    }
    let slanted = export(&all_terms("ur10.urdf"), Target::Sdf, &[]).unwrap();
    assert!(slanted.text.contains("set the gravity of the world to [1.0, -3.0, -9.0] m/s² (in the base frame)"));
}

#[test]
fn names_that_sdf_does_not_allow() {
    let exported = export(&robot_named("a::b"), Target::Sdf, &[]).unwrap();
    let text = &exported.text;
    assert!(text.contains("<model name=\"robot_world\">") && text.contains("<link name=\"a_b\">"), "{text}");
    assert!(text.contains("<joint name=\"a_b_\" type=\"continuous\">"), "{text}");
    assert_eq!(exported.notes.iter().filter(|note| note.contains("a::b")).count(), 2, "{:#?}", exported.notes);
}

#[test]
fn a_body_that_cannot_be_real_is_refused_by_its_reader() {
    let robot = robot_named("arm");
    let negative = InertialParameters([-1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.1]);
    let model = robot.model().with_inertials(&[negative]).unwrap();
    let robot = RobotModel::new(model, Vec::new(), Vec::new()).unwrap();
    let refused = export(&robot, Target::Sdf, &[]).unwrap_err().to_string();
    assert!(refused.contains("body `arm`") && refused.contains("libsdformat would refuse it"), "{refused}");
    assert!(export(&robot, Target::Mjcf, &[]).unwrap_err().to_string().contains("MuJoCo would refuse it"));
    // These formats accept any numbers.
    assert!(export(&robot, Target::Json, &[]).is_ok() && export(&robot, Target::Ros2Yaml, &[]).is_ok());
}
