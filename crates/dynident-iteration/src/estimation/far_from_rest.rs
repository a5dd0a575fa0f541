//! Exclusion of rows near rest (zero velocity), joint by joint, if they increase the residual.
//!
//! Near rest a joint with dry friction sticks, breaks loose and jumps, but its smoothed motion does not. The
//! difference has the same sign in every run, so more rows narrow the error bars without reducing the error. It
//! biases drive inertias and looks like a lag of individual joints. Rows near rest then have larger residuals than
//! other rows. A run is therefore fitted with and without these rows; they are excluded for the joints whose residual
//! they increase.

use crate::estimation::estimate::{RunEstimate, identify_runs};
use crate::estimation::run_logs::{RunLog, recordings};
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::{RunIdentificationSettings, Scheme};
use crate::signals::near_rest::SamplesNearRest;
use crate::signals::rests::{StictionBand, has_dry_friction};
use dynident_identification::examination::Stiction;
use dynident_identification::friction::chosen_model;
use dynident_identification::{Recording, RegressorModel, Samples};
use dynident_simulation::Record;

/// Candidate margins around rest, widest first. A slowly accelerating joint sticks up to a fifth of its speed, and
/// the smoothed breakaway lasts one period of the smoother's cut-off frequency.
const MARGINS: [StictionBand; 4] = [
    StictionBand { speed_share: 0.2, smoothing_periods: 1.0 },
    StictionBand { speed_share: 0.1, smoothing_periods: 1.0 },
    StictionBand { speed_share: 0.1, smoothing_periods: 0.75 },
    StictionBand { speed_share: 0.1, smoothing_periods: 0.5 },
];

/// Minimum share of a run's samples that must remain for a joint; otherwise its friction near rest would not be
/// determined.
const MIN_SAMPLES_SHARE: f64 = 0.5;

/// Rows near rest are excluded if the ratio of the residuals with and without them exceeds this. If a third of some
/// hundred rows is excluded, the ratio varies by some percent by chance. A wrong exclusion only widens the error
/// bars.
const MIN_RESIDUAL_RATIO: f64 = 1.05;

/// Estimates the base parameters from a run, without rows near rest where friction does not explain them.
pub(crate) fn without_near_rest(
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
) -> Result<RunEstimate, IterationError> {
    let run = OneRun { task, records, settings };
    let all = run.identified(&[])?;
    let has_windows = task.legs.iter().any(|leg| leg.windows().is_some());
    let reads_rows = settings.estimation.estimator.reads_filtered_rows();
    if settings.scheme != Scheme::AllJoints || has_windows || !reads_rows || !settings.set_aside_near_rest {
        return Ok(all);
    }
    let (widest, shares) = run.widest_margins()?;
    // If the remaining rows cannot be fitted, no rows are excluded.
    let Some(far) = run.identified(&widest).ok().filter(|far| far.impossible.is_none()) else { return Ok(all) };
    let is_excluded = |joint: usize| {
        let (near, far) = (all.joint_sigma[joint], far.joint_sigma[joint]);
        widest[joint] != StictionBand::REST && far > 0.0 && near > MIN_RESIDUAL_RATIO * far
    };
    let excluded: Vec<bool> = (0..widest.len()).map(is_excluded).collect();
    if !excluded.contains(&true) {
        return Ok(all);
    }
    let margin = |joint: usize| if excluded[joint] { widest[joint] } else { StictionBand::REST };
    let margins: Vec<StictionBand> = (0..widest.len()).map(margin).collect();
    let found = if margins == widest { far } else { run.identified(&margins)? };
    let friction = run.dry_friction_nm(&found)?;
    let near_rest = (0..widest.len()).map(|joint| {
        let (share, dry_friction_nm) = (shares[joint], friction[joint]);
        let [all, far] = [&all, &found].map(|fit| fit.joint_sigma[joint] * fit.joint_sigma[joint]);
        let residual_nm = ((all - (1.0 - share) * far) / share).max(0.0).sqrt();
        excluded[joint].then_some(SamplesNearRest { margin: margins[joint], share, residual_nm, dry_friction_nm })
    });
    let near_rest = near_rest.collect();
    Ok(RunEstimate { near_rest, ..found })
}

struct OneRun<'a> {
    task: &'a IterationTask,
    records: &'a [Record],
    settings: &'a RunIdentificationSettings,
}

impl OneRun<'_> {
    fn log<'l>(&'l self, rest_margins: &'l [StictionBand]) -> RunLog<'l> {
        let (legs, records) = (&self.task.legs, self.records);
        RunLog { run: 1, legs, records, joint_sigma: &[], differentiator: None, rest_margins }
    }

    /// The estimate with these margins around rest. Friction laws that need rows near rest are not selected without
    /// them.
    fn identified(&self, rest_margins: &[StictionBand]) -> Result<RunEstimate, IterationError> {
        let mut settings = self.settings.clone();
        settings.friction = settings.friction.with_searches(|mut search| {
            let joint = self.task.robot.model().joint_index(&search.joint);
            let margin = joint.and_then(|joint| rest_margins.get(joint)).copied().unwrap_or_default();
            search.rows_near_rest &= margin == StictionBand::REST;
            search
        });
        identify_runs(self.task, &[self.log(rest_margins)], &settings)
    }

    /// The widest margins around rest with which enough samples of each joint remain (for a joint without dry
    /// friction only samples at rest are excluded), and the share of the samples that they exclude.
    fn widest_margins(&self) -> Result<(Vec<StictionBand>, Vec<f64>), IterationError> {
        let dry = has_dry_friction(&self.task.robot, self.settings.friction.searches());
        let count = |margin: StictionBand| -> Result<Vec<f64>, IterationError> {
            let margins = vec![margin; dry.len()];
            Ok(counted(&recordings(self.task, &[self.log(&margins)], self.settings)?, dry.len()))
        };
        let moving = count(StictionBand::REST)?;
        let samples = self.records.iter().map(|record| record.samples).sum::<usize>() as f64;
        let (mut widest, mut shares) = (vec![StictionBand::REST; dry.len()], vec![0.0; dry.len()]);
        for margin in MARGINS {
            let left = count(margin)?;
            for joint in (0..dry.len()).filter(|&joint| dry[joint] && moving[joint] > 0.0) {
                let is_enough = left[joint] >= MIN_SAMPLES_SHARE * samples && left[joint] < moving[joint];
                if widest[joint] == StictionBand::REST && is_enough {
                    (widest[joint], shares[joint]) = (margin, 1.0 - left[joint] / moving[joint]);
                }
            }
        }
        Ok((widest, shares))
    }

    /// The dry friction of each joint in an estimate of the run, Nm (N).
    fn dry_friction_nm(&self, found: &RunEstimate) -> Result<Vec<f64>, IterationError> {
        let robot = chosen_model(&self.task.robot, &found.friction)
            .map_err(|source| IterationError::ChosenFriction { run: 1, source })?;
        let model = RegressorModel::from(robot);
        let of_joint = |joint: usize| {
            let squares = |record: &Record| record.tau[record.of(joint)].iter().map(|tau| tau * tau).sum::<f64>();
            let samples: usize = self.records.iter().map(|record| record.samples).sum();
            let load = (self.records.iter().map(squares).sum::<f64>() / samples.max(1) as f64).sqrt();
            Stiction::of(&model, joint, &found.values).under(load)
        };
        Ok((0..model.dof()).map(of_joint).collect())
    }
}

/// Number of samples of each joint that are not excluded.
fn counted(motions: &[Recording], joints: usize) -> Vec<f64> {
    let mut counts = vec![0.0; joints];
    for recording in motions {
        let Samples::Motion(record) = &recording.samples else { continue };
        for (joint, count) in counts.iter_mut().enumerate() {
            let own = record.motion.set_aside.chunks_exact(record.motion.rows.max(1)).nth(joint).unwrap_or_default();
            *count += (record.motion.rows - own.iter().filter(|aside| **aside).count()) as f64;
        }
    }
    counts
}
