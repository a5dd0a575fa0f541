//! Distances between the arm's own links.

use super::error::LimitError;
use super::kind::{Constraint, LimitKind};
use super::pairs::{SolidPair, SolidPairs};
use super::self_collision_shapes::SelfCollision;
use super::solids::{LinkSolid, SolidDistance, solid_distance};
use super::term::{Adjoint, Inputs, Term};
use dynident_model::{Model, Vec3};

/// Distance beyond the clearance, as a share of a pair's size, above which all distances are treated as equal. There
/// the search needs no exact value, and a bound is computed quickly.
const MAX_RELATIVE_EXCESS: f64 = 0.25;

/// Constraint `(clearance - d) / size`, where `d` is the distance between the surfaces of the two links; at least
/// -[`MAX_RELATIVE_EXCESS`].
#[derive(Clone, Debug)]
pub(crate) struct SelfCollisionLimits {
    solids: Vec<LinkSolid>,
    rows: Vec<(SolidPair, Constraint)>,
}

impl SelfCollisionLimits {
    pub(crate) fn new(model: &Model, limit: &SelfCollision) -> Result<Self, LimitError> {
        let SolidPairs { solids, pairs, .. } = limit.resolve(model)?;
        let row = |pair: SolidPair| {
            let [a, b] = pair.of.map(|index| &solids[index].link);
            let constraint = Constraint {
                kind: LimitKind::SelfCollision,
                subject: format!("{a} / {b}"),
                middle: pair.clearance_m,
                size: pair.size_m,
                unit: "m",
            };
            (pair, constraint)
        };
        let rows = pairs.into_iter().map(row).collect();
        Ok(Self { solids, rows })
    }

    fn apart(&self, pair: &SolidPair, inputs: &Inputs<'_>, sample: usize, guesses: &mut Vec<Vec3>) -> SolidDistance {
        let [first, second] = pair.of.map(|place| &self.solids[place]);
        let [one, other] = [first, second].map(|solid| inputs.placement(solid.body, sample));
        solid_distance(first, &one, second, &other, pair.clearance_m + MAX_RELATIVE_EXCESS * pair.size_m, guesses)
    }
}

impl Term for SelfCollisionLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.rows.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        let samples = inputs.motion.samples;
        // Most links are far apart most of the time; their bounding spheres show this.
        let centre = |solid: &LinkSolid, sample: usize| match solid.body {
            Some(body) => inputs.placements[sample * inputs.bodies + body].point(solid.centre),
            None => solid.centre,
        };
        let centres: Vec<Vec3> =
            self.solids.iter().flat_map(|solid| (0..samples).map(move |sample| centre(solid, sample))).collect();
        for ((pair, _), row) in self.rows.iter().zip(out.chunks_exact_mut(samples)) {
            let mut guesses = Vec::new();
            let [first, second] = pair.of.map(|place| &centres[place * samples..(place + 1) * samples]);
            let [reach, other_reach] = pair.of.map(|place| self.solids[place].reach_m);
            let far = reach + other_reach + pair.clearance_m + MAX_RELATIVE_EXCESS * pair.size_m;
            for (sample, c) in row.iter_mut().enumerate() {
                let between = first[sample] - second[sample];
                if between.dot(between) > far * far {
                    *c = -MAX_RELATIVE_EXCESS;
                    continue;
                }
                let apart = self.apart(pair, inputs, sample, &mut guesses);
                *c = ((pair.clearance_m - apart.surface_m) / pair.size_m).max(-MAX_RELATIVE_EXCESS);
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        let bodies = inputs.bodies;
        for ((pair, _), row) in self.rows.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            for (sample, &weight) in row.iter().enumerate() {
                if weight == 0.0 {
                    continue;
                }
                let SolidDistance { surface_m, points, direction, slope, .. } =
                    self.apart(pair, inputs, sample, &mut Vec::new());
                if surface_m >= pair.clearance_m + MAX_RELATIVE_EXCESS * pair.size_m {
                    continue;
                }
                let gradient = direction.scale(-weight * slope / pair.size_m);
                let [first, second] = pair.of.map(|place| self.solids[place].body);
                adjoint.point(first, bodies, sample, points[0], gradient);
                adjoint.point(second, bodies, sample, points[1], -gradient);
            }
        }
    }

    fn needs_placements(&self) -> bool {
        true
    }
}
