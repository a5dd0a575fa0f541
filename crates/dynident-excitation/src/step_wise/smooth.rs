//! Smooth formulation of the stroke problem, with exact gradients.

use super::stroke::{PEAK_OF_SECOND, Stroke, StrokeConstants};
use crate::optimisers::ConstrainedProblem;

/// Number of samples of a window; with it the relative error of the condition number is below 1e-4.
const POINTS: usize = 256;

/// Minimises s over amplitude A, steepness ω, window half width δ and s. s is an upper bound of the logarithm of the
/// joint's condition number. The limits of equations 17 and 18 are constraints value/limit - 1 <= 0. Joints that move
/// one after another are independent, so this covers one joint completely.
///
/// [`StrokeConstants::condition_number`] is discontinuous where δ includes one more sample. Here every window
/// contains the same number of samples, evenly distributed from -δ to δ (at the middles of equal parts). The
/// condition number is the same up to the width of a sample. δ <= T/4 is a constraint. Limits are tightened by 1e-6,
/// so that a solution within the optimiser's tolerance keeps them strictly.
///
/// The condition number has a kink at the optimum. Rotated by A/2, the rows of the regressor W are [q̈, -g sin p | g
/// cos p] with p = q - A/2, odd and even in time from the mid-point. W therefore splits into two blocks, whose
/// largest singular values are equal at the optimum. The singular values of each block are smooth. The problem is
/// smooth with one constraint ln σ_large - ln σ_small - s <= 0 for every pair that can be extreme.
#[derive(Clone, Debug)]
pub(super) struct SmoothStroke {
    constants: StrokeConstants,
    x: [f64; 4],
}

/// Constraints: three pairs of singular values; velocity, acceleration, both at rest, window.
const PAIRS: usize = 3;
const CONSTRAINTS: usize = PAIRS + 5;
const RELATIVE_MARGIN: f64 = 1e-6;

/// A value and its gradient with respect to A, ω, δ.
type Slope = (f64, [f64; 3]);

/// Logarithms of the singular values of the odd block (the larger and the smaller) and of the even block.
struct LogSingular {
    odd: [Slope; 2],
    even: Slope,
}

impl LogSingular {
    /// Pairs whose ratio can be the condition number, as differences of logarithms.
    fn pairs(&self) -> [Slope; PAIRS] {
        let [large, small] = self.odd;
        [(self.even, small), (large, small), (large, self.even)]
            .map(|(over, under)| (over.0 - under.0, core::array::from_fn(|i| over.1[i] - under.1[i])))
    }
}

impl SmoothStroke {
    pub(super) fn new(constants: &StrokeConstants) -> Self {
        Self { constants: constants.clone(), x: [0.0; 4] }
    }

    /// A, ω, δ with the smallest feasible s.
    pub(super) fn start(&self, x: &[f64]) -> Vec<f64> {
        let pairs = self.log_singular(&Stroke::of(x)).pairs();
        let bound = pairs.iter().fold(0.0, |largest: f64, pair| largest.max(pair.0));
        vec![x[0], x[1], x[2], bound]
    }

    /// Sums over the later half of the window only, because the earlier half contains the same values.
    fn log_singular(&self, stroke: &Stroke) -> LogSingular {
        let Stroke { amplitude_rad: a, steepness_per_s: w, window_s } = *stroke;
        let gravity = self.constants.gravity;
        // Columns q̈, g sin p, g cos p with their gradients.
        let rows: Vec<[Slope; 3]> = (0..POINTS / 2)
            .map(|k| {
                let place = (2 * k + 1) as f64 / POINTS as f64;
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
        // The smaller eigenvalue of the odd block follows from its determinant aa·‖b - (ab/aa) a‖², without
        // cancellation.
        let share = ab / aa;
        let rest: f64 = rows.iter().map(|row| (row[1].0 - share * row[0].0).powi(2)).sum();
        let half = 0.5 * (aa - bb);
        let radius = half.hypot(ab);
        let large = 0.5 * (aa + bb) + radius;
        // Angle of the eigenvector with the larger eigenvalue: tan 2θ = 2 ab/(aa - bb).
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

    /// Value of every limit, and gradient with respect to A, ω, δ. All limits are products of powers: c = s Aᵃ ωʷ δᵈ
    /// - 1.
    fn limits(&self, stroke: &Stroke) -> [Slope; CONSTRAINTS - PAIRS] {
        let constants = &self.constants;
        let quarter = 0.25 * constants.period_times_steepness;
        let rest = 1.0 / (1.0 + quarter.exp());
        let first = rest * (1.0 - rest);
        let Stroke { amplitude_rad: a, steepness_per_s: w, window_s: d } = *stroke;
        [
            (0.25 / constants.speed_limit, [1, 1, 0]),
            (PEAK_OF_SECOND / constants.acceleration_limit, [1, 2, 0]),
            (first / constants.rest_limit, [1, 1, 0]),
            (first * (1.0 - 2.0 * rest) / constants.rest_limit, [1, 2, 0]),
            (1.0 / quarter, [0, 1, 1]),
        ]
        .map(|(scale, powers)| {
            let product = scale * (1.0 + RELATIVE_MARGIN) * a.powi(powers[0]) * w.powi(powers[1]) * d.powi(powers[2]);
            let gradient = [
                product * f64::from(powers[0]) / a,
                product * f64::from(powers[1]) / w,
                product * f64::from(powers[2]) / d,
            ];
            (product - 1.0, gradient)
        })
    }
}

impl ConstrainedProblem for SmoothStroke {
    fn variables(&self) -> usize {
        4
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        let mut bounds = self.constants.bounds().to_vec();
        // The end position of the stroke is below A.
        bounds[0][1] = bounds[0][1].min(self.constants.position_limit_rad * (1.0 - RELATIVE_MARGIN));
        // Condition numbers are at least 1; above e⁴⁰ no digits are significant.
        bounds.push([0.0, 40.0]);
        bounds
    }

    fn constraints(&self) -> usize {
        CONSTRAINTS
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.x.copy_from_slice(x);
        let stroke = Stroke::of(x);
        for (c, pair) in constraints.iter_mut().zip(self.log_singular(&stroke).pairs()) {
            *c = pair.0 - x[3];
        }
        for (c, limit) in constraints[PAIRS..].iter_mut().zip(self.limits(&stroke)) {
            *c = limit.0;
        }
        x[3]
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let stroke = Stroke::of(&self.x);
        let pairs = self.log_singular(&stroke).pairs();
        for (weight, (_, slope)) in weights.iter().zip(pairs.iter().chain(&self.limits(&stroke))) {
            for (out, slope) in gradient.iter_mut().zip(slope) {
                *out += weight * slope;
            }
        }
        gradient[3] = 1.0 - weights[..PAIRS].iter().sum::<f64>();
    }
}
