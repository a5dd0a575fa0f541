//! What the next run is, from the records alone.

use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::{
    Iteration, IterationSettings, IterationStatus, IterationTask, ModelParameters, Next, RunEstimate, RunPlan,
    RunRecord, UsedController,
};
use dynident_model::InertialParameters;
use dynident_model::sample::planar_2r;
use dynident_simulation::Reference;

fn iteration() -> Iteration {
    let tip = InertialParameters([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    let robot = ParametricModel::new(planar_2r(1.0, tip, tip), Vec::new()).unwrap();
    let rest = || vec![0.0; 20];
    let motion = Motion { samples: 10, joints: 2, q: rest(), dq: rest(), ddq: rest(), dddq: Vec::new() };
    let task = IterationTask::new(robot, Reference::new(100.0, motion).unwrap()).unwrap();
    Iteration::new(task, IterationSettings::default()).unwrap()
}

/// An estimate of six parameters, all alike.
fn estimate(value: f64, std: f64) -> RunEstimate {
    RunEstimate {
        values: vec![value; 6],
        std: vec![std; 6],
        covariance: Vec::new(),
        rows: 1000,
        joint_sigma: vec![0.1; 2],
        fixed: Vec::new(),
        possible: Some(vec![value; 20]),
        impossible: None,
        friction: Vec::new(),
        torque_lags: Vec::new(),
    }
}

/// A run of a controller with the model `model` (without one if none), its tracking error and what it determined.
fn run(number: usize, model: Option<f64>, tracking: f64, accepted: bool, estimate: RunEstimate) -> RunRecord {
    let model = model.map(|value| ModelParameters::All(vec![value; 20]));
    RunRecord {
        run: number,
        controller: UsedController { name: "any".to_owned(), model, damping: 1.0, stiffness: 1.0 },
        done: true,
        outcome: "done".to_owned(),
        max_tracking_error_rad: vec![tracking; 2],
        accepted,
        reason: None,
        rehearsal: None,
        estimate: Some(estimate),
    }
}

fn planned(records: &[RunRecord]) -> RunPlan {
    match iteration().next(records).unwrap() {
        Next::Run(plan) => plan,
        Next::Finished(status) => panic!("{status}"),
    }
}

fn model(plan: &RunPlan) -> Option<f64> {
    plan.model.as_ref().map(|model| model.values()[0])
}

/// Bad tracking speaks against the model that was loaded, not against what the run says of the parameters.
#[test]
fn a_rejected_run_with_narrower_bars_gives_the_next_model() {
    let first = run(1, None, 0.5, true, estimate(1.0, 1.0));
    let plan = planned(&[first.clone(), run(2, Some(1.0), 2.0, false, estimate(3.0, 0.1))]);
    assert_eq!((model(&plan), plan.damping), (Some(3.0), 1.0));
    // Bars as wide as before: nothing new; back to the controller without a model, stiffer.
    let plan = planned(&[first, run(2, Some(1.0), 2.0, false, estimate(3.0, 1.0))]);
    assert_eq!((model(&plan), plan.stiffness), (None, 2.0));
}

#[test]
fn a_model_that_was_tried_and_rejected_is_not_tried_again() {
    let records = [
        run(1, None, 0.5, true, estimate(1.0, 1.0)),
        run(2, Some(1.0), 0.2, true, estimate(2.0, 1.0)),
        // The step from 1 to 2 was too much, and this run determines less than the one before.
        run(3, Some(2.0), 2.0, false, estimate(9.0, 5.0)),
    ];
    let plan = planned(&records);
    assert_eq!((model(&plan), plan.damping), (Some(1.5), 0.5));
}

/// A controller without a model that hardly moves the arm does not wipe out what was known.
#[test]
fn a_poor_run_does_not_take_the_place_of_a_good_one() {
    let precise = run(2, Some(1.0), 2.0, false, estimate(3.0, 0.1));
    let failed = RunRecord { done: false, estimate: None, ..run(3, Some(3.0), 2.0, false, estimate(0.0, 1.0)) };
    let poor = run(3, None, 0.4, true, estimate(7.0, 1.0));
    let first = run(1, None, 0.5, true, estimate(1.0, 1.0));
    assert_eq!(model(&planned(&[first.clone(), precise.clone(), poor.clone()])), Some(3.0));
    // Unless the precise one was tried, and failed.
    let poor = RunRecord { run: 4, ..poor };
    assert_eq!(model(&planned(&[first, precise, failed, poor])), Some(7.0));
}

/// Error bars as wide as the parameters: that nothing has moved by more than them says nothing.
#[test]
fn what_is_hardly_known_has_not_settled() {
    let records = |std: f64| {
        [run(1, Some(1.0), 0.5, true, estimate(1.0, std)), run(2, Some(1.0), 0.5, true, estimate(1.0 + std, std))]
    };
    assert_eq!(model(&planned(&records(0.8))), Some(1.8));
    assert_eq!(iteration().next(&records(0.01)).unwrap(), Next::Finished(IterationStatus::Converged));
}
