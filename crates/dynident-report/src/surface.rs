//! Triangle surfaces of bodies.

use std::collections::BTreeMap;

/// Number of sides that approximate a round surface.
const SIDES: usize = 24;

/// Number of steps from the equator of a sphere to its pole.
const STEPS: usize = 6;

/// Indices of the corners of each side of a box.
const FACES: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// A surface of triangles; lengths in m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertices, m.
    pub vertices_m: Vec<[f64; 3]>,
    /// Vertices of each triangle by index, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// A box around the origin with edges along x, y and z, m.
    pub fn cuboid(size_m: [f64; 3]) -> Self {
        let corner = |k: usize| std::array::from_fn(|a| if k >> a & 1 == 0 { -0.5 } else { 0.5 } * size_m[a]);
        let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        Self { vertices_m: (0..8).map(corner).collect(), triangles: FACES.into_iter().flat_map(halves).collect() }
    }

    /// A cylinder along z around the origin, m.
    pub fn cylinder(radius_m: f64, length_m: f64) -> Self {
        let half = 0.5 * length_m;
        Self::turned(&[[0.0, -half], [radius_m, -half], [radius_m, half], [0.0, half]])
    }

    /// A cylinder along z with hemispheres at its ends, m; a sphere for length 0.
    pub fn capsule(radius_m: f64, length_m: f64) -> Self {
        let arc = |end: f64| {
            (0..=STEPS).map(move |step| {
                let angle =
                    std::f64::consts::FRAC_PI_2 * (step as f64 / STEPS as f64 - if end < 0.0 { 1.0 } else { 0.0 });
                [radius_m * angle.cos(), 0.5 * end * length_m + radius_m * angle.sin()]
            })
        };
        Self::turned(&arc(-1.0).chain(arc(1.0)).collect::<Vec<_>>())
    }

    /// A capsule between two points, m.
    pub fn rod(from_m: [f64; 3], to_m: [f64; 3], radius_m: f64) -> Self {
        let along: [f64; 3] = std::array::from_fn(|a| to_m[a] - from_m[a]);
        let length = norm(along);
        let z = if length > 0.0 { along.map(|x| x / length) } else { [0.0, 0.0, 1.0] };
        let other = if z[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let x = cross(other, z);
        let x = x.map(|value| value / norm(x));
        let y = cross(z, x);
        let rotation = std::array::from_fn(|a| [x[a], y[a], z[a]]);
        Self::capsule(radius_m, length).placed(&rotation, std::array::from_fn(|a| 0.5 * (from_m[a] + to_m[a])))
    }

    /// The surface of a profile of radius and height, from the lower to the upper end, turned about z.
    fn turned(profile: &[[f64; 2]]) -> Self {
        let mut surface = Self::default();
        for &[radius, height] in profile {
            for side in 0..SIDES {
                let (sin, cos) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
                surface.vertices_m.push([radius * cos, radius * sin, height]);
            }
        }
        let sides = SIDES as u32;
        for ring in 0..profile.len().saturating_sub(1) as u32 {
            for side in 0..sides {
                let [a, b] = [ring * sides + side, ring * sides + (side + 1) % sides];
                surface.triangles.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
            }
        }
        // Triangles at a pole of the surface have no area, so they are removed.
        surface.merged(|vertex| vertex.map(|x| (x * 1e9).round() as i64))
    }

    /// The surface turned by `rotation` (rows) and moved by `translation_m`.
    #[must_use]
    pub fn placed(mut self, rotation: &[[f64; 3]; 3], translation_m: [f64; 3]) -> Self {
        for vertex in &mut self.vertices_m {
            *vertex = std::array::from_fn(|a| dot(rotation[a], *vertex) + translation_m[a]);
        }
        self
    }

    /// Adds another surface.
    pub fn join(&mut self, other: &Self) {
        let first = self.vertices_m.len() as u32;
        self.vertices_m.extend_from_slice(&other.vertices_m);
        self.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
    }

    /// Volume of the enclosed space, m³; negative if the triangles are oriented inwards.
    pub fn volume_m3(&self) -> f64 {
        self.triangles.iter().map(|corners| self.corners(*corners)).map(|[a, b, c]| dot(a, cross(b, c)) / 6.0).sum()
    }

    /// The surface with at most `triangles` triangles: all vertices in a cell of a grid become their mean (Rossignac
    /// and Borrel 1993). The cells are as small as this number of triangles allows, within a factor of 1.1.
    #[must_use]
    pub fn within(&self, triangles: usize) -> Self {
        let [low, high] = self.bounds_m();
        let extent = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let mut cell = extent / 512.0;
        let mut coarse = self.clone();
        while coarse.triangles.len() > triangles && cell <= extent {
            coarse = self.merged(|vertex| std::array::from_fn(|a| ((vertex[a] - low[a]) / cell).floor() as i64));
            cell *= 1.1;
        }
        coarse
    }

    /// Lowest and highest coordinates, m; both zero for an empty surface.
    pub fn bounds_m(&self) -> [[f64; 3]; 2] {
        let first = self.vertices_m.first().copied().unwrap_or_default();
        self.vertices_m.iter().fold([first; 2], |[low, high], vertex| {
            [std::array::from_fn(|a| low[a].min(vertex[a])), std::array::from_fn(|a| high[a].max(vertex[a]))]
        })
    }

    pub(crate) fn corners(&self, triangle: [u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|corner| self.vertices_m[corner as usize])
    }

    /// Merges vertices with the same key; triangles with two equal vertices are omitted.
    fn merged(&self, key: impl Fn([f64; 3]) -> [i64; 3]) -> Self {
        let mut places: BTreeMap<[i64; 3], usize> = BTreeMap::new();
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        let mut place_of = Vec::with_capacity(self.vertices_m.len());
        for &vertex in &self.vertices_m {
            let place = *places.entry(key(vertex)).or_insert(sums.len());
            if place == sums.len() {
                sums.push(([0.0; 3], 0.0));
            }
            let (sum, count) = &mut sums[place];
            *sum = std::array::from_fn(|a| sum[a] + vertex[a]);
            *count += 1.0;
            place_of.push(place as u32);
        }
        let mut triangles: Vec<[u32; 3]> =
            self.triangles.iter().map(|t| t.map(|corner| place_of[corner as usize])).collect();
        triangles.retain(|[a, b, c]| a != b && b != c && a != c);
        triangles.sort_unstable();
        triangles.dedup();
        Self { vertices_m: sums.into_iter().map(|(sum, count)| sum.map(|x| x / count)).collect(), triangles }
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}
