//! How far variables can go while the data's half squares stay below a limit: the convex program
//!
//! ```text
//!     minimise  g·x + ...   subject to  q(x) = c − ½‖A x − b‖² ≥ 0  and all other constraints.
//! ```
//!
//! With multiplier λ of q and r = b − A x the Lagrangian's gradient has `−λ Aᵀr`, and Newton's system `λ AᵀA` beside
//! the row `√(λ/q) Aᵀr` of a linear constraint, which stands behind those of the program's rows. The term of second
//! order of its product, `½ λ ‖A Δx‖²`, is in the corrector. It begins where the program that minimises the same
//! squares was on its way: λ is one there.

use super::{Certificate, DVector, Direction, InteriorPointResult, Newton, Pair, Program, State, Targets, from_state};

/// Points and multipliers inside the cones on the way to the optimum of a program, with ever smaller gaps: where others
/// begin that have the same variables, blocks and rows. Their own optima are not so near that they would be stuck at
/// this one's boundary (Gondzio, Math. Programming 83 (1998) 125).
#[derive(Clone, Debug)]
pub(in crate::consistent) struct OnTheWay(Vec<Stage>);

/// A point on the way.
#[derive(Clone, Debug)]
struct Stage {
    state: State,
    data_squares: f64,
}

/// As [`interior_point`](super::interior_point), with what is on the way.
pub(in crate::consistent) fn interior_point_on_the_way(
    program: &Program,
    start: DVector<f64>,
    limits: (f64, usize),
) -> Option<(InteriorPointResult, OnTheWay)> {
    let mut stages = Vec::new();
    let mut keep = |state: &State, _: &Certificate| {
        stages.push(Stage { state: state.clone(), data_squares: program.data_squares(&state.x) });
        false
    };
    let solved = from_state(program, State::new(program, start)?, limits.0, limits.1, &mut keep)?;
    Some((solved, OnTheWay(stages)))
}

impl OnTheWay {
    /// The first point that leaves room between the least squares and their limit, on a central path that ends there.
    fn first_within(&self, least: f64, limit: f64) -> Option<&Stage> {
        let room = limit - least;
        let begins = |stage: &&Stage| {
            limit - stage.data_squares > LEAST_ROOM * room && stage.state.products() < LARGEST_GAP * room
        };
        self.0.iter().find(begins).or_else(|| self.0.last()).filter(|stage| stage.data_squares < limit)
    }

    /// Where a program with this limit begins.
    pub(in crate::consistent) fn start(&self, limits: (f64, f64)) -> Option<&DVector<f64>> {
        self.first_within(limits.0, limits.1).map(|stage| &stage.state.x.high)
    }
}

/// What data leave of the room below their limit where a program begins, at least, and the duality gap there at most,
/// both as shares of that room.
const LEAST_ROOM: f64 = 0.1;
const LARGEST_GAP: f64 = 2.0;

/// How far the imbalance of a limited program alone may drive a point beside the room that the barrier leaves while μ
/// falls. It begins balanced but for the direction in which it is to go.
pub(super) const LARGEST_DRIVE: f64 = 30.0;

/// What is left of the room below the limit where a step would come to its end.
const KEPT_ROOM: f64 = 0.1;

/// A limit's product of slack and multiplier over the mean of all, from which on a new limit begins anew.
const LARGEST_PRODUCT: f64 = 50.0;

/// What a point on the way to the farthest one looks like.
pub(in crate::consistent) struct Iterate<'a> {
    pub(in crate::consistent) x: &'a DVector<f64>,
    /// `b − A x`.
    pub(in crate::consistent) left: &'a DVector<f64>,
    /// q, and λ.
    pub(in crate::consistent) limit: (f64, f64),
    pub(in crate::consistent) certificate: Certificate,
}

/// What is to be done there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::consistent) enum Next {
    /// Go on, to a duality gap no less than this.
    On(f64),
    /// The limit is another.
    Limit(f64),
    /// Enough is known.
    Stop,
}

/// Follows the path of a program with a limit of its data from where another program, without the limit and without the
/// last rows, was on its way; its least squares are `least`. `look` sees every point, each of which keeps the limit. It
/// ends at [`Next::Stop`], and where double precision allows no step any more, iterations are used up, or no point of
/// the way is inside.
pub(in crate::consistent) fn interior_point_within_limit(
    program: &mut Program,
    way: &OnTheWay,
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
                    Some(pair) if slack > 0.0 && slack * pair.force < LARGEST_PRODUCT * mean => pair.slack = slack,
                    // Out of balance with the others, or outside, it would take long to come back.
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
    /// Where a way begins for a program with a limit, with pairs for it and the rows that have come.
    fn within_limit(program: &Program, way: &OnTheWay, least: f64) -> Option<Self> {
        let limit = program.data_limit?;
        let Stage { state, data_squares } = way.first_within(least, limit)?;
        let (x, mut rows) = (state.x.of_another(), state.rows.clone());
        let mu = state.products() / state.degree() as f64;
        for row in &program.rows[rows.len()..] {
            let slack = Some(row.value(&x.high)).filter(|&slack| slack > 0.0)?;
            rows.push(Pair { slack, force: mu / slack });
        }
        // Without a limit the squares count once.
        rows.push(Pair { slack: limit - data_squares, force: 1.0 });
        Some(Self { x, cones: state.cones.clone(), rows, balanced: false })
    }

    /// The sum of all products of slacks and multipliers.
    fn products(&self) -> f64 {
        let cones = self.cones.iter().map(|cone| cone.scaling.lambda.norm_squared()).sum::<f64>();
        cones + self.rows.iter().map(|pair| pair.slack * pair.force).sum::<f64>()
    }

    fn degree(&self) -> usize {
        4 * self.cones.len() + self.rows.len()
    }
}

impl Newton<'_> {
    /// The term of second order of a limit of the data.
    pub(super) fn bend(&self, targets: &mut Targets, affine: &Direction, share: f64) {
        let (Some(pair), Some(change), Some(target)) =
            (self.state.rows.last(), affine.row_dual.last(), targets.rows.last_mut())
        else {
            return;
        };
        *target += share * (pair.force + change) * 0.5 * self.moved_data(affine).norm_squared();
    }

    /// How far a direction can be followed before little is left of the room below the limit: q bends by
    /// `½ α² ‖A Δx‖²`.
    pub(super) fn longest_within_limit(&self, direction: &Direction) -> f64 {
        let (Some(pair), Some(slope)) = (self.state.rows.last(), direction.row_primal.last()) else {
            return f64::INFINITY;
        };
        let (room, bend) = ((1.0 - KEPT_ROOM) * pair.slack, self.moved_data(direction).norm_squared());
        let root = (slope * slope + 2.0 * room * bend).sqrt();
        // The stable one of both ways to write the positive root.
        let longest = if *slope > 0.0 { (slope + root) / bend } else { 2.0 * room / (root - slope) };
        if longest.is_nan() { f64::INFINITY } else { longest }
    }

    /// `A Δx`.
    fn moved_data(&self, direction: &Direction) -> DVector<f64> {
        &self.program.data * self.system.rows().unframed(&direction.x)
    }
}
