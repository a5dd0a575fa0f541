//! Minimum height of the shapes of links above the floor.

use super::description::FloorLimit;
use super::error::LimitError;
use super::kind::{Constraint, LimitKind};
use super::pairs::arm_length_m;
use super::solids::LinkSolid;
use super::term::{Adjoint, Inputs, Term};
use dynident_model::{Model, Vec3};

/// Constraint `(lowest - z) / L`, one row per link: `z` is the height of a link's lowest point, `lowest` its minimum,
/// and `L` the arm's length.
#[derive(Clone, Debug)]
pub(crate) struct FloorShapes(Vec<(LinkSolid, Constraint)>);

impl FloorShapes {
    pub(crate) fn new(model: &Model, limit: &FloorLimit) -> Result<Self, LimitError> {
        let length = arm_length_m(model).max(1e-9);
        let row = |solid: LinkSolid| {
            let middle = limit.height_m - limit.lowered_m.get(&solid.link).copied().unwrap_or(0.0);
            let subject = solid.link.clone();
            let constraint = Constraint { kind: LimitKind::Floor, subject, middle, size: length, unit: "m" };
            (solid, constraint)
        };
        Ok(Self(LinkSolid::gather(model, &limit.shapes, "the floor")?.into_iter().map(row).collect()))
    }
}

impl Term for FloorShapes {
    fn constraints(&self) -> Vec<Constraint> {
        self.0.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        for ((solid, constraint), row) in self.0.iter().zip(out.chunks_exact_mut(inputs.motion.samples)) {
            for (sample, c) in row.iter_mut().enumerate() {
                *c = (constraint.middle - solid.lowest(&inputs.placement(solid.body, sample)).0) / constraint.size;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        let bodies = inputs.bodies;
        for ((solid, constraint), row) in self.0.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            for (sample, &weight) in row.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
                let (_, place) = solid.lowest(&inputs.placement(solid.body, sample));
                adjoint.point(solid.body, bodies, sample, place, Vec3([0.0, 0.0, -weight / constraint.size]));
            }
        }
    }

    fn needs_placements(&self) -> bool {
        true
    }
}
