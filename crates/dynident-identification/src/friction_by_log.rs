//! Separate friction parameters for each log, because friction varies from day to day.
//!
//! For each log l, `τ_l = W_b θ_b + W_f θ_{f,l}`: all logs share the parameters θ_b of bodies and drives, while
//! friction and offsets θ_{f,l} are free in every log ("fixed effects": Mundlak, Econometrica 46 (1978) 69).

use dynident_dynamics::Column;
use dynident_estimation::{EstimationError, LinearProblem, Unexcited};

/// Maximum number of log groups with separate friction. Because every group adds columns, successive logs share a group
/// if there are more logs.
const MAX_GROUPS: usize = 8;

/// Whether a base parameter belongs to a torque of a single joint, which can vary from day to day.
pub(crate) fn is_friction_column(column: &Column) -> bool {
    matches!(column, Column::Term(term) if !term.is_drive_inertia())
}

/// Adds friction columns for each log group except the first, which keeps the existing columns. `None` for a single
/// log, and with a prior, because the prior has no values for the added columns.
pub(crate) fn with_friction_by_log(
    problem: &LinearProblem,
    is_friction: &[bool],
) -> Result<Option<LinearProblem>, EstimationError> {
    let groups = problem.logs().len().min(MAX_GROUPS);
    if groups < 2 || problem.prior().is_some() {
        return Ok(None);
    }
    let count = problem.columns().len();
    let friction: Vec<usize> = (0..count).filter(|&column| is_friction.get(column) == Some(&true)).collect();
    let group_of = |log: usize| log * groups / problem.logs().len();
    let own = |column: usize, group: usize| match (group, friction.binary_search(&column)) {
        (1.., Ok(place)) => count + (group - 1) * friction.len() + place,
        _ => column,
    };
    let further = || (1..groups).flat_map(|_| &friction);
    let names = problem.columns().iter().cloned().chain(further().map(|&column| problem.columns()[column].clone()));
    let values = problem.fallback().iter().copied().chain(further().map(|&column| problem.fallback()[column]));
    let in_all = |columns: &[usize]| {
        columns
            .iter()
            .flat_map(|&column| (0..groups).map(move |group| (column, group)))
            .map(|(c, g)| own(c, g))
            .collect()
    };
    let Unexcited { columns, silent } = problem.unexcited();
    let unexcited = Unexcited { columns: in_all(columns), silent: in_all(silent) };
    let mut separate = LinearProblem::new(names.collect(), problem.joints().to_vec())
        .with_fallback(values.collect())?
        .with_unexcited(unexcited)?;
    for rows in problem.equations() {
        let columns = rows.columns.iter().map(|&column| own(column, group_of(rows.log))).collect();
        separate.add(&problem.logs()[rows.log], rows.joint, columns, rows.factor.clone())?;
    }
    Ok(Some(separate))
}
