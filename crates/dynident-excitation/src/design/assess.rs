//! Assessment of a trajectory: information from every logged sample, and every limit also between samples.

use super::{DesignTask, grid};
use crate::criteria::Criterion;
use crate::information::Information;
use crate::limits::{PeakSettings, peaks};
use crate::motion::Motion;
use nalgebra::DMatrix;

const MIN_PEAK_SAMPLES: usize = 1001;

#[derive(Clone)]
pub(crate) struct Assessment {
    pub(crate) parameters: Vec<f64>,
    pub(crate) figure: Option<f64>,
    pub(crate) information: DMatrix<f64>,
    /// Largest `ratio - 1` of all limits.
    pub(crate) violation: f64,
    pub(crate) extremes: Vec<f64>,
}

impl Assessment {
    pub(crate) fn better_than(&self, other: &Self) -> bool {
        match (self.violation <= 0.0, other.violation <= 0.0) {
            (true, true) => self.figure.unwrap_or(f64::INFINITY) < other.figure.unwrap_or(f64::INFINITY),
            (true, false) => true,
            (false, true) => false,
            (false, false) => self.violation < other.violation,
        }
    }
}

pub(crate) fn assess(
    task: &DesignTask<'_>,
    criterion: &dyn Criterion,
    parameters: Vec<f64>,
    fine: &[f64],
    logged: &[f64],
) -> Assessment {
    let mut motion = Motion::default();
    task.family.motion(&parameters, logged, &mut motion);
    let information =
        Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior).of(&motion, 1.0);
    // Finer than the grids of the search, so that no peak between its samples is missed.
    let dense = grid(task.family.duration_s(), (4 * fine.len()).max(MIN_PEAK_SAMPLES));
    let extremes = extremes(task, &parameters, &dense);
    let violation = extremes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Assessment { figure: criterion.figure(&information), parameters, information, violation, extremes }
}

pub(super) fn extremes(task: &DesignTask<'_>, parameters: &[f64], times: &[f64]) -> Vec<f64> {
    let mut workspace = task.limits.workspace();
    let found = peaks(task.limits, &mut workspace, times, PeakSettings::default(), |times, out| {
        task.family.motion(parameters, times, out);
    });
    found.iter().map(|peak| peak.value).collect()
}
