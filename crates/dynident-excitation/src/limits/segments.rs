//! Distance between two line segments, with the nearest points.

use dynident_model::Vec3;

/// Nearest points of two segments as fractions along each, their distance, and the direction from the second to the
/// first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SegmentDistance {
    /// Fraction along the first segment, 0 to 1.
    pub along_first: f64,
    /// Fraction along the second segment, 0 to 1.
    pub along_second: f64,
    /// Distance, m.
    pub distance_m: f64,
    /// Unit vector from the second point to the first; for intersecting segments a unit vector normal to both.
    pub direction: Vec3,
}

/// Distance of the segments `first[0]`-`first[1]` and `second[0]`-`second[1]`, which can be parallel or points.
///
/// The squared distance is convex in the two fractions. Its minimum over the unit square is the stationary point if
/// that is inside. Otherwise it lies on one of the four edges, each of which is the distance of an end point from the
/// other segment (compare Ericson, *Real-Time Collision Detection* (2005), section 5.1.9). All five candidates are
/// evaluated, so that no case depends on a threshold for parallelism. Among equal candidates the middle is chosen,
/// for parallel segments the middle of their overlap. By the envelope theorem the distance changes only with the
/// motion of the two nearest points along [`direction`](SegmentDistance::direction).
pub(crate) fn segment_distance(first: [Vec3; 2], second: [Vec3; 2]) -> SegmentDistance {
    let (u, v, w) = (first[1] - first[0], second[1] - second[0], first[0] - second[0]);
    let (uu, uv, vv, uw, vw) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    // Fraction on one segment that is nearest to a fraction on the other; a segment of length zero has only its
    // start.
    let fraction =
        |numerator: f64, length2: f64| if length2 > 0.0 { (numerator / length2).clamp(0.0, 1.0) } else { 0.0 };
    let on_second = |s: f64| fraction(uv * s + vw, vv);
    let on_first = |t: f64| fraction(uv * t - uw, uu);
    let determinant = uu * vv - uv * uv;
    // Parallel segments have no unique stationary point, so an end is used.
    let s = if determinant > 0.0 { ((uv * vw - vv * uw) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let candidates = [
        (on_first(on_second(s)), on_second(s)),
        (0.0, on_second(0.0)),
        (1.0, on_second(1.0)),
        (on_first(0.0), 0.0),
        (on_first(1.0), 1.0),
    ];
    let apart = |(s, t): (f64, f64)| u.scale(s) - v.scale(t) + w;
    let squares = candidates.map(|candidate| {
        let apart = apart(candidate);
        apart.dot(apart)
    });
    let least = squares.iter().copied().fold(f64::INFINITY, f64::min);
    // Tolerance for rounding of the five candidates. Because of convexity, averaging candidates adds no more than
    // this.
    let tied = least * (1.0 + 1e-12);
    // The minimisers of parallel segments are a line in the square, from its lowest to its highest fraction.
    let (mut low, mut high) = (None, None);
    for (&candidate, &square) in candidates.iter().zip(&squares) {
        if square <= tied {
            low = low.filter(|low: &(f64, f64)| low.0 <= candidate.0).or(Some(candidate));
            high = high.filter(|high: &(f64, f64)| high.0 >= candidate.0).or(Some(candidate));
        }
    }
    let at = low.zip(high).map_or(candidates[0], |(low, high)| (0.5 * (low.0 + high.0), 0.5 * (low.1 + high.1)));
    let apart = apart(at);
    let distance_m = apart.norm();
    // If the points differ by less, the difference is rounding and has no direction.
    let scale = uu.max(vv).max(w.dot(w)).sqrt();
    let direction = if distance_m > 1e-14 * scale { apart.scale(1.0 / distance_m) } else { normal_to(u, v) };
    SegmentDistance { along_first: at.0, along_second: at.1, distance_m, direction }
}

/// Unit vector normal to both; for parallel or zero vectors normal to the longer one.
fn normal_to(u: Vec3, v: Vec3) -> Vec3 {
    let unit_axis = |k: usize| Vec3(core::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
    let cross = u.cross(v);
    let longer = if u.dot(u) >= v.dot(v) { u } else { v };
    if cross.norm() > 1e-9 * longer.dot(longer) {
        return cross.scale(1.0 / cross.norm());
    }
    // The axis least aligned with the vector results in the best conditioned normal.
    let least = (0..3).min_by(|&a, &b| longer[a].abs().total_cmp(&longer[b].abs())).unwrap_or(0);
    let normal = longer.cross(unit_axis(least));
    if normal.norm() > 0.0 { normal.scale(1.0 / normal.norm()) } else { unit_axis(2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Minimum of a convex function on 0 to 1 by ternary search: an independent oracle without derivatives.
    fn least(of: &dyn Fn(f64) -> f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..90 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if of(a) < of(b) { high = b } else { low = a }
        }
        of(0.5 * (low + high)).min(of(0.0)).min(of(1.0))
    }

    /// The squared distance is convex in both fractions, and so is its minimum over one of them as a function of the
    /// other.
    fn nested_search(first: [Vec3; 2], second: [Vec3; 2]) -> f64 {
        let point = |ends: [Vec3; 2], s: f64| ends[0].scale(1.0 - s) + ends[1].scale(s);
        let square = |s: f64, t: f64| {
            let apart = point(first, s) - point(second, t);
            apart.dot(apart)
        };
        least(&|s| least(&|t| square(s, t)))
    }

    fn is_the_least(first: [Vec3; 2], second: [Vec3; 2]) -> Result<(), TestCaseError> {
        let found = segment_distance(first, second);
        prop_assert!((0.0..=1.0).contains(&found.along_first) && (0.0..=1.0).contains(&found.along_second));
        let point = |ends: [Vec3; 2], s: f64| ends[0] + (ends[1] - ends[0]).scale(s);
        let attained = (point(first, found.along_first) - point(second, found.along_second)).norm();
        // A few dozen operations on coordinates below 8.
        prop_assert!((found.distance_m - attained).abs() < 1e-12, "{} {attained}", found.distance_m);
        let (square, expected) = (found.distance_m * found.distance_m, nested_search(first, second));
        // Tolerances: candidates tie within 1e-12 of the square; the rounding of the search in a flat valley is
        // smaller.
        prop_assert!((square - expected).abs() < 2e-12 * (1.0 + expected), "{square} {expected}");
        Ok(())
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        // Half of the coordinates are on a coarse grid, so that parallel, intersecting and zero-length segments occur.
        let coordinate = prop_oneof![-2.0..2.0_f64, (-2..=2_i32).prop_map(f64::from)];
        [coordinate.clone(), coordinate.clone(), coordinate].prop_map(Vec3)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn is_the_least_distance(a in vector(), b in vector(), c in vector(), d in vector()) {
            is_the_least([a, b], [c, d])?;
            let found = segment_distance([a, b], [c, d]);
            prop_assert!((found.direction.norm() - 1.0).abs() < 1e-9);
            let back = segment_distance([c, d], [a, b]);
            prop_assert!((back.distance_m - found.distance_m).abs() < 1e-12);
        }

        #[test]
        fn nearly_parallel_segments_are_no_special_case(
            a in vector(), u in vector(), gap in vector(), tilt in vector(), small in -16.0..-2.0_f64,
        ) {
            is_the_least([a, a + u], [a + gap, a + gap + u + tilt.scale(10_f64.powf(small))])?;
        }
    }

    #[test]
    fn parallel_segments_touch_in_the_middle_of_their_overlap() {
        let at = |x: f64, y: f64| Vec3([x, y, 0.0]);
        let found = segment_distance([at(0.0, 0.0), at(2.0, 0.0)], [at(1.0, 0.5), at(3.0, 0.5)]);
        assert_eq!(found.distance_m, 0.5);
        assert!((found.along_first - 0.75).abs() < 1e-15 && (found.along_second - 0.25).abs() < 1e-15, "{found:?}");
        assert_eq!(found.direction, at(0.0, -1.0));
    }
}
