//! How far each parameter of a body or law could go: intervals that respect what is possible.

use crate::machine::Machine;
use crate::progress::Progress;
use crate::study::EstimatorMethod;
use dynident_dynamics::Column;
use dynident_estimation::consistent::{IntervalEnd, IntervalSettings, PhysicalSettings, PossibleIntervals};
use dynident_estimation::{Estimate, LinearProblem};
use dynident_identification::consistent::{ConsistencySettings, consistency_problem};
use rayon::prelude::*;
use serde::Serialize;

/// The 95 % interval of one parameter of a body or law, over all possible machines that the data do not reject.
#[derive(Clone, Debug, Serialize)]
pub struct PossibleIntervalResult {
    /// Symbol of the parameter: `m3`, `mx3`, `Ixx3` (about the body frame's origin), `fv3`.
    pub symbol: String,
    /// The body's or the joint's name; none for a law of several joints.
    pub of: Option<String>,
    /// Its unit at a turning joint.
    pub unit: String,
    /// Of the possible set that fits best.
    pub value: f64,
    /// Lower end; none where it is open.
    pub lower: Option<f64>,
    /// Upper end; none where it is open.
    pub upper: Option<f64>,
    /// What holds the two ends: data, a constraint, nothing.
    pub held_by: [IntervalEnd; 2],
}

/// Where the parameters come from, and what the possible machine is asked.
pub(crate) struct Asked<'a> {
    pub(crate) machine: &'a Machine,
    pub(crate) problem: &'a LinearProblem,
    pub(crate) estimate: &'a Estimate,
    pub(crate) method: EstimatorMethod,
    pub(crate) settings: &'a ConsistencySettings,
}

/// The intervals of all parameters that the model has; otherwise the reason why there are none.
pub(crate) fn possible_intervals(
    asked: &Asked<'_>,
    progress: &dyn Progress,
) -> Result<Vec<PossibleIntervalResult>, String> {
    let Asked { machine, problem, estimate, method, settings } = *asked;
    let said = |error: &dyn core::fmt::Display| error.to_string();
    let mut problem = consistency_problem(&machine.parametric, problem, &estimate.joint_sigma, settings)
        .map_err(|error| said(&error))?;
    if !method.is_plain() {
        problem = problem.around(&estimate.values).map_err(|error| said(&error))?;
    }
    let own = IntervalSettings::default();
    let physical = PhysicalSettings { prior_weight: own.physical.prior_weight, ..settings.fit() };
    // Each base parameter's variance has its own degrees of freedom; a sum of several has about the middle one's.
    let mut freedoms: Vec<f64> = estimate.std_freedom.iter().copied().filter(|freedom| freedom.is_finite()).collect();
    freedoms.sort_by(f64::total_cmp);
    let freedom = freedoms.get(freedoms.len() / 2).copied().unwrap_or(estimate.degrees_of_freedom as f64);
    let intervals =
        PossibleIntervals::new(&problem, Some(&estimate.covariance), freedom, IntervalSettings { physical, ..own })
            .map_err(|error| said(&error))?;
    let columns = machine.base().all_columns();
    progress.begin("intervals of bodies", Some(columns.len() as u64));
    let joints = machine.model().joints();
    let found = columns
        .par_iter()
        .enumerate()
        .map(|(index, column)| {
            let interval = intervals.of(index).map_err(|error| said(&error))?;
            progress.advance(1);
            let of = match column {
                Column::Body { body, .. } => Some(machine.model().bodies()[*body].name().to_owned()),
                Column::Law(law) => match law.joints()[..] {
                    [joint] => Some(joints[joint].name.clone()),
                    _ => None,
                },
            };
            Ok(PossibleIntervalResult {
                symbol: column.symbol(),
                of,
                unit: column.unit().to_owned(),
                value: interval.value,
                lower: interval.lower,
                upper: interval.upper,
                held_by: interval.held_by,
            })
        })
        .collect();
    progress.end();
    found
}
