//! Route 1: a primal-dual path-following method on the 4 × 4 blocks.
//!
//! Every iterate is strictly inside the constraints. The direction is that of Nesterov and Todd with Mehrotra's
//! predictor and corrector (Mehrotra, SIAM J. Optimization 2 (1992) 575; Todd, Toh and Tütüncü, SIAM J. Optimization 8
//! (1998) 769), reduced to least squares in x:
//!
//! ```text
//!     minimise ½‖A Δx − (b − A x)‖² + g·Δx + Σ ½‖R⁻¹ mat(M Δx) R⁻ᵀ − (D + Λ)‖² + Σ ½ (√(z/s) a·Δx − (t/s + z)/√(z/s))²
//! ```
//!
//! Each body is represented in the frame of its own factor (`ΔS = L mat(u) Lᵀ`), in which the rows of its cone are of
//! size one. The factors of S and Z are updated in each step by triangular factors near one, which keeps the digits of
//! eigenvalues of 1e-12 next to masses of 1e6 references; S and Z themselves would lose them. The pair of an entropic
//! prior stays at its weight γ from the start.

mod data_limit;
mod newton;

pub(super) use data_limit::{CentralPath, Iterate, Next, interior_point_with_path, interior_point_within_limit};

use super::cone::Scaling;
use super::conic::{BlockMap, Certificate, Multipliers, Program, Slacks};
use super::coordinates::{matrix_of, vector_of};
use super::precise::Precise;
use nalgebra::DVector;
use newton::{Cone, Direction, Newton, Pair, State, Targets};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// Certificate within the tolerance.
    Solved,
    /// No further improvement in double precision.
    Stalled,
    /// Iteration limit reached.
    Limit,
}

#[derive(Clone, Debug)]
pub(super) struct InteriorPointResult {
    pub(super) x: DVector<f64>,
    pub(super) multipliers: Multipliers,
    pub(super) certificate: Certificate,
    pub(super) iterations: usize,
    pub(super) ending: Ending,
}

const FRACTION_TO_BOUNDARY: f64 = 0.99;

/// Minimum product of slack and multiplier after a step, relative to the mean (to its weight for an entropic block). A
/// smaller product makes the next step short near the boundary.
const MIN_BALANCE: f64 = 0.02;

/// Below this balance the next step only centres.
const CENTRING_BALANCE: f64 = 0.1;

/// Relative gap below which multipliers must balance the gradient before μ decreases further. Bodies that the data
/// drive far from their references grow by a factor per step while μ is large, but slowly once μ is small, because the
/// remaining imbalance of the start acts like a weight on their trace.
const BALANCING_GAP: f64 = 0.3;

/// Maximum displacement by the imbalance alone relative to the room of the barrier.
const MAX_DRIVE: f64 = 0.3;

/// μ stops decreasing when the gap is this share of the tolerance.
const GAP_SHARE_OF_TOLERANCE: f64 = 0.7;

/// Solves the program from a strictly interior point; `None` if `start` is not interior.
pub(super) fn interior_point(
    program: &Program,
    start: DVector<f64>,
    tolerance: f64,
    max_iterations: usize,
) -> Option<InteriorPointResult> {
    from_state(program, State::new(program, start)?, tolerance, max_iterations, &mut |_, _| false)
}

/// Like [`interior_point`], but stops at the first point for which `enough` is true.
pub(super) fn interior_point_until(
    program: &Program,
    start: DVector<f64>,
    limits: (f64, usize),
    enough: impl Fn(&DVector<f64>, &Certificate) -> bool,
) -> Option<InteriorPointResult> {
    from_state(program, State::new(program, start)?, limits.0, limits.1, &mut |state, now| enough(&state.x.high, now))
}

/// Iterates from a state to the optimum or until `seen` returns true.
fn from_state(
    program: &Program,
    mut state: State,
    tolerance: f64,
    max_iterations: usize,
    seen: &mut dyn FnMut(&State, &Certificate) -> bool,
) -> Option<InteriorPointResult> {
    let mut best = state.solved(program, 0, Ending::Limit)?;
    let mut poor = 0;
    for iteration in 1..=max_iterations {
        // A gap below the tolerance would only lose digits of the slacks.
        let least_gap = GAP_SHARE_OF_TOLERANCE * tolerance * (1.0 + program.smooth_objective(&state.x).abs());
        if state.step(program, least_gap).is_none() {
            best.ending = Ending::Stalled;
            break;
        }
        let Some(now) = state.solved(program, iteration, Ending::Limit) else {
            best.ending = Ending::Stalled;
            break;
        };
        best.iterations = iteration;
        if seen(&state, &now.certificate) {
            return Some(now);
        }
        if now.certificate.residual() < 0.9 * best.certificate.residual() {
            poor = 0;
        } else {
            poor += 1;
        }
        if now.certificate.residual() < best.certificate.residual() {
            best = now;
        }
        if best.certificate.residual() <= tolerance {
            best.ending = Ending::Solved;
            break;
        }
        // Rounding limits the residual; more steps do not help.
        let patience = if best.certificate.residual() < 1.0e-4 { 12 } else { 60 };
        if poor >= patience {
            best.ending = Ending::Stalled;
            break;
        }
    }
    if best.certificate.residual() <= tolerance {
        best.ending = Ending::Solved;
    }
    Some(best)
}

impl State {
    /// Multipliers on the central path of the start, of about the size of the gradient there.
    fn new(program: &Program, x: DVector<f64>) -> Option<Self> {
        let (gradient, _) = program.gradient(&Precise::new(x.clone()));
        let mu = (gradient.amax()).clamp(1.0e-3, 1.0e12);
        let mut owned = Vec::new();
        let cones = program
            .blocks
            .iter()
            .map(|block| {
                let s = block.value(&x);
                let z = super::cone::inverse(&s)? * if block.entropy > 0.0 { block.entropy } else { mu };
                let owner = match block.map {
                    BlockMap::Own(first) if block.entropy == 0.0 && !owned.contains(&first) => Some(first),
                    _ => None,
                };
                owned.extend(owner);
                Some(Cone { scaling: Scaling::new(&s, &z)?, owner })
            })
            .collect::<Option<Vec<_>>>()?;
        let rows = program
            .rows
            .iter()
            .map(|row| Some(row.value(&x)).filter(|&s| s > 0.0).map(|slack| Pair { slack, force: mu / slack }))
            .collect::<Option<Vec<_>>>()?;
        Some(Self { x: Precise::new(x), cones, rows, balanced: false })
    }

    fn solved(&self, program: &Program, iterations: usize, ending: Ending) -> Option<InteriorPointResult> {
        let (certificate, multipliers) = self.certificate(program)?;
        Some(InteriorPointResult { x: self.x.high.clone(), multipliers, certificate, iterations, ending })
    }

    fn certificate(&self, program: &Program) -> Option<(Certificate, Multipliers)> {
        let multipliers = Multipliers {
            blocks: self.cones.iter().map(|cone| cone.scaling.dual()).collect(),
            rows: self.rows.iter().map(|pair| pair.force).collect(),
        };
        let slacks = Slacks {
            blocks: self.cones.iter().map(|cone| cone.scaling.primal()).collect(),
            rows: self.rows.iter().map(|pair| pair.slack).collect(),
        };
        let certificate = program.certificate_of(&self.x, &slacks, &multipliers)?;
        Some((certificate, multipliers))
    }

    /// One step; `None` if double precision allows none. Unbalanced products are centred first; then the multipliers
    /// are balanced with the gradient while μ is large; then predictor and corrector lower μ until the sum of the
    /// products is `least_gap`.
    fn step(&mut self, program: &Program, least_gap: f64) -> Option<()> {
        let newton = Newton::new(program, self)?;
        let (mu, balance) = (newton.excess(None), self.balance(program));
        if balance < CENTRING_BALANCE {
            let centring = newton.direction(&newton.targets(mu), 0.0)?;
            if let Some((_, next)) = self.followed(program, &newton, &centring, (1.2 * balance).min(CENTRING_BALANCE)) {
                *self = next;
                return Some(());
            }
        }
        let scale = 1.0 + program.smooth_objective(&self.x).abs();
        let (is_near, drive) = match program.data_limit {
            Some(_) => (true, data_limit::MAX_DRIVE),
            None => (mu * newton.degree() < BALANCING_GAP * scale, MAX_DRIVE),
        };
        if !self.balanced && is_near && newton.residual() > drive * mu.sqrt() {
            let direction = newton.direction(&newton.targets(mu), 1.0)?;
            if let Some((alpha, next)) = self.followed(program, &newton, &direction, MIN_BALANCE) {
                *self = next;
                self.balanced |= alpha >= 1.0;
                return Some(());
            }
        }
        let affine = newton.direction(&newton.targets(0.0), 1.0)?;
        let alpha = newton.longest(&affine).min(1.0);
        let after = newton.excess(Some((&affine, alpha)));
        let sigma = if mu > 0.0 { (after / mu).powi(3).clamp(0.0, 1.0) } else { 0.0 };
        let least = least_gap / newton.degree();
        let mut targets = newton.targets((sigma * mu).max(least));
        // The corrector's second-order term is valid for full steps; it is scaled down after short ones.
        let share = alpha * alpha;
        for (k, target) in targets.blocks.iter_mut().enumerate() {
            let product = affine.primal[k] * affine.dual[k];
            *target -= (product + product.transpose()) * (0.5 * share);
        }
        for (l, target) in targets.rows.iter_mut().enumerate() {
            *target -= share * affine.row_primal[l] * affine.row_dual[l];
        }
        if program.data_limit.is_some() {
            newton.bend(&mut targets, &affine, share);
        }
        let worst = balance.min(MIN_BALANCE);
        let mut best = self.followed(program, &newton, &newton.direction(&targets, 1.0)?, worst);
        if best.as_ref().is_none_or(|(alpha, _)| *alpha < 0.3) {
            let centred = newton.direction(&newton.targets((sigma.max(0.5) * mu).max(least)), 1.0)?;
            let other = self.followed(program, &newton, &centred, worst);
            if other.as_ref().map(|(alpha, _)| *alpha) > best.as_ref().map(|(alpha, _)| *alpha) {
                best = other;
            }
        }
        let (alpha, next) = best?;
        *self = next;
        self.balanced |= alpha >= 1.0;
        Some(())
    }

    /// Follows a direction as far as no product falls too far below the others.
    fn followed(
        &self,
        program: &Program,
        newton: &Newton<'_>,
        direction: &Direction,
        worst: f64,
    ) -> Option<(f64, Self)> {
        let mut alpha = (FRACTION_TO_BOUNDARY * newton.longest(direction)).min(1.0);
        let mut last = None;
        for _ in 0..30 {
            if let Some(next) = self.moved(program, newton, direction, alpha) {
                if next.balance(program) >= worst {
                    return Some((alpha, next));
                }
                last = Some((alpha, next));
            }
            alpha *= 0.8;
        }
        last
    }

    /// Smallest product of slack and multiplier relative to the mean, for entropic blocks relative to their weight.
    fn balance(&self, program: &Program) -> f64 {
        let (mut sum, mut count, mut least, mut entropic) = (0.0, 0, f64::INFINITY, f64::INFINITY);
        let mut plain = |product: f64| {
            sum += product;
            count += 1;
            least = product.min(least);
        };
        for (cone, block) in self.cones.iter().zip(&program.blocks) {
            for lambda in &cone.scaling.lambda {
                let product = lambda * lambda;
                if block.entropy > 0.0 {
                    entropic = (product / block.entropy).min(entropic);
                } else {
                    plain(product);
                }
            }
        }
        self.rows.iter().for_each(|pair| plain(pair.slack * pair.force));
        (least * f64::from(count.max(1)) / sum).min(entropic)
    }

    fn moved(&self, program: &Program, newton: &Newton<'_>, direction: &Direction, alpha: f64) -> Option<Self> {
        let mut x = self.x.clone();
        x.add(&(newton.system.rows().unframed(&direction.x) * alpha));
        let mut cones = Vec::with_capacity(self.cones.len());
        for (k, (cone, block)) in self.cones.iter().zip(&program.blocks).enumerate() {
            let (ds, dz) = (direction.primal[k] * alpha, direction.dual[k] * alpha);
            let scaling = if cone.owner.is_some() {
                cone.scaling.moved(&ds, &dz)?
            } else {
                let z = cone.scaling.dual() + cone.scaling.unscaled_dual(&dz);
                Scaling::new(&block.value(&x.high), &matrix_of(&vector_of(&z)))?
            };
            cones.push(Cone { scaling, owner: cone.owner });
        }
        let rows = self
            .rows
            .iter()
            .enumerate()
            .map(|(l, pair)| {
                let (ds, dz) = (alpha * direction.row_primal[l], alpha * direction.row_dual[l]);
                let slack = match (program.rows.get(l), program.data_limit) {
                    // Updating a small slack is more accurate than a difference of large numbers.
                    (Some(_), _) if ds.abs() < 0.999 * pair.slack => pair.slack + ds,
                    (Some(row), _) => row.value(&x.high),
                    (None, limit) => limit? - program.data_squares(&x),
                };
                let force = pair.force + dz;
                (slack > 0.0 && force > 0.0 && slack.is_finite() && force.is_finite()).then_some(Pair { slack, force })
            })
            .collect::<Option<Vec<_>>>()?;
        x.high.iter().all(|value| value.is_finite()).then_some(Self { x, cones, rows, balanced: self.balanced })
    }
}
