//! How far each parameter of a body or law could go: intervals that respect what is possible.

use super::error::ConsistencyError;
use super::problem::consistency_problem;
use super::settings::ConsistencySettings;
use crate::progress::Progress;
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::consistent::{IntervalEnd, IntervalSettings, PhysicalSettings, PossibleIntervals};
use dynident_estimation::{Estimate, LinearProblem};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The 95 % interval of one parameter of a body or law, over all possible machines that the data do not reject.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterInterval {
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

/// The 95 % intervals of all parameters, over all consistent sets that the data do not reject; `plain` if the estimate is least squares on these very rows.
///
/// # Errors
/// Numbers that are not finite, bodies whose limits exclude each other.
pub fn consistent_intervals(
    robot: &ParametricModel,
    (problem, estimate, plain): (&LinearProblem, &Estimate, bool),
    settings: &ConsistencySettings,
    progress: &dyn Progress,
) -> Result<Vec<ParameterInterval>, ConsistencyError> {
    let mut problem = consistency_problem(robot, problem, &estimate.joint_sigma, settings)?;
    if !plain {
        problem = problem.around(&estimate.values)?;
    }
    let own = IntervalSettings::default();
    let physical = PhysicalSettings { prior_weight: own.physical.prior_weight, ..settings.fit() };
    // Each base parameter's variance has its own degrees of freedom; a sum of several has about the middle one's.
    let mut freedoms: Vec<f64> = estimate.std_freedom.iter().copied().filter(|freedom| freedom.is_finite()).collect();
    freedoms.sort_by(f64::total_cmp);
    let freedom = freedoms.get(freedoms.len() / 2).copied().unwrap_or(estimate.degrees_of_freedom as f64);
    let intervals =
        PossibleIntervals::new(&problem, Some(&estimate.covariance), freedom, IntervalSettings { physical, ..own })?;
    let columns = robot.base().all_columns();
    progress.begin("intervals of bodies", Some(columns.len() as u64));
    let joints = robot.model().joints();
    let found = columns
        .par_iter()
        .enumerate()
        .map(|(index, column)| {
            let interval = intervals.of(index)?;
            progress.advance(1);
            let of = match column {
                Column::Body { body, .. } => Some(robot.model().bodies()[*body].name().to_owned()),
                Column::Law(law) => match law.joints()[..] {
                    [joint] => Some(joints[joint].name.clone()),
                    _ => None,
                },
            };
            Ok(ParameterInterval {
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
