//! Constant torques that single runs have and others have not: zeros of sensors that drift, a cable that pulls.

use crate::run_logs::RunLog;
use crate::settings::RunOffsets;
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use dynident_identification::OffsetChoice;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Serialize};

/// An offset of a run deviates clearly beyond so many of its standard deviations: of a hundred of them that share one
/// offset, chance alone brings one so far in a thousand fits or more, also where few segments make the bars.
const CLEAR_BARS: f64 = 5.0;

/// A smaller share of the joint's torque (root mean square) is nothing that a fit of the others would suffer from.
const MATTERS: f64 = 0.01;

/// By how much an offset of a run deviates from the mean of all runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunOffset {
    /// The run.
    pub run: usize,
    /// The joint's place, from 0.
    pub joint: usize,
    /// The deviation, Nm (N).
    pub deviation: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// How the runs are fitted: together with one offset for each joint, with one for each run, or both ways.
pub(crate) fn choices(robot: &ParametricModel, runs: &[RunLog<'_>], asked: RunOffsets) -> &'static [OffsetChoice] {
    let has_offset = robot.terms().iter().any(|term| matches!(term, TorqueTerm::Offset(_)));
    // Of several legs each would have its own: joints that are held say nothing of theirs.
    let possible = has_offset && runs.len() > 1 && runs.iter().all(|run| run.legs.len() == 1);
    match asked {
        RunOffsets::WhereSeen if possible => &[OffsetChoice::Shared, OffsetChoice::PerLog],
        RunOffsets::PerRun if possible => &[OffsetChoice::PerLog],
        RunOffsets::Shared | RunOffsets::WhereSeen | RunOffsets::PerRun => &[OffsetChoice::Shared],
    }
}

/// The deviations that an estimate with an offset for each run has; `columns` are (run's place, joint, column), and the
/// last run's are what the others leave.
pub(crate) fn deviations(
    columns: &[(usize, usize, usize)],
    estimate: &Estimate,
    runs: &[RunLog<'_>],
) -> Vec<RunOffset> {
    let mut found = Vec::new();
    let joints = columns.iter().map(|(_, joint, _)| joint + 1).max().unwrap_or(0);
    for joint in 0..joints {
        let own: Vec<(usize, usize)> =
            columns.iter().filter(|(_, of, _)| *of == joint).map(|&(place, _, column)| (place, column)).collect();
        let (false, Some(last)) = (own.is_empty(), runs.last()) else { continue };
        for &(place, column) in &own {
            let Some(run) = runs.get(place) else { continue };
            let std = estimate.covariance[(column, column)].max(0.0).sqrt();
            found.push(RunOffset { run: run.run, joint, deviation: estimate.values[column], std });
        }
        let sum: f64 = own.iter().map(|(_, column)| estimate.values[*column]).sum();
        let pairs = own.iter().flat_map(|a| own.iter().map(move |b| (a.1, b.1)));
        let variance: f64 = pairs.map(|pair| estimate.covariance[pair]).sum();
        found.push(RunOffset { run: last.run, joint, deviation: -sum, std: variance.max(0.0).sqrt() });
    }
    found
}

/// Whether one of them is clearly there and matters.
pub(crate) fn seen(deviations: &[RunOffset], runs: &[RunLog<'_>]) -> bool {
    deviations.iter().any(|own| {
        own.deviation.abs() > CLEAR_BARS * own.std && own.deviation.abs() > MATTERS * torque_rms(runs, own.joint)
    })
}

/// Root mean square of a joint's torque over all runs, Nm (N).
fn torque_rms(runs: &[RunLog<'_>], joint: usize) -> f64 {
    let records = || runs.iter().flat_map(|run| run.records);
    let square: f64 =
        records().map(|record| record.tau[record.of(joint)].iter().map(|tau| tau * tau).sum::<f64>()).sum();
    let samples: usize = records().map(|record| record.samples).sum();
    (square / samples.max(1) as f64).sqrt()
}
