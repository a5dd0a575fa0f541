//! Position and velocity limits of joints that follow other joints (mimic joints), from the robot description: limits
//! on weighted sums of the followed joints' motions.

use super::kind::{Constraint, LimitKind};
use super::term::{Adjoint, Inputs, Term};
use super::validate::middle_and_half;
use dynident_model::Model;

/// Constraint `|Σ multiplier x + offset - middle| / half - 1`, where `x` are positions or velocities of the followed
/// joints.
#[derive(Clone, Debug)]
struct FollowerBand {
    /// Degree of freedom and multiplier of each followed joint.
    sources: Vec<(usize, f64)>,
    kind: LimitKind,
    offset: f64,
    range: [f64; 2],
    joint: String,
    unit: &'static str,
}

/// Limits of the followers in the robot description. A study can give limits of independent joints only; these are
/// separate.
fn follower_bands(model: &Model) -> Vec<FollowerBand> {
    let Some(coupling) = model.coupling() else { return Vec::new() };
    let mut bands = Vec::new();
    for (index, joint) in model.followers() {
        let sources = coupling.row(index).to_vec();
        if sources.is_empty() {
            continue;
        }
        let limits = &joint.limits;
        let stops = limits.lower.zip(limits.upper).map(|(lower, upper)| [lower, upper]);
        let units = if joint.is_rotary() { ["rad", "rad/s"] } else { ["m", "m/s"] };
        let of_kind = [
            (LimitKind::Position, coupling.offset(index), stops, units[0]),
            (LimitKind::Speed, 0.0, limits.velocity.map(|most| [-most, most]), units[1]),
        ];
        for (kind, offset, range, unit) in of_kind {
            if let Some(range) = range.filter(|[lower, upper]| lower < upper) {
                let (joint, sources) = (joint.name.clone(), sources.clone());
                bands.push(FollowerBand { sources, kind, offset, range, joint, unit });
            }
        }
    }
    bands
}

#[derive(Clone, Debug)]
pub(crate) struct FollowerLimits(Vec<FollowerBand>);

impl FollowerLimits {
    pub(crate) fn new(model: &Model) -> Self {
        Self(follower_bands(model))
    }
}

impl Term for FollowerLimits {
    fn constraints(&self) -> Vec<Constraint> {
        let constraint = |band: &FollowerBand| {
            let (middle, size) = middle_and_half(band.range);
            Constraint { kind: band.kind, subject: band.joint.clone(), middle, size, unit: band.unit }
        };
        self.0.iter().map(constraint).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        let motion = inputs.motion;
        for (band, row) in self.0.iter().zip(out.chunks_exact_mut(motion.samples)) {
            let (middle, half) = middle_and_half(band.range);
            let from = if band.kind == LimitKind::Position { &motion.q } else { &motion.dq };
            row.fill(band.offset - middle);
            for &(joint, share) in &band.sources {
                for (c, x) in row.iter_mut().zip(&from[motion.of(joint)]) {
                    *c += share * x;
                }
            }
            for c in row {
                *c = c.abs() / half - 1.0;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        let motion = inputs.motion;
        for (band, row) in self.0.iter().zip(weights.chunks_exact(motion.samples)) {
            let (middle, half) = middle_and_half(band.range);
            let is_position = band.kind == LimitKind::Position;
            let from = if is_position { &motion.q } else { &motion.dq };
            let to = if is_position { &mut adjoint.motion.q } else { &mut adjoint.motion.dq };
            for (sample, weight) in row.iter().enumerate() {
                let at = |joint: usize| motion.of(joint).start + sample;
                let x: f64 = band.sources.iter().map(|&(joint, share)| share * from[at(joint)]).sum();
                let slope = weight * (x + band.offset - middle).signum() / half;
                for &(joint, share) in &band.sources {
                    to[at(joint)] += share * slope;
                }
            }
        }
    }
}
