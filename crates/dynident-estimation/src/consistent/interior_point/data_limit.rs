//! Extreme values of variables while the data's half squares stay below a limit: the convex program
//!
//! ```text
//!     minimise  g·x + ...   subject to  q(x) = c − ½‖A x − b‖² ≥ 0  and all other constraints.
//! ```
//!
//! With multiplier λ of q and r = b − A x the Lagrangian's gradient includes `−λ Aᵀr`. Newton's system includes `λ
//! AᵀA` and the row `√(λ/q) Aᵀr` of a linear constraint, after the rows of the program. The corrector includes the
//! second-order term of the product, `½ λ ‖A Δx‖²`. The start is an iterate of the program that minimises the same
//! squares, with λ = 1.

use super::{Certificate, DVector, Direction, InteriorPointResult, Newton, Pair, Program, State, Targets, from_state};

/// Strictly interior iterates of a program with decreasing gaps, used as start points of other programs with the same
/// variables, blocks and rows. Early iterates are better start points than the optimum, which is too close to the
/// boundary of the other program (Gondzio, Math. Programming 83 (1998) 125).
#[derive(Clone, Debug)]
pub(in crate::consistent) struct CentralPath(Vec<Stage>);

#[derive(Clone, Debug)]
struct Stage {
    state: State,
    data_squares: f64,
}

/// Like [`interior_point`](super::interior_point), and also returns the iterates.
pub(in crate::consistent) fn interior_point_with_path(
    program: &Program,
    start: DVector<f64>,
    limits: (f64, usize),
) -> Option<(InteriorPointResult, CentralPath)> {
    let mut stages = Vec::new();
    let mut keep = |state: &State, _: &Certificate| {
        stages.push(Stage { state: state.clone(), data_squares: program.data_squares(&state.x) });
        false
    };
    let solved = from_state(program, State::new(program, start)?, limits.0, limits.1, &mut keep)?;
    Some((solved, CentralPath(stages)))
}

impl CentralPath {
    /// The first iterate with enough room between the least squares and their limit and a small enough gap.
    fn first_within(&self, least: f64, limit: f64) -> Option<&Stage> {
        let room = limit - least;
        let begins = |stage: &&Stage| {
            limit - stage.data_squares > MIN_START_ROOM_SHARE * room
                && stage.state.products() < MAX_START_GAP_SHARE * room
        };
        self.0.iter().find(begins).or_else(|| self.0.last()).filter(|stage| stage.data_squares < limit)
    }

    pub(in crate::consistent) fn start(&self, limits: (f64, f64)) -> Option<&DVector<f64>> {
        self.first_within(limits.0, limits.1).map(|stage| &stage.state.x.high)
    }
}

/// Minimum share of the room below the limit at the start of a program, and maximum duality gap there relative to that
/// room.
const MIN_START_ROOM_SHARE: f64 = 0.1;
const MAX_START_GAP_SHARE: f64 = 2.0;

/// Maximum displacement of a limited program by the imbalance alone, relative to the room of the barrier, while μ
/// decreases. The start is balanced except in the search direction.
pub(super) const MAX_DRIVE: f64 = 30.0;

/// Share of the room below the limit that a step must keep.
const MIN_KEPT_ROOM_SHARE: f64 = 0.1;

/// Product of slack and multiplier of a limit relative to the mean, from which the program restarts for a new limit.
const MAX_PRODUCT_RATIO: f64 = 50.0;

pub(in crate::consistent) struct Iterate<'a> {
    pub(in crate::consistent) x: &'a DVector<f64>,
    /// Residual `b − A x`.
    pub(in crate::consistent) left: &'a DVector<f64>,
    /// Slack q of the data limit, and its multiplier λ.
    pub(in crate::consistent) limit: (f64, f64),
    pub(in crate::consistent) certificate: Certificate,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::consistent) enum Next {
    /// Continue to a duality gap not below this value.
    On(f64),
    /// Change the limit.
    Limit(f64),
    Stop,
}

/// Follows the central path of a program with a limit of its data. `way` are the iterates of the program without the
/// limit and without the last rows, `least` its least squares. `look` receives every iterate; each satisfies the limit.
/// The search ends at [`Next::Stop`], if double precision allows no step, at the iteration limit, or if no start point
/// is inside.
pub(in crate::consistent) fn interior_point_within_limit(
    program: &mut Program,
    way: &CentralPath,
    least: f64,
    max_iterations: usize,
    look: &mut dyn FnMut(&Iterate<'_>) -> Next,
) {
    let Some(mut state) = State::within_limit(program, way, least) else { return };
    let mut least_gap = 0.0;
    for _ in 0..max_iterations {
        if state.step(program, least_gap).is_none() {
            return;
        }
        let (Some((certificate, _)), Some(pair)) = (state.certificate(program), state.rows.last()) else {
            return;
        };
        let left = state.x.data_rest(&program.data, &program.target);
        match look(&Iterate { x: &state.x.high, left, limit: (pair.slack, pair.force), certificate }) {
            Next::On(gap) => least_gap = gap,
            Next::Stop => return,
            Next::Limit(limit) => {
                program.data_limit = Some(limit);
                let slack = limit - program.data_squares(&state.x);
                let mean = state.products() / state.degree() as f64;
                match state.rows.last_mut() {
                    Some(pair) if slack > 0.0 && slack * pair.force < MAX_PRODUCT_RATIO * mean => pair.slack = slack,
                    // A strongly unbalanced or infeasible pair would converge slowly.
                    _ => match State::within_limit(program, way, least) {
                        Some(begun) => state = begun,
                        None => return,
                    },
                }
            }
        }
    }
}

impl State {
    /// Start of a program with a limit, with pairs for the limit and the added rows.
    fn within_limit(program: &Program, way: &CentralPath, least: f64) -> Option<Self> {
        let limit = program.data_limit?;
        let Stage { state, data_squares } = way.first_within(least, limit)?;
        let (x, mut rows) = (state.x.of_another(), state.rows.clone());
        let mu = state.products() / state.degree() as f64;
        for row in &program.rows[rows.len()..] {
            let slack = Some(row.value(&x.high)).filter(|&slack| slack > 0.0)?;
            rows.push(Pair { slack, force: mu / slack });
        }
        // Without a limit the squares have weight one.
        rows.push(Pair { slack: limit - data_squares, force: 1.0 });
        Some(Self { x, cones: state.cones.clone(), rows, balanced: false })
    }

    fn products(&self) -> f64 {
        let cones = self.cones.iter().map(|cone| cone.scaling.lambda.norm_squared()).sum::<f64>();
        cones + self.rows.iter().map(|pair| pair.slack * pair.force).sum::<f64>()
    }

    fn degree(&self) -> usize {
        4 * self.cones.len() + self.rows.len()
    }
}

impl Newton<'_> {
    /// Second-order term of the data limit.
    pub(super) fn bend(&self, targets: &mut Targets, affine: &Direction, share: f64) {
        let (Some(pair), Some(change), Some(target)) =
            (self.state.rows.last(), affine.row_dual.last(), targets.rows.last_mut())
        else {
            return;
        };
        *target += share * (pair.force + change) * 0.5 * self.moved_data(affine).norm_squared();
    }

    /// Longest step that keeps a share of the room below the limit; q decreases by `½ α² ‖A Δx‖²`.
    pub(super) fn longest_within_limit(&self, direction: &Direction) -> f64 {
        let (Some(pair), Some(slope)) = (self.state.rows.last(), direction.row_primal.last()) else {
            return f64::INFINITY;
        };
        let (room, bend) = ((1.0 - MIN_KEPT_ROOM_SHARE) * pair.slack, self.moved_data(direction).norm_squared());
        let root = (slope * slope + 2.0 * room * bend).sqrt();
        // Numerically stable form of the positive root.
        let longest = if *slope > 0.0 { (slope + root) / bend } else { 2.0 * room / (root - slope) };
        if longest.is_nan() { f64::INFINITY } else { longest }
    }

    /// `A Δx`.
    fn moved_data(&self, direction: &Direction) -> DVector<f64> {
        &self.program.data * self.system.rows().unframed(&direction.x)
    }
}
