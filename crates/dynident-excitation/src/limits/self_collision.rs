//! Distances between the capsules of the arm's own links.

use super::capsules::{BodyCapsule, CapsulePairs, SelfCollision};
use super::error::LimitError;
use super::kind::{Constraint, LimitKind};
use super::segments::{SegmentDistance, segment_distance};
use super::term::{Inputs, Pull, Term};
use dynident_model::{Model, Vec3};

/// `1 - d / (r_a + r_b + clearance)` with `d` the distance of the two segments.
#[derive(Clone, Debug)]
pub(crate) struct SelfCollisionLimits {
    capsules: Vec<BodyCapsule>,
    rows: Vec<([usize; 2], Constraint)>,
}

impl SelfCollisionLimits {
    pub(crate) fn new(model: &Model, limit: &SelfCollision) -> Result<Self, LimitError> {
        let CapsulePairs { capsules, pairs, .. } = limit.resolve(model)?;
        let row = |pair: [usize; 2]| {
            let [a, b] = pair.map(|index| &capsules[index]);
            let subject = format!("{} / {}", a.link, b.link);
            let size = a.radius_m + b.radius_m + limit.clearance_m;
            (pair, Constraint { kind: LimitKind::SelfCollision, subject, middle: 0.0, size, unit: "m" })
        };
        let rows = pairs.into_iter().map(row).collect();
        Ok(Self { capsules, rows })
    }

    fn ends(&self, capsule: usize, inputs: &Inputs<'_>, sample: usize) -> [Vec3; 2] {
        let capsule = &self.capsules[capsule];
        let placement = inputs.placement(capsule.body, sample);
        capsule.ends.map(|end| placement.point(end))
    }
}

impl Term for SelfCollisionLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.rows.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        for ((pair, constraint), row) in self.rows.iter().zip(out.chunks_exact_mut(inputs.motion.samples)) {
            for (sample, c) in row.iter_mut().enumerate() {
                let [a, b] = pair.map(|capsule| self.ends(capsule, inputs, sample));
                *c = 1.0 - segment_distance(a, b).distance_m / constraint.size;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], pull: &mut Pull<'_>) {
        let joints = inputs.motion.joints;
        for ((pair, constraint), row) in self.rows.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            for (sample, &weight) in row.iter().enumerate() {
                if weight == 0.0 {
                    continue;
                }
                let [a, b] = pair.map(|capsule| self.ends(capsule, inputs, sample));
                let SegmentDistance { along_first, along_second, direction, .. } = segment_distance(a, b);
                let gradient = direction.scale(-weight / constraint.size);
                let between = |ends: [Vec3; 2], fraction: f64| ends[0] + (ends[1] - ends[0]).scale(fraction);
                let [first, second] = pair.map(|capsule| self.capsules[capsule].body);
                pull.point(first, joints, sample, between(a, along_first), gradient);
                pull.point(second, joints, sample, between(b, along_second), -gradient);
            }
        }
    }

    fn needs_placements(&self) -> bool {
        true
    }
}
