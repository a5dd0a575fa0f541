use crate::estimation::motion::measured_motion;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::settings::RunIdentificationSettings;
use crate::signals::rests::{StictionBand, has_dry_friction};
use dynident_identification::examination::LagCandidates;
use dynident_identification::friction::FrictionSearch;
use dynident_identification::rows::ParallelFilterSettings;
use dynident_identification::{IdentificationSettings, LogNoise, Recording};
use dynident_recording::DifferentiatorSettings;
use dynident_simulation::{Record, require_length};
use std::sync::Arc;

/// The records of one run with its number.
#[derive(Clone, Copy, Debug)]
pub struct RunLog<'a> {
    /// Number of the run, from 1.
    pub run: usize,
    /// Trajectories of the run.
    pub legs: &'a [Leg],
    /// One record per trajectory.
    pub records: &'a [Record],
    /// Standard deviation of each joint's residual in this run alone, Nm (N); the weights if joints are identified
    /// one by one.
    pub joint_sigma: &'a [f64],
    /// The differentiator that was selected for the run; `None` for that of the settings.
    pub differentiator: Option<&'a DifferentiatorSettings>,
    /// Distance from rest above which the torque of each joint with dry friction is used, as selected for the run.
    /// Without an entry only samples at rest are excluded.
    pub rest_margins: &'a [StictionBand],
}

/// The records as recordings with computed motions, run by run and trajectory by trajectory.
pub(crate) fn recordings(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
) -> Result<Vec<Recording>, IterationError> {
    let dry = has_dry_friction(&task.robot, settings.friction.searches());
    let mut recordings = Vec::new();
    for log in runs {
        let legs = log.legs.len();
        require_length("records of the run's legs", legs, log.records.len())?;
        let own = log.differentiator.map(|differentiator| settings.with_differentiator(differentiator));
        let settings = own.as_ref().unwrap_or(settings);
        for (number, (leg, record)) in log.legs.iter().zip(log.records).enumerate() {
            let margin = |joint: usize| log.rest_margins.get(joint).copied().unwrap_or_default();
            let margins: Vec<Option<StictionBand>> =
                (0..dry.len()).map(|joint| dry[joint].then(|| margin(joint))).collect();
            let motion = measured_motion(record, leg, settings, &margins)?;
            let of_leg = if legs > 1 { format!(", leg {}", number + 1) } else { String::new() };
            let mut recording = Recording::of_motion(format!("run {}{of_leg}", log.run), motion);
            recording.commanded = Some(Arc::clone(leg.commanded()));
            recording.payload = leg.payload().map(str::to_owned);
            recordings.push(recording);
        }
    }
    Ok(recordings)
}

pub(crate) fn identification_settings(
    task: &IterationTask,
    settings: &RunIdentificationSettings,
    runs: usize,
) -> IdentificationSettings {
    let mut identification = IdentificationSettings::default();
    identification.motion.differentiator = settings.differentiator.clone();
    identification.parallel_filter = ParallelFilterSettings::from(settings.parallel_filter.as_ref());
    identification.estimation = settings.estimation.clone();
    identification.estimation.held.clone_from(&task.known);
    identification.consistency.clone_from(&settings.consistency);
    identification.thresholds.clone_from(&settings.thresholds);
    // Friction that is poorly determined would prevent convergence.
    identification.friction = settings.friction.clone().with_searches(|own| FrictionSearch {
        most_inflation: own.most_inflation.or(Some(FrictionSearch::MOST_INFLATION)),
        ..own
    });
    // With the same controller, friction causes a different apparent lag at each joint and in each run.
    identification.lags = LagCandidates::Common;
    // A run of some seconds has few reversals. Their times and the lag of a joint can then diverge together.
    identification.estimation.thresholds.lag.max_reversal_std = f64::MAX;
    identification.log_noise = if runs > 1 { LogNoise::Own } else { LogNoise::Shared };
    identification
}
