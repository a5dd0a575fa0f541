//! Success means success: what an iteration says of robots that follow, clip, log late, fall, stick, or are another
//! arm.

use crate::simulated_arm::{Simulated, iterated, settings};
use dynident_iteration::{IterationOutcome, IterationStatus, Shortfall};
use dynident_model::terms::CoulombShape;
use dynident_simulation::controllers::JointPdSettings;
use dynident_simulation::{ControllerSettings, RunLimits, SensorSettings};

fn words(outcome: &IterationOutcome) -> String {
    let unmet: Vec<String> = outcome.shortfalls.iter().map(Shortfall::to_string).collect();
    let runs: Vec<String> = outcome
        .runs
        .iter()
        .map(|run| format!("run {} {:?} {:?} {:?}", run.run, run.accepted, run.max_tracking_error_rad, run.reason))
        .collect();
    format!("{}\n{}\n{}", outcome.status, unmet.join("\n"), runs.join("\n"))
}

#[test]
fn a_robot_as_described_converges_with_nothing_unmet() {
    let (_, outcome) = iterated(&Simulated::default(), settings());
    assert_eq!(outcome.status, IterationStatus::Converged, "{}", words(&outcome));
    assert!(outcome.shortfalls.is_empty() && outcome.runs.iter().all(|run| run.accepted), "{}", words(&outcome));
    let last = outcome.runs.last().unwrap().evidence.as_ref().unwrap();
    for joint in &last.joints {
        // 95 % of a 95 % band; four deviations of the share of 200 independent rows are 6 %.
        assert!((joint.prediction.unwrap().inside - 0.95).abs() < 0.06, "{joint:?}");
        assert_eq!(joint.clipping, None);
    }
}

/// A drive that gives less than the motion takes, and nobody has said so.
#[test]
fn a_robot_that_clips_never_converges() {
    let torque = Some(vec![1e3, 8.0].into());
    let clipping = Simulated { limits: RunLimits { torque, ..RunLimits::default() }, ..Simulated::default() };
    let (_, outcome) = iterated(&clipping, settings());
    let words = words(&outcome);
    assert!(!outcome.status.is_converged(), "{words}");
    let shown = outcome.runs.iter().filter_map(|run| run.evidence.as_ref()?.joints[1].clipping);
    let most = shown.reduce(|a, b| if a.share > b.share { a } else { b }).unwrap();
    assert!((most.torque - 8.0).abs() < 0.3 && most.share > 0.1 && !most.stated, "{most:?}");
    assert!(words.contains("torque of joint joint2"), "{words}");
}

#[test]
fn positions_that_are_logged_late_are_said_and_are_no_success() {
    let sensors = SensorSettings { position_delay_s: 8e-3.into(), ..Simulated::default().sensors };
    let (_, outcome) = iterated(&Simulated { sensors, ..Simulated::default() }, settings());
    let words = words(&outcome);
    assert!(!outcome.status.is_converged(), "{words}");
    let lags: Vec<f64> = outcome
        .shortfalls
        .iter()
        .filter_map(|unmet| if let Shortfall::Lag { lag_s, .. } = unmet { Some(*lag_s) } else { None })
        .collect();
    // Late positions are early torque.
    assert!(!lags.is_empty() && lags.iter().all(|lag| (lag + 8e-3).abs() < 1e-3), "{words}");
}

/// The first controller cannot hold the arm: its run is no good one, and the iteration goes on from what it told.
#[test]
fn a_run_that_falls_is_not_good() {
    let weak = ControllerSettings::JointPd(JointPdSettings { kp: 3.0.into(), kd: 2.0.into() });
    let mut settings = settings();
    settings.start = dynident_iteration::StartWith::ModelFree;
    settings.model_free = weak;
    let (_, outcome) = iterated(&Simulated::default(), settings);
    let words = words(&outcome);
    let first = &outcome.runs[0];
    assert!(first.max_tracking_error_rad.iter().any(|error| *error > 1.0), "{words}");
    assert!(!first.accepted && first.reason.as_ref().unwrap().contains("left its trajectory"), "{words}");
    // Nothing of it is in the fit of the good runs.
    let last = outcome.runs.last().unwrap();
    assert!(outcome.status.is_converged() && last.tracking_error() < 1e-3, "{words}");
    let good = outcome.runs.iter().filter(|run| run.accepted).count();
    let rows = |rows: usize| rows / outcome.runs[1].estimate.as_ref().unwrap().rows;
    assert_eq!(last.pooled.as_ref().map(|pooled| rows(pooled.rows)), Some(good), "{words}");
}

#[test]
fn another_arm_than_described_never_converges() {
    for length_m in [0.8, 1.2] {
        let (_, outcome) = iterated(&Simulated { length_m, ..Simulated::default() }, settings());
        assert!(!outcome.status.is_converged(), "{length_m} m: {}", words(&outcome));
        assert!(!outcome.shortfalls.is_empty());
    }
}

/// Friction that breaks loose with a step, in a joint whose model has a smooth one of a wide range.
#[test]
fn a_joint_that_sticks_never_converges() {
    let sticking =
        Simulated { shape: CoulombShape::Smooth { width: 0.002 }, coulomb: [6.0, 4.0], ..Simulated::default() };
    let (_, outcome) = iterated(&sticking, settings());
    assert!(!outcome.status.is_converged(), "{}", words(&outcome));
}
