//! The paper's problem without steps: windows sampled at a fixed number of points, limits as constraints, exact gradients.

use super::condition::Singular3;
use super::{PEAK_OF_SECOND, PaperProblem, Stroke, strokes};
use crate::optimisers::ConstrainedProblem;

/// ln(cond(M) + cond(Q)) as a smooth function of A1, ω1, δ1, A2, ω2, δ2, and the limits (17), (18) as constraints value/limit - 1 <= 0.
///
/// [`PaperProblem::fitness`] jumps where δ takes in one sample more and where a limit is met. Here every window holds the same number of samples, spread evenly from -δ to δ (the middles of equal parts), which has the same
/// condition number up to the width of a sample; δ <= T/4 is a constraint. Limits are tightened by one part in a million, so that a solution within the optimiser's tolerance keeps them strictly.
#[derive(Clone, Debug)]
pub struct SmoothPaperProblem {
    problem: PaperProblem,
    points: usize,
    x: Vec<f64>,
}

/// Speed, acceleration, both at rest, window.
const CONSTRAINTS_PER_JOINT: usize = 5;
const MARGIN: f64 = 1e-6;

impl SmoothPaperProblem {
    /// With 256 points a window: error of the condition number below 1e-4 of itself.
    pub fn new(problem: &PaperProblem) -> Self {
        Self { problem: problem.clone(), points: 256, x: vec![0.0; 6] }
    }

    /// cond(M) + cond(Q) at `x`.
    ///
    /// # Panics
    /// If `x` has fewer than six entries.
    pub fn condition_sum(&self, x: &[f64]) -> f64 {
        strokes(x).iter().map(|stroke| self.singular(stroke).condition_number()).sum()
    }

    /// Where in the window point `k` lies, from -1 to 1.
    fn place(&self, k: usize) -> f64 {
        (2 * k + 1) as f64 / self.points as f64 - 1.0
    }

    fn singular(&self, stroke: &Stroke) -> Singular3 {
        let gravity = self.problem.gravity;
        Singular3::of_rows((0..self.points).map(|k| {
            let (q, ddq) = stroke.position_and_acceleration(self.place(k) * stroke.window_s);
            let (sin, cos) = q.sin_cos();
            [ddq, gravity * cos, -gravity * sin]
        }))
    }

    /// Condition number κ and its gradient by A, ω, δ: dσ = uᵀ dW v with u = W v/σ, so d ln κ = v₁ᵀWᵀdW v₁/σ₁² - v₃ᵀWᵀdW v₃/σ₃².
    fn condition_gradient(&self, stroke: &Stroke) -> (f64, [f64; 3]) {
        let singular = self.singular(stroke);
        let gravity = self.problem.gravity;
        let Stroke { amplitude_rad: a, steepness_per_s: w, window_s } = *stroke;
        let mut by_log = [0.0; 3];
        for k in 0..self.points {
            let place = self.place(k);
            let t = place * window_s;
            let f = 1.0 / (1.0 + (-w * t).exp());
            let first = f * (1.0 - f);
            let second = first * (1.0 - 2.0 * f);
            let third = first * (1.0 - 6.0 * first);
            let (sin, cos) = (a * f).sin_cos();
            let (jerk, speed) = (a * w.powi(3) * third, a * w * first);
            let dq = [f, a * first * t, speed * place];
            let dddq = [w * w * second, 2.0 * a * w * second + a * w * w * third * t, jerk * place];
            let row = [a * w * w * second, gravity * cos, -gravity * sin];
            for (index, sign) in [(0, 1.0), (2, -1.0)] {
                let v = singular.vectors[index];
                let u = row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
                let weight = sign * u / singular.values[index].powi(2);
                let by_q = -gravity * (sin * v[1] + cos * v[2]);
                for i in 0..3 {
                    by_log[i] += weight * (dddq[i] * v[0] + dq[i] * by_q);
                }
            }
        }
        let condition = singular.condition_number();
        (condition, by_log.map(|g| condition * g))
    }

    /// Value and gradient by A, ω, δ of every constraint of one joint. All are products of powers: c = s Aᵃ ωʷ δᵈ - 1.
    fn constraints_of(&self, stroke: &Stroke) -> [(f64, [f64; 3]); CONSTRAINTS_PER_JOINT] {
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
        6
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        let mut bounds = self.problem.bounds();
        // Position and ground: the stroke ends below A.
        let highest = self.problem.position_limit_rad.min(core::f64::consts::PI) * (1.0 - MARGIN);
        for joint in 0..2 {
            bounds[3 * joint][1] = bounds[3 * joint][1].min(highest);
        }
        bounds
    }

    fn constraints(&self) -> usize {
        2 * CONSTRAINTS_PER_JOINT
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.x.copy_from_slice(x);
        for (stroke, out) in strokes(x).iter().zip(constraints.chunks_exact_mut(CONSTRAINTS_PER_JOINT)) {
            for (c, (value, _)) in out.iter_mut().zip(self.constraints_of(stroke)) {
                *c = value;
            }
        }
        self.condition_sum(x).ln()
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        let strokes = strokes(&self.x);
        let parts = strokes.map(|stroke| self.condition_gradient(&stroke));
        let sum = parts[0].0 + parts[1].0;
        for joint in 0..2 {
            let out = &mut gradient[3 * joint..3 * joint + 3];
            for i in 0..3 {
                out[i] = parts[joint].1[i] / sum;
            }
            let weights = &weights[CONSTRAINTS_PER_JOINT * joint..];
            for (weight, (_, row)) in weights.iter().zip(self.constraints_of(&strokes[joint])) {
                for i in 0..3 {
                    out[i] += weight * row[i];
                }
            }
        }
    }
}
