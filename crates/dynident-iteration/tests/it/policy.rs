use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_identification::examination::{LagChoice, TorqueLag};
use dynident_iteration::{
    Clipping, Iteration, IterationSettings, IterationStatus, IterationTask, JointEvidence, ModelParameters, Next,
    Prediction, RunEstimate, RunEvidence, RunPlan, RunRecord, UnmetCondition, UsedController,
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
        lag: LagChoice::default(),
        differentiator: None,
        near_rest: Vec::new(),
        run_offsets: Vec::new(),
    }
}

/// A run of a controller with the model `model` (or without a model), its tracking error and its estimate.
fn run(number: usize, model: Option<f64>, tracking: f64, accepted: bool, estimate: RunEstimate) -> RunRecord {
    let model = model.map(|value| ModelParameters::All(vec![value; 20]));
    RunRecord {
        run: number,
        motion: None,
        forecast: None,
        controller: UsedController { name: "any".to_owned(), model, damping: 1.0, stiffness: 1.0 },
        done: true,
        outcome: "done".to_owned(),
        max_tracking_error_rad: vec![tracking; 2],
        accepted,
        reason: None,
        rehearsal: None,
        warm_up: None,
        torque_check: None,
        estimate: Some(estimate),
        pooled: None,
        evidence: Some(evidence()),
        held_out: None,
    }
}

fn evidence() -> RunEvidence {
    let joint = JointEvidence {
        torque_rms: 10.0,
        torque_noise: 0.1,
        row_noise: 0.1,
        oscillation: None,
        clipping: None,
        prediction: Some(Prediction { rows: 1000, inside: 0.95, rms_error: 0.1, half_width: 0.2 }),
        tracking_floor_rad: None,
    };
    RunEvidence { log_rates_hz: vec![100.0], joints: vec![joint; 2], feedback_delay_s: None, other_length: None }
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

/// Bad tracking is evidence against the loaded model, not against the estimate of the run.
#[test]
fn a_rejected_run_with_narrower_bars_gives_the_next_model() {
    let first = run(1, None, 0.5, true, estimate(1.0, 1.0));
    let plan = planned(&[first.clone(), run(2, Some(1.0), 2.0, false, estimate(3.0, 0.1))]);
    assert_eq!((model(&plan), plan.damping), (Some(3.0), 1.0));
    // Error bars as wide as before: back to the controller without a model, with higher gains.
    let plan = planned(&[first, run(2, Some(1.0), 2.0, false, estimate(3.0, 1.0))]);
    assert_eq!((model(&plan), plan.stiffness), (None, 2.0));
}

#[test]
fn a_model_that_was_tried_and_rejected_is_not_tried_again() {
    let records = [
        run(1, None, 0.5, true, estimate(1.0, 1.0)),
        run(2, Some(1.0), 0.2, true, estimate(2.0, 1.0)),
        // The step from 1 to 2 was too large, and this run determines less than the one before.
        run(3, Some(2.0), 2.0, false, estimate(9.0, 5.0)),
    ];
    let plan = planned(&records);
    assert_eq!((model(&plan), plan.damping), (Some(1.5), 0.5));
}

#[test]
fn a_poor_run_does_not_take_the_place_of_a_good_one() {
    let precise = run(2, Some(1.0), 2.0, false, estimate(3.0, 0.1));
    let failed = RunRecord { done: false, estimate: None, ..run(3, Some(3.0), 2.0, false, estimate(0.0, 1.0)) };
    let poor = run(3, None, 0.4, true, estimate(7.0, 1.0));
    let first = run(1, None, 0.5, true, estimate(1.0, 1.0));
    assert_eq!(model(&planned(&[first.clone(), precise.clone(), poor.clone()])), Some(3.0));
    // Unless the precise estimate was tried and failed.
    let poor = RunRecord { run: 4, ..poor };
    assert_eq!(model(&planned(&[first, precise, failed, poor])), Some(7.0));
}

/// With error bars as wide as the parameters, constant parameters are not converged.
#[test]
fn what_is_hardly_known_has_not_settled() {
    let records = |std: f64| {
        [run(1, Some(1.0), 1e-4, true, estimate(1.0, std)), run(2, Some(1.0), 1e-4, true, estimate(1.0 + std, std))]
    };
    assert_eq!(model(&planned(&records(0.8))), Some(1.8));
    assert_eq!(iteration().next(&records(0.01)).unwrap(), Next::Finished(IterationStatus::Converged));
}

fn good_pair() -> [RunRecord; 2] {
    [1, 2].map(|number| run(number, Some(1.0), 1e-4, true, estimate(1.0, 0.01)))
}

fn shortfalls(records: &[RunRecord]) -> Vec<UnmetCondition> {
    iteration().shortfalls(records).unwrap()
}

/// Tracking that no longer improves is not convergence: the iteration ends and reports the unmet condition.
#[test]
fn standing_still_is_not_success() {
    let still = |number| run(number, Some(1.0), 1.17, true, estimate(1.0, 0.01));
    let two = [still(1), still(2)];
    assert!(matches!(iteration().next(&two).unwrap(), Next::Run(_)));
    let three = [still(1), still(2), still(3)];
    assert_eq!(iteration().next(&three).unwrap(), Next::Finished(IterationStatus::Settled));
    let unmet = shortfalls(&three);
    assert_eq!(unmet.len(), 2);
    let UnmetCondition::Tracking { error_rad, floor_rad, .. } = &unmet[0] else { panic!("{unmet:?}") };
    assert_eq!((*error_rad, *floor_rad), (1.17, None));
}

/// Tracking cannot be better than the floor from noise, friction and delay: up to twice the floor is accepted.
#[test]
fn tracking_at_its_floor_is_met() {
    for (error, met) in [(1.9e-3, true), (2.1e-3, false)] {
        let mut records = good_pair();
        records[1].max_tracking_error_rad = vec![error; 2];
        for joint in &mut records[1].evidence.as_mut().unwrap().joints {
            joint.tracking_floor_rad = Some(1e-3);
        }
        assert_eq!(shortfalls(&records).is_empty(), met, "{error}");
    }
}

#[test]
fn every_condition_counts_by_itself() {
    assert!(shortfalls(&good_pair()).is_empty());
    let with = |spoil: &dyn Fn(&mut RunRecord)| {
        let mut records = good_pair();
        spoil(&mut records[1]);
        assert_ne!(iteration().next(&records).unwrap(), Next::Finished(IterationStatus::Converged));
        let unmet = shortfalls(&records);
        assert_eq!(unmet.len(), 1, "{unmet:?}");
        assert!(!unmet[0].remedy().is_empty());
        unmet[0].to_string()
    };
    let joint = |record: &mut RunRecord, change: &dyn Fn(&mut JointEvidence)| {
        change(&mut record.evidence.as_mut().unwrap().joints[1]);
    };
    let clipped = |stated| Clipping { share: 0.59, torque: 8.0, stated };
    let message = with(&|record| joint(record, &|shown| shown.clipping = Some(clipped(true))));
    assert!(message.contains("joint2") && message.contains("59.0 %") && message.contains("8.000 Nm"), "{message}");
    let late = TorqueLag { lag_s: -8e-3, std_s: 1e-4, half_width_95_s: 2e-4, matters: true, taken_off_s: 0.0 };
    let message = with(&|record| record.estimate.as_mut().unwrap().lag.common = Some(late));
    assert!(message.contains("8.0 +- 0.2 ms (95 %) before"), "{message}");
    let message = with(&|record| record.estimate.as_mut().unwrap().lag.lag_s = vec![0.0, -0.011]);
    assert!(message.contains("11.0 ms apart"), "{message}");
    let poor = Prediction { rows: 1000, inside: 0.6, rms_error: 0.4, half_width: 0.2 };
    let message = with(&|record| joint(record, &|shown| shown.prediction = Some(poor)));
    assert!(message.contains("60 %") && message.contains("0.400 Nm"), "{message}");
    let message = with(&|record| record.estimate.as_mut().unwrap().joint_sigma[1] = 1.0);
    assert!(message.contains("9.9 %"), "{message}");
    let message = with(&|record| record.estimate.as_mut().unwrap().values[3] = 1.1);
    assert!(message.contains("changed by 7.1 error bars"), "{message}");
    let message = with(&|record| record.controller.model = None);
    assert!(message.contains("newest model"), "{message}");
    let message = with(&|record| record.evidence = None);
    assert!(message.contains("earlier version"), "{message}");
    let message = with(&|record| (record.accepted, record.reason) = (false, Some("it fell".to_owned())));
    assert!(message.contains("it fell"), "{message}");
    // Constant peak torque without a stated limit, in a joint that follows, is caused by the motion.
    let mut records = good_pair();
    joint(&mut records[1], &|shown| shown.clipping = Some(clipped(false)));
    assert!(shortfalls(&records).is_empty());
}

#[test]
fn the_next_model_is_that_of_all_good_runs() {
    let mut last = run(2, Some(1.0), 0.1, true, estimate(3.0, 0.1));
    last.pooled = Some(estimate(2.0, 0.05));
    assert_eq!(model(&planned(&[run(1, Some(1.0), 0.2, true, estimate(1.0, 0.1)), last])), Some(2.0));
}
