//! Smallest change of a single limit that makes a motion possible, when no motion keeps all limits. The change is
//! found by searches with that limit widened.

use super::assess::extremes;
use super::effort::single_change_budget;
use super::restoration::FeasibilityOnly;
use super::rounds::Rounds;
use super::{DesignSettings, DesignTask, grid, ranges};
use crate::limits::{Relaxation, Widened, relaxation};
use crate::optimisers::OptimiserError;
use core::sync::atomic::{AtomicUsize, Ordering};
use dynident_model::sample::Random;
use std::collections::BTreeMap;

const SEARCH_EVALUATIONS: usize = 300;

/// Maximum number of doublings of a widening; if more are needed, a change of this limit alone is not sufficient.
const MAX_WIDENINGS: usize = 3;

const BISECTIONS: usize = 5;

const RANDOM_STARTS: usize = 1;

const MAX_GROUPS: usize = 6;

/// Violation on samples that a search accepts, and margin of the other limits. The result is then checked between
/// samples.
const SAMPLE_MARGIN: f64 = 2e-3;

/// Finds, for each kind of limit that the motion of `parameters` violates, and for its most violated row alone, the
/// smallest widening with which a motion of the family keeps all other limits. Results are sorted by size, as shares
/// of the limits. Empty if there is no such widening or `stop` returned true.
///
/// # Errors
/// Errors of [`design`](crate::design()).
pub fn single_changes(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    parameters: &[f64],
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Relaxation>, OptimiserError> {
    let coarse = settings.search_grid(task);
    let fine = grid(task.family.duration_s(), 2 * coarse - 1);
    let worst = extremes(task, parameters, &fine);
    // Searches follow one another, so that the number of evaluations is the same on any number of threads.
    let (most, used) = (single_change_budget(task, settings, fine.len()), AtomicUsize::new(0));
    let stop = || {
        used.fetch_add(1, Ordering::Relaxed);
        used.load(Ordering::Relaxed) > most || stop()
    };
    let stop: &(dyn Fn() -> bool + Sync) = &stop;
    let mut found: Vec<(f64, Vec<usize>, Relaxation)> = Vec::new();
    for rows in groups(task, &worst).into_iter().take(MAX_GROUPS) {
        if stop() {
            break;
        }
        let Some(change) = smallest_widening(task, settings, parameters, &fine, &worst, &rows, stop)? else { continue };
        let size = change.iter().map(|widened| widened.by).fold(0.0, f64::max);
        // A change of all rows of a kind is redundant if a smaller change of one of these rows is sufficient.
        let known = found.iter().any(|(known, of, _)| of.iter().all(|row| rows.contains(row)) && *known <= size);
        if !known && let Some(relaxation) = relaxation(task.limits, &change) {
            found.push((size, rows, relaxation));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(found.into_iter().map(|(_, _, relaxation)| relaxation).collect())
}

/// Candidates for a single change: the most violated row of each violated kind, then all rows of that kind.
fn groups(task: &DesignTask<'_>, worst: &[f64]) -> Vec<Vec<usize>> {
    let constraints = task.limits.constraints();
    let mut broken: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (row, value) in worst.iter().enumerate().filter(|(_, value)| **value > 0.0) {
        if value.is_finite() {
            broken.entry(constraints[row].kind).or_default().push(row);
        }
    }
    let mut groups = Vec::new();
    for (kind, mut rows) in broken {
        rows.sort_by(|a, b| worst[*b].total_cmp(&worst[*a]));
        groups.push(vec![rows[0]]);
        let all: Vec<usize> = (0..constraints.len()).filter(|&row| constraints[row].kind == kind).collect();
        if all.len() > 1 {
            groups.push(all);
        }
    }
    groups
}

/// Smallest widening of the rows with which a motion keeps all other limits; returns the part of the widening that
/// this motion needs.
fn smallest_widening(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    parameters: &[f64],
    fine: &[f64],
    worst: &[f64],
    rows: &[usize],
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Vec<Widened>>, OptimiserError> {
    let mut start = parameters.to_vec();
    let mut wide = rows.iter().map(|&row| worst[row]).fold(0.0, f64::max);
    let mut possible: Option<(f64, Vec<f64>)> = None;
    for _ in 0..MAX_WIDENINGS {
        if stop() {
            break;
        }
        possible = motion_with_wider(task, settings, &start, fine, rows, wide, stop)?;
        if possible.is_some() {
            break;
        }
        wide *= 2.0;
    }
    let Some((mut much, mut kept)) = possible else { return Ok(None) };
    start.clone_from(&kept);
    let mut little = 0.0;
    for _ in 0..BISECTIONS {
        if stop() || much - little < 0.01 * much {
            break;
        }
        let middle = 0.5 * (little + much);
        match motion_with_wider(task, settings, &start, fine, rows, middle, stop)? {
            Some((used, parameters)) => {
                much = used.min(middle);
                kept = parameters;
                start.clone_from(&kept);
            }
            None => little = middle,
        }
    }
    let values = extremes(task, &kept, fine);
    let used = |&row: &usize| Widened { row, by: values[row] };
    Ok(Some(rows.iter().map(used).filter(|widened| widened.by > 0.0).collect()))
}

/// Searches for a motion that keeps all rows except `rows`, which may be violated by `wide`. Returns the actual
/// violation.
fn motion_with_wider(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    start: &[f64],
    fine: &[f64],
    rows: &[usize],
    wide: f64,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Option<(f64, Vec<f64>)>, OptimiserError> {
    let search = Rounds::new(task, fine, fine.len(), false);
    let mut random = Random::new(settings.seed ^ 0x51a6);
    let (positions, speeds) = ranges(task.limits);
    let mut margins = vec![SAMPLE_MARGIN; task.limits.constraints().len()];
    for &row in rows {
        margins[row] = -wide;
    }
    for attempt in 0..=RANDOM_STARTS {
        let from = if attempt == 0 { start.to_vec() } else { task.family.random(&positions, &speeds, &mut random) };
        let found = search.polish(&FeasibilityOnly, &margins, from.into(), SEARCH_EVALUATIONS, &|_, violation| {
            violation <= 0.0 || stop()
        })?;
        let parameters = found.best.feasible;
        let values = extremes(task, &parameters, fine);
        let kept = (0..values.len()).filter(|row| !rows.contains(row)).all(|row| values[row] <= 0.0);
        let used = rows.iter().map(|&row| values[row]).fold(0.0, f64::max);
        if kept && used <= wide + SAMPLE_MARGIN {
            return Ok(Some((used, parameters)));
        }
        if stop() {
            break;
        }
    }
    Ok(None)
}
