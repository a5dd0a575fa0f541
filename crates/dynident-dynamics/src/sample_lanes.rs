//! Copies between samples and lanes.

use dynident_lanes::Lane;

/// Copies one joint vector into scratch scalars.
#[inline(always)]
pub(crate) fn take<T: Lane>(to: &mut [T], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = T::splat(*from);
    }
}

/// Copies samples `at..at + LANES` of a joint-major array into lanes; past the end the last sample repeats.
#[inline(always)]
pub(crate) fn take_lanes<T: Lane>(to: &mut [T], from: &[f64], samples: usize, at: usize) {
    if at + T::LANES <= samples {
        for (joint, to) in to.iter_mut().enumerate() {
            *to = T::load(&from[joint * samples + at..]);
        }
    } else {
        for (joint, to) in to.iter_mut().enumerate() {
            let row = &from[joint * samples..(joint + 1) * samples];
            let mut padded = [0.0; 8];
            for (k, value) in padded.iter_mut().enumerate() {
                *value = row[(at + k).min(samples - 1)];
            }
            *to = T::load(&padded);
        }
    }
}

/// Writes lanes to samples `at..` of a row; lanes past the end of the row are dropped.
#[inline(always)]
pub(crate) fn put_lanes<T: Lane>(value: T, row: &mut [f64], at: usize) {
    if at + T::LANES <= row.len() {
        value.store(&mut row[at..]);
    } else {
        for (k, to) in row[at..].iter_mut().enumerate() {
            *to = value.lane(k);
        }
    }
}
