//! Decomposition of a surface into convex pieces.
//!
//! The surface is cut by planes normal to the coordinate axes. Each cut minimises the total volume of the convex
//! hulls of all pieces; a convex surface is not cut. Triangles are split at the plane, so that the hulls of the
//! pieces contain every point of the surface, and the interior of a closed surface. The greedy selection of planes
//! follows Mamou and Ghorbel, *A simple and efficient approach for 3D mesh approximate convex decomposition* (ICIP
//! 2009), but with the volume of hulls instead of their concavity, and without voxels.

use dynident_model::Vec3;

/// Number of slabs of a piece along each axis; the borders of slabs are the candidate planes.
const SLABS: usize = 16;

/// Number of directions whose outermost points approximate the volume of a hull.
const DIRECTIONS: usize = 48;

/// Minimum reduction of the hull volume by a cut, as a share of the first hull's volume.
const MIN_RELATIVE_GAIN: f64 = 0.02;

type Triangle = [Vec3; 3];

struct Piece {
    triangles: Vec<Triangle>,
    cut: Option<Cut>,
}

#[derive(Clone, Copy)]
struct Cut {
    gain: f64,
    axis: usize,
    at: f64,
}

/// Corners of at most `most` convex pieces; together the hulls of the pieces contain all triangles.
pub(super) fn convex_pieces(triangles: Vec<Triangle>, most: usize) -> Vec<Vec<Vec3>> {
    let directions = spiral(DIRECTIONS);
    let (whole, cut) = best_cut(&triangles, &directions);
    let mut pieces = vec![Piece { triangles, cut }];
    while pieces.len() < most {
        let gain = |piece: &Piece| piece.cut.map_or(0.0, |cut| cut.gain);
        let best = (0..pieces.len()).reduce(|a, b| if gain(&pieces[b]) > gain(&pieces[a]) { b } else { a });
        let Some((place, cut)) = best.and_then(|place| Some((place, pieces[place].cut?))) else { break };
        if cut.gain < MIN_RELATIVE_GAIN * whole {
            break;
        }
        let halves = [-1.0, 1.0].map(|side| {
            let triangles = half(&pieces[place].triangles, cut, side);
            Piece { cut: best_cut(&triangles, &directions).1, triangles }
        });
        let [lower, upper] = halves;
        pieces[place] = lower;
        pieces.push(upper);
    }
    pieces.into_iter().map(|piece| distinct(piece.triangles)).collect()
}

fn distinct(triangles: Vec<Triangle>) -> Vec<Vec3> {
    let mut corners: Vec<[u64; 3]> = triangles.into_iter().flatten().map(|corner| corner.0.map(f64::to_bits)).collect();
    corners.sort_unstable();
    corners.dedup();
    corners.into_iter().map(|bits| Vec3(bits.map(f64::from_bits))).collect()
}

/// Evenly distributed directions (a spiral on the sphere).
pub(super) fn spiral(count: usize) -> Vec<Vec3> {
    let golden = core::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Vec3([across * cos, across * sin, z])
    };
    (0..count).map(direction).collect()
}

#[derive(Clone)]
struct Outermost(Vec<(f64, Vec3)>);

impl Outermost {
    fn none() -> Self {
        Self(vec![(f64::NEG_INFINITY, Vec3::ZERO); DIRECTIONS])
    }

    fn add(&mut self, point: Vec3, directions: &[Vec3]) {
        for (known, direction) in self.0.iter_mut().zip(directions) {
            let along = point.dot(*direction);
            if along > known.0 {
                *known = (along, point);
            }
        }
    }

    fn join(&mut self, other: &Self) {
        for (known, new) in self.0.iter_mut().zip(&other.0) {
            if new.0 > known.0 {
                *known = *new;
            }
        }
    }

    fn volume(&self) -> f64 {
        let mut points: Vec<Vec3> = Vec::with_capacity(DIRECTIONS);
        for (along, point) in &self.0 {
            if along.is_finite() && !points.contains(point) {
                points.push(*point);
            }
        }
        hull_volume(&points)
    }
}

fn best_cut(triangles: &[Triangle], directions: &[Vec3]) -> (f64, Option<Cut>) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for corner in triangles.iter().flatten() {
        for axis in 0..3 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    let mut slabs: Vec<Vec<Outermost>> = (0..3).map(|_| vec![Outermost::none(); SLABS]).collect();
    for axis in 0..3 {
        let width = (high[axis] - low[axis]) / SLABS as f64;
        if width.is_nan() || width <= 0.0 {
            continue;
        }
        let slab = |x: f64| (((x - low[axis]) / width) as usize).min(SLABS - 1);
        for triangle in triangles {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let (from, to) = (slab(a[axis]), slab(b[axis]));
                slabs[axis][from].add(a, directions);
                // Points where the edge crosses borders of slabs.
                for border in from.min(to)..from.max(to) {
                    let at = low[axis] + width * (border + 1) as f64;
                    let share = ((at - a[axis]) / (b[axis] - a[axis])).clamp(0.0, 1.0);
                    let crossing = a + (b - a).scale(share);
                    slabs[axis][border].add(crossing, directions);
                    slabs[axis][border + 1].add(crossing, directions);
                }
            }
        }
    }
    let joined = |slabs: &mut dyn Iterator<Item = &Outermost>| {
        let mut sum = Outermost::none();
        let mut joined = Vec::with_capacity(SLABS);
        for slab in slabs {
            sum.join(slab);
            joined.push(sum.clone());
        }
        joined
    };
    let mut whole = 0.0;
    let mut best: Option<Cut> = None;
    for axis in 0..3 {
        let lower = joined(&mut slabs[axis].iter());
        let upper = joined(&mut slabs[axis].iter().rev());
        let all = lower[SLABS - 1].volume();
        if all <= 0.0 {
            continue;
        }
        whole = all;
        for border in 1..SLABS {
            let gain = all - lower[border - 1].volume() - upper[SLABS - 1 - border].volume();
            if gain > best.map_or(0.0, |cut| cut.gain) {
                let at = low[axis] + (high[axis] - low[axis]) * border as f64 / SLABS as f64;
                best = Some(Cut { gain, axis, at });
            }
        }
    }
    (whole, best)
}

fn half(triangles: &[Triangle], cut: Cut, side: f64) -> Vec<Triangle> {
    let mut kept = Vec::with_capacity(triangles.len() / 2);
    for triangle in triangles {
        let out = triangle.map(|corner| -side * (corner[cut.axis] - cut.at));
        if out.iter().all(|out| *out <= 0.0) {
            kept.push(*triangle);
            continue;
        }
        let mut polygon: Vec<Vec3> = Vec::with_capacity(4);
        for k in 0..3 {
            let next = (k + 1) % 3;
            if out[k] <= 0.0 {
                polygon.push(triangle[k]);
            }
            if (out[k] < 0.0 && out[next] > 0.0) || (out[k] > 0.0 && out[next] < 0.0) {
                let share = out[k] / (out[k] - out[next]);
                polygon.push(triangle[k] + (triangle[next] - triangle[k]).scale(share));
            }
        }
        // A corner or an edge on the plane is kept too, because the hulls of both sides must contain it.
        match polygon.as_slice() {
            [] => {}
            [a] => kept.push([*a; 3]),
            [a, b] => kept.push([*a, *b, *b]),
            [first, rest @ ..] => kept.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]])),
        }
    }
    kept
}

/// Volume of the convex hull of a few points, m³; 0 for coplanar points. The hull is built point by point: each point
/// replaces the faces that are visible from it by faces to their border.
fn hull_volume(points: &[Vec3]) -> f64 {
    let Some(mut faces) = first_tetrahedron(points) else { return 0.0 };
    let size = points.iter().fold(0.0_f64, |size, point| size.max((*point - points[0]).norm()));
    for (index, point) in points.iter().enumerate() {
        let sees = |[a, b, c]: &[usize; 3]| {
            let normal = (points[*b] - points[*a]).cross(points[*c] - points[*a]);
            normal.dot(*point - points[*a]) > 1e-12 * size * normal.norm()
        };
        let (seen, rest): (Vec<[usize; 3]>, Vec<[usize; 3]>) = faces.iter().partition(|face| sees(face));
        if seen.is_empty() {
            continue;
        }
        let edges = || seen.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let border = edges().filter(|[a, b]| !edges().any(|[c, d]| c == *b && d == *a));
        let new = border.map(|[a, b]| [a, b, index]).collect::<Vec<_>>();
        faces = rest;
        faces.extend(new);
    }
    let inside = points[faces[0][0]];
    let part = |[a, b, c]: &[usize; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| points[*corner] - inside);
        a.cross(b).dot(c) / 6.0
    };
    faces.iter().map(part).sum::<f64>().max(0.0)
}

/// Faces of a tetrahedron of distant points, counter-clockwise seen from outside; `None` for coplanar points.
fn first_tetrahedron(points: &[Vec3]) -> Option<Vec<[usize; 3]>> {
    let farthest = |measure: &dyn Fn(Vec3) -> f64| {
        let best = (0..points.len()).max_by(|&a, &b| measure(points[a]).total_cmp(&measure(points[b])))?;
        Some((best, measure(points[best])))
    };
    let first = *points.first()?;
    let (b, size) = farthest(&|point| (point - first).norm())?;
    let along = points[b] - first;
    let (c, off_line) = farthest(&|point| along.cross(point - first).norm())?;
    let normal = along.cross(points[c] - first);
    let (d, off_plane) = farthest(&|point| normal.dot(point - first).abs())?;
    let flat = size <= 0.0 || off_line <= 1e-9 * size * size || off_plane <= 1e-9 * size * normal.norm();
    if flat {
        return None;
    }
    // The fourth corner is below the first face.
    let (b, c) = if normal.dot(points[d] - first) > 0.0 { (c, b) } else { (b, c) };
    Some(vec![[0, b, c], [0, c, d], [0, d, b], [b, d, c]])
}

#[cfg(test)]
mod tests {
    use super::super::convex::{Placed, hull_distance};
    use super::*;
    use dynident_model::Transform;
    use dynident_model::sample::Random;

    fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
        let corner =
            |k: usize| Vec3(core::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] }));
        let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let split = |f: [usize; 4]| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]];
        faces.into_iter().flat_map(split).map(|triangle| triangle.map(corner)).collect()
    }

    #[test]
    fn hulls_of_a_box_a_tetrahedron_and_a_plane_have_their_volumes() {
        let corners: Vec<Vec3> = block([0.0; 3], [1.0, 2.0, 3.0]).into_iter().flatten().collect();
        assert!((hull_volume(&corners) - 6.0).abs() < 1e-12);
        let tetrahedron = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3);
        assert!((hull_volume(&tetrahedron) - 1.0 / 6.0).abs() < 1e-15);
        assert_eq!(hull_volume(&tetrahedron[..3]), 0.0);
        let mut random = Random::new(3);
        let mut more = corners;
        more.extend((0..50).map(|_| Vec3([1.0, 2.0, 3.0].map(|high| random.uniform(0.0, high)))));
        assert!((hull_volume(&more) - 6.0).abs() < 1e-9);
    }

    #[test]
    fn an_angle_is_cut_into_its_legs_and_a_box_is_not_cut() {
        assert_eq!(convex_pieces(block([0.0; 3], [1.0, 2.0, 3.0]), 8).len(), 1);
        let mut angle = block([0.0; 3], [0.1, 0.1, 1.0]);
        angle.extend(block([0.0; 3], [1.0, 0.1, 0.1]));
        let pieces = convex_pieces(angle.clone(), 8);
        assert!(pieces.len() >= 2, "{}", pieces.len());
        let directions = spiral(DIRECTIONS);
        let volume = |points: &[Vec3]| {
            let mut outermost = Outermost::none();
            for point in points {
                outermost.add(*point, &directions);
            }
            outermost.volume()
        };
        let sum: f64 = pieces.iter().map(|piece| volume(piece)).sum();
        // The legs have 0.019 m³, their hull 0.06.
        assert!(sum < 0.024, "{sum}");
        let mut random = Random::new(4);
        for triangle in &angle {
            for _ in 0..20 {
                let (mut s, mut t) = (random.uniform(0.0, 1.0), random.uniform(0.0, 1.0));
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                let point = triangle[0] + (triangle[1] - triangle[0]).scale(s) + (triangle[2] - triangle[0]).scale(t);
                let one = [point];
                let at = Transform::IDENTITY;
                let apart = pieces.iter().map(|piece| {
                    let (piece, point) = (Placed { corners: piece, at: &at }, Placed { corners: &one, at: &at });
                    hull_distance(piece, point, f64::INFINITY, &mut Vec3::ZERO.clone()).distance_m
                });
                assert!(apart.fold(f64::INFINITY, f64::min) < 1e-9);
            }
        }
    }
}
