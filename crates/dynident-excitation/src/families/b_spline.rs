//! Quintic B-splines, exactly at rest at both ends.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use serde::{Deserialize, Serialize};

const NAME: &str = "b_spline";
const DEGREE: usize = 5;

/// Settings of a [`BSpline`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct BSplineSettings {
    /// Number of control points n, including those at the ends. Default 14.
    pub control_points: usize,
    /// Whether the motion ends at its start position. Default true.
    pub returns: bool,
}

impl Default for BSplineSettings {
    fn default() -> Self {
        Self { control_points: 14, returns: true }
    }
}

impl BSplineSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// Fewer than 7 control points (with 6 a returning motion cannot move), or more than 1000.
    pub fn validate(&self) -> Result<(), FamilyError> {
        let fix = "give 7 to 1000";
        require((7..=MAX_COUNT).contains(&self.control_points), NAME, "control_points", self.control_points as f64, fix)
    }
}

/// q(t) = Σ_i P_i N_i(t) with B-splines of degree 5 on equally spaced knots, the end knots six-fold.
///
/// The first three control points are equal, and so are the last three, so that q̇ = q̈ = 0 exactly at both ends. If
/// the motion returns (q(T) = q(0)), all six are equal and n - 5 parameters per joint are free: the end posture, then
/// P_3 .. P_(n-4), all in rad (m). Otherwise n - 4 parameters are free: start, end, then the inner control points.
/// Every control point acts on only six spans, so the cost per sample does not depend on n. Positions are weighted
/// means of control points and stay between the smallest and the largest.
///
/// # Source
/// de Boor, A Practical Guide to Splines (2001), chapters IX and X; The NURBS Book (Piegl and Tiller 1997), Eqs. 2.5
/// and 2.7.
pub type BSpline = LinearFamily<BSplineBasis>;

/// Basis functions of a [`BSpline`] family.
#[derive(Clone, Debug)]
pub struct BSplineBasis {
    settings: BSplineSettings,
    duration_s: f64,
}

impl BSpline {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`BSplineSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &BSplineSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate()?;
        Ok(Self::of(BSplineBasis { settings: settings.clone(), duration_s }, joints, duration_s))
    }
}

impl BSplineBasis {
    fn ends(&self) -> usize {
        if self.settings.returns { 1 } else { 2 }
    }

    /// Knot `index` of the clamped knot vector, in units of a span.
    fn knot(&self, index: usize) -> f64 {
        index.saturating_sub(DEGREE).min(self.settings.control_points - DEGREE) as f64
    }

    /// First of the six control points that act at `x` (in spans), and their functions with three derivatives by x.
    fn functions(&self, x: f64) -> (usize, [[f64; 4]; DEGREE + 1]) {
        let spans = self.settings.control_points - DEGREE;
        let span = (x as usize).min(spans - 1) + DEGREE;
        // Row `degree` of Cox and de Boor's triangle: functions span - degree ..= span.
        let mut triangle = [[0.0; DEGREE + 1]; DEGREE + 1];
        triangle[0][0] = 1.0;
        for degree in 1..=DEGREE {
            for position in 0..degree {
                // The function of the next lower degree that begins at knot `first`.
                let first = span + 1 + position - degree;
                let (from, to) = (self.knot(first), self.knot(first + degree));
                let part = triangle[degree - 1][position] / (to - from);
                triangle[degree][position] += (to - x) * part;
                triangle[degree][position + 1] += (x - from) * part;
            }
        }
        let mut out = [[0.0; 4]; DEGREE + 1];
        for order in 0..4 {
            // Each derivative raises the degree by one and takes differences (Eq. 2.7).
            let mut values = triangle[DEGREE - order];
            for degree in DEGREE - order + 1..=DEGREE {
                let mut raised = [0.0; DEGREE + 1];
                for position in 0..degree {
                    let first = span + 1 + position - degree;
                    let slope = degree as f64 * values[position] / (self.knot(first + degree) - self.knot(first));
                    raised[position] -= slope;
                    raised[position + 1] += slope;
                }
                values = raised;
            }
            for (function, value) in out.iter_mut().zip(values) {
                function[order] = value;
            }
        }
        (span - DEGREE, out)
    }
}

impl Basis for BSplineBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        self.settings.control_points - 6 + self.ends()
    }

    fn row(&self, _joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        let (points, ends) = (self.settings.control_points, self.ends());
        let per_span = (points - DEGREE) as f64 / self.duration_s;
        let (first, functions) = self.functions(time_s * per_span);
        let scales = [1.0, per_span, per_span.powi(2), per_span.powi(3)];
        // The sum of all functions is 1. With one parameter for both ends, its function is 1 minus the others, and
        // exactly zero where no function of the ends is nonzero.
        let of_ends = ends == 1 && (first < 3 || first + DEGREE + 3 >= points);
        if of_ends {
            out[0][0] = 1.0;
        }
        for (offset, function) in functions.iter().enumerate() {
            let point = first + offset;
            for order in 0..4 {
                let value = function[order] * scales[order];
                if (3..points - 3).contains(&point) {
                    out[point - 3 + ends][order] += value;
                    if of_ends {
                        out[0][order] -= value;
                    }
                } else if ends == 2 {
                    out[usize::from(point >= 3)][order] += value;
                }
            }
        }
    }

    fn standing(&self) -> Vec<f64> {
        vec![1.0; self.columns()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Motion;
    use crate::families::check;
    use crate::family::Family;
    use proptest::prelude::*;

    #[test]
    fn free_numbers() {
        for (control_points, returns, numbers) in [(14, true, 9), (40, true, 35), (14, false, 10)] {
            let settings = BSplineSettings { control_points, returns };
            assert_eq!(BSpline::new(1, 10.0, &settings).unwrap().parameters(), numbers);
        }
    }

    /// In the middle of a long spline the functions are cardinal B-splines (Schoenberg): N(k) = 1, 26, 66, 26, 1 over
    /// 120 at the knots, slopes 5, 50, 0, -50, -5 over 120.
    #[test]
    fn cardinal_values() {
        let settings = BSplineSettings { control_points: 25, returns: true };
        let family = BSpline::new(1, 20.0, &settings).unwrap();
        let mut parameters = vec![0.0; family.parameters()];
        parameters[12 - 2] = 120.0;
        let mut motion = Motion::default();
        family.motion(&parameters, &[7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0], &mut motion);
        for (sample, (value, slope)) in
            [(0.0, 0.0), (1.0, 5.0), (26.0, 50.0), (66.0, 0.0), (26.0, -50.0), (1.0, -5.0), (0.0, 0.0)]
                .iter()
                .enumerate()
        {
            assert!((motion.q[sample] - value).abs() < 1e-12 && (motion.dq[sample] - slope).abs() < 1e-12);
        }
    }

    /// At most six functions are nonzero away from the ends, and the sum of all is one everywhere.
    #[test]
    fn supports_are_six_spans() {
        let basis = BSplineBasis { settings: BSplineSettings { control_points: 80, returns: true }, duration_s: 10.0 };
        for sample in 0..=200 {
            let time_s = f64::from(sample) * 0.05;
            let mut row = vec![[0.0; 4]; basis.columns()];
            basis.row(0, time_s, &mut row);
            let sum: f64 = row.iter().map(|function| function[0]).sum();
            assert!((sum - 1.0).abs() < 1e-14, "{time_s} {sum}");
            let acting = row.iter().filter(|function| function.iter().any(|value| *value != 0.0)).count();
            assert!(acting <= 6, "{time_s}: {acting}");
            assert!(row[0] == [0.0; 4] || !(0.41..9.59).contains(&time_s), "{time_s}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn exact(seed in any::<u64>(), control_points in 7_usize..30, returns in any::<bool>()) {
            let family = BSpline::new(2, 4.0, &BSplineSettings { control_points, returns }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::curvature(&family, seed);
            check::rest(&family, seed);
        }

        #[test]
        fn stays_between_its_control_points(seed in any::<u64>(), control_points in 7_usize..30) {
            let family = BSpline::new(1, 4.0, &BSplineSettings { control_points, returns: false }).unwrap();
            let parameters = check::start(&family, seed);
            let [low, high] = parameters.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(*p), h.max(*p)]);
            let times: Vec<f64> = (0..=200).map(|s| f64::from(s) * 0.02).collect();
            let mut motion = Motion::default();
            family.motion(&parameters, &times, &mut motion);
            prop_assert!(motion.q.iter().all(|q| (low - 1e-12..=high + 1e-12).contains(q)));
        }
    }
}
