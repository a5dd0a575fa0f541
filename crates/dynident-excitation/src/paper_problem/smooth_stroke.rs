//! One joint's share of the paper's problem without steps and kinks: joints that move one after another do not know of each other.

use super::smooth::{CONSTRAINTS_PER_JOINT, MARGIN, PAIRS, SmoothPaperProblem};
use super::{PaperProblem, Stroke};
use crate::optimisers::ConstrainedProblem;

/// Minimise s over A, ω, δ, s, where s bounds the logarithm of the joint's condition number from above, under the constraints of [`SmoothPaperProblem`].
#[derive(Clone, Debug)]
pub(crate) struct SmoothStroke {
    problem: PaperProblem,
    smooth: SmoothPaperProblem,
    x: [f64; 4],
}

impl SmoothStroke {
    pub(crate) fn new(problem: &PaperProblem) -> Self {
        Self { problem: problem.clone(), smooth: SmoothPaperProblem::new(problem), x: [0.0; 4] }
    }

    /// A, ω, δ with the smallest s that fits.
    pub(crate) fn start(&self, x: &[f64]) -> Vec<f64> {
        let pairs = self.smooth.log_singular(&Stroke::of(x)).pairs();
        let bound = pairs.iter().fold(0.0, |largest: f64, pair| largest.max(pair.0));
        vec![x[0], x[1], x[2], bound]
    }
}

impl ConstrainedProblem for SmoothStroke {
    fn variables(&self) -> usize {
        4
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        let mut bounds = self.problem.bounds()[..3].to_vec();
        // The stroke ends below A.
        bounds[0][1] = bounds[0][1].min(self.problem.position_limit_rad * (1.0 - MARGIN));
        // Condition numbers are at least 1; beyond e⁴⁰ there are no digits left.
        bounds.push([0.0, 40.0]);
        bounds
    }

    fn constraints(&self) -> usize {
        CONSTRAINTS_PER_JOINT
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.x.copy_from_slice(x);
        let stroke = Stroke::of(x);
        for (c, pair) in constraints.iter_mut().zip(self.smooth.log_singular(&stroke).pairs()) {
            *c = pair.0 - x[3];
        }
        for (c, limit) in constraints[PAIRS..].iter_mut().zip(self.smooth.limits_of(&stroke)) {
            *c = limit.0;
        }
        x[3]
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        let stroke = Stroke::of(&self.x);
        let pairs = self.smooth.log_singular(&stroke).pairs();
        for (weight, (_, slope)) in weights.iter().zip(pairs.iter().chain(&self.smooth.limits_of(&stroke))) {
            for (out, slope) in gradient.iter_mut().zip(slope) {
                *out += weight * slope;
            }
        }
        gradient[3] = 1.0 - weights[..PAIRS].iter().sum::<f64>();
    }
}
