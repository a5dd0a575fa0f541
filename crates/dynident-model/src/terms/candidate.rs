//! How a law takes part when recordings choose the friction of a joint.

use super::{CoulombShape, TorqueTerm};

/// A law that recordings can choose for a joint: constants of its kind.
#[derive(Debug)]
pub struct CandidateLaw {
    /// Its name among candidates, each name once.
    pub name: &'static str,
    /// Number of constants that are chosen on the grid; they are included in the number of parameters.
    pub constants: usize,
    /// When it is tried.
    pub role: CandidateRole,
    /// Whether it is the step at rest, whose width is chosen again with every further term.
    pub is_step: bool,
    /// Whether only rows near rest distinguish it from other friction.
    pub is_near_rest: bool,
    /// Its terms, for each point of the grid of its constants.
    pub grid: fn(&CandidateJoint) -> Vec<GridPoint>,
}

impl CandidateLaw {
    /// A law without constants.
    pub(super) const fn new(
        name: &'static str,
        role: CandidateRole,
        grid: fn(&CandidateJoint) -> Vec<GridPoint>,
    ) -> Self {
        Self { name, constants: 0, role, is_step: false, is_near_rest: false, grid }
    }

    /// The law in whose place it is tried.
    pub fn replaces(&self) -> Option<&'static Self> {
        let CandidateRole::InPlaceOf(replaced) = self.role else { return None };
        TorqueTerm::candidates().find(|law| law.name == replaced)
    }

    /// True for the step at rest that is the same in both directions.
    pub fn is_common_step(&self) -> bool {
        self.is_step && self.replaces().is_none()
    }

    /// Its place in the order of laws: one that is tried in place of another follows it.
    pub fn rank(&self) -> (Option<usize>, bool) {
        let replaced = self.replaces();
        let name = replaced.map_or(self.name, |law| law.name);
        (TorqueTerm::candidates().position(|law| law.name == name), replaced.is_some())
    }
}

impl PartialEq for CandidateLaw {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for CandidateLaw {}

/// When a candidate is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandidateRole {
    /// Part of every model that a search begins with.
    Base,
    /// With the base a model that a search begins with.
    Start,
    /// In place of the candidate of this name.
    InPlaceOf(&'static str),
    /// In addition to all others. It is dropped where the data do not show it.
    Addition,
}

/// A point of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPoint {
    /// The terms there: one, or one for each direction.
    pub terms: Vec<TorqueTerm>,
    /// Number of its step on the first axis of the grid, ascending; `None` for a point that is tried alone.
    pub step: Option<usize>,
}

impl GridPoint {
    /// A term that is tried alone.
    pub(super) fn alone(term: TorqueTerm) -> Self {
        Self { terms: vec![term], step: None }
    }

    /// A term at step `step`.
    pub(super) fn at(step: usize, term: TorqueTerm) -> Self {
        Self { terms: vec![term], step: Some(step) }
    }
}

/// The joint that candidates are made for.
#[derive(Clone, Debug)]
pub struct CandidateJoint {
    /// Its index.
    pub joint: usize,
    /// A rad/s (m/s) of a usual arm.
    pub velocity: f64,
    /// A rad (m) of a usual arm.
    pub position: f64,
    /// Steps at rest that are tried alone.
    pub alone: Vec<CoulombShape>,
    /// Grid of widths of the step at rest, rad/s (m/s), ascending.
    pub widths: Vec<f64>,
    /// Width of the step of a law that has the joint's, rad/s (m/s).
    pub width: f64,
}

/// Bounds of the velocities among the constants, rad/s (m/s) of a usual arm.
const VELOCITIES: [f64; 2] = [1.0e-4, 10.0];

/// The constant of this logarithm, within its bounds.
pub(super) fn within(logarithm: f64, [least, most]: [f64; 2]) -> f64 {
    logarithm.clamp(least.ln(), most.ln()).exp()
}

/// The velocity of this logarithm, within bounds; `velocity` is a rad/s (m/s) of a usual arm.
pub(super) fn velocity_within(logarithm: f64, velocity: f64) -> f64 {
    within(logarithm, VELOCITIES.map(|usual| usual * velocity))
}
