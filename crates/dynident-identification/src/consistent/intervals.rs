//! Intervals of inertial, friction and drive parameters over all physically consistent robots.

use super::error::ConsistencyError;
use super::problem::consistency_problem;
use super::settings::ConsistencySettings;
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::consistent::{ConsistentIntervals, IntervalEnd, IntervalSettings, PhysicalSettings};
use dynident_estimation::{Estimate, LinearProblem};
use dynident_rows::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The 95 % interval of one inertial, friction or drive parameter, over all physically consistent robots that the data
/// do not reject.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterInterval {
    /// Symbol of the parameter: `m3`, `mx3`, `Ixx3` (about the body frame's origin), `fv3`.
    pub symbol: String,
    /// Name of the body or joint; `None` for a term that belongs to several joints.
    pub of: Option<String>,
    /// Unit of the parameter at a revolute joint.
    pub unit: String,
    /// Value in the best consistent fit.
    pub value: f64,
    /// Lower end; `None` if the parameter has no lower bound.
    pub lower: Option<f64>,
    /// Upper end; `None` if the parameter has no upper bound.
    pub upper: Option<f64>,
    /// What limits the lower end and the upper end: the data, a constraint, or nothing.
    pub held_by: [IntervalEnd; 2],
}

/// The 95 % intervals of all parameters, over all physically consistent sets that the data do not reject. `plain`
/// states whether the estimate is the least-squares solution of these rows.
///
/// # Errors
/// Values that are not finite, contradictory limits of bodies.
pub fn consistent_intervals(
    robot: &ParametricModel,
    problem: &LinearProblem,
    estimate: &Estimate,
    plain: bool,
    settings: &ConsistencySettings,
    progress: &dyn Progress,
) -> Result<Vec<ParameterInterval>, ConsistencyError> {
    let mut problem = consistency_problem(robot, problem, &estimate.joint_sigma, settings)?;
    if !plain {
        problem = problem.around(&estimate.values)?;
    }
    let own = IntervalSettings::default();
    let physical = PhysicalSettings { prior_weight: own.physical.prior_weight, ..settings.fit() };
    // Each base parameter has its own degrees of freedom. For sums of base parameters, their median is used.
    let mut degrees_of_freedom: Vec<f64> = estimate
        .std_degrees_of_freedom
        .iter()
        .copied()
        .filter(|degrees_of_freedom| degrees_of_freedom.is_finite())
        .collect();
    degrees_of_freedom.sort_by(f64::total_cmp);
    let degrees_of_freedom =
        degrees_of_freedom.get(degrees_of_freedom.len() / 2).copied().unwrap_or(estimate.degrees_of_freedom as f64);
    let intervals = ConsistentIntervals::new(
        &problem,
        Some(&estimate.covariance),
        degrees_of_freedom,
        IntervalSettings { physical, ..own },
    )?;
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
                Column::Term(term) => match term.joints()[..] {
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
