//! If no motion keeps all limits, the search finds the smallest change of one limit, which is known in closed form
//! here.

use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_excitation::criteria::DOptimal;
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{FloorLimit, JointLimit, LimitKind, LimitSet, Limits, LinkPoint, Relaxation};
use dynident_excitation::{DesignSettings, DesignTask, Family, single_changes};

/// Two rods of 0.5 m that are vertical at zero.
const ARM: &str = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/><link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="1" upper="2" velocity="2" effort="100"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.5"/><limit lower="-2" upper="2" velocity="2" effort="100"/></joint>
  <joint name="end" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0 0 0.5"/></joint></robot>"#;

#[test]
fn a_floor_that_is_too_high_is_lowered_to_what_the_arm_can_keep() {
    let model = dynident_model::read_urdf(ARM).unwrap().model;
    let joint = |name: &str, position| JointLimit {
        joint: name.to_owned(),
        position: Some(position),
        speed: Some(2.0),
        ..JointLimit::default()
    };
    let tip = LinkPoint { link: "tip".to_owned(), ..LinkPoint::default() };
    let limits = Limits {
        joints: vec![joint("shoulder", [1.0, 2.0]), joint("elbow", [-2.0, 2.0])],
        floor: Some(FloorLimit { height_m: 0.9, points: vec![tip], ..FloorLimit::default() }),
        ..Limits::default()
    };
    let set = LimitSet::new(&limits, &model).unwrap();
    let family = Fourier::new(2, 4.0, &FourierSettings { harmonics: 2, ..FourierSettings::default() }).unwrap();
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let layout = PanelLayout::new(&model, base.base_columns());
    let task = DesignTask {
        family: &family,
        criteria: &[&DOptimal],
        limits: &set,
        layout: &layout,
        torque_std_nm: &[1.0, 1.0],
        prior: None,
    };
    // A motion about a middle posture.
    let mut parameters = vec![0.1; family.parameters()];
    parameters[0] = 1.5;
    parameters[family.parameters() / 2] = 0.0;
    let settings = DesignSettings { search_samples: Some(33), ..DesignSettings::default() };
    let found = single_changes(&task, &settings, &parameters, &|| false).unwrap();
    let Some(Relaxation::OtherMotion { kind: LimitKind::Floor, changes }) = found.first() else { panic!("{found:?}") };
    // The tip is highest with the shoulder at 1 rad and the forearm vertical. The search stops within a hundredth of
    // the missing height and its tolerance on samples.
    let highest = 0.5 * 1.0_f64.cos() + 0.5;
    let (_, now, needed, _) = &changes[0];
    assert_eq!(*now, 0.9);
    assert!(*needed < highest + 1e-6 && *needed > highest - 0.02, "{needed} for {highest}");
    // A stopped search returns no change.
    assert!(single_changes(&task, &settings, &parameters, &|| true).unwrap().is_empty());
}
