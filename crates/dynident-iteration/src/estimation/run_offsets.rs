use crate::estimation::run_logs::RunLog;
use crate::setup::settings::RunOffsets;
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use dynident_identification::OffsetChoice;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Serialize};

/// Deviation of a run's offset, in standard deviations, above which it is significant. Among a hundred runs with the
/// same offset it is exceeded by chance in less than one of a thousand fits, even if the error bars come from few
/// time segments.
const MIN_DEVIATION_SIGMAS: f64 = 5.0;

/// Smallest relevant deviation as a share of the joint's torque (root mean square).
const MIN_DEVIATION_SHARE: f64 = 0.01;

/// Deviation of a run's offset from the mean of all runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunOffset {
    /// Number of the run.
    pub run: usize,
    /// Index of the joint, from 0.
    pub joint: usize,
    /// Deviation from the mean, Nm (N).
    pub deviation: f64,
    /// Standard deviation of the deviation, Nm (N).
    pub std: f64,
}

pub(crate) fn choices(robot: &ParametricModel, runs: &[RunLog<'_>], asked: RunOffsets) -> &'static [OffsetChoice] {
    let has_offset = robot.terms().iter().any(|term| matches!(term, TorqueTerm::Offset(_)));
    // With several trajectories, each would need its own offset, but joints at rest do not determine it.
    let possible = has_offset && runs.len() > 1 && runs.iter().all(|run| run.legs.len() == 1);
    match asked {
        RunOffsets::WhereSeen if possible => &[OffsetChoice::Shared, OffsetChoice::PerLog],
        RunOffsets::PerRun if possible => &[OffsetChoice::PerLog],
        RunOffsets::Shared | RunOffsets::WhereSeen | RunOffsets::PerRun => &[OffsetChoice::Shared],
    }
}

/// The deviations in an estimate with an offset per run; `columns` contains (index of the run, joint, column). The
/// deviation of the last run is minus the sum of the other deviations.
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

/// Whether a deviation is significant and large enough to be relevant.
pub(crate) fn is_any_significant(deviations: &[RunOffset], runs: &[RunLog<'_>]) -> bool {
    deviations.iter().any(|own| {
        own.deviation.abs() > MIN_DEVIATION_SIGMAS * own.std
            && own.deviation.abs() > MIN_DEVIATION_SHARE * torque_rms(runs, own.joint)
    })
}

fn torque_rms(runs: &[RunLog<'_>], joint: usize) -> f64 {
    let records = || runs.iter().flat_map(|run| run.records);
    let square: f64 =
        records().map(|record| record.tau[record.of(joint)].iter().map(|tau| tau * tau).sum::<f64>()).sum();
    let samples: usize = records().map(|record| record.samples).sum();
    (square / samples.max(1) as f64).sqrt()
}
