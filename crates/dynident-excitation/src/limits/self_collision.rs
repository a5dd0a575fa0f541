//! Distances between the arm's own links.

use super::error::LimitError;
use super::kind::{Constraint, LimitKind};
use super::pairs::{SolidPair, SolidPairs};
use super::self_collision_shapes::SelfCollision;
use super::solids::{LinkSolid, SolidDistance, solid_distance};
use super::term::{Inputs, Pull, Term};
use dynident_model::{Model, Vec3};

/// A lack of distance below minus this share of a pair's size is not told apart: links are then far enough from each
/// other for every purpose of a search, and a bound of their distance is found at once.
const FAR: f64 = 0.25;

/// `(clearance - d) / size` with `d` the distance of the two links from surface to surface, and no less than -[`FAR`]:
/// all that are farther apart are alike.
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
        solid_distance(first, &one, second, &other, pair.clearance_m + FAR * pair.size_m, guesses)
    }
}

impl Term for SelfCollisionLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.rows.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        let samples = inputs.motion.samples;
        // Most links are far from each other most of the time: balls about them say so.
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
            let far = reach + other_reach + pair.clearance_m + FAR * pair.size_m;
            for (sample, c) in row.iter_mut().enumerate() {
                let between = first[sample] - second[sample];
                if between.dot(between) > far * far {
                    *c = -FAR;
                    continue;
                }
                let apart = self.apart(pair, inputs, sample, &mut guesses);
                *c = ((pair.clearance_m - apart.surface_m) / pair.size_m).max(-FAR);
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], pull: &mut Pull<'_>) {
        let bodies = inputs.bodies;
        for ((pair, _), row) in self.rows.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            for (sample, &weight) in row.iter().enumerate() {
                if weight == 0.0 {
                    continue;
                }
                let SolidDistance { surface_m, points, direction, slope } =
                    self.apart(pair, inputs, sample, &mut Vec::new());
                if surface_m >= pair.clearance_m + FAR * pair.size_m {
                    continue;
                }
                let gradient = direction.scale(-weight * slope / pair.size_m);
                let [first, second] = pair.of.map(|place| self.solids[place].body);
                pull.point(first, bodies, sample, points[0], gradient);
                pull.point(second, bodies, sample, points[1], -gradient);
            }
        }
    }

    fn needs_placements(&self) -> bool {
        true
    }
}
