//! The design itself: the best trajectory of a family by a criterion, inside all limits.
//!
//! Many random starts, each an augmented-Lagrangian descent with exact gradients: parameters → motion → regressor and
//! limits, and one reverse sweep back. Rounds follow one another (random starts on a coarse grid, restarts around the
//! best, a polish on the fine grid), each within an evaluation budget, so that the result depends on the seed alone; a
//! deadline only ends it early, with the best feasible trajectory so far.

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
use polish::{polished, taken_inside};
use rounds::Candidate;
use run::DesignRun;
use search::searched;
use serde::{Deserialize, Serialize};
pub use single_change::single_changes;
use std::time::Instant;

/// How much is searched, and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DesignSettings {
    /// Random starts of the first round. Default 8, for condition numbers 4, with 24 or more numbers a joint 2; fewer
    /// for a robot so large that the search would else take more than about a minute of a core: unless one of this,
    /// `rounds`, `evaluations_per_start` and `time_limit_s` is given, it gets less of everything.
    pub starts: Option<usize>,
    /// Rounds of restarts around the best, of half as many starts and two at least. Default 1, for condition numbers
    /// 36, with 24 or more numbers a joint 8.
    pub rounds: Option<usize>,
    /// Evaluations of one start or restart at most. Default 1,000, for condition numbers 600 and 500, with 24 or more
    /// numbers a joint 2,000.
    pub evaluations_per_start: Option<usize>,
    /// Evaluations of one polish at most (up to six, while something is broken between samples). Default 1,000.
    pub polish_evaluations: usize,
    /// Samples of the search grid. Default 96 (for condition numbers and families that are linear in their numbers 64),
    /// at least five per free number of a joint, for families that move fast, and 12.5 a second where places are
    /// limited, so that the ways between samples, on which columns are looked for, are nearly straight.
    pub search_samples: Option<usize>,
    /// Rate at which the robot will be logged, Hz: every sample counts for the information. Default 100.
    pub rate_hz: f64,
    /// Stop after so many seconds with the best so far; none by default. The result then depends on the computer.
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
    /// Samples of the search grid.
    pub(crate) fn search_grid(&self, task: &DesignTask<'_>) -> usize {
        let (family, limits) = (task.family, task.limits);
        let many_optima = task.criteria.last().is_some_and(|criterion| criterion.has_many_optima());
        let least = if many_optima && family.is_linear() { LEAST_SAMPLES_OF_MANY } else { LEAST_SAMPLES };
        let each = family.parameters() / family.joints().max(1);
        let of_place = if limits.has_places() {
            (limits.model().own_scale().round_hertz(PLACE_RATE_HZ) * family.duration_s()) as usize
        } else {
            0
        };
        // Whole registers.
        self.search_samples.unwrap_or_else(|| least.max((5 * each).max(of_place).next_multiple_of(16))).max(8)
    }
}

/// Samples of the search grid at least; where many descents are needed and each joint is a sum of few functions, whose
/// extremes are then seen to some hundredths, fewer.
const LEAST_SAMPLES: usize = 96;
const LEAST_SAMPLES_OF_MANY: usize = 64;

/// Rate of the search grid where places are limited, Hz of a usual arm.
const PLACE_RATE_HZ: f64 = 12.5;

/// What is to be designed.
#[derive(Clone, Copy)]
pub struct DesignTask<'a> {
    /// The family.
    pub family: &'a dyn Family,
    /// Criteria one after another: each round goes on with the next (a smooth norm first, then a sharp one); the last
    /// stays.
    pub criteria: &'a [&'a dyn Criterion],
    /// Everything that must be kept.
    pub limits: &'a LimitSet,
    /// The columns to be identified: base columns, terms included.
    pub layout: &'a PanelLayout,
    /// Standard deviation of each joint's torque, Nm (N).
    pub torque_std_nm: &'a [f64],
    /// Information before the motion.
    pub prior: Option<&'a DMatrix<f64>>,
}

/// The best trajectory found.
#[derive(Clone, Debug)]
pub struct Design {
    /// Parameters of the family.
    pub parameters: Vec<f64>,
    /// Information of the trajectory, every logged sample counted.
    pub information: DMatrix<f64>,
    /// The last criterion's figure.
    pub figure: Option<f64>,
    /// Largest `ratio - 1` of any limit, refined between samples: not positive for a feasible trajectory.
    pub violation: f64,
    /// Evaluations of cost and gradient.
    pub evaluations: usize,
    /// Wall seconds.
    pub seconds: f64,
}

/// How far a design has come.
#[derive(Clone, Copy, Debug)]
pub struct DesignProgress {
    /// Name of the round.
    pub round: &'static str,
    /// Best value of the round's criterion in its smooth form; infinite before the first evaluation.
    pub value: f64,
    /// Largest violation there.
    pub violation: f64,
    /// Evaluations so far.
    pub evaluations: u64,
}

/// Watches a design: called after every evaluation, from any thread; may end the search.
pub(crate) type DesignWatch<'a> = dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync + 'a;

/// Searches for the best trajectory. `watch` is called after every evaluation, from any thread, and may end the search.
/// The best motion found until then is moved inside the limits, in at most 0.5 s.
///
/// # Errors
/// If settings are out of range or no start can be evaluated at all.
pub fn design(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Design, OptimiserError> {
    let begun = Instant::now();
    timed(task, settings, &watch, &|| begun.elapsed().as_secs_f64())
}

/// [`design()`] with the seconds since its beginning from the clock `elapsed_s`.
fn timed(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: &DesignWatch<'_>,
    elapsed_s: &(dyn Fn() -> f64 + Sync),
) -> Result<Design, OptimiserError> {
    let run = DesignRun::new(task, settings, watch, elapsed_s)?;
    let Candidate { state, feasible, .. } = searched(&run)?;
    let polished = polished(&run, state.on_twice_the_samples(run.coarse.len()), &feasible)?;
    let kept = taken_inside(&run, polished, feasible)?;
    Ok(Design {
        figure: kept.figure,
        information: kept.information,
        violation: kept.violation,
        parameters: kept.parameters,
        evaluations: run.interruption.evaluations() as usize,
        seconds: elapsed_s(),
    })
}

/// `count` equal steps from 0 to the duration, both ends included.
pub fn grid(duration_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| duration_s * k as f64 / (count.max(2) - 1) as f64).collect()
}

/// For every parameter the root mean square of its joint's, for the size of noise (joint after joint, as families store
/// them).
fn joint_scales(parameters: &[f64], joints: usize) -> Vec<f64> {
    let per_joint = (parameters.len() / joints.max(1)).max(1);
    let rms = |part: &[f64]| (part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64).sqrt();
    parameters.chunks(per_joint).flat_map(|part| vec![rms(part); part.len()]).collect()
}

/// Position ranges and velocity limits for random starts: the study's where it narrows the description's.
pub(crate) fn ranges(limits: &LimitSet) -> (Vec<[f64; 2]>, Vec<f64>) {
    let free = |joint: &dynident_model::Joint| if joint.turns() { core::f64::consts::PI } else { 0.5 };
    let mut ranges: Vec<[f64; 2]> = limits.model().joints().iter().map(|joint| [-free(joint), free(joint)]).collect();
    let mut speeds = vec![UNKNOWN_SPEED; ranges.len()];
    for band in limits.bands() {
        let middle = limits.constraints()[band.row].middle;
        match band.order {
            0 => {
                let range = &mut ranges[band.joint];
                let [lower, upper] = [middle - band.half, middle + band.half];
                // A range that lies beyond half a turn is taken as it is.
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

/// Velocity of random starts where none is limited, rad/s (m/s).
const UNKNOWN_SPEED: f64 = 2.0;
