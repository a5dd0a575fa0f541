//! **Quality of the defaults.** A study that only names its files and columns is compared with the best possible one,
//! with plain least squares and with each estimator by name, for robots × motions × friction × noise × lag.
//!
//! In every run the robot's bodies differ from the robot description, the motion is designed for it, the exact torque
//! with friction is delayed by some milliseconds, and both have noise. The error of a model is that of its torque on
//! another random motion without noise: RMS over joints, each in units of the standard deviation of its torque. Each
//! case has a fixed seed, so results do not depend on the selection or order of cases or on the number of threads.

mod bound;
mod cases;
mod figures;
mod fits;
mod simulated;
mod table;

pub use cases::{CaseFriction, CaseMotion, CaseNoise, DEFAULT_CASES, DefaultCase};
pub use figures::{CaseFigures, Covered, ErrorOfName};
pub use fits::{NamedEstimator, default_settings};
pub use table::{TABLE_HEADER, csv_header, csv_line, goals, table_line};

use crate::accuracy::BenchmarkError;
use core::ops::Range;
use dynident_dynamics::Column;
use dynident_estimation::EstimationError;
use dynident_identification::Identification;
use dynident_identification::estimators::Estimator;
use dynident_model::terms::TorqueTerm;
use figures::{NamedRun, RunFigures, summed};
use fits::CUTOFF_MULTIPLES;
use rayon::prelude::*;
use simulated::{CaseRobot, Simulated};

/// Fits the recordings `runs` (each number has its own robot, motion and noise) of a case in all ways; the estimators
/// by name only if `by_name`.
///
/// # Errors
/// A robot, motion or recording that cannot be created, a default fit that fails. Other failures are results.
pub fn case_figures(case: &DefaultCase, runs: Range<u64>, by_name: bool) -> Result<CaseFigures, BenchmarkError> {
    let failed = |reason: String| BenchmarkError::Excitation { robot: case.label(), reason };
    let robot = CaseRobot::new(case).map_err(failed)?;
    let done: Vec<(Simulated, RunFigures)> = runs
        .into_par_iter()
        .map(|run| {
            let made = Simulated::new(case, &robot, run).map_err(failed)?;
            let figures = run_figures(case, &robot, &made, by_name)?;
            Ok((made, figures))
        })
        .collect::<Result<_, BenchmarkError>>()?;
    let (made, figures): (Vec<Simulated>, Vec<RunFigures>) = done.into_iter().unzip();
    // The best cut-off is the same in all runs.
    let square = |place: usize| figures.iter().map(|run| run.with_truth[place].powi(2)).sum::<f64>();
    let best = (0..CUTOFF_MULTIPLES.len()).min_by(|a, b| square(*a).total_cmp(&square(*b))).unwrap_or(0);
    let written = |made: &Simulated| {
        let found = made.with_truth(case, &robot, CUTOFF_MULTIPLES[best], true);
        found.map_or(f64::NAN, |found| made.written_error(&found))
    };
    let of_best: Vec<f64> = made.par_iter().map(written).collect();
    Ok(summed(&figures, (best, CUTOFF_MULTIPLES[best]), &of_best))
}

/// Mean square error of the bodies' parameters relative to the Cramér-Rao bound.
fn square_over_bound(made: &Simulated, found: &Identification, bound: &[f64]) -> f64 {
    let ratios = bodies(made, found).map(|(place, truth)| {
        let own = made.regressor.layout().columns();
        let symbol = found.model().layout().columns()[place].symbol();
        let at = own.iter().position(|column| column.symbol() == symbol).unwrap_or(place);
        ((found.base_values()[place] - truth) / bound[at]).powi(2)
    });
    let ratios: Vec<f64> = ratios.collect();
    ratios.iter().sum::<f64>() / ratios.len() as f64
}

fn run_figures(
    case: &DefaultCase,
    robot: &CaseRobot,
    made: &Simulated,
    by_name: bool,
) -> Result<RunFigures, BenchmarkError> {
    let failed =
        |source: EstimationError| BenchmarkError::Excitation { robot: case.label(), reason: source.to_string() };
    let default = made.by_default(robot)?;
    // Filters that leave no rows or are impossible at this rate are excluded.
    let ladder = CUTOFF_MULTIPLES.map(|multiple| made.with_truth(case, robot, multiple, false));
    let with_truth =
        ladder.each_ref().map(|found| found.as_ref().map_or(f64::INFINITY, |found| made.free_error(found)));
    let bound = bound::bound(case, made).map_err(failed)?;
    let tellable = made.tellable(case, robot).map_err(failed)?;
    // Terms that cannot be selected from a log stay as at the start of a study.
    let terms_of = |joint: usize| {
        let name = &robot.described.model().joints()[joint].name;
        let own = default.training.friction_choice.iter().find(|one| one.joint == *name)?;
        let stated = || robot.described.terms().iter().filter(|term| term.own_joint() == Some(joint)).cloned();
        Some(own.terms.clone().unwrap_or_else(|| stated().collect()))
    };
    let is_law_selected = |joint: &usize| {
        let truth = case.friction.of(*joint);
        tellable[*joint]
            && terms_of(*joint).is_some_and(|terms| terms.iter().any(|term| truth.is_distinguished_by(term)))
    };
    // No true friction has hysteresis.
    let needs_load = |joint: usize| case.friction.of(joint).terms(joint).iter().any(TorqueTerm::needs_load);
    let is_unneeded = |joint: usize| {
        let terms = terms_of(joint).unwrap_or_default();
        !needs_load(joint) && terms.iter().any(|term| term.has_memory() || term.needs_load())
    };
    let covered = |place: usize, truth: f64| {
        let estimate = default.estimate();
        let is_free = estimate.rank.fixed.iter().all(|fixed| fixed.column != place);
        let inside = (estimate.values[place] - truth).abs() <= estimate.half_width_95[place];
        Covered { inside: usize::from(is_free && inside), all: usize::from(is_free) }
    };
    let of_bodies = bodies(made, &default).map(|(place, truth)| covered(place, truth)).sum();
    let of_friction = frictions(case, made, &default, robot.described.dof());
    let named = |estimator: &NamedEstimator| match estimator.of(case, robot.described.dof()).filter(|_| by_name) {
        Some(asked) => made.by_name(robot, &default, asked).map_or(NamedRun::Failed, NamedRun::Settled),
        None => NamedRun::NotAsked,
    };
    let plain = |estimator| made.plain(robot, estimator).map(|found| made.free_error(&found));
    Ok(RunFigures {
        written: made.written_error(&default),
        free: made.free_error(&default),
        laws_stated: made.written_error(&made.with_laws_stated(robot)?),
        with_truth,
        plain: plain(Estimator::Ordinary),
        plain_weighted: plain(Estimator::Weighted),
        by_name: NamedEstimator::ALL.iter().map(named).collect(),
        square_over_bound: bound.map(|bound| square_over_bound(made, &default, &bound)),
        bodies: of_bodies,
        friction: of_friction.into_iter().map(|(place, truth)| covered(place, truth)).sum(),
        tellable: tellable.iter().filter(|tellable| **tellable).count(),
        told: (0..tellable.len()).filter(is_law_selected).count(),
        unneeded: (0..tellable.len()).filter(|&joint| is_unneeded(joint)).count(),
        without_need: (0..tellable.len()).filter(|&joint| !needs_load(joint)).count(),
        lag_found_s: default.torque_lag.common.map(|common| common.lag_s),
        lag_is_held: default.torque_lag.common.is_some_and(|lag| (lag.lag_s - case.lag_s).abs() <= lag.half_width_95_s),
        instruments: default.estimator.name() == "instrumental",
        cutoff_hz: default.cutoff.as_ref().map_or(f64::NAN, |choice| choice.cutoff_hz),
        asked_hz: made.asked_hz,
    })
}

/// Indices of the bodies' base parameters in a fit, with their true values.
fn bodies<'a>(made: &'a Simulated, found: &'a Identification) -> impl Iterator<Item = (usize, f64)> + 'a {
    let columns = found.model().layout().columns().iter().enumerate();
    let bodies = columns.filter(|(_, column)| matches!(column, Column::Body { .. }));
    bodies.filter_map(|(place, column)| Some((place, made.true_value(column)?)))
}

/// Indices of the friction parameters of joints whose laws were all selected correctly, with their true values.
fn frictions(case: &DefaultCase, made: &Simulated, found: &Identification, dof: usize) -> Vec<(usize, f64)> {
    let columns = found.model().layout().columns();
    let of_joint = |joint: usize| {
        let own = columns.iter().enumerate().filter(move |(_, column)| {
            matches!(column, Column::Term(term) if term.own_joint() == Some(joint) && term.is_joint_friction())
        });
        let values: Option<Vec<(usize, f64)>> =
            own.map(|(place, column)| Some((place, made.true_value(column)?))).collect();
        let laws = case.friction.of(joint).terms(joint);
        let as_many = laws.iter().filter(|term| term.is_joint_friction()).count();
        values.filter(|values| values.len() == as_many).unwrap_or_default()
    };
    (0..dof).flat_map(of_joint).collect()
}
