//! Factors as numbers: exact round trip, and errors for invalid numbers.

use crate::common::Random;
use dynident_estimation::{SegmentSettings, SegmentedFactor};

fn factor(rows: usize, columns: usize, seed: u64) -> SegmentedFactor {
    let mut random = Random::new(seed);
    let settings = SegmentSettings { max_segments: 8, first_length_rows: 5 };
    let mut factor = SegmentedFactor::new(columns, settings).unwrap();
    let panel: Vec<f64> = (0..rows * (columns + 1)).map(|_| random.normal()).collect();
    factor.absorb(&panel, rows).unwrap();
    factor
}

#[test]
fn stored_values_are_restored_bit_identically() {
    for (rows, columns) in [(0, 3), (1, 1), (4, 3), (39, 3), (200, 3), (1000, 7)] {
        let own = factor(rows, columns, 3);
        let (shape, numbers) = (own.shape(), own.numbers());
        assert_eq!(shape.count(), Some(numbers.len()));
        let mut again = SegmentedFactor::from_numbers(&shape, &numbers).unwrap();
        assert_eq!((again.rows(), again.segment_rows()), (own.rows(), own.segment_rows()));
        assert_eq!(again.total(), own.total());
        // Absorbing more rows gives the same result.
        let mut own = own;
        let panel: Vec<f64> = (0..50 * (columns + 1)).map(|k| (k as f64).sin()).collect();
        own.absorb(&panel, 50).unwrap();
        again.absorb(&panel, 50).unwrap();
        assert_eq!((again.shape(), again.numbers()), (own.shape(), own.numbers()));
    }
}

/// Merging neighbours keeps `‖τ − Wθ‖²` up to rounding of sums of several hundred squares.
#[test]
fn fewer_segments_contain_the_same_rows() {
    let own = factor(700, 5, 9);
    let theta = [1.0, -2.0, 0.5, 0.0, 3.0];
    let whole = own.total().residual_sum_of_squares(&theta).unwrap();
    for most in [1, 2, 3, 8, 100] {
        let few = own.with_at_most(most).unwrap();
        assert!(few.segment_rows().len() <= most && few.rows() == 700);
        let found = few.total().residual_sum_of_squares(&theta).unwrap();
        assert!((found - whole).abs() < 1e-11 * whole);
    }
    assert!(own.with_at_most(0).is_err());
}

#[test]
fn invalid_stored_factors_are_refused() {
    let own = factor(1000, 3, 1);
    let (shape, numbers) = (own.shape(), own.numbers());
    let said = |shape, numbers: &[f64]| SegmentedFactor::from_numbers(shape, numbers).unwrap_err().to_string();
    assert!(said(&shape, &numbers[1..]).contains("number of values of a stored factor"));
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        let mut harmed = numbers.clone();
        harmed[2] = bad;
        assert!(said(&shape, &harmed).contains("cannot be used in a fit"));
    }
    let mut negative = numbers.clone();
    negative[0] = -1.0;
    assert!(said(&shape, &negative).contains("diagonal"));
    let mut many = shape.clone();
    many.max_segments = 2;
    assert!(said(&many, &numbers).contains("segments of a stored factor"));
    let mut endless = shape;
    endless.columns = usize::MAX;
    assert_eq!(endless.count(), None);
    assert!(SegmentedFactor::from_numbers(&endless, &numbers).is_err());
}
