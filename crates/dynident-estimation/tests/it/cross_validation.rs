//! Cross-validation from factors compared with fits of the rows.
use dynident_estimation::{
    CrossValidation, EstimationError, LinearProblem, OrdinarySettings, SegmentSettings, SegmentedFactor,
    ordinary_least_squares,
};

const ROWS: usize = 200;

/// Columns a, b and the candidates c, d; torque a + 2 b + 3 c and a small unexplained part.
fn rows() -> Vec<Vec<f64>> {
    let wave = |rate: f64, phase: f64| (0..ROWS).map(|k| (rate * k as f64 + phase).sin()).collect::<Vec<_>>();
    let (a, b, c, d) = (wave(0.31, 0.0), wave(0.77, 1.0), wave(1.3, 2.0), wave(2.1, 0.5));
    let tau = (0..ROWS).map(|k| a[k] + 2.0 * b[k] + 3.0 * c[k] + 0.1 * (0.011 * (k * k) as f64).sin()).collect();
    vec![a, b, c, d, tau]
}

fn problem(columns: &[usize], rows: &[Vec<f64>], range: core::ops::Range<usize>) -> LinearProblem {
    let mut factor =
        SegmentedFactor::new(columns.len(), SegmentSettings { max_segments: 64, first_length_rows: 10 }).unwrap();
    let chosen = columns.iter().copied().chain([4]);
    let panel: Vec<f64> = chosen.flat_map(|c| rows[c][range.clone()].to_vec()).collect();
    factor.absorb(&panel, range.len()).unwrap();
    let mut problem = LinearProblem::new(columns.iter().map(|c| format!("c{c}")).collect(), vec!["j".into()]);
    problem.add("log", 0, (0..columns.len()).collect(), factor).unwrap();
    problem
}

#[test]
fn errors_on_left_out_blocks_equal_those_of_fits_without_them() {
    let rows = rows();
    let whole = problem(&[0, 1, 2, 3], &rows, 0..ROWS);
    let folds = CrossValidation::new(&whole, 5).unwrap();
    let joint = folds.joint(0, &[0, 1], &[2, 3], &[1.0]).unwrap();
    for chosen in [vec![], vec![0], vec![1], vec![0, 1]] {
        let found = joint.errors(&chosen, &vec![false; chosen.len()]);
        let columns: Vec<usize> = [0, 1].into_iter().chain(chosen.iter().map(|c| c + 2)).collect();
        for fold in 0..5 {
            // Segments of ten rows, distributed in turn.
            let (out, kept): (Vec<usize>, Vec<usize>) = (0..ROWS).partition(|k| k / 10 % 5 == fold);
            let kept: Vec<Vec<f64>> = rows.iter().map(|c| kept.iter().map(|&k| c[k]).collect()).collect();
            let fit = ordinary_least_squares(&problem(&columns, &kept, 0..160), &OrdinarySettings::default()).unwrap();
            let square: f64 = out
                .into_iter()
                .map(|k| rows[4][k] - columns.iter().zip(&fit.values).map(|(&c, v)| rows[c][k] * v).sum::<f64>())
                .map(|e| e * e)
                .sum();
            assert_eq!(found.rows[fold], 40);
            // Well-conditioned columns: the difference is rounding of sums in another order.
            assert!((found.squares[fold] - square).abs() < 1e-10 * (1.0 + square), "{chosen:?} {fold}");
        }
    }
    // With c only the unexplained part remains; a negative coefficient is rejected.
    let (with, without) = (joint.errors(&[0], &[true]), joint.errors(&[], &[]));
    assert!(with.rms() < 0.1 && without.rms() > 1.0 && (with.coefficients[0] - 3.0).abs() < 0.1);
    let [excess, error] = without.excess_over(&with);
    assert!(excess > 2.0 * error && with.excess_over(&with) == [0.0, 0.0]);
}

/// `c` is `0.9 a` plus part of `d`: the oracle is a fit of `c` to the others, row by row. A dependent column has
/// infinite inflation, an orthogonal one none.
#[test]
fn variance_inflation_is_that_of_a_fit_of_the_column() {
    let mut rows = rows();
    rows[2] = (0..ROWS).map(|k| 0.9 * rows[0][k] + 0.1 * (0.5 + rows[3][k])).collect();
    let whole = problem(&[0, 1, 2, 3], &rows, 0..ROWS);
    let folds = CrossValidation::new(&whole, 5).unwrap();
    let joint = folds.joint(0, &[0, 1], &[2, 3], &[1.0]).unwrap();
    let fitted = |columns: &[usize]| {
        let mut of_c = rows.clone();
        of_c[4] = rows[2].clone();
        let fit = ordinary_least_squares(&problem(columns, &of_c, 0..ROWS), &OrdinarySettings::default()).unwrap();
        let left = |k: usize| rows[2][k] - columns.iter().zip(&fit.values).map(|(&c, v)| rows[c][k] * v).sum::<f64>();
        let square = |of: &dyn Fn(usize) -> f64| (0..ROWS).map(|k| of(k).powi(2)).sum::<f64>();
        square(&|k| rows[2][k]) / square(&left)
    };
    let alone = joint.variance_inflation(&[(0, 1.0)], &[]);
    assert!((alone / fitted(&[0, 1]) - 1.0).abs() < 1e-9 && alone > 20.0, "{alone}");
    let beside_d = joint.variance_inflation(&[(0, 1.0)], &[&[(1, 1.0)]]);
    assert!((beside_d / fitted(&[0, 1, 3]) - 1.0).abs() < 1e-9 && beside_d > alone, "{beside_d}");
    assert!(joint.variance_inflation(&[(1, 1.0)], &[]) < 1.1);
    assert!(joint.variance_inflation(&[(1, 2.0)], &[&[(1, 1.0)]]) > 1e6);
}

#[test]
fn a_selection_of_columns_is_the_factor_of_those_columns() {
    let rows = rows();
    for (max_segments, first_length_rows) in [(64, 10), (4, 50), (2, 1)] {
        let settings = SegmentSettings { max_segments, first_length_rows };
        let mut all = SegmentedFactor::new(4, settings).unwrap();
        all.absorb(&rows.concat(), ROWS).unwrap();
        let mut some = SegmentedFactor::new(2, settings).unwrap();
        some.absorb(&[rows[3].clone(), rows[1].clone(), rows[4].clone()].concat(), ROWS).unwrap();
        let selected = all.selected(&[3, 1]).unwrap();
        assert_eq!(selected.segment_rows(), some.segment_rows());
        for (a, b) in selected.segment_factors().iter().zip(some.segment_factors()) {
            for (row, column) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
                assert!((a.entry(row, column) - b.entry(row, column)).abs() < 1e-12);
            }
        }
        assert!(matches!(all.selected(&[4]), Err(EstimationError::Mismatch { .. })));
    }
}

#[test]
fn too_few_data_are_reported() {
    let rows = rows();
    let short = problem(&[0, 1, 2, 3], &rows, 0..30);
    assert!(matches!(CrossValidation::new(&short, 5), Err(EstimationError::TooFewSegments { clusters: 3 })));
    assert!(matches!(CrossValidation::new(&short, 1), Err(EstimationError::Setting { .. })));
    let folds = CrossValidation::new(&short, 3).unwrap();
    assert!(matches!(folds.joint(1, &[0], &[1], &[1.0]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(folds.joint(0, &[0], &[7], &[1.0]), Err(EstimationError::Mismatch { .. })));
    assert!(matches!(folds.joint(0, &[0], &[1], &[f64::NAN]), Err(EstimationError::Setting { .. })));
}
