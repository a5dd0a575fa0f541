//! Second-order sections: design of the digital Butterworth low-pass, and filtering of three signals together.

use crate::error::{FilterError, require};
use core::f64::consts::PI;

/// Transfer function `H(z) = (b0 + b1 z⁻¹ + b2 z⁻²) / (1 + a1 z⁻¹ + a2 z⁻²)` of one section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Section {
    pub(crate) b: [f64; 3],
    pub(crate) a: [f64; 2],
}

/// Minimum ratio of the cut-off to the sample rate; with it, the gain at zero frequency is accurate to seven digits.
const MIN_CUTOFF_RATIO: f64 = 1e-5;

/// Digital Butterworth low-pass of `order`: analogue prototype poles `exp(iπ(2k + n + 1) / 2n)`, cut-off pre-warped,
/// bilinear transform; each section has unit gain at zero frequency. Equals `scipy.signal.butter(order, cutoff_hz,
/// fs=rate_hz, output="sos")` except for the distribution of the gain over the sections.
/// Source: Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.1.2.
///
/// # Errors
/// If `order` is not 1 to 12, or the cut-off is not from 1e-5 of the rate to below half of it.
pub(crate) fn butterworth_low_pass(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Vec<Section>, FilterError> {
    require((1..=12).contains(&order), "order", order as f64, "give 1 to 12")?;
    require(cutoff_hz.is_finite() && cutoff_hz > 0.0, "cutoff_hz", cutoff_hz, "give a positive frequency")?;
    if cutoff_hz.partial_cmp(&(0.5 * rate_hz)) != Some(core::cmp::Ordering::Less) {
        return Err(FilterError::AboveNyquist { cutoff_hz, rate_hz });
    }
    let fix = "give a higher cut-off: below 1e-5 of the sampling rate the recursion loses all precision";
    require(cutoff_hz >= MIN_CUTOFF_RATIO * rate_hz, "cutoff_hz", cutoff_hz, fix)?;
    let warped = (PI * cutoff_hz / rate_hz).tan();
    let mut sections: Vec<Section> = (0..order / 2)
        .map(|k| {
            // Poles of s² + 2 d w s + w² with the damping d: the sine of the angle between the pole and the imaginary
            // axis.
            let damping = (PI * (2 * k + 1) as f64 / (2 * order) as f64).sin();
            let square = warped * warped;
            let norm = 1.0 / (1.0 + 2.0 * damping * warped + square);
            let b = square * norm;
            Section {
                b: [b, 2.0 * b, b],
                a: [2.0 * (square - 1.0) * norm, (1.0 - 2.0 * damping * warped + square) * norm],
            }
        })
        .collect();
    if order % 2 == 1 {
        let norm = 1.0 / (1.0 + warped);
        sections.push(Section { b: [warped * norm, warped * norm, 0.0], a: [(warped - 1.0) * norm, 0.0] });
    }
    Ok(sections)
}

/// Maximum pole radius of all sections; transients of n samples decay as `radiusⁿ`.
pub(crate) fn pole_radius(sections: &[Section]) -> f64 {
    sections.iter().fold(0.0_f64, |radius, section| {
        let [a1, a2] = section.a;
        let discriminant = a1 * a1 - 4.0 * a2;
        let largest = if discriminant < 0.0 { a2.sqrt() } else { 0.5 * (a1.abs() + discriminant.sqrt()) };
        radius.max(largest)
    })
}

/// Position with its first and second difference: three signals that pass the same filter.
pub(crate) type Triple = [f64; 3];

/// Filters `signal` in place with all sections (from its end if `reversed`), in transposed direct form II. Each section
/// starts in its steady state for the constant input `start`, as with `scipy.signal.sosfilt_zi`.
pub(crate) fn run(sections: &[Section], signal: &mut [Triple], start: Triple, reversed: bool) {
    for some in sections.chunks(2) {
        match some {
            [first, second] => run_together([*first, *second], signal, start, reversed),
            _ => some.iter().for_each(|section| run_together([*section], signal, start, reversed)),
        }
    }
}

/// Applies N sections in one pass, so that the processor can overlap their recursions.
fn run_together<const N: usize>(sections: [Section; N], signal: &mut [Triple], start: Triple, reversed: bool) {
    // Each section has unit gain. For constant x, y = x, so s2 = (b2 - a2) x and s1 = (b1 - a1) x + s2.
    let mut s2 = sections.map(|Section { b: [_, _, b2], a: [_, a2] }| start.map(|x| (b2 - a2) * x));
    let mut s1: [Triple; N] = core::array::from_fn(|k| {
        let Section { b: [_, b1, _], a: [a1, _] } = sections[k];
        [0, 1, 2].map(|i| (b1 - a1) * start[i] + s2[k][i])
    });
    let mut step = |value: &mut Triple| {
        for k in 0..N {
            let Section { b: [b0, b1, b2], a: [a1, a2] } = sections[k];
            for i in 0..3 {
                let x = value[i];
                let y = b0 * x + s1[k][i];
                s1[k][i] = b1 * x - a1 * y + s2[k][i];
                s2[k][i] = b2 * x - a2 * y;
                value[i] = y;
            }
        }
    };
    if reversed {
        for value in signal.iter_mut().rev() {
            step(value);
        }
    } else {
        for value in signal {
            step(value);
        }
    }
}
