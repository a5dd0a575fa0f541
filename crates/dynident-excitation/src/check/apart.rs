//! Distance of two links, computed with a different algorithm than in the search.
//!
//! The nearest points of two convex hulls are weighted means of their corners. Each iteration moves weight from the
//! worst corner to the best one (Mitchell, Demyanov and Malozemov, SIAM J. Control 12(1), 1974) until no further gain
//! is possible. The separating plane gives a lower bound of the distance, and the check uses this bound.

use dynident_model::{Transform, Vec3};

/// Corners of a convex hull in the frame of its body, with a radius around it.
pub(super) struct Hull {
    pub(super) corners: Vec<Vec3>,
    pub(super) radius_m: f64,
}

pub(super) struct Link {
    pub(super) body: Option<usize>,
    pub(super) hulls: Vec<Hull>,
    /// Bounding sphere of each hull: centre and radius, m.
    balls: Vec<(Vec3, f64)>,
    /// Distance of the farthest point from the body's origin, m.
    reach_m: f64,
}

pub(super) struct Pair {
    pub(super) links: [Link; 2],
    pub(super) clearance_m: f64,
    pub(super) size_m: f64,
    /// Placements of both links at the last computed distance, and that distance.
    known: Option<([Transform; 2], f64)>,
}

const MAX_EXCHANGES: usize = 4000;

/// Maximum gap between the bounds of a distance, as a share of the pair's size.
const RELATIVE_DISTANCE_TOLERANCE: f64 = 1e-7;

impl Pair {
    pub(super) fn new(links: [Link; 2], clearance_m: f64, size_m: f64) -> Self {
        Self { links, clearance_m, size_m, known: None }
    }

    /// Ratio to the clearance: 1 at the clearance, larger if the distance is smaller. Returns `worst` if the ratio
    /// cannot exceed it.
    pub(super) fn ratio(&mut self, placements: &[Transform], worst: f64) -> f64 {
        let at = [0, 1].map(|k| self.links[k].body.map_or(Transform::IDENTITY, |body| placements[body]));
        let ratio = |apart: f64| 1.0 + (self.clearance_m - apart) / self.size_m;
        // A point moves at most as far as the frame's translation plus the rotation times its distance from the origin.
        if let Some((then, apart)) = &self.known {
            let gone: f64 = (0..2).map(|k| self.links[k].max_displacement_m(&then[k], &at[k])).sum();
            if ratio(apart - gone) <= worst {
                return worst;
            }
        }
        // Only a smaller distance can exceed the worst ratio.
        let relevant_m = self.clearance_m - (worst - 1.0) * self.size_m;
        let mut apart = f64::INFINITY;
        let balls = |k: usize| self.links[k].hulls.iter().zip(&self.links[k].balls);
        for (first, ball) in balls(0) {
            for (second, other_ball) in balls(1) {
                let between = (at[0].point(ball.0) - at[1].point(other_ball.0)).norm() - ball.1 - other_ball.1;
                if between > relevant_m.min(apart) {
                    apart = apart.min(between);
                    continue;
                }
                let [a, b] = [(first, &at[0]), (second, &at[1])].map(|(hull, at)| {
                    let place = |corner: &Vec3| at.rotation.mul_vec(*corner) + at.translation;
                    hull.corners.iter().map(place).collect::<Vec<_>>()
                });
                let radii = first.radius_m + second.radius_m;
                apart = apart
                    .min(certified_m(&a, &b, relevant_m + radii, RELATIVE_DISTANCE_TOLERANCE * self.size_m) - radii);
            }
        }
        self.known = Some((at, apart));
        ratio(apart).max(worst)
    }
}

impl Link {
    pub(super) fn new(body: Option<usize>, hulls: Vec<Hull>) -> Self {
        let far = |hull: &Hull| {
            hull.corners
                .iter()
                .map(|corner| corner.norm())
                .fold(hull.radius_m, |far, corner| far.max(corner + hull.radius_m))
        };
        let reach_m = hulls.iter().map(far).fold(0.0, f64::max);
        let ball = |hull: &Hull| {
            let sum = hull.corners.iter().fold(Vec3::ZERO, |sum, corner| sum + *corner);
            let centre = sum.scale(1.0 / hull.corners.len().max(1) as f64);
            let far = |far: f64, corner: &Vec3| far.max((*corner - centre).norm());
            (centre, hull.corners.iter().fold(0.0, far) + hull.radius_m)
        };
        let balls = hulls.iter().map(ball).collect();
        Self { body, hulls, balls, reach_m }
    }

    /// Depth of the lowest point below `height_m`, m; `worst_m` if the depth cannot exceed it.
    pub(super) fn depth_below_m(&self, placements: &[Transform], height_m: f64, worst_m: f64) -> f64 {
        let at = self.body.map_or(Transform::IDENTITY, |body| placements[body]);
        if height_m - (at.translation[2] - self.reach_m) <= worst_m {
            return worst_m;
        }
        let up = Vec3(at.rotation.0[2]);
        let mut lowest = f64::INFINITY;
        for hull in &self.hulls {
            for corner in &hull.corners {
                lowest = lowest.min(up.dot(*corner) + at.translation[2] - hull.radius_m);
            }
        }
        height_m - lowest
    }

    /// Upper bound of the displacement of all points of the link between two placements, m.
    fn max_displacement_m(&self, then: &Transform, now: &Transform) -> f64 {
        let turned: f64 = (0..3)
            .flat_map(|row| (0..3).map(move |column| (row, column)))
            .map(|(row, column)| (now.rotation.0[row][column] - then.rotation.0[row][column]).powi(2))
            .sum();
        (now.translation - then.translation).norm() + self.reach_m * turned.sqrt()
    }
}

/// Lower bound of the distance of two hulls. It is at most `near` below the distance, or larger than `enough`; zero
/// if the hulls overlap.
fn certified_m(first: &[Vec3], second: &[Vec3], enough: f64, near: f64) -> f64 {
    let mut shares = [vec![0.0; first.len()], vec![0.0; second.len()]];
    shares[0][0] = 1.0;
    shares[1][0] = 1.0;
    let mut apart = first[0] - second[0];
    let mut certified = 0.0_f64;
    for _ in 0..MAX_EXCHANGES {
        let length = apart.norm();
        if length <= near {
            return 0.0;
        }
        // Along the direction `apart`, the best corner of the first hull is the lowest, and the best corner of the
        // second hull the highest.
        let mut exchange: Option<(f64, usize, usize, usize, Vec3)> = None;
        let mut reach = 0.0;
        for (side, corners) in [first, second].into_iter().enumerate() {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let along = |k: usize| sign * corners[k].dot(apart);
            let (mut best, mut worst) = (0, None);
            let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..corners.len() {
                let value = along(k);
                if value < lowest {
                    (lowest, best) = (value, k);
                }
                if shares[side][k] > 0.0 && value > highest {
                    (highest, worst) = (value, Some(k));
                }
            }
            reach += lowest;
            let Some(worst) = worst else { continue };
            let step = (corners[best] - corners[worst]).scale(sign);
            let gain = highest - lowest;
            if exchange.as_ref().is_none_or(|known| gain > known.0) {
                exchange = Some((gain, side, best, worst, step));
            }
        }
        certified = certified.max(reach / length);
        if certified > enough || length - certified <= near {
            break;
        }
        let Some((_, side, best, worst, step)) = exchange else { break };
        let square = step.dot(step);
        if square <= 0.0 {
            break;
        }
        let share = (-apart.dot(step) / square).clamp(0.0, shares[side][worst]);
        shares[side][worst] -= share;
        shares[side][best] += share;
        apart += step.scale(share);
    }
    certified
}
