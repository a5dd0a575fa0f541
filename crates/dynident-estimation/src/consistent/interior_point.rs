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

pub(super) use data_limit::{CentralPath, Iterate, Next, interior_point_with_path, interior_point_within_limit};

use super::cone::Scaling;
use super::conic::{Block, BlockMap, Certificate, Multipliers, Program, Slacks};
use super::coordinates::{Matrix10, Vector10, matrix_of, vector_of};
use super::precise::Precise;
use super::stacked::{LocalRows, RightSide, Rows, Singles, StackedSystem};
use nalgebra::{DMatrix, DVector, Matrix4};

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

#[derive(Clone, Debug)]
struct Cone {
    scaling: Scaling,
    /// The body whose variables are S up to a constant: its scaling is the frame of those variables.
    owner: Option<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    slack: f64,
    force: f64,
}

#[derive(Clone, Debug)]
struct State {
    x: Precise,
    cones: Vec<Cone>,
    rows: Vec<Pair>,
    /// Whether a full step was taken: the multipliers then balance the gradient up to rounding.
    balanced: bool,
}

struct Direction {
    x: DVector<f64>,
    primal: Vec<Matrix4<f64>>,
    dual: Vec<Matrix4<f64>>,
    row_primal: Vec<f64>,
    row_dual: Vec<f64>,
}

struct Targets {
    blocks: Vec<Matrix4<f64>>,
    rows: Vec<f64>,
}

/// A Newton system with the data of its right-hand sides.
struct Newton<'a> {
    program: &'a Program,
    state: &'a State,
    system: StackedSystem,
    /// Coefficients of every row of the program in the frame (not scaled).
    framed_rows: Vec<DVector<f64>>,
    singles: Singles,
    /// `b − A x` (zero for limited data), and the same for the local squares.
    data_rest: DVector<f64>,
    local_rest: Vec<DVector<f64>>,
    linear: DVector<f64>,
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

fn add_block(rows: &mut Rows, map: &BlockMap, cone: &Cone, state: &State) {
    let square = |matrix: &Matrix10| DMatrix::from_column_slice(10, 10, matrix.as_slice());
    match (map, cone.owner) {
        (BlockMap::Own(first), Some(_)) => {
            rows.local.push(LocalRows { first: *first, matrix: square(&cone.scaling.scaled_frame()) });
        }
        (BlockMap::Own(first), None) => {
            let matrix = match state.cones.iter().find(|cone| cone.owner == Some(*first)) {
                Some(owner) => cone.scaling.scaled_frame_of(&owner.scaling),
                None => cone.scaling.inverse_frame(),
            };
            rows.local.push(LocalRows { first: *first, matrix: square(&matrix) });
        }
        (BlockMap::General(map), _) => {
            let framed = rows.framed(map);
            rows.wide.push(square(&cone.scaling.inverse_frame()) * framed);
        }
    }
}

impl<'a> Newton<'a> {
    fn new(program: &'a Program, state: &'a State) -> Option<Self> {
        let mut rows = Rows::default();
        for cone in &state.cones {
            if let Some(first) = cone.owner {
                rows.frames.push((first, cone.scaling.frame()));
            }
        }
        // Limited squares are weighted by their multiplier.
        let limiting = program.data_limit.and_then(|_| state.rows.last()).map(|pair| pair.force);
        let mut data = rows.framed(&program.data);
        if let Some(force) = limiting {
            data *= force.sqrt();
        }
        rows.wide.push(data);
        for term in &program.local {
            let framed = rows.framed_part(term.first, &term.matrix);
            rows.local.push(LocalRows { first: term.first, matrix: framed });
        }
        for (block, cone) in program.blocks.iter().zip(&state.cones) {
            add_block(&mut rows, &block.map, cone, state);
        }
        let of_limit = limiting.map(|_| program.data_slope(&state.x));
        let framed_rows: Vec<DVector<f64>> = program
            .rows
            .iter()
            .map(|row| {
                let mut dense = DVector::zeros(program.variables);
                row.add_to(1.0, &mut dense);
                dense
            })
            .chain(of_limit)
            .map(|dense| rows.framed_gradient(&dense))
            .collect();
        let scaled = |(row, pair): (&DVector<f64>, &Pair)| row * (pair.force / pair.slack).sqrt();
        let scaled: Vec<DVector<f64>> = framed_rows.iter().zip(&state.rows).map(scaled).collect();
        let singles = rows.add_singles(&scaled);
        let linear = rows.framed_gradient(&program.linear);
        let system = StackedSystem::new(program.variables, rows)?;
        let local_rest = program
            .local
            .iter()
            .map(|term| &term.target - &term.matrix * state.x.high.rows(term.first, term.matrix.ncols()));
        let data_rest = state.x.data_rest(&program.data, &program.target);
        Some(Self {
            program,
            state,
            framed_rows,
            singles,
            data_rest: if limiting.is_some() { DVector::zeros(data_rest.len()) } else { data_rest.clone() },
            local_rest: local_rest.collect(),
            linear,
            system,
        })
    }

    /// Products at μ; those of an entropic block at its weight.
    fn targets(&self, mu: f64) -> Targets {
        let goal = |block: &Block| if block.entropy > 0.0 { block.entropy } else { mu };
        let blocks = self.program.blocks.iter().map(|block| Matrix4::identity() * goal(block)).collect();
        Targets { blocks, rows: vec![mu; self.state.rows.len()] }
    }

    fn direction(&self, targets: &Targets, share: f64) -> Option<Direction> {
        let cones = &self.state.cones;
        let wanted: Vec<Matrix4<f64>> =
            cones.iter().zip(&targets.blocks).map(|(cone, target)| cone.scaling.divided(target)).collect();
        let right = self.right_side(&wanted, &targets.rows, share);
        let u = self.system.solve(&right);
        if !u.iter().all(|value| value.is_finite()) {
            return None;
        }
        let x = self.system.rows().unframed(&u);
        let primal: Vec<Matrix4<f64>> = self
            .program
            .blocks
            .iter()
            .zip(cones)
            .map(|(block, cone)| match cone.owner {
                Some(first) => {
                    let own = Vector10::from_column_slice(&u.as_slice()[first..first + 10]);
                    matrix_of(&(cone.scaling.scaled_frame() * own))
                }
                None => cone.scaling.scaled_primal(&matrix_of(&block.linear_part(&x))),
            })
            .collect();
        let dual = wanted
            .iter()
            .zip(&primal)
            .zip(cones)
            .map(|((wanted, primal), cone)| wanted - Matrix4::from_diagonal(&cone.scaling.lambda) - primal)
            .collect();
        let row_primal: Vec<f64> = self.framed_rows.iter().map(|row| row.dot(&u)).collect();
        let row_dual = targets
            .rows
            .iter()
            .zip(&row_primal)
            .zip(&self.state.rows)
            .map(|((target, ds), p)| (target - p.force * ds) / p.slack - p.force)
            .collect();
        Some(Direction { x: u, primal, dual, row_primal, row_dual })
    }

    /// Mean excess of the products over their final values.
    fn excess(&self, step: Option<(&Direction, f64)>) -> f64 {
        let plain =
            || self.state.cones.iter().zip(&self.program.blocks).enumerate().filter(|(_, (_, b))| b.entropy == 0.0);
        let degree = (4 * plain().count() + self.state.rows.len()).max(1) as f64;
        let blocks = plain().map(|(k, (cone, _))| {
            let diagonal = Matrix4::from_diagonal(&cone.scaling.lambda);
            let (s, z) = step.map_or((diagonal, diagonal), |(d, alpha)| {
                (diagonal + d.primal[k] * alpha, diagonal + d.dual[k] * alpha)
            });
            s.dot(&z).max(0.0)
        });
        let rows = self.state.rows.iter().enumerate().map(|(l, p)| {
            let (ds, dz) = step.map_or((0.0, 0.0), |(d, alpha)| (alpha * d.row_primal[l], alpha * d.row_dual[l]));
            ((p.slack + ds) * (p.force + dz)).max(0.0)
        });
        (blocks.sum::<f64>() + rows.sum::<f64>()) / degree
    }

    /// Right-hand side of a direction that removes `share` of the dual residual and changes the products to `wanted`
    /// (scaled, `½ (Λ D + D Λ)` is the new product) and `rows`.
    fn right_side(&self, wanted: &[Matrix4<f64>], rows: &[f64], share: f64) -> RightSide {
        let mut local: Vec<DVector<f64>> = self.local_rest.iter().map(|rest| rest * share).collect();
        let mut wide = vec![&self.data_rest * share];
        for ((block, wanted), cone) in self.program.blocks.iter().zip(wanted).zip(&self.state.cones) {
            let kept = Matrix4::from_diagonal(&cone.scaling.lambda) * (1.0 - share);
            let h = DVector::from_column_slice(vector_of(&(wanted - kept)).as_slice());
            match block.map {
                BlockMap::Own(_) => local.push(h),
                BlockMap::General(_) => wide.push(h),
            }
        }
        let of_row = |(p, target): (&Pair, &f64)| {
            let root = (p.slack * p.force).sqrt();
            target / root - (1.0 - share) * root
        };
        let of_rows: Vec<f64> = self.state.rows.iter().zip(rows).map(of_row).collect();
        self.singles.append(&of_rows, &mut local, &mut wide);
        RightSide { local, wide, direct: &self.linear * -share }
    }

    /// Dual residual in the frames. Divided by √μ it is the displacement by the imbalance relative to the room of the
    /// barrier.
    fn residual(&self) -> f64 {
        let now: Vec<Matrix4<f64>> =
            self.state.cones.iter().map(|cone| Matrix4::from_diagonal(&cone.scaling.lambda)).collect();
        let rows: Vec<f64> = self.state.rows.iter().map(|p| p.slack * p.force).collect();
        self.system.rows().transposed(&self.right_side(&now, &rows, 1.0)).amax()
    }

    /// Number of products in the mean μ.
    fn degree(&self) -> f64 {
        let plain = self.program.blocks.iter().filter(|b| b.entropy == 0.0).count();
        (4 * plain + self.state.rows.len()).max(1) as f64
    }

    fn longest(&self, d: &Direction) -> f64 {
        let mut alpha = f64::INFINITY;
        for (k, cone) in self.state.cones.iter().enumerate() {
            alpha = alpha.min(cone.scaling.largest_step(&d.primal[k])).min(cone.scaling.largest_step(&d.dual[k]));
        }
        if self.program.data_limit.is_some() {
            alpha = alpha.min(self.longest_within_limit(d));
        }
        for (l, pair) in self.state.rows.iter().enumerate() {
            for (value, change) in [(pair.slack, d.row_primal[l]), (pair.force, d.row_dual[l])] {
                if change < 0.0 {
                    alpha = alpha.min(-value / change);
                }
            }
        }
        alpha
    }
}
