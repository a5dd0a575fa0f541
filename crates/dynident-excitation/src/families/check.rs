//! Shared tests of all families: exact derivatives, exact gradient, rest at the ends.

use super::random_start::grid;
use crate::family::Family;
use crate::motion::Motion;
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector};

pub(crate) fn start(family: &dyn Family, seed: u64) -> Vec<f64> {
    let joints = family.joints();
    let ranges: Vec<_> = (0..joints).map(|joint| [-1.5 - joint as f64 * 0.2, 2.0]).collect();
    let speeds: Vec<_> = (0..joints).map(|joint| 2.0 + joint as f64 * 0.3).collect();
    let parameters = family.random(&ranges, &speeds, &mut Random::new(seed));
    assert_eq!(parameters.len(), family.parameters());
    for (value, bound) in parameters.iter().zip(family.bounds()) {
        assert!(bound[0] <= *value && *value <= bound[1], "start {value} outside {bound:?}");
    }
    let mut motion = Motion::default();
    family.motion(&parameters, &grid(family.duration_s()), &mut motion);
    for joint in 0..joints {
        for sample in motion.of(joint) {
            assert!(ranges[joint][0] - 1e-9 <= motion.q[sample] && motion.q[sample] <= ranges[joint][1] + 1e-9);
            assert!(motion.dq[sample].abs() <= speeds[joint] * (1.0 + 1e-9));
        }
    }
    parameters
}

fn times(family: &dyn Family, random: &mut Random) -> Vec<f64> {
    let duration = family.duration_s();
    (0..29).map(|_| random.uniform(0.02 * duration, 0.98 * duration)).collect()
}

/// Compares the integrals of q̇, q̈ and jerk over short spans with the changes of q, q̇ and q̈.
///
/// Gauss-Legendre quadrature with five points over 1e-4 of the duration integrates every smooth piece up to rounding.
/// The tolerance is 1e-6 of the integral's largest possible value, plus the rounding of the difference. A span with a
/// discontinuity of the next derivative (a knot) is less accurate; two of 29 spans may fail.
pub(crate) fn derivatives(family: &dyn Family, seed: u64) {
    const NODES: [[f64; 2]; 5] = [
        [-0.906_179_845_938_664, 0.236_926_885_056_189_08],
        [-0.538_469_310_105_683_1, 0.478_628_670_499_366_47],
        [0.0, 0.568_888_888_888_888_9],
        [0.538_469_310_105_683_1, 0.478_628_670_499_366_47],
        [0.906_179_845_938_664, 0.236_926_885_056_189_08],
    ];
    let mut random = Random::new(seed ^ 0x55);
    let parameters = start(family, seed);
    let span = 1e-4 * family.duration_s();
    let middles = times(family, &mut random);
    let mut all = Vec::new();
    for middle in &middles {
        all.push(middle - 0.5 * span);
        all.push(middle + 0.5 * span);
        all.extend(NODES.iter().map(|node| middle + 0.5 * span * node[0]));
    }
    let mut motion = Motion::default();
    family.motion(&parameters, &all, &mut motion);
    let orders = motion.arrays();
    for order in 0..3 {
        for joint in 0..family.joints() {
            let (low, high) = (&orders[order][motion.of(joint)], &orders[order + 1][motion.of(joint)]);
            let size = |values: &[f64]| values.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
            // Peaks of the whole motion, because the rounding of a sum does not decrease where the sum is near zero.
            let (peak_low, peak_high) = (size(low), size(high));
            let mut broken = 0;
            for middle in 0..middles.len() {
                let at = 7 * middle;
                let integral: f64 =
                    NODES.iter().enumerate().map(|(n, node)| 0.5 * span * node[1] * high[at + 2 + n]).sum();
                let error = (low[at + 1] - low[at] - integral).abs();
                if error > 1e-12 * peak_low + 1e-6 * span * peak_high {
                    broken += 1;
                }
            }
            assert!(broken <= 2, "{}: joint {joint}, order {order}: {broken} spans disagree", family.name());
        }
    }
}

/// Compares the gradient of a random linear function of the motion with central differences, and checks that it is
/// added to the output.
pub(crate) fn gradient(family: &dyn Family, seed: u64) {
    gradient_at(family, &start(family, seed), seed);
}

pub(crate) fn gradient_at(family: &dyn Family, parameters: &[f64], seed: u64) {
    gradient_on(family, parameters, &times(family, &mut Random::new(seed ^ 0xaa)), seed);
}

pub(crate) fn gradient_on(family: &dyn Family, parameters: &[f64], times: &[f64], seed: u64) {
    let mut random = Random::new(seed ^ 0x77);
    let mut adjoint = Motion::default();
    adjoint.reset(family.joints(), times.len());
    for values in adjoint.arrays_mut() {
        values.fill_with(|| random.normal());
    }
    let mut motion = Motion::default();
    let mut cost = |parameters: &[f64]| -> f64 {
        family.motion(parameters, times, &mut motion);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        motion.arrays().into_iter().zip(adjoint.arrays()).map(|(motion, adjoint)| dot(motion, adjoint)).sum()
    };
    let mut gradient = vec![1.0; parameters.len()];
    family.apply_adjoint(parameters, times, &adjoint, &mut gradient);
    let scale = gradient.iter().fold(1.0_f64, |peak, value| peak.max(value.abs()));
    for index in 0..parameters.len() {
        let mut moved = parameters.to_vec();
        let step = 1e-5 * parameters[index].abs().max(0.1);
        let mut at = |offset: f64| {
            moved[index] = parameters[index] + offset * step;
            cost(&moved)
        };
        let difference = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
        // Fourth-order differences: rounding 1e-16 × cost / step and truncation step^4 are both below 1e-8 of the
        // largest derivative.
        assert!(
            (gradient[index] - 1.0 - difference).abs() < 1e-7 * scale,
            "{}: parameter {index}: {} but {difference}",
            family.name(),
            gradient[index] - 1.0
        );
    }
}

/// Compares the curvature for random weights with the gradients of every weighted value of the motion: Σ w (Jᵀe)(Jᵀe)ᵀ.
pub(crate) fn curvature(family: &dyn Family, seed: u64) {
    let parameters = start(family, seed);
    let mut random = Random::new(seed ^ 0x55);
    let times: Vec<f64> = (0..5).map(|_| random.uniform(0.0, family.duration_s())).collect();
    let (joints, each) = (family.joints(), family.parameters() / family.joints());
    let mut weights = Motion::default();
    weights.reset(joints, times.len());
    for values in weights.arrays_mut() {
        values.fill_with(|| random.uniform(0.0, 1.0));
    }
    for joint in 0..joints {
        let mut found = DMatrix::zeros(each, each);
        assert!(family.curvature(&parameters, &times, joint, &weights, &mut found), "{}", family.name());
        let mut expected = DMatrix::zeros(each, each);
        for order in 0..4 {
            for sample in weights.of(joint) {
                let mut unit = Motion::default();
                unit.reset(joints, times.len());
                unit.arrays_mut()[order][sample] = 1.0;
                let mut gradient = vec![0.0; parameters.len()];
                family.apply_adjoint(&parameters, &times, &unit, &mut gradient);
                let row = DVector::from_column_slice(&gradient[joint * each..(joint + 1) * each]);
                expected.ger(weights.arrays()[order][sample], &row, &row, 1.0);
            }
        }
        let error = (&found - &expected).amax();
        assert!(error <= 1e-12 * expected.amax(), "{}: curvature off by {error:e}", family.name());
    }
}

/// Checks q̇ = q̈ = 0 at both ends, up to rounding of the peaks.
pub(crate) fn rest(family: &dyn Family, seed: u64) {
    let parameters = start(family, seed);
    let mut motion = Motion::default();
    family.motion(&parameters, &grid(family.duration_s()), &mut motion);
    let last = motion.samples - 1;
    for joint in 0..family.joints() {
        for values in [&motion.dq, &motion.ddq] {
            let own = &values[motion.of(joint)];
            let peak = own.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
            assert!(own[0].abs() <= 1e-12 * peak && own[last].abs() <= 1e-12 * peak, "{}", family.name());
        }
    }
}
