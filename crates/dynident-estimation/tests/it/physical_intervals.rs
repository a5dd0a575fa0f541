//! The ends of intervals are where the profile of the data's cost reaches the threshold, computed by independent fits
//! with a fixed parameter.

use crate::physical_problems::{Case, case};
use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, ConsistentIntervals, IntervalEnd, IntervalSettings, PhysicalProblem, PhysicalSettings, physical_fit,
};
use nalgebra::{DMatrix, DVector};

/// Allowed relative error of an end: a hundredth for the intervals, and as much for the fits.
const EXACT: f64 = 0.02;

/// Minimum cost of the data with a parameter near `value`, and its actual value: a row much stiffer than the data
/// fixes it.
fn profile(case: &Case, index: usize, value: f64, width: f64) -> (f64, f64) {
    let (triangle, right) = &case.rows;
    let base = case.problem.base().matrix();
    let (rows, all) = base.shape();
    let stiffness = 1.0e4 / width;
    let mut matrix = DMatrix::zeros(rows + 1, all);
    matrix.rows_mut(0, rows).copy_from(base);
    matrix[(rows, index)] = 1.0;
    let mut panel = DMatrix::zeros(rows + 1, rows + 2);
    panel.view_mut((0, 0), (rows, rows)).copy_from(triangle);
    panel.view_mut((0, rows + 1), (rows, 1)).copy_from(right);
    panel[(rows, rows)] = stiffness;
    panel[(rows, rows + 1)] = stiffness * value;
    let factor = TriangularFactor::from_rows(rows + 1, panel.as_slice(), rows + 1).unwrap();
    let (bodies, scalars) = (case.problem.bodies().to_vec(), case.problem.scalars().to_vec());
    let mut problem = PhysicalProblem::new(BaseMap::new(matrix).unwrap(), bodies, scalars, &factor).unwrap();
    if let Some(limits) = case.total_mass_kg {
        problem = problem.with_total_mass_kg(limits).unwrap();
    }
    let settings = PhysicalSettings { prior_weight: 1.0e-8, tolerance: 1.0e-10, ..case.settings.clone() };
    let fit = physical_fit(&problem, &settings).unwrap();
    let theta = base * DVector::from_column_slice(&fit.parameters);
    (0.5 * (triangle * theta - right).norm_squared(), fit.parameters[index])
}

#[test]
fn interval_ends_lie_on_the_profile_threshold() {
    let mut kinds = [0; 3];
    for seed in [1, 2, 3, 5, 6, 7, 9, 10, 11] {
        let case = case(seed, 3);
        let physical = PhysicalSettings { prior_weight: 1.0e-5, ..case.settings.clone() };
        let settings = IntervalSettings { physical, ..IntervalSettings::default() };
        let intervals = ConsistentIntervals::new(&case.problem, None, 1.0e6, settings).unwrap();
        let best = intervals.best();
        // Half the squared 95 % quantile.
        let threshold = best.data_objective + 0.5 * 1.959_964_f64.powi(2);
        for index in (0..best.parameters.len()).step_by(3) {
            let interval = intervals.of(index).unwrap();
            let value = interval.value;
            for (end, held_by) in [interval.lower, interval.upper].into_iter().zip(interval.held_by) {
                let place = format!("seed {seed}, parameter {index}: {interval:?}");
                assert_ne!(held_by, IntervalEnd::Unsettled, "{place}");
                let Some(end) = end else {
                    kinds[2] += 1;
                    continue;
                };
                let (reach, size) = (end - value, value.abs().max(1.0e-3));
                // No profile exists if the best set is at the end itself.
                if reach.abs() < 1.0e-4 * size {
                    continue;
                }
                kinds[usize::from(held_by == IntervalEnd::Constraint)] += 1;
                let (inside, _) = profile(&case, index, value + (1.0 - EXACT) * reach, reach.abs());
                assert!(inside <= threshold + 1.0e-3, "{place}: {inside} at the end, threshold {threshold}");
                let (outside, reached) = profile(&case, index, value + (1.0 + EXACT) * reach, reach.abs());
                let is_short = (reached - value) / reach < 1.0 + 0.5 * EXACT;
                assert!(is_short || outside >= threshold - 1.0e-3, "{place}: {outside} beyond, threshold {threshold}");
            }
        }
    }
    assert!(kinds[0] > 100 && kinds[1] > 5 && kinds[2] > 0, "data, constraint, open: {kinds:?}");
}
