//! Exact test whether two triangle surfaces are closer than a distance, with a tree of bounding boxes.

use super::convex::{Placed, hull_distance};
use dynident_model::collision::Solid;
use dynident_model::{Transform, Vec3};

const MAX_LEAF_ELEMENTS: usize = 4;

#[derive(Clone, Debug)]
struct Element {
    first: usize,
    end: usize,
    radius_m: f64,
}

#[derive(Clone, Debug)]
struct Node {
    centre: Vec3,
    half: Vec3,
    below: Children,
}

#[derive(Clone, Copy, Debug)]
enum Children {
    Nodes([usize; 2]),
    Elements(usize, usize),
}

#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    corners: Vec<Vec3>,
    elements: Vec<Element>,
    nodes: Vec<Node>,
}

impl Surface {
    pub(super) fn new<'a>(solids: impl IntoIterator<Item = &'a Solid>) -> Self {
        let mut surface = Self::default();
        for solid in solids {
            let Solid { corners_m, radius_m, triangles } = solid;
            for triangle in triangles {
                surface.add(triangle.iter().map(|place| corners_m[*place as usize]), *radius_m);
            }
            if triangles.is_empty() {
                surface.add(corners_m.iter().copied(), *radius_m);
            }
        }
        let mut order: Vec<usize> = (0..surface.elements.len()).collect();
        if !order.is_empty() {
            surface.nodes.push(surface.node(&order));
            surface.split(0, &mut order, 0);
            surface.elements = order.iter().map(|place| surface.elements[*place].clone()).collect();
        }
        surface
    }

    fn add(&mut self, corners: impl Iterator<Item = Vec3>, radius_m: f64) {
        let first = self.corners.len();
        self.corners.extend(corners);
        if self.corners.len() > first {
            self.elements.push(Element { first, end: self.corners.len(), radius_m });
        }
    }

    fn node(&self, elements: &[usize]) -> Node {
        let (mut low, mut high) = (Vec3([f64::INFINITY; 3]), Vec3([f64::NEG_INFINITY; 3]));
        for place in elements {
            let Element { first, end, radius_m } = self.elements[*place];
            for corner in &self.corners[first..end] {
                for axis in 0..3 {
                    low[axis] = low[axis].min(corner[axis] - radius_m);
                    high[axis] = high[axis].max(corner[axis] + radius_m);
                }
            }
        }
        Node { centre: (low + high).scale(0.5), half: (high - low).scale(0.5), below: Children::Elements(0, 0) }
    }

    /// Splits a node at the median along its longest axis; `order` contains its elements, the first of which has index
    /// `start`.
    fn split(&mut self, node: usize, order: &mut [usize], start: usize) {
        if order.len() <= MAX_LEAF_ELEMENTS {
            self.nodes[node].below = Children::Elements(start, start + order.len());
            return;
        }
        let half = self.nodes[node].half;
        let axis = (0..3).fold(0, |best, axis| if half[axis] > half[best] { axis } else { best });
        let middle = |place: usize| {
            let Element { first, end, .. } = self.elements[place];
            let sum: f64 = self.corners[first..end].iter().map(|corner| corner[axis]).sum();
            sum / (end - first) as f64
        };
        order.sort_by(|a, b| middle(*a).total_cmp(&middle(*b)).then(a.cmp(b)));
        let (lower, upper) = order.split_at_mut(order.len() / 2);
        let below = [self.nodes.len(), self.nodes.len() + 1];
        let nodes = [self.node(lower), self.node(upper)];
        self.nodes.extend(nodes);
        self.nodes[node].below = Children::Nodes(below);
        let between = start + lower.len();
        self.split(below[0], lower, start);
        self.split(below[1], upper, between);
    }

    /// Whether the distance to the other surface is at most `distance_m` (0: the surfaces touch). A surface
    /// completely inside a closed surface is not treated as close.
    pub(super) fn is_within(&self, at: &Transform, other: &Self, other_at: &Transform, distance_m: f64) -> bool {
        if self.nodes.is_empty() || other.nodes.is_empty() {
            return false;
        }
        let here_from_other = at.inverse().then(other_at);
        let mut stack = vec![(0, 0)];
        while let Some((first, second)) = stack.pop() {
            let (a, b) = (&self.nodes[first], &other.nodes[second]);
            if apart(a, b, &here_from_other) > distance_m {
                continue;
            }
            match (a.below, b.below) {
                (Children::Elements(from, to), Children::Elements(other_from, other_to)) => {
                    for one in &self.elements[from..to] {
                        for two in &other.elements[other_from..other_to] {
                            let corners = [&self.corners[one.first..one.end], &other.corners[two.first..two.end]];
                            let placed = [
                                Placed { corners: corners[0], at: &Transform::IDENTITY },
                                Placed { corners: corners[1], at: &here_from_other },
                            ];
                            let enough = distance_m + one.radius_m + two.radius_m;
                            let found = hull_distance(placed[0], placed[1], enough, &mut Vec3::ZERO.clone());
                            if found.distance_m <= enough {
                                return true;
                            }
                        }
                    }
                }
                (Children::Nodes(below), Children::Elements(..)) => stack.extend(below.map(|node| (node, second))),
                (Children::Elements(..), Children::Nodes(below)) => stack.extend(below.map(|node| (first, node))),
                (Children::Nodes(below), Children::Nodes(other_below)) => {
                    if a.half.dot(a.half) >= b.half.dot(b.half) {
                        stack.extend(below.map(|node| (node, second)));
                    } else {
                        stack.extend(other_below.map(|node| (first, node)));
                    }
                }
            }
        }
        false
    }
}

/// Lower bound of the distance of two boxes; the second is replaced by its bounding box along the first one's axes.
fn apart(a: &Node, b: &Node, here_from_other: &Transform) -> f64 {
    let centre = here_from_other.point(b.centre) - a.centre;
    let rows = &here_from_other.rotation.0;
    let gap: [f64; 3] = core::array::from_fn(|axis| {
        let reach: f64 = (0..3).map(|k| rows[axis][k].abs() * b.half[k]).sum();
        (centre[axis].abs() - a.half[axis] - reach).max(0.0)
    });
    Vec3(gap).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::Mat3;
    use dynident_model::sample::Random;

    fn sheet(random: &mut Random, steps: u32) -> Solid {
        let corner = |random: &mut Random, i: u32, j: u32| {
            Vec3([f64::from(i), f64::from(j), random.uniform(0.0, 1.5)]).scale(1.0 / f64::from(steps))
        };
        let count = steps + 1;
        let corners_m: Vec<Vec3> = (0..count * count).map(|k| corner(random, k / count, k % count)).collect();
        let square = |k: u32| {
            let (i, j) = (k / steps, k % steps);
            let at = |i: u32, j: u32| i * count + j;
            [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]]
        };
        Solid { corners_m, radius_m: 0.0, triangles: (0..steps * steps).flat_map(square).collect() }
    }

    #[test]
    fn the_tree_finds_what_all_pairs_of_triangles_have() {
        let mut random = Random::new(8);
        let [one, two] = [9, 6].map(|steps| sheet(&mut random, steps));
        let [tree, other] = [&one, &two].map(|solid| Surface::new([solid]));
        for _ in 0..60 {
            let at = Transform {
                rotation: Mat3::from_axis_angle(random.direction(), random.uniform(0.0, 3.0)),
                translation: random.direction().scale(random.uniform(0.0, 1.5)),
            };
            let corners = |solid: &Solid| -> Vec<[Vec3; 3]> {
                solid.triangles.iter().map(|t| t.map(|place| solid.corners_m[place as usize])).collect()
            };
            let mut least = f64::INFINITY;
            for a in corners(&one) {
                for b in corners(&two) {
                    let placed = [Placed { corners: &a, at: &at }, Placed { corners: &b, at: &Transform::IDENTITY }];
                    let apart = hull_distance(placed[0], placed[1], f64::INFINITY, &mut Vec3::ZERO.clone());
                    least = least.min(apart.distance_m);
                }
            }
            for (distance, within) in [(least + 1e-6, true), (least - 1e-6, false)] {
                assert_eq!(tree.is_within(&at, &other, &Transform::IDENTITY, distance), within, "{least}");
            }
        }
    }
}
