//! When no motion keeps all limits: the smallest change of a single one that makes one possible, found by searches with
//! that limit wider.

use super::assess::extremes;
use super::effort::most_of_changes;
use super::restoration::Anything;
use super::rounds::Rounds;
use super::{DesignSettings, DesignTask, grid, ranges};
use crate::limits::{Relaxation, Widened, relaxation};
use crate::optimisers::OptimiserError;
use core::sync::atomic::{AtomicUsize, Ordering};
use dynident_model::sample::Random;
use std::collections::BTreeMap;

/// Evaluations of one search.
const EVALUATIONS: usize = 300;

/// How often a limit is widened to twice as much before it counts as one that does not help alone.
const WIDENINGS: usize = 3;

/// Halvings of what is too much.
const HALVINGS: usize = 5;

/// Searches from random starts beside the one from the best motion.
const STARTS: usize = 1;

/// Single limits, or all of a kind, that are tried.
const MOST_TRIED: usize = 6;

/// Violation on samples that a search may leave: what it finds is looked at between samples afterwards.
const LEFT: f64 = 2e-3;

/// For each kind of limit that the motion of `parameters` breaks, and for its worst row alone, the smallest widening
/// found with which some motion of the family keeps all others; smallest first, as shares of the limits. Empty where
/// none was found, or `stop` said so.
///
/// # Errors
/// As [`design`](crate::design()).
pub fn single_changes(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    parameters: &[f64],
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Relaxation>, OptimiserError> {
    let coarse = settings.search_grid(task);
    let fine = grid(task.family.duration_s(), 2 * coarse - 1);
    let worst = extremes(task, parameters, &fine);
    // Searches follow one another, so that their evaluations are counted alike on any number of threads.
    let (most, used) = (most_of_changes(task, settings, fine.len()), AtomicUsize::new(0));
    let stop = || {
        used.fetch_add(1, Ordering::Relaxed);
        used.load(Ordering::Relaxed) > most || stop()
    };
    let stop: &(dyn Fn() -> bool + Sync) = &stop;
    let mut found: Vec<(f64, Vec<usize>, Relaxation)> = Vec::new();
    for rows in groups(task, &worst).into_iter().take(MOST_TRIED) {
        if stop() {
            break;
        }
        let Some(change) = smallest_of(task, settings, parameters, &fine, &worst, &rows, stop)? else { continue };
        let size = change.iter().map(|widened| widened.by).fold(0.0, f64::max);
        // All of a kind say nothing where one of them would do with no more.
        let known = found.iter().any(|(known, of, _)| of.iter().all(|row| rows.contains(row)) && *known <= size);
        if !known && let Some(relaxation) = relaxation(task.limits, &change) {
            found.push((size, rows, relaxation));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(found.into_iter().map(|(_, _, relaxation)| relaxation).collect())
}

/// What may be changed alone: the worst row of each kind that is broken, then all rows of that kind.
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

/// The least widening of the rows with which a motion keeps everything else; how much of it that motion uses.
fn smallest_of(
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
    for _ in 0..WIDENINGS {
        if stop() {
            break;
        }
        possible = with_wider(task, settings, &start, fine, rows, wide, stop)?;
        if possible.is_some() {
            break;
        }
        wide *= 2.0;
    }
    let Some((mut much, mut kept)) = possible else { return Ok(None) };
    start.clone_from(&kept);
    let mut little = 0.0;
    for _ in 0..HALVINGS {
        if stop() || much - little < 0.01 * much {
            break;
        }
        let middle = 0.5 * (little + much);
        match with_wider(task, settings, &start, fine, rows, middle, stop)? {
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

/// A motion that keeps all rows but those, which may be broken by `wide`; how much of that it uses.
fn with_wider(
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
    // What is kept on samples is kept between them, nearly.
    let mut margins = vec![LEFT; task.limits.constraints().len()];
    for &row in rows {
        margins[row] = -wide;
    }
    for attempt in 0..=STARTS {
        let from = if attempt == 0 { start.to_vec() } else { task.family.random(&positions, &speeds, &mut random) };
        let found =
            search.polish(&Anything, &margins, from.into(), EVALUATIONS, &|_, violation| violation <= 0.0 || stop())?;
        let parameters = found.best.feasible;
        let values = extremes(task, &parameters, fine);
        let kept = (0..values.len()).filter(|row| !rows.contains(row)).all(|row| values[row] <= 0.0);
        let used = rows.iter().map(|&row| values[row]).fold(0.0, f64::max);
        if kept && used <= wide + LEFT {
            return Ok(Some((used, parameters)));
        }
        if stop() {
            break;
        }
    }
    Ok(None)
}
