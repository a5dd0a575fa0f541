//! Triangular and segmented factors: RᵀR = [W | τ]ᵀ[W | τ] for any blocking and order.

use crate::common::Random;
use dynident_estimation::factor::FactorWorkspace;
use dynident_estimation::{EstimationError, RecursiveFactor, SegmentSettings, SegmentedFactor, TriangularFactor};
use dynident_lanes::Level;
use nalgebra::DMatrix;
use proptest::prelude::*;

/// Householder reduction is backward stable: the error of R is a small multiple of rows · columns · 1.1e-16 of the
/// matrix norm. 1e-12 is sufficient for 400 × 50.
const TOLERANCE: f64 = 1.0e-12;

fn rows(random: &mut Random, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns + 1, |_, c| random.normal() * 10_f64.powi(c as i32 % 5 - 2))
}

fn triangle(factor: &TriangularFactor) -> DMatrix<f64> {
    DMatrix::from_fn(factor.columns() + 1, factor.columns() + 1, |r, c| factor.entry(r, c))
}

/// The larger error; a NaN is treated as infinite.
fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

fn gram_difference(r: &DMatrix<f64>, w: &DMatrix<f64>) -> f64 {
    let (a, b) = (r.tr_mul(r), w.tr_mul(w));
    let mut worst = 0.0_f64;
    for i in 0..a.nrows() {
        for j in 0..a.ncols() {
            let scale = (b[(i, i)] * b[(j, j)]).sqrt();
            worst = worse(worst, (a[(i, j)] - b[(i, j)]).abs() / if scale > 0.0 { scale } else { 1.0 });
        }
    }
    worst
}

fn triangle_difference(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (0..a.ncols()).map(|c| (a.column(c) - b.column(c)).norm() / b.column(c).norm()).fold(0.0, worse)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn gram_matrix_is_preserved(seed in 0_u64..1_000_000, count in 0_usize..400, columns in 0_usize..50) {
        let w = rows(&mut Random::new(seed), count, columns);
        let factor = TriangularFactor::from_rows(columns, w.as_slice(), count).unwrap();
        prop_assert_eq!(factor.rows(), count);
        let r = triangle(&factor);
        prop_assert!(gram_difference(&r, &w) < TOLERANCE);
        prop_assert!((0..=columns).all(|k| r[(k, k)] >= 0.0));
        // Sufficient for these well-excited columns (condition number at most about 1e4 after scaling).
        let theta: Vec<f64> = (0..columns).map(|c| c as f64 - 2.0).collect();
        let residual = w.column(columns) - w.columns(0, columns) * nalgebra::DVector::from_vec(theta.clone());
        let rss = factor.residual_sum_of_squares(&theta).unwrap();
        prop_assert!((rss - residual.norm_squared()).abs() <= TOLERANCE * residual.norm_squared() + 1e-300);
    }

    #[test]
    fn fewer_rows_than_columns_stay_finite(seed in 0_u64..1_000_000, count in 0_usize..40, more in 1_usize..40) {
        let columns = count + more;
        let mut random = Random::new(seed);
        let w = rows(&mut random, count, columns);
        for level in Level::available() {
            let mut factor = TriangularFactor::new(columns);
            factor.absorb_with(&mut FactorWorkspace::new(level), w.as_slice(), count).unwrap();
            let r = triangle(&factor);
            prop_assert!(r.iter().all(|x| x.is_finite()));
            prop_assert!((0..=columns).all(|k| r[(k, k)] >= 0.0));
            prop_assert!(gram_difference(&r, &w) < TOLERANCE);
        }
    }

    #[test]
    fn blocking_order_and_merging_change_nothing(seed in 0_u64..1_000_000, columns in 1_usize..20, cuts in prop::collection::vec(1_usize..90, 1..6)) {
        let mut random = Random::new(seed);
        let count: usize = 3 * (columns + 1) + cuts.iter().sum::<usize>();
        let w = rows(&mut random, count, columns);
        let whole = TriangularFactor::from_rows(columns, w.as_slice(), count).unwrap();
        let mut blocks = Vec::new();
        let mut start = 0;
        for length in cuts.iter().copied().chain([3 * (columns + 1)]) {
            blocks.push(w.rows(start, length).into_owned());
            start += length;
        }
        let mut forward = TriangularFactor::new(columns);
        let mut merged = TriangularFactor::new(columns);
        for block in &blocks {
            forward.absorb(block.as_slice(), block.nrows()).unwrap();
            merged.merge(&TriangularFactor::from_rows(columns, block.as_slice(), block.nrows()).unwrap()).unwrap();
        }
        let mut backward = TriangularFactor::new(columns);
        for block in blocks.iter().rev() {
            backward.absorb(block.as_slice(), block.nrows()).unwrap();
        }
        // R with positive diagonal is unique; its error grows with the condition number, here below 1e3 after scaling
        // (at least three times as many rows as columns): 1e3 times the tolerance of the Gram matrix.
        for other in [&forward, &merged, &backward] {
            prop_assert_eq!(other.rows(), count);
            prop_assert!(triangle_difference(&triangle(other), &triangle(&whole)) < 1.0e3 * TOLERANCE);
        }
    }

    /// The cached total is updated by later rows, and derived factors have their own totals.
    #[test]
    fn cached_total_equals_that_of_all_rows(seed in 0_u64..1_000_000, columns in 1_usize..9, counts in prop::array::uniform2(1_usize..90)) {
        let mut random = Random::new(seed);
        let settings = SegmentSettings { max_segments: 4, first_length_rows: 3 };
        let mut segmented = SegmentedFactor::new(columns, settings).unwrap();
        let mut all = DMatrix::zeros(0, columns + 1);
        for count in counts {
            let block = rows(&mut random, count, columns);
            segmented.absorb(block.as_slice(), count).unwrap();
            let before = all.nrows();
            all = all.resize_vertically(before + count, 0.0);
            all.rows_mut(before, count).copy_from(&block);
            prop_assert_eq!(segmented.total().rows(), all.nrows());
            prop_assert!(gram_difference(&triangle(segmented.total()), &all) < TOLERANCE);
        }

        // The first column alone; then twice the first, and the torque minus the last.
        let first = segmented.selected(&[0]).unwrap();
        let mut map = DMatrix::zeros(columns + 1, 2);
        (map[(0, 0)], map[(columns, 1)], map[(columns - 1, 1)]) = (2.0, 1.0, -1.0);
        let other = segmented.mapped(&map).unwrap();
        for (made, of) in [(&first, all.select_columns(&[0, columns])), (&other, &all * &map)] {
            prop_assert!(gram_difference(&triangle(made.total()), &of) < TOLERANCE);
            let mut of_segments = TriangularFactor::new(1);
            made.segment_factors().iter().for_each(|segment| of_segments.merge(segment).unwrap());
            prop_assert!(gram_difference(&triangle(&of_segments), &of) < TOLERANCE);
        }
    }

    #[test]
    fn segments_contain_the_same_rows(seed in 0_u64..1_000_000, columns in 0_usize..12, most in 2_usize..9, first in 1_usize..20, calls in prop::collection::vec(0_usize..70, 0..12)) {
        let mut random = Random::new(seed);
        let settings = SegmentSettings { max_segments: most, first_length_rows: first };
        let mut segmented = SegmentedFactor::new(columns, settings).unwrap();
        let mut all = DMatrix::zeros(0, columns + 1);
        for count in calls {
            let block = rows(&mut random, count, columns);
            segmented.absorb(block.as_slice(), count).unwrap();
            let before = all.nrows();
            all = all.resize_vertically(before + count, 0.0);
            all.rows_mut(before, count).copy_from(&block);
        }
        prop_assert_eq!(segmented.rows(), all.nrows());
        prop_assert!(gram_difference(&triangle(segmented.total()), &all) < TOLERANCE);
        let lengths = segmented.segment_rows();
        prop_assert!(lengths.len() <= most);
        prop_assert_eq!(lengths.iter().sum::<usize>(), all.nrows());
        if let Some((last, equal)) = lengths.split_last() {
            prop_assert!(equal.iter().all(|l| l == &equal[0] && l % first == 0 && last <= l));
        }
        // Factor and scores of every segment match its rows.
        let theta: Vec<f64> = (0..columns).map(|c| 0.5 - c as f64).collect();
        let scores = segmented.scores(&theta).unwrap();
        let mut start = 0;
        for ((factor, score), length) in segmented.segment_factors().iter().zip(&scores).zip(lengths) {
            let part = all.rows(start, length).into_owned();
            start += length;
            prop_assert_eq!(factor.rows(), length);
            prop_assert!(gram_difference(&triangle(factor), &part) < TOLERANCE);
            let w = part.columns(0, columns);
            let residual = part.column(columns) - w * nalgebra::DVector::from_vec(theta.clone());
            for c in 0..columns {
                let scale = w.column(c).norm() * part.norm() * (columns as f64 + 1.0);
                prop_assert!((w.column(c).dot(&residual) - score[c]).abs() <= TOLERANCE * scale);
            }
        }
    }
}

#[test]
fn every_processor_level_gives_the_same_factor() {
    let w = rows(&mut Random::new(7), 777, 43);
    let reference = TriangularFactor::from_rows(43, w.as_slice(), 777).unwrap();
    for level in Level::available() {
        let mut factor = TriangularFactor::new(43);
        factor.absorb_with(&mut FactorWorkspace::new(level), w.as_slice(), 777).unwrap();
        let difference = triangle_difference(&triangle(&factor), &triangle(&reference));
        assert!(difference < 1.0e2 * TOLERANCE, "{}: {difference:e}", level.name());
    }
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let w = rows(&mut Random::new(8), 300, 11);
    let factor = || TriangularFactor::from_rows(11, w.as_slice(), 300).unwrap();
    assert_eq!(factor(), factor());
}

/// The remainder of a dependent column is rounding error, that of the next one its rounding error, and so on down to
/// 1e-114, whose cube underflows to zero. A division by this zero must not occur.
#[test]
fn a_single_row_of_many_columns_stays_finite() {
    let w = rows(&mut Random::new(0), 1, 26);
    for level in Level::available() {
        let mut factor = TriangularFactor::new(26);
        factor.absorb_with(&mut FactorWorkspace::new(level), w.as_slice(), 1).unwrap();
        assert!(triangle(&factor).iter().all(|x| x.is_finite()), "{}", level.name());
    }
}

#[test]
fn dependent_zero_and_extreme_columns_stay_finite() {
    let mut random = Random::new(9);
    let mut w = rows(&mut random, 200, 8);
    w.column_mut(1).fill(0.0);
    let double = w.column(0) * 2.0;
    w.set_column(3, &double);
    w.column_mut(4).scale_mut(1.0e-200);
    w.column_mut(5).scale_mut(1.0e130);
    w.column_mut(6).fill(5.0e-324);
    w.column_mut(7).fill(1.0);
    let factor = TriangularFactor::from_rows(8, w.as_slice(), 200).unwrap();
    let r = triangle(&factor);
    assert!(r.iter().all(|x| x.is_finite()));
    for c in [0, 2, 3, 5, 7, 8] {
        let (found, expected) = (r.column(c).norm(), w.column(c).norm());
        assert!((found - expected).abs() < TOLERANCE * expected, "column {c}: {found:e} {expected:e}");
    }
}

#[test]
fn unusable_rows_are_refused_whole() {
    let mut factor = TriangularFactor::from_rows(1, &[1.0, 2.0, 3.0, 4.0], 2).unwrap();
    let before = factor.clone();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0e200] {
        let error = factor.absorb(&[1.0, 2.0, 3.0, bad], 2).unwrap_err();
        assert!(matches!(error, EstimationError::Unusable { row: 1, column: 1, .. }), "{error}");
        assert_eq!(factor, before);
    }
    assert!(matches!(factor.absorb(&[1.0], 2), Err(EstimationError::Shape { expected: 4, found: 1, .. })));
    assert!(matches!(factor.absorb(&[], usize::MAX), Err(EstimationError::Shape { .. })));
    assert!(factor.merge(&TriangularFactor::new(2)).is_err());
    assert!(factor.scaled(f64::NAN).is_err() && factor.scaled(-1.0).is_err());
    assert!(factor.residual_sum_of_squares(&[]).is_err());
}

#[test]
fn a_weight_scales_the_triangle() {
    let factor = TriangularFactor::from_rows(1, &[3.0, 4.0, 1.0, 1.0], 2).unwrap().scaled(2.0).unwrap();
    assert!((factor.entry(0, 0) - 10.0).abs() < 1e-14);
    assert!((factor.residual_sum_of_squares(&[0.0]).unwrap() - 8.0).abs() < 1e-13);
}

/// Samples of some rows each, in which row m begins at `begins[m]`, absorbed into both factors.
fn recursive(
    seed: u64,
    columns: usize,
    begins: &[usize],
    samples: usize,
    level: Level,
) -> (RecursiveFactor, DMatrix<f64>) {
    let mut random = Random::new(seed);
    let mut all = rows(&mut random, samples * begins.len(), columns);
    let mut factor = RecursiveFactor::with_level(columns, begins, level);
    for sample in 0..samples {
        for (row, &begin) in begins.iter().enumerate() {
            for column in 0..=columns {
                let value = &mut all[(sample * begins.len() + row, column)];
                if column < begin {
                    *value = 0.0;
                } else {
                    factor.set(row, column, *value);
                }
            }
        }
        factor.absorb().unwrap();
    }
    (factor, all)
}

#[test]
fn sample_by_sample_is_the_same_triangle() {
    // Columns within one line and over several; more rows than one group; rows in any order of their beginnings, and
    // one row with torque only.
    let shapes: [(usize, &[usize]); 6] = [
        (1, &[0]),
        (7, &[0, 3]),
        (15, &[4, 0, 15]),
        (22, &[0, 0, 9, 1, 17, 8, 3]),
        (40, &[3; 8]),
        (33, &[0, 30, 5, 7, 9, 2, 4, 8, 1, 6, 3]),
    ];
    for (columns, begins) in shapes {
        for level in Level::available() {
            for samples in [1, 3, 40] {
                let (factor, all) = recursive(9, columns, begins, samples, level);
                let expected = triangle(&TriangularFactor::from_rows(columns, all.as_slice(), all.nrows()).unwrap());
                let found = factor.to_triangular();
                assert_eq!((factor.samples(), found.rows()), (samples, all.nrows()));
                let found = triangle(&found);
                assert!(found.diagonal().iter().all(|&value| value >= 0.0));
                assert!(gram_difference(&found, &all) < TOLERANCE, "{columns} columns, {samples}, {}", level.name());
                // R is unique if the rows determine all columns.
                if samples == 40 && begins[0] == 0 {
                    assert!(triangle_difference(&found, &expected) < 1e-10, "{columns} columns, {}", level.name());
                    let mut values = vec![0.0; columns];
                    assert!(factor.solve(&mut values));
                    let (w, tau) = (all.columns(0, columns), all.column(columns));
                    let gradient = w.tr_mul(&(tau - w * nalgebra::DVector::from_vec(values)));
                    let size = w.norm() * tau.norm();
                    assert!(gradient.amax() < TOLERANCE * size, "{} of {size}", gradient.amax());
                }
            }
        }
    }
}

#[test]
fn samples_with_nan_are_refused_whole() {
    let (mut factor, _) = recursive(4, 12, &[5, 0, 2], 9, Level::detect());
    let before = factor.to_triangular();
    for bad in [f64::NAN, f64::INFINITY, -1e150] {
        factor.set(1, 3, 1.0);
        factor.set(0, 9, bad);
        let refused = factor.absorb();
        assert!(matches!(refused, Err(EstimationError::Unusable { row: 0, column: 9, .. })), "{refused:?}");
        assert_eq!(factor.to_triangular(), before);
    }
    // Nothing of the rejected sample remains for the next one.
    factor.absorb().unwrap();
    assert_eq!(triangle(&factor.to_triangular()), triangle(&before));
    factor.scale(2.0).unwrap();
    assert_eq!(triangle(&factor.to_triangular()), 2.0 * triangle(&before));
    assert!(factor.scale(-1.0).is_err());
    let mut other = RecursiveFactor::new(12, &[0]);
    other.start_from(&before).unwrap();
    assert_eq!(triangle(&other.to_triangular()), triangle(&before));
    assert!(RecursiveFactor::new(3, &[0]).start_from(&before).is_err());
    assert!(!RecursiveFactor::new(3, &[0]).solve(&mut [0.0; 3]));
}

#[test]
fn torques_of_one_motion_come_from_one_factor() {
    let mut random = Random::new(31);
    let (columns, torques, count) = (4, 3, 60);
    let all = rows(&mut random, count, columns + torques - 1);
    let of = |matrix: &DMatrix<f64>| {
        TriangularFactor::from_rows(matrix.ncols() - 1, matrix.as_slice(), matrix.nrows()).unwrap()
    };
    let both = of(&all);
    for weights in [[0.0, 1.0, 0.0], [2.0, -0.5, 3.0], [0.0; 3]] {
        let mut wanted = all.columns(0, columns + 1).into_owned();
        wanted.set_column(columns, &(all.columns(columns, torques) * nalgebra::Vector3::from(weights)));
        let found = both.with_torque(columns, &weights).unwrap();
        assert_eq!((found.rows(), found.columns()), (count, columns));
        assert!(gram_difference(&triangle(&found), &wanted) < TOLERANCE, "{weights:?}");
    }
    for (columns, weights) in
        [(4, &[1.0; 2][..]), (5, &[1.0; 3]), (6, &[1.0]), (7, &[]), (9, &[]), (usize::MAX, &[1.0])]
    {
        let is_possible = columns == 6;
        let found = both.with_torque(columns, weights);
        assert_eq!(found.is_ok(), is_possible, "{columns} {weights:?}");
    }
    let found = both.with_torque(columns, &[1.0, f64::NAN, 0.0]);
    assert!(matches!(found, Err(EstimationError::Setting { .. })));
}
