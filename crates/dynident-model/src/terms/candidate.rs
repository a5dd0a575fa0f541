//! Candidate friction laws: the friction selection tries them on recordings.

use super::{CoulombShape, TorqueTerm};

/// A friction law that can be selected for a joint, with a grid of its constants.
#[derive(Debug)]
pub struct CandidateLaw {
    /// Unique name among the candidates.
    pub name: &'static str,
    /// Number of constants that are selected on the grid; they are included in the number of parameters.
    pub constants: usize,
    /// Role of the law in the search.
    pub role: CandidateRole,
    /// Whether the law is Coulomb friction. The width of its smoothed sign function is selected again with every
    /// further term.
    pub is_step: bool,
    /// Whether only rows near zero velocity distinguish the law from other friction.
    pub is_near_rest: bool,
    /// Terms of the law for each grid point of its constants.
    pub grid: fn(&CandidateJoint) -> Vec<GridPoint>,
}

impl CandidateLaw {
    pub(super) const fn new(
        name: &'static str,
        role: CandidateRole,
        grid: fn(&CandidateJoint) -> Vec<GridPoint>,
    ) -> Self {
        Self { name, constants: 0, role, is_step: false, is_near_rest: false, grid }
    }

    /// The law that this law replaces.
    pub fn replaces(&self) -> Option<&'static Self> {
        let CandidateRole::InPlaceOf(replaced) = self.role else { return None };
        TorqueTerm::candidates().find(|law| law.name == replaced)
    }

    /// True for Coulomb friction that is the same in both directions.
    pub fn is_common_step(&self) -> bool {
        self.is_step && self.replaces().is_none()
    }

    /// Position in the order of laws: a replacement comes after the law that it replaces.
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

/// Role of a candidate law in a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandidateRole {
    /// Part of every start model of a search.
    Base,
    /// Together with the base laws, a start model of a search.
    Start,
    /// Replaces the candidate with this name.
    InPlaceOf(&'static str),
    /// Added to all other laws, and dropped if it is not significant.
    Addition,
}

/// One point of a candidate's grid of constants.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPoint {
    /// Terms of the point: one, or one for each direction.
    pub terms: Vec<TorqueTerm>,
    /// Index on the first axis of the grid, ascending; `None` for a point that does not belong to the grid.
    pub step: Option<usize>,
}

impl GridPoint {
    pub(super) fn alone(term: TorqueTerm) -> Self {
        Self { terms: vec![term], step: None }
    }

    /// Grid point with one term at index `step`.
    pub(super) fn at(step: usize, term: TorqueTerm) -> Self {
        Self { terms: vec![term], step: Some(step) }
    }
}

/// The joint for which candidates are made.
#[derive(Clone, Debug)]
pub struct CandidateJoint {
    /// Index of the joint.
    pub joint: usize,
    /// Velocity of this joint that corresponds to 1 rad/s (m/s) of a typical arm.
    pub velocity: f64,
    /// Position of this joint that corresponds to 1 rad (m) of a typical arm.
    pub position: f64,
    /// Shapes of Coulomb friction that are tested separately, outside the grid.
    pub alone: Vec<CoulombShape>,
    /// Grid of widths of the smoothed sign function of Coulomb friction, rad/s (m/s), ascending.
    pub widths: Vec<f64>,
    /// Width of the smoothed sign function that a law shares with the joint's Coulomb friction, rad/s (m/s).
    pub width: f64,
}

/// Bounds of the velocity constants, rad/s (m/s) of a typical arm.
const VELOCITY_BOUNDS: [f64; 2] = [1.0e-4, 10.0];

/// The constant that has this logarithm, clamped to its bounds.
pub(super) fn clamped_exp(logarithm: f64, [least, most]: [f64; 2]) -> f64 {
    logarithm.clamp(least.ln(), most.ln()).exp()
}

/// The velocity that has this logarithm, clamped; `velocity` corresponds to 1 rad/s (m/s) of a typical arm.
pub(super) fn clamped_velocity(logarithm: f64, velocity: f64) -> f64 {
    clamped_exp(logarithm, VELOCITY_BOUNDS.map(|usual| usual * velocity))
}
