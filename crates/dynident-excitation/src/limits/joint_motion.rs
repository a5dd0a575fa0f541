//! Limits of position, velocity, acceleration and jerk of single joints: ranges (bands) of the motion itself.

use super::description::JointLimit;
use super::kind::{Constraint, LimitKind};
use super::term::{Adjoint, Inputs, Term};
use super::validate::middle_and_half;
use dynident_model::Model;

/// Constraint `|x - middle| / half - 1` on one of the four arrays of a motion.
#[derive(Clone, Debug)]
struct Band {
    joint: usize,
    kind: LimitKind,
    middle: f64,
    half: f64,
    constraint: Constraint,
}

#[derive(Clone, Debug)]
pub(crate) struct JointMotionLimits(Vec<Band>);

impl JointMotionLimits {
    pub(crate) fn new(model: &Model, limits: &[JointLimit]) -> Self {
        let mut bands = Vec::new();
        for (index, joint) in model.joints().iter().enumerate() {
            let Some(limit) = limits.iter().find(|limit| limit.joint == joint.name) else { continue };
            let units =
                if joint.is_rotary() { ["rad", "rad/s", "rad/s^2", "rad/s^3"] } else { ["m", "m/s", "m/s^2", "m/s^3"] };
            let magnitude = |size: Option<f64>| size.map(|size| (0.0, size));
            let ranges = [
                (LimitKind::Position, limit.position.map(middle_and_half)),
                (LimitKind::Speed, magnitude(limit.speed)),
                (LimitKind::Acceleration, magnitude(limit.acceleration)),
                (LimitKind::Jerk, magnitude(limit.jerk)),
            ];
            for ((kind, range), unit) in ranges.into_iter().zip(units) {
                if let Some((middle, half)) = range {
                    let constraint = Constraint { kind, subject: joint.name.clone(), middle, size: half, unit };
                    bands.push(Band { joint: index, kind, middle, half, constraint });
                }
            }
        }
        Self(bands)
    }
}

/// Order of the derivative that a limit concerns.
fn order(kind: LimitKind) -> usize {
    match kind {
        LimitKind::Position => 0,
        LimitKind::Speed => 1,
        LimitKind::Acceleration => 2,
        _ => 3,
    }
}

/// A row of a [`LimitSet`](super::LimitSet) that limits the position (order 0), velocity, acceleration or jerk (order
/// 3) of a single joint: `c = |x - middle| / half - 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointBand {
    /// Index of the row in the set.
    pub row: usize,
    pub joint: usize,
    /// Order of the limited derivative of the position.
    pub order: usize,
    /// Half width of the band, rad/s^order (m/s^order).
    pub half: f64,
}

impl JointMotionLimits {
    /// The bands; this term must be the first of the set.
    pub(crate) fn bands(&self) -> Vec<JointBand> {
        let band = |(row, band): (usize, &Band)| JointBand {
            row,
            joint: band.joint,
            order: order(band.kind),
            half: band.half,
        };
        self.0.iter().enumerate().map(band).collect()
    }
}

impl Term for JointMotionLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.0.iter().map(|band| band.constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        let motion = inputs.motion;
        for (band, row) in self.0.iter().zip(out.chunks_exact_mut(motion.samples)) {
            let scale = 1.0 / band.half;
            for (c, x) in row.iter_mut().zip(&motion.arrays()[order(band.kind)][motion.of(band.joint)]) {
                *c = (x - band.middle).abs() * scale - 1.0;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        let motion = inputs.motion;
        for (band, row) in self.0.iter().zip(weights.chunks_exact(motion.samples)) {
            let (scale, range) = (1.0 / band.half, motion.of(band.joint));
            let order = order(band.kind);
            let to = &mut adjoint.motion.arrays_mut()[order][range.clone()];
            for ((to, weight), x) in to.iter_mut().zip(row).zip(&motion.arrays()[order][range]) {
                *to += weight * scale * (x - band.middle).signum();
            }
        }
    }
}
