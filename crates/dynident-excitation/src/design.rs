//! Design of a trajectory: finds the parameters of a trajectory family that optimise a criterion within all limits.
//!
//! The search consists of many random starts. Each start is an augmented-Lagrangian descent with exact gradients: a
//! forward pass computes motion, regressor and limits from the parameters, and one reverse sweep the gradient. Rounds
//! follow one another (random starts on a coarse grid, restarts around the best motion, a polish on the fine grid).
//! Each round has an evaluation budget, so that the result depends only on the seed. A time limit ends the search
//! early with the best feasible trajectory so far.

pub(crate) mod assess;
mod clear_starts;
mod column_units;
mod effort;
mod envelope;
mod interruption;
mod metric;
mod polish;
mod problem;
mod restarts;
mod restoration;
mod rounds;
mod run;
mod search;
mod shrunk;
mod single_change;
mod way_inside;

use crate::criteria::Criterion;
use crate::family::Family;
use crate::limits::LimitSet;
use crate::optimisers::OptimiserError;
use core::ops::ControlFlow;
use dynident_dynamics::PanelLayout;
use nalgebra::DMatrix;
use polish::{moved_inside, polished};
use rounds::Candidate;
use run::DesignRun;
use search::searched;
use serde::{Deserialize, Serialize};
pub use single_change::single_changes;
use std::time::Instant;

/// Effort and resolution of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DesignSettings {
    /// Number of random starts of the first round. Default 8; 4 for condition numbers, 2 for condition numbers with
    /// 24 or more parameters per joint. All defaults are lower for a large robot whose search would take more than
    /// about a minute on one core, unless one of `starts`, `rounds`, `evaluations_per_start` and `time_limit_s` is
    /// given.
    pub starts: Option<usize>,
    /// Number of rounds of restarts around the best motion, each with half as many starts as the first round, but at
    /// least two. Default 1; 36 for condition numbers, 8 for condition numbers with 24 or more parameters per joint.
    pub rounds: Option<usize>,
    /// Maximum number of evaluations of a start or restart. Default 1,000. For condition numbers 600 per start and
    /// 500 per restart; 2,000 for condition numbers with 24 or more parameters per joint.
    pub evaluations_per_start: Option<usize>,
    /// Maximum number of evaluations of a polish (final descent on a fine grid). At most six polishes follow the
    /// search, while a limit is violated between samples. Default 1,000.
    pub polish_evaluations: usize,
    /// Number of samples of the search grid. Default 96 (64 for condition numbers and linear families), but at least
    /// five per free parameter of a joint, for families that move fast. With place limits at least 12.5 samples per
    /// second, so that the paths between samples, which are tested against columns, are nearly straight.
    pub search_samples: Option<usize>,
    /// Rate of the log, Hz. The information includes every logged sample. Default 100.
    pub rate_hz: f64,
    /// Time limit, s, after which the search returns the best result so far; no limit by default. With a time limit
    /// the result depends on the computer.
    pub time_limit_s: Option<f64>,
    /// Seed of the random starts. Default 1.
    pub seed: u64,
}

impl Default for DesignSettings {
    fn default() -> Self {
        Self {
            starts: None,
            rounds: None,
            evaluations_per_start: None,
            polish_evaluations: 1_000,
            search_samples: None,
            rate_hz: 100.0,
            time_limit_s: None,
            seed: 1,
        }
    }
}

impl DesignSettings {
    pub(crate) fn search_grid(&self, task: &DesignTask<'_>) -> usize {
        let (family, limits) = (task.family, task.limits);
        let many_optima = task.criteria.last().is_some_and(|criterion| criterion.has_many_optima());
        let least = if many_optima && family.is_linear() { MIN_SAMPLES_MULTIMODAL } else { MIN_SAMPLES };
        let each = family.parameters() / family.joints().max(1);
        let of_place = if limits.has_places() {
            (limits.model().characteristic_scale().round_hertz(PLACE_RATE_HZ) * family.duration_s()) as usize
        } else {
            0
        };
        // A multiple of the register width.
        self.search_samples.unwrap_or_else(|| least.max((5 * each).max(of_place).next_multiple_of(16))).max(8)
    }
}

/// Minimum number of samples of the search grid, and a smaller minimum for criteria that need many descents. For
/// linear families the coarser grid determines extremes to a few per cent.
const MIN_SAMPLES: usize = 96;
const MIN_SAMPLES_MULTIMODAL: usize = 64;

/// Sampling rate of the search grid with place limits, Hz for an arm of usual size.
const PLACE_RATE_HZ: f64 = 12.5;

/// Task of a design.
#[derive(Clone, Copy)]
pub struct DesignTask<'a> {
    /// Trajectory family.
    pub family: &'a dyn Family,
    /// Criteria in the order of the rounds: each round uses the next criterion (a smooth norm first, then a sharper
    /// one); further rounds use the last criterion.
    pub criteria: &'a [&'a dyn Criterion],
    /// Limits that the motion must keep.
    pub limits: &'a LimitSet,
    /// Columns to be identified: base columns and terms.
    pub layout: &'a PanelLayout,
    /// Standard deviation of each joint's torque, Nm (N).
    pub torque_std_nm: &'a [f64],
    /// Prior information matrix of the columns, added to that of the motion.
    pub prior: Option<&'a DMatrix<f64>>,
}

/// Best trajectory found.
#[derive(Clone, Debug)]
pub struct Design {
    /// Parameters of the family.
    pub parameters: Vec<f64>,
    /// Information matrix of the trajectory, from every logged sample.
    pub information: DMatrix<f64>,
    /// Value of the last criterion.
    pub figure: Option<f64>,
    /// Largest `ratio - 1` of all limits, also between samples; not positive for a feasible trajectory.
    pub violation: f64,
    /// Number of evaluations of cost and gradient.
    pub evaluations: usize,
    /// Wall time, s.
    pub seconds: f64,
}

/// Progress of a design.
#[derive(Clone, Copy, Debug)]
pub struct DesignProgress {
    /// Name of the round.
    pub round: &'static str,
    /// Best smooth value of the round's criterion; infinite before the first evaluation.
    pub value: f64,
    /// Largest violation of the motion with the best value.
    pub violation: f64,
    /// Number of evaluations so far.
    pub evaluations: u64,
}

/// Progress callback: called after every evaluation, from any thread; can end the search.
pub(crate) type DesignWatch<'a> = dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync + 'a;

/// Searches for the best trajectory. `watch` is called after every evaluation, from any thread, and can end the search;
/// the best motion so far is then moved inside the limits within 0.5 s.
///
/// # Errors
/// Settings that are out of range; no start that can be evaluated.
pub fn design(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Design, OptimiserError> {
    let begun = Instant::now();
    timed(task, settings, &watch, &|| begun.elapsed().as_secs_f64())
}

/// Like [`design()`], with the clock `elapsed_s`, in seconds since the start.
fn timed(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: &DesignWatch<'_>,
    elapsed_s: &(dyn Fn() -> f64 + Sync),
) -> Result<Design, OptimiserError> {
    let run = DesignRun::new(task, settings, watch, elapsed_s)?;
    let Candidate { state, feasible, .. } = searched(&run)?;
    let polished = polished(&run, state.on_twice_the_samples(run.coarse.len()), &feasible)?;
    let kept = moved_inside(&run, polished, feasible)?;
    Ok(Design {
        figure: kept.figure,
        information: kept.information,
        violation: kept.violation,
        parameters: kept.parameters,
        evaluations: run.interruption.evaluations() as usize,
        seconds: elapsed_s(),
    })
}

/// `count` equidistant times from 0 to the duration, both ends included.
pub fn grid(duration_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| duration_s * k as f64 / (count.max(2) - 1) as f64).collect()
}

/// Root mean square of the parameters of each joint, repeated for each parameter (stored joint after joint). Scales
/// the noise of restarts.
fn joint_scales(parameters: &[f64], joints: usize) -> Vec<f64> {
    let per_joint = (parameters.len() / joints.max(1)).max(1);
    let rms = |part: &[f64]| (part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64).sqrt();
    parameters.chunks(per_joint).flat_map(|part| vec![rms(part); part.len()]).collect()
}

/// Position ranges and velocity limits for random starts: limits of the study where they are narrower than those of
/// the robot description.
pub(crate) fn ranges(limits: &LimitSet) -> (Vec<[f64; 2]>, Vec<f64>) {
    let free = |joint: &dynident_model::Joint| if joint.is_rotary() { core::f64::consts::PI } else { 0.5 };
    let mut ranges: Vec<[f64; 2]> = limits.model().joints().iter().map(|joint| [-free(joint), free(joint)]).collect();
    let mut speeds = vec![DEFAULT_START_SPEED; ranges.len()];
    for band in limits.bands() {
        let middle = limits.constraints()[band.row].middle;
        match band.order {
            0 => {
                let range = &mut ranges[band.joint];
                let [lower, upper] = [middle - band.half, middle + band.half];
                // A range that does not overlap half a turn around zero is used unchanged.
                *range = if lower < range[1] && upper > range[0] {
                    [lower.max(range[0]), upper.min(range[1])]
                } else {
                    [lower, upper]
                };
            }
            1 => speeds[band.joint] = band.half,
            _ => {}
        }
    }
    (ranges, speeds)
}

/// Velocity of random starts of a joint without velocity limit, rad/s (m/s).
const DEFAULT_START_SPEED: f64 = 2.0;
