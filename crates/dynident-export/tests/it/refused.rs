//! Errors of models that cannot be exported.

use super::common::{all_terms, tree};
use dynident_export::{CodeOptions, RobotModel, Target, export, export_with};
use dynident_model::terms::{Coulomb, CoulombShape, MaxwellSlip, Offset, Stribeck, TorqueTerm};
use dynident_model::{InertialParameters, read_urdf};

fn message(term: TorqueTerm) -> String {
    let model = tree().model().clone();
    let robot = RobotModel::new(model, vec![term], vec![1.0]).unwrap();
    export(&robot, Target::C, &[]).unwrap_err().to_string()
}

#[test]
fn terms_that_need_more_than_the_motion() {
    let slip = message(TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: 0.01 }));
    assert!(slip.contains("slip1_0.01 (maxwell-slip)") && slip.contains("the motion before"), "{slip}");
}

#[test]
fn options_of_other_forms() {
    let with = |target, options| export_with(&tree(), target, options, &[]).unwrap_err().to_string();
    let float32 = CodeOptions { float32: true, ..CodeOptions::default() };
    let message = with(Target::Python, float32);
    assert_eq!(message, "the form python has no option float32: omit the option, or use one of c, cpp, rust");
    let regressor = CodeOptions { regressor: true, ..CodeOptions::default() };
    assert!(with(Target::Urdf, regressor).contains("the form urdf has no option regressor"));
    let width = |width| CodeOptions { step_width: Some(width), ..CodeOptions::default() };
    assert!(with(Target::Json, width(0.1)).contains("step-width"));
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(with(Target::C, width(wrong)).contains("is not a positive finite number"));
    }
    // A number of 32 bits ends at 3.4e38.
    let model = tree().model().clone();
    let large = RobotModel::new(model, vec![TorqueTerm::Offset(Offset { joint: 0 })], vec![1e39]).unwrap();
    assert!(export_with(&large, Target::C, float32, &[]).is_err() && export(&large, Target::C, &[]).is_ok());
}

/// Signs and narrow steps get the requested width, wider steps keep theirs.
#[test]
fn steps_have_the_requested_width() {
    let model = tree().model().clone();
    let step = |joint, shape| TorqueTerm::Coulomb(Coulomb { joint, shape });
    let shapes = [
        CoulombShape::Sign { dead_band: 0.01 },
        CoulombShape::Smooth { width: 1e-4 },
        CoulombShape::Smooth { width: 0.5 },
    ];
    let terms = shapes.into_iter().enumerate().map(|(joint, shape)| step(joint, shape)).collect();
    let robot = RobotModel::new(model, terms, vec![1.0, 2.0, 3.0]).unwrap();
    let options = CodeOptions { step_width: Some(0.125), ..CodeOptions::default() };
    let text = export_with(&robot, Target::C, options, &[]).unwrap().text;
    for line in
        ["tau[0] = tanh(dq[0] * 8.0);", "tau[1] = tanh(dq[1] * 8.0) * 2.0;", "tau[2] = tanh(dq[2] * 2.0) * 3.0;"]
    {
        assert!(text.contains(line), "{line}: {text}");
    }
}

#[test]
fn invalid_values_are_refused() {
    let model = tree().model().clone();
    let offset = || vec![TorqueTerm::Offset(Offset { joint: 0 })];
    let error = RobotModel::new(model.clone(), offset(), Vec::new()).unwrap_err();
    assert_eq!(error.to_string(), "0 values for 1 torque terms: give one for each");
    let error = RobotModel::new(model.clone(), offset(), vec![f64::NAN]).unwrap_err();
    assert_eq!(error.to_string(), "the value of off1 is NaN, not a finite number");
    let far = vec![TorqueTerm::Offset(Offset { joint: 9 })];
    assert!(RobotModel::new(model, far, vec![0.0]).unwrap_err().to_string().contains("off10"));
}

#[test]
fn a_joint_that_moves_nothing() {
    let text = r#"<robot name="ghost"><link name="base"/><link name="arm"><inertial><mass value="0"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"#;
    let model = read_urdf(text).unwrap().model;
    let robot = RobotModel::new(model, Vec::new(), Vec::new()).unwrap();
    assert!(export(&robot, Target::C, &[]).unwrap_err().to_string().contains("joint `hinge` moves no inertia"));
}

#[test]
fn temperature_terms_are_noted() {
    let exported = export(&all_terms("ur10.urdf"), Target::Python, &[]).unwrap();
    let note = "fvT1 is left out: the drive is assumed to be at 25 °C.";
    assert_eq!(exported.notes, [note]);
    assert!(exported.text.contains(note));
}

/// No format writes `inf` for numbers that overflow.
#[test]
fn numbers_that_overflow() {
    let model = tree().model().clone();
    let with = |body: [f64; 10]| {
        let mut inertials = model.inertials().to_vec();
        inertials[1] = InertialParameters(body);
        RobotModel::new(model.with_inertials(&inertials).unwrap(), Vec::new(), Vec::new()).unwrap_err().to_string()
    };
    let large = with([1e308; 10]);
    assert!(large.contains("body `left`") && large.contains("1e308"), "{large}");
    // The centre of mass is the first moment divided by the mass.
    let mut light = [0.0; 10];
    (light[0], light[1]) = (1e-305, 1e8);
    assert!(with(light).contains("the centre of mass is inf"), "{}", with(light));
    let steep = Stribeck { joint: 0, speed: 1e-300, exponent: 3.0, shape: CoulombShape::Smooth { width: 0.1 } };
    let robot = RobotModel::new(model.clone(), vec![TorqueTerm::Stribeck(steep)], vec![1e300]).unwrap();
    for target in Target::ALL {
        let written = export(&robot, target, &[]).map(|written| written.text.to_lowercase());
        assert!(written.as_ref().is_ok_and(|text| !text.contains("inf")) || written.is_err(), "{written:?}");
    }
}
