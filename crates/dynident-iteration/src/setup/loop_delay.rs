//! Highest bandwidth of a joint's loop if the controller has a delay.
//!
//! A joint of inertia `m` with the gains `K_p = ω² m̂`, `K_d = 2 ω m̂` has the open loop `L(s) = r (2 ω s + ω²) e^(-τ
//! s) / s²`. `r = m̂ / m` is the ratio of the inertia in the gains to the true inertia, `τ` the delay. At the
//! crossover frequency `ω_c = x ω` with `x² = 2 r² + r √(4 r² + 1)`, the gain is `|L| = 1` and the phase margin is
//! `atan 2x - ω_c τ` (Åström and Murray, *Feedback Systems*, 2008, chapter 9).

use nalgebra::{DMatrix, DVector};

/// Minimum phase margin, rad: 30 degrees.
const MIN_PHASE_MARGIN_RAD: f64 = core::f64::consts::FRAC_PI_6;

/// Highest natural frequency with the minimum phase margin, rad/s; infinite without a delay.
pub(crate) fn highest_omega(ratio: f64, delay_s: f64) -> f64 {
    omega_with_margin(ratio, delay_s, MIN_PHASE_MARGIN_RAD, 1.0)
}

/// Natural frequency at which a joint that is lighter than expected has half of the minimum phase margin, rad/s, with
/// `K_d = 2 ζ ω m̂` for a damping ratio `ζ`; infinite without a delay.
pub(crate) fn highest_omega_if_light(ratio: f64, delay_s: f64, damping: f64) -> f64 {
    omega_with_margin(ratio, delay_s, 0.5 * MIN_PHASE_MARGIN_RAD, damping)
}

/// With damping ratio `ζ`, the crossover is at `x² = 2 ζ² r² + r √(4 ζ⁴ r² + 1)`, and the phase margin is `atan 2 ζ x
/// - ω_c τ`.
fn omega_with_margin(ratio: f64, delay_s: f64, margin: f64, damping: f64) -> f64 {
    let damped = damping * damping * ratio;
    let crossover = (2.0 * damped * ratio + ratio * (4.0 * damped * damped + 1.0).sqrt()).sqrt();
    ((2.0 * damping * crossover).atan() - margin) / (crossover * delay_s)
}

/// Factor (at most 1) by which the natural frequencies `omega` (rad/s) must be multiplied so that joints with
/// velocity gains `kd` (Nms/rad) keep the minimum phase margin in a posture with mass matrix `M`. `None` if `M` is
/// not positive definite.
///
/// The coupled loops can be too fast although each single loop is slow enough. The fastest motion of all joints has
/// its crossover at `λ`, the largest eigenvalue of `M⁻¹ K_d`, like a single joint with `r = λ / 2ω`.
pub(crate) fn share_of_all(matrix: &DMatrix<f64>, kd: &[f64], omega: &[f64], delay_s: f64) -> Option<f64> {
    let root = DMatrix::from_diagonal(&DVector::from_iterator(kd.len(), kd.iter().map(|kd| kd.sqrt())));
    let fastest = (&root * matrix.clone().cholesky()?.inverse() * &root).symmetric_eigenvalues().max();
    // The joint with the largest ratio of position to velocity gain has the smallest phase.
    let highest = omega.iter().copied().fold(0.0, f64::max);
    Some((highest_omega(fastest / (2.0 * highest), delay_s) / highest).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loop `m q̈ = -K_d q̇(t - τ) - K_p q(t - τ)` in small steps: a deflection decays at the highest frequency and
    /// grows at three times that frequency (no margin left).
    #[test]
    fn the_highest_frequency_is_stable_and_three_times_that_is_not() {
        let delay_s = 0.008;
        let usual = [1.0, 1.5, 4.0, 10.0].map(|ratio| (ratio, 1.0, highest_omega(ratio, delay_s)));
        let light = [(4.0, 1.0), (4.0, 0.5), (10.0, 0.5)]
            .map(|(ratio, damping)| (ratio, damping, highest_omega_if_light(ratio, delay_s, damping)));
        for (ratio, damping, highest) in usual.into_iter().chain(light) {
            let grows = |omega: f64| {
                let (step, late) = (1e-5, 800);
                let (mut q, mut dq) = (1.0_f64, 0.0_f64);
                let mut seen = std::collections::VecDeque::from(vec![(1.0, 0.0); late]);
                let seconds = 20.0 / omega;
                for _ in 0..(seconds / step) as usize {
                    let (late_q, late_dq) = seen.pop_front().unwrap();
                    dq -= step * ratio * (omega * omega * late_q + 2.0 * damping * omega * late_dq);
                    q += step * dq;
                    seen.push_back((q, dq));
                }
                q.abs().max(dq.abs() / omega) > 1.0
            };
            assert!(!grows(highest), "{ratio} {damping}");
            assert!(grows(3.0 * highest), "{ratio} {damping}");
        }
    }

    /// Without coupling it equals the rule for a single joint.
    #[test]
    fn all_together_is_the_single_joint_where_nothing_couples() {
        let (m, omega, delay_s) = (2.5, 40.0, 0.01);
        let kd = 2.0 * omega * m;
        let share = share_of_all(&DMatrix::from_diagonal_element(2, 2, m), &[kd, kd], &[omega; 2], delay_s).unwrap();
        assert!((share - highest_omega(1.0, delay_s) / omega).abs() < 1e-12);
        assert_eq!(share_of_all(&DMatrix::from_diagonal_element(2, 2, m), &[kd, kd], &[omega; 2], 1e-4), Some(1.0));
        assert_eq!(share_of_all(&DMatrix::zeros(1, 1), &[1.0], &[1.0], delay_s), None);
    }
}
