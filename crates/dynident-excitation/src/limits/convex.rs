//! Distance between the convex hulls of two sets of corners, with the nearest points.
//!
//! Algorithm of Gilbert, Johnson and Keerthi (IEEE J. Robotics and Automation 4(2), 1988): simplices of corners of the
//! Minkowski difference approach its point nearest to the origin.

use super::segments::segment_distance;
use dynident_model::{Transform, Vec3};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<'a> {
    pub(crate) corners: &'a [Vec3],
    pub(crate) at: &'a Transform,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HullDistance {
    /// Distance, m; 0 if the hulls overlap. A distance above the requested one is a lower bound.
    pub distance_m: f64,
    /// Nearest points of the two hulls.
    pub points: [Vec3; 2],
    /// Unit vector from the second point to the first; for overlapping hulls, between the centres of the hulls.
    pub direction: Vec3,
}

/// Maximum number of iterations; a dozen are usual.
const MAX_ITERATIONS: usize = 48;

const RELATIVE_TOLERANCE: f64 = 1e-12;

#[derive(Clone, Copy)]
struct Corner {
    difference: Vec3,
    first: Vec3,
    second: Vec3,
}

impl Placed<'_> {
    fn farthest(&self, direction: Vec3) -> Vec3 {
        let local = self.at.rotation.transpose_mul_vec(direction);
        let mut best = (f64::NEG_INFINITY, Vec3::ZERO);
        for corner in self.corners {
            let along = corner.dot(local);
            if along > best.0 {
                best = (along, *corner);
            }
        }
        self.at.point(best.1)
    }

    fn centre(&self) -> Vec3 {
        let sum = self.corners.iter().fold(Vec3::ZERO, |sum, corner| sum + *corner);
        self.at.point(sum.scale(1.0 / self.corners.len().max(1) as f64))
    }
}

/// Distance of two hulls. If the distance exceeds `beyond`, the result is a lower bound above `beyond`. `guess`
/// stores the last search direction, which is the initial direction of the next similar query.
pub(crate) fn hull_distance(first: Placed<'_>, second: Placed<'_>, beyond: f64, guess: &mut Vec3) -> HullDistance {
    if let ([a, .., b] | [a @ b], [c, .., d] | [c @ d]) = (first.corners, second.corners)
        && first.corners.len() <= 2
        && second.corners.len() <= 2
    {
        let (one, other) = ([*a, *b].map(|end| first.at.point(end)), [*c, *d].map(|end| second.at.point(end)));
        let found = segment_distance(one, other);
        let between = |ends: [Vec3; 2], share: f64| ends[0] + (ends[1] - ends[0]).scale(share);
        let points = [between(one, found.along_first), between(other, found.along_second)];
        return HullDistance { distance_m: found.distance_m, points, direction: found.direction };
    }
    let mut towards = if guess.dot(*guess) > 0.0 { *guess } else { first.centre() - second.centre() };
    if towards.dot(towards) <= 0.0 {
        towards = Vec3([1.0, 0.0, 0.0]);
    }
    let mut simplex: Vec<Corner> = Vec::with_capacity(4);
    let mut nearest: Option<Nearest> = None;
    for _ in 0..MAX_ITERATIONS {
        let (a, b) = (first.farthest(-towards), second.farthest(towards));
        let corner = Corner { difference: a - b, first: a, second: b };
        let length = towards.norm();
        let bound = towards.dot(corner.difference) / length;
        if bound > beyond {
            *guess = towards;
            return HullDistance { distance_m: bound, points: [a, b], direction: towards.scale(1.0 / length) };
        }
        if let Some(known) = &nearest {
            let gained = known.square - towards.dot(corner.difference);
            let again = simplex.iter().any(|known| known.difference == corner.difference);
            if again || gained <= RELATIVE_TOLERANCE * known.square {
                break;
            }
        }
        simplex.push(corner);
        let found = nearest_of(&simplex);
        if let Some(known) = &nearest
            && found.square >= known.square
        {
            // Rounding prevents a further decrease.
            break;
        }
        let largest =
            simplex.iter().fold(0.0_f64, |largest, known| largest.max(known.difference.dot(known.difference)));
        let whole = simplex.len() == 4 && found.shares.iter().all(|share| *share > 0.0);
        if whole || found.square <= 1e-24 * largest {
            return overlapping(first, second);
        }
        let mut points = [Vec3::ZERO; 2];
        let mut kept = 0;
        for (k, share) in found.shares.into_iter().enumerate().take(simplex.len()) {
            if share > 0.0 {
                points[0] += simplex[k].first.scale(share);
                points[1] += simplex[k].second.scale(share);
                simplex.swap(kept, k);
                kept += 1;
            }
        }
        simplex.truncate(kept);
        towards = found.point;
        nearest = Some(Nearest { square: found.square, points });
    }
    let Some(Nearest { square, points }) = nearest else { return overlapping(first, second) };
    *guess = towards;
    let distance_m = square.sqrt();
    HullDistance { distance_m, points, direction: towards.scale(1.0 / towards.norm()) }
}

struct Nearest {
    square: f64,
    points: [Vec3; 2],
}

fn overlapping(first: Placed<'_>, second: Placed<'_>) -> HullDistance {
    let points = [first.centre(), second.centre()];
    let apart = points[0] - points[1];
    let length = apart.norm();
    let direction = if length > 0.0 { apart.scale(1.0 / length) } else { Vec3([0.0, 0.0, 1.0]) };
    HullDistance { distance_m: 0.0, points, direction }
}

struct SimplexPoint {
    point: Vec3,
    square: f64,
    /// Barycentric shares of the corners; zero for unused corners.
    shares: [f64; 4],
}

fn nearest_of(simplex: &[Corner]) -> SimplexPoint {
    let at = |k: usize| simplex[k].difference;
    match simplex.len() {
        1 => of_shares(simplex, [1.0, 0.0, 0.0, 0.0]),
        2 => {
            let [s, t] = on_segment(at(0), at(1));
            of_shares(simplex, [s, t, 0.0, 0.0])
        }
        3 => {
            let [s, t, u] = on_triangle(at(0), at(1), at(2));
            of_shares(simplex, [s, t, u, 0.0])
        }
        _ => on_tetrahedron(simplex),
    }
}

fn of_shares(simplex: &[Corner], shares: [f64; 4]) -> SimplexPoint {
    let point =
        simplex.iter().zip(shares).fold(Vec3::ZERO, |sum, (corner, share)| sum + corner.difference.scale(share));
    SimplexPoint { point, square: point.dot(point), shares }
}

fn on_segment(a: Vec3, b: Vec3) -> [f64; 2] {
    let along = b - a;
    let length2 = along.dot(along);
    let t = if length2 > 0.0 { (-a.dot(along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    [1.0 - t, t]
}

/// Barycentric shares at the point of a triangle nearest to the origin (Ericson, *Real-Time Collision Detection*
/// (2005), section 5.1.5).
fn on_triangle(a: Vec3, b: Vec3, c: Vec3) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (-ab.dot(a), -ac.dot(a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (-ab.dot(b), -ac.dot(b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let [s, t] = on_segment(a, b);
        return [s, t, 0.0];
    }
    let (d5, d6) = (-ab.dot(c), -ac.dot(c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let [s, t] = on_segment(a, c);
        return [s, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let [s, t] = on_segment(b, c);
        return [0.0, s, t];
    }
    let sum = va + vb + vc;
    if sum > 0.0 { [va / sum, vb / sum, vc / sum] } else { [1.0, 0.0, 0.0] }
}

/// The tetrahedron itself if it contains the origin, otherwise the nearest of its faces.
fn on_tetrahedron(simplex: &[Corner]) -> SimplexPoint {
    let at = |k: usize| simplex[k].difference;
    let [a, b, c, d] = [0, 1, 2, 3].map(at);
    let volume = |p: Vec3, q: Vec3, r: Vec3, s: Vec3| (q - p).cross(r - p).dot(s - p);
    let whole = volume(a, b, c, d);
    let o = Vec3::ZERO;
    let parts =
        [volume(o, b, c, d), volume(a, o, c, d), volume(a, b, o, d), volume(a, b, c, o)].map(|part| part / whole);
    if parts.iter().all(|part| *part > 0.0 && part.is_finite()) {
        return SimplexPoint { point: Vec3::ZERO, square: 0.0, shares: parts };
    }
    let faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
    let mut best: Option<SimplexPoint> = None;
    for [i, j, k] in faces {
        let found = on_triangle(at(i), at(j), at(k));
        let mut shares = [0.0; 4];
        [shares[i], shares[j], shares[k]] = found;
        let candidate = of_shares(simplex, shares);
        if best.as_ref().is_none_or(|best| candidate.square < best.square) {
            best = Some(candidate);
        }
    }
    best.unwrap_or_else(|| of_shares(simplex, [1.0, 0.0, 0.0, 0.0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::Mat3;
    use dynident_model::sample::Random;

    /// Distance by moving weight from the worst corner to the best (Mitchell, Demyanov and Malozemov 1974): an
    /// independent, slow and simple algorithm with a lower bound.
    fn by_shares(first: &[Vec3], second: &[Vec3]) -> [f64; 2] {
        let corners: Vec<Vec3> = first.iter().flat_map(|a| second.iter().map(|b| *a - *b)).collect();
        let mut shares = vec![0.0; corners.len()];
        shares[0] = 1.0;
        let mut point = corners[0];
        let mut below = 0.0_f64;
        for _ in 0..200_000 {
            let along: Vec<f64> = corners.iter().map(|corner| corner.dot(point)).collect();
            let best = (0..along.len()).min_by(|&a, &b| along[a].total_cmp(&along[b])).unwrap();
            let used = (0..along.len()).filter(|&k| shares[k] > 0.0);
            let worst = used.max_by(|&a, &b| along[a].total_cmp(&along[b])).unwrap();
            below = below.max(along[best] / point.norm());
            if along[worst] - along[best] < 1e-13 {
                break;
            }
            let step = corners[best] - corners[worst];
            let share = (-point.dot(step) / step.dot(step)).clamp(0.0, shares[worst]);
            shares[worst] -= share;
            shares[best] += share;
            point += step.scale(share);
        }
        [below, point.norm()]
    }

    fn hull(random: &mut Random, corners: usize) -> Vec<Vec3> {
        // Half of the coordinates are on a coarse grid, so that parallel faces and edges occur.
        let mut coordinate = || {
            let x = random.uniform(-1.0, 1.0);
            if random.uniform(0.0, 1.0) < 0.5 { (2.0 * x).round() / 2.0 } else { x }
        };
        (0..corners).map(|_| Vec3([coordinate(), coordinate(), coordinate()])).collect()
    }

    #[test]
    fn the_distance_is_the_least_and_attained() {
        let mut random = Random::new(11);
        for case in 0..400 {
            let counts = [1 + case % 9, 1 + (case / 9) % 9];
            let [first, second] = counts.map(|count| hull(&mut random, count));
            let shift = random.direction().scale(random.uniform(0.0, 4.0));
            let at = Transform {
                rotation: Mat3::from_axis_angle(random.direction(), random.uniform(0.0, 3.0)),
                translation: shift,
            };
            let one = Placed { corners: &first, at: &at };
            let other = Placed { corners: &second, at: &Transform::IDENTITY };
            let placed: Vec<Vec3> = first.iter().map(|corner| at.point(*corner)).collect();
            let [below, above] = by_shares(&placed, &second);
            let mut guess = if case % 2 == 0 { Vec3::ZERO } else { random.direction() };
            let found = hull_distance(one, other, f64::INFINITY, &mut guess);
            // The oracle's bounds differ by at most 1e-7 for separate hulls.
            assert!(found.distance_m < above + 1e-9 && found.distance_m > below - 1e-9, "{found:?} {below} {above}");
            if found.distance_m > 1e-6 {
                let apart = found.points[0] - found.points[1];
                assert!((apart.norm() - found.distance_m).abs() < 1e-9);
                assert!((apart.scale(1.0 / apart.norm()) - found.direction).norm() < 1e-6);
            }
            let bounded = hull_distance(one, other, 0.3, &mut Vec3::ZERO.clone());
            assert!(bounded.distance_m <= found.distance_m + 1e-9);
            assert!(bounded.distance_m > 0.3 || (bounded.distance_m - found.distance_m).abs() < 1e-9);
        }
    }

    #[test]
    fn boxes_face_to_face_and_inside_each_other() {
        let cube: Vec<Vec3> =
            (0..8).map(|k| Vec3(core::array::from_fn(|axis| if k >> axis & 1 == 0 { -0.5 } else { 0.5 }))).collect();
        let at = |x: f64| Transform { rotation: Mat3::IDENTITY, translation: Vec3([x, 0.2, 0.1]) };
        for (x, expected) in [(1.5, 0.5), (1.01, 0.01), (1.0, 0.0), (0.7, 0.0), (0.0, 0.0)] {
            let moved = at(x);
            let found = hull_distance(
                Placed { corners: &cube, at: &moved },
                Placed { corners: &cube, at: &Transform::IDENTITY },
                f64::INFINITY,
                &mut Vec3::ZERO.clone(),
            );
            assert!((found.distance_m - expected).abs() < 1e-12, "{x}: {found:?}");
        }
    }
}
