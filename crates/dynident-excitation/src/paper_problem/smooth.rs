//! The paper's problem without steps and kinks: windows sampled at a fixed number of points, condition numbers and limits as constraints, exact gradients.

use super::{PEAK_OF_SECOND, PaperProblem, Stroke, strokes};
use crate::optimisers::ConstrainedProblem;
use core::f64::consts::PI;

/// Minimise ln(e^s1 + e^s2) over A1, ω1, δ1, A2, ω2, δ2, s1, s2, where s is an upper bound of the logarithm of each joint's condition number, under
/// the limits (17), (18) as constraints value/limit - 1 <= 0.
///
/// [`PaperProblem::fitness`] jumps where δ takes in one sample more and where a limit is met. Here every window holds the same number of samples,
/// spread evenly from -δ to δ (the middles of equal parts), which has the same
/// condition number up to the width of a sample; δ <= T/4 is a constraint. Limits are tightened by one part in a million, so that a solution within
/// the optimiser's tolerance keeps them strictly.
///
/// The condition number itself has a kink, and the optimum lies on it: turned by A/2, the rows are [q̈, -g sin p | g cos p] with p = q - A/2, odd and
/// even in time from the mid-point, so W splits into two blocks, and at the
/// optimum the largest singular values of both are equal. Each block's singular values are smooth; so is the problem with one constraint ln σ_large -
/// ln σ_small - s <= 0 for every pair that may be extreme.
#[derive(Clone, Debug)]
pub struct SmoothPaperProblem {
    problem: PaperProblem,
    points: usize,
    x: Vec<f64>,
}

/// Three pairs of singular values; speed, acceleration, both at rest, window.
pub(super) const PAIRS: usize = 3;
pub(super) const CONSTRAINTS_PER_JOINT: usize = PAIRS + 5;
pub(super) const MARGIN: f64 = 1e-6;

/// A number and its gradient by A, ω, δ.
pub(super) type Slope = (f64, [f64; 3]);

/// ln of the singular values of the odd block, large and small, and of the even one.
pub(super) struct LogSingular {
    odd: [Slope; 2],
    even: Slope,
}

impl LogSingular {
    /// The pairs whose ratio may be the condition number, as differences of logarithms.
    pub(super) fn pairs(&self) -> [Slope; PAIRS] {
        let [large, small] = self.odd;
        [(self.even, small), (large, small), (large, self.even)]
            .map(|(over, under)| (over.0 - under.0, core::array::from_fn(|i| over.1[i] - under.1[i])))
    }
}

impl SmoothPaperProblem {
    /// With 256 points a window: error of the condition number below 1e-4 of itself.
    pub fn new(problem: &PaperProblem) -> Self {
        Self { problem: problem.clone(), points: 256, x: vec![0.0; 8] }
    }

    /// cond(M) + cond(Q) at `x` (its first six entries).
    ///
    /// # Panics
    /// If `x` has fewer than six entries.
    pub fn condition_sum(&self, x: &[f64]) -> f64 {
        self.log_conditions(x).iter().map(|log| log.exp()).sum()
    }

    /// A full point: the given A1 .. δ2 with the smallest s1, s2 that fit.
    ///
    /// # Panics
    /// If `x` has fewer than six entries.
    pub fn with_bounds_of_conditions(&self, x: &[f64]) -> Vec<f64> {
        let mut full = x[..6].to_vec();
        full.extend(self.log_conditions(x));
        full
    }

    fn log_conditions(&self, x: &[f64]) -> [f64; 2] {
        strokes(x).map(|stroke| {
            let pairs = self.log_singular(&stroke).pairs();
            pairs.iter().fold(0.0, |largest: f64, pair| largest.max(pair.0))
        })
    }

    /// Sums over the later half of the window; the earlier one repeats them.
    pub(super) fn log_singular(&self, stroke: &Stroke) -> LogSingular {
        let Stroke { amplitude_rad: a, steepness_per_s: w, window_s } = *stroke;
        let gravity = self.problem.gravity;
        // Columns q̈, g sin p, g cos p with their gradients.
        let rows: Vec<[Slope; 3]> = (0..self.points / 2)
            .map(|k| {
                let place = (2 * k + 1) as f64 / self.points as f64;
                let t = place * window_s;
                let f = 1.0 / (1.0 + (-w * t).exp());
                let first = f * (1.0 - f);
                let second = first * (1.0 - 2.0 * f);
                let third = first * (1.0 - 6.0 * first);
                let (sin, cos) = (a * (f - 0.5)).sin_cos();
                let dp = [f - 0.5, a * first * t, a * w * first * place];
                let dddq =
                    [w * w * second, 2.0 * a * w * second + a * w * w * third * t, a * w.powi(3) * third * place];
                [
                    (a * w * w * second, dddq),
                    (gravity * sin, dp.map(|d| gravity * cos * d)),
                    (gravity * cos, dp.map(|d| -gravity * sin * d)),
                ]
            })
            .collect();
        let product = |i: usize, j: usize| -> f64 { rows.iter().map(|row| row[i].0 * row[j].0).sum() };
        let (aa, ab, bb, cc) = (product(0, 0), product(0, 1), product(1, 1), product(2, 2));
        // The small eigenvalue of the odd block from its determinant aa·‖b - (ab/aa) a‖², where nothing cancels.
        let share = ab / aa;
        let rest: f64 = rows.iter().map(|row| (row[1].0 - share * row[0].0).powi(2)).sum();
        let half = 0.5 * (aa - bb);
        let radius = half.hypot(ab);
        let large = 0.5 * (aa + bb) + radius;
        // Angle of the large eigenvector: tan 2θ = 2 ab/(aa - bb).
        let (sin, cos) = (0.5 * ab.atan2(half)).sin_cos();
        let (mut d_aa, mut d_rest, mut d_large, mut d_cc) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
        for [acceleration, odd, even] in &rows {
            let along = cos * acceleration.0 + sin * odd.0;
            let residual = odd.0 - share * acceleration.0;
            for i in 0..3 {
                d_aa[i] += 2.0 * acceleration.0 * acceleration.1[i];
                d_rest[i] += 2.0 * residual * (odd.1[i] - share * acceleration.1[i]);
                d_large[i] += 2.0 * along * (cos * acceleration.1[i] + sin * odd.1[i]);
                d_cc[i] += 2.0 * even.0 * even.1[i];
            }
        }
        // ln σ = ½ ln λ.
        let log = |value: f64, slope: [f64; 3]| (0.5 * value.ln(), slope.map(|d| 0.5 * d / value));
        let (first, determinant, second) = (log(large, d_large), log(aa, d_aa), log(rest, d_rest));
        let small = core::array::from_fn(|i| determinant.1[i] + second.1[i] - first.1[i]);
        LogSingular { odd: [first, (determinant.0 + second.0 - first.0, small)], even: log(cc, d_cc) }
    }

    /// Value and gradient by A, ω, δ of every limit of one joint. All are products of powers: c = s Aᵃ ωʷ δᵈ - 1.
    pub(super) fn limits_of(&self, stroke: &Stroke) -> [Slope; CONSTRAINTS_PER_JOINT - PAIRS] {
        let problem = &self.problem;
        let quarter = 0.25 * problem.period_times_steepness;
        let rest = 1.0 / (1.0 + quarter.exp());
        let first = rest * (1.0 - rest);
        let Stroke { amplitude_rad: a, steepness_per_s: w, window_s: d } = *stroke;
        [
            (0.25 / problem.speed_limit, [1, 1, 0]),
            (PEAK_OF_SECOND / problem.acceleration_limit, [1, 2, 0]),
            (first / problem.rest_limit, [1, 1, 0]),
            (first * (1.0 - 2.0 * rest) / problem.rest_limit, [1, 2, 0]),
            (1.0 / quarter, [0, 1, 1]),
        ]
        .map(|(scale, powers)| {
            let product = scale * (1.0 + MARGIN) * a.powi(powers[0]) * w.powi(powers[1]) * d.powi(powers[2]);
            let gradient = [
                product * f64::from(powers[0]) / a,
                product * f64::from(powers[1]) / w,
                product * f64::from(powers[2]) / d,
            ];
            (product - 1.0, gradient)
        })
    }
}

impl ConstrainedProblem for SmoothPaperProblem {
    fn variables(&self) -> usize {
        8
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        let mut bounds = self.problem.bounds();
        // Position and ground: the stroke ends below A.
        let highest = self.problem.position_limit_rad.min(PI) * (1.0 - MARGIN);
        for joint in 0..2 {
            bounds[3 * joint][1] = bounds[3 * joint][1].min(highest);
        }
        // Condition numbers are at least 1; beyond e⁴⁰ there are no digits left.
        bounds.extend([[0.0, 40.0]; 2]);
        bounds
    }

    fn constraints(&self) -> usize {
        2 * CONSTRAINTS_PER_JOINT
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.x.copy_from_slice(x);
        let joints = strokes(x).into_iter().zip(&x[6..]);
        for ((stroke, bound), out) in joints.zip(constraints.chunks_exact_mut(CONSTRAINTS_PER_JOINT)) {
            for (c, pair) in out.iter_mut().zip(self.log_singular(&stroke).pairs()) {
                *c = pair.0 - bound;
            }
            for (c, limit) in out[PAIRS..].iter_mut().zip(self.limits_of(&stroke)) {
                *c = limit.0;
            }
        }
        (x[6].exp() + x[7].exp()).ln()
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let conditions = [self.x[6].exp(), self.x[7].exp()];
        for (joint, stroke) in strokes(&self.x).iter().enumerate() {
            let weights = &weights[CONSTRAINTS_PER_JOINT * joint..];
            let pairs = self.log_singular(stroke).pairs();
            for (weight, (_, slope)) in weights.iter().zip(pairs.iter().chain(&self.limits_of(stroke))) {
                for i in 0..3 {
                    gradient[3 * joint + i] += weight * slope[i];
                }
            }
            let held: f64 = weights[..PAIRS].iter().sum();
            gradient[6 + joint] = conditions[joint] / (conditions[0] + conditions[1]) - held;
        }
    }
}
