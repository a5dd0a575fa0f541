use super::simulated_arm::{Simulated, friction, reference, settings};
use dynident_dynamics::ParametricModel;
use dynident_iteration::{
    IterationTask, Robot, RunEstimate, RunIdentificationSettings, RunLog, RunOffsets, RunRequest, identify_runs,
};
use dynident_model::terms::{CoulombShape, Offset, TorqueTerm};
use dynident_simulation::Record;
use dynident_simulation::controllers::{ControllerSettings, JointPdSettings};

fn described() -> ParametricModel {
    let mut terms = friction(CoulombShape::Smooth { width: 0.1 });
    terms.extend([0, 1].map(|joint| TorqueTerm::Offset(Offset { joint })));
    ParametricModel::new(super::simulated_arm::described().model().clone(), terms).unwrap()
}

/// Three runs with joint PD; `added` is the sensor offset of joint 2 in the second run.
fn records(added: f64) -> Vec<Record> {
    let controller = ControllerSettings::JointPd(JointPdSettings { kp: 1200.0.into(), kd: 120.0.into() });
    let (mut robot, reference) = (Simulated::default().robot(), reference());
    let mut run = |run: usize| robot.run(&RunRequest::new(run, &reference, &controller)).unwrap().record;
    let mut records: Vec<Record> = (1..=3).map(&mut run).collect();
    let own = records[1].of(1);
    records[1].tau[own].iter_mut().for_each(|tau| *tau += added);
    records
}

fn identified(records: &[Record], run_offsets: RunOffsets) -> RunEstimate {
    let task = IterationTask::new(described(), reference()).unwrap();
    let identification = RunIdentificationSettings { run_offsets, ..settings().identification };
    let runs: Vec<RunLog<'_>> = records
        .iter()
        .enumerate()
        .map(|(place, record)| RunLog {
            run: place + 1,
            legs: &task.legs,
            records: core::slice::from_ref(record),
            joint_sigma: &[],
            differentiator: None,
            rest_margins: &[],
        })
        .collect();
    identify_runs(&task, &runs, &identification).unwrap()
}

/// Largest difference of parameters other than offsets, in error bars, and difference of the offset of joint 2, Nm.
fn apart(one: &RunEstimate, other: &RunEstimate) -> (f64, f64) {
    let names = described().base().expressions();
    let (mut bars, mut offset) = (0.0_f64, 0.0);
    for (k, name) in names.iter().enumerate() {
        let step = one.values[k] - other.values[k];
        if !name.starts_with("off") {
            bars = bars.max(step.abs() / other.std[k]);
        } else if name.contains('2') {
            offset = step;
        }
    }
    (bars, offset)
}

#[test]
fn an_offset_of_one_run_is_its_own() {
    let records = records(2.0);
    let found = identified(&records, RunOffsets::WhereSeen);
    // Two thirds above the mean of the three runs, the others a third below; joint 1 has no offset.
    assert_eq!(found.run_offsets.len(), 6);
    for own in &found.run_offsets {
        let expected = match (own.joint, own.run) {
            (1, 2) => 4.0 / 3.0,
            (1, _) => -2.0 / 3.0,
            _ => 0.0,
        };
        assert!((own.deviation - expected).abs() < 4.5 * own.std && own.std < 0.1, "{own:?}");
    }
    assert_eq!(found, identified(&records, RunOffsets::PerRun));
    // The other parameters are unchanged, and the mean is a third of 2 Nm higher.
    let without = identified(&self::records(0.0), RunOffsets::PerRun);
    let (bars, offset) = apart(&found, &without);
    assert!(bars < 1e-6 && (offset - 2.0 / 3.0).abs() < 1e-6, "{bars} bars, {offset} Nm");
    // A shared offset biases them.
    let shared = identified(&records, RunOffsets::Shared);
    let (bars, _) = apart(&shared, &identified(&self::records(0.0), RunOffsets::Shared));
    assert!(shared.run_offsets.is_empty() && bars > 0.1, "{bars}");
}

/// Runs with equal offsets get no additional columns: the fit is bit-identical to one without.
#[test]
fn offsets_that_are_the_same_are_shared() {
    let mut records = records(0.0);
    let found = identified(&records, RunOffsets::WhereSeen);
    assert!(found.run_offsets.is_empty());
    assert_eq!(found, identified(&records, RunOffsets::Shared));
    // A significant but irrelevant offset is ignored: 0.02 Nm of about 10 Nm.
    let own = records[1].of(1);
    records[1].tau[own].iter_mut().for_each(|tau| *tau += 0.02);
    assert!(identified(&records, RunOffsets::WhereSeen).run_offsets.is_empty());
}
