//! The time at which the friction of a joint changes its sign, relative to its velocity.
//!
//! The model changes the sign of friction where the filtered velocity is zero. A real joint sticks at a reversal. Its
//! friction changes while the joint is at rest, and the zero of the filtered velocity is in the middle of this time or
//! later. A lag of the torque looks the same at reversals, but it also shifts the torque of the bodies. Therefore a
//! column `−ε ∂τ_s/∂t` (predicted torque τ_s of the friction with a sign function, time ε) separates the two. It is
//! used only if the times ε of all joints together are significant, since it makes the lag less certain.

use dynident_estimation::Estimate;

/// Half-width of the 95 % interval of a normal variable, in standard deviations.
const HALF_WIDTH_95: f64 = 1.96;
/// Number of bisections for the spread of the times.
const BISECTIONS: usize = 40;

/// Time by which the friction of a joint changes its sign later than its filtered velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reversal {
    pub(crate) joint: usize,
    /// The time, s; negative if the friction changes its sign first.
    pub(crate) late_s: f64,
    /// Standard deviation of a normal error with the same 95 % interval, s. It is larger than that of the estimate if
    /// there are few time segments.
    pub(crate) std_s: f64,
}

/// Times of reversal of all joints with friction that changes its sign. `first` is the column of the first joint.
pub(super) fn of_joints(estimate: &Estimate, first: usize) -> Vec<Reversal> {
    let of = |column: usize| Reversal {
        joint: column - first,
        late_s: estimate.values[column],
        std_s: estimate.half_width_95[column] / HALF_WIDTH_95,
    };
    (first..estimate.values.len()).map(of).filter(|reversal| reversal.std_s > 0.0).collect()
}

/// Standard deviation s of the times ε of all joints around zero, from `Σ ε²/(σ² + s²) = n` for n joints with the
/// standard deviations σ (Paule and Mandel, J. Res. NBS 87 (1982) 377, with a known mean). `None` if `Σ ε²/σ²` is at
/// most `max_std` standard deviations `√(2n)` above its mean n: the times are then noise.
pub(super) fn spread_s(free: &Estimate, first: usize, max_std: f64) -> Option<f64> {
    spread_of(&of_joints(free, first), max_std)
}

fn spread_of(times: &[Reversal], max_std: f64) -> Option<f64> {
    let count = times.len() as f64;
    let squares = |spread_s: f64| {
        times.iter().map(|time| time.late_s.powi(2) / (time.std_s.powi(2) + spread_s.powi(2))).sum::<f64>()
    };
    if times.is_empty() || squares(0.0) - count <= max_std * (2.0 * count).sqrt() {
        return None;
    }
    let longest = times.iter().fold(0.0_f64, |most, time| most.max(time.late_s.abs()));
    let mut bounds = [0.0, longest * count.sqrt()];
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (bounds[0] + bounds[1]);
        bounds[usize::from(squares(middle) <= count)] = middle;
    }
    Some(bounds[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(late_s: &[f64], std_s: f64) -> Vec<Reversal> {
        let of = |(joint, &late_s): (usize, &f64)| Reversal { joint, late_s, std_s };
        late_s.iter().enumerate().map(of).collect()
    }

    #[test]
    fn times_within_their_errors_are_noise() {
        // χ² of 6 for 6 joints, then of 24 for a limit of 6 + 4 √12 = 19.9.
        assert_eq!(spread_of(&times(&[1e-3, -1e-3, 1e-3, -1e-3, 1e-3, 1e-3], 1e-3), 4.0), None);
        let spread_s = spread_of(&times(&[2e-3; 6], 1e-3), 4.0).unwrap();
        // 6 · 4 / (1 + s²) = 6 in ms.
        assert!((spread_s - 3.0_f64.sqrt() * 1e-3).abs() < 1e-9, "{spread_s}");
        assert_eq!(spread_of(&[], 4.0), None);
    }

    #[test]
    fn a_time_that_is_hardly_determined_does_not_count() {
        let mut one = times(&[-5e-3, -6e-3, -5e-3], 0.3e-3);
        let spread_s = spread_of(&one, 4.0).unwrap();
        one.push(Reversal { joint: 3, late_s: 80e-3, std_s: 90e-3 });
        let with_unknown = spread_of(&one, 4.0).unwrap();
        assert!((with_unknown / spread_s - 1.0).abs() < 0.2, "{spread_s}, {with_unknown}");
    }
}
