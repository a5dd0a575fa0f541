//! Intervals of standard parameters that respect what is physically consistent: how far can a mass, a moment of
//! inertia, a friction go before the data object, every body and term staying physically consistent?

use super::description::{BaseMap, PhysicalProblem, expect, finite};
use super::fit::{PhysicalFit, physical_fit_near};
use super::interior_point::OnTheWay;
use super::{PhysicalError, PhysicalSettings};
use crate::uncertainty::student_half_width;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Settings of [`ConsistentIntervals`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IntervalSettings {
    /// Confidence level of each interval. Default 0.95.
    pub level: f64,
    /// The solver, its margin and its prior. The prior only chooses among bodies that the data and the pull leave
    /// alike; its weight is far below that of a fit: 1e-5 by default.
    pub physical: PhysicalSettings,
    /// An end counts as open beyond this many times the size of the reference (the body's own moments, a scalar's
    /// `scale`). Default 100.
    pub open_beyond: f64,
    /// Most physical fits for one end. Default 20; three or four are usual.
    pub max_fits: usize,
}

impl Default for IntervalSettings {
    fn default() -> Self {
        let physical = PhysicalSettings { prior_weight: 1.0e-5, ..PhysicalSettings::default() };
        Self { level: 0.95, physical, open_beyond: 100.0, max_fits: 20 }
    }
}

impl IntervalSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`PhysicalError::Setting`] for a level outside 0.5 to 0.9999, a size below 10, fewer than three fits, or as
    /// [`PhysicalSettings::validate`].
    pub fn validate(&self) -> Result<(), PhysicalError> {
        self.physical.validate()?;
        let error = |setting, value, fix| Err(PhysicalError::Setting { setting, value, fix });
        if !(0.5..=0.9999).contains(&self.level) {
            return error("level", self.level, "give a level from 0.5 to 0.9999, such as 0.95");
        }
        if !(10.0..=1.0e9).contains(&self.open_beyond) {
            return error("open_beyond", self.open_beyond, "give 10 to 1e9 times the reference's size");
        }
        if self.max_fits < 3 {
            return error("max_fits", self.max_fits as f64, "give at least 3");
        }
        Ok(())
    }
}

/// What holds an end of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IntervalEnd {
    /// Beyond it the data are fitted too badly.
    Data,
    /// Beyond it nothing is physically consistent that the data allow: the body's cone or a limit stops it before the
    /// data's cost reaches its threshold.
    Constraint,
    /// Neither holds it: the value can be as large as one likes.
    Open,
    /// The fits were used up: the value may go farther than is said.
    Unsettled,
}

/// An interval of one standard parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ConsistentInterval {
    /// The value of the consistent set that fits best.
    pub value: f64,
    /// Lower end; none where it is open.
    pub lower: Option<f64>,
    /// Upper end; none where it is open.
    pub upper: Option<f64>,
    /// What holds the lower and the upper end.
    pub held_by: [IntervalEnd; 2],
}

/// Profile-likelihood intervals of standard parameters within the constraints of a [`PhysicalProblem`]:
///
/// ```text
///     { p : min over consistent π with π_i = p of ½‖R₁ B π − ρ₁‖²  ≤  C_min + ½ t² κ_i }
/// ```
///
/// C_min belongs to the best consistent set, t is Student's quantile, and κ_i is how much larger than for white
/// residuals the variance of what the data say in the direction of π_i is, `κ_i = gᵀΣg / gᵀ(R₁ᵀR₁)⁻¹g`, from the
/// covariance Σ of the base parameters that is thought honest. Without active constraints this is the usual interval
/// `π̂_i ± t σ_i`; an end that only physics holds is said to be so, and one that nothing holds is open. Profile
/// likelihood: Venzon and Moolgavkar, Applied Statistics 37 (1988) 87; here every profile is a convex problem, solved
/// by pulling the parameter with a spring and moving the spring's other end.
#[derive(Clone, Debug)]
pub struct ConsistentIntervals {
    problem: PhysicalProblem,
    settings: IntervalSettings,
    best: PhysicalFit,
    /// Where the fits of pulled parameters begin; none where the best set's was not found in this way.
    on_the_way: Option<OnTheWay>,
    quantile: f64,
    information: DMatrix<f64>,
    covariance: Option<DMatrix<f64>>,
    mean_inflation: f64,
    /// Rough standard deviation of each standard parameter, constraints aside; large where no data are.
    deviations: Vec<f64>,
    sizes: Vec<f64>,
}

impl ConsistentIntervals {
    /// The best consistent set, from which intervals are then measured. `covariance` of the base parameters, shape
    /// (base, base), replaces that of white residuals; `degrees_of_freedom` are those of Student's distribution.
    ///
    /// # Errors
    /// [`PhysicalError::Setting`], [`PhysicalError::Mismatch`], [`PhysicalError::NotFinite`], and those of
    /// [`physical_fit`](super::physical_fit).
    pub fn new(
        problem: &PhysicalProblem,
        covariance: Option<&DMatrix<f64>>,
        degrees_of_freedom: f64,
        settings: IntervalSettings,
    ) -> Result<Self, PhysicalError> {
        settings.validate()?;
        let base = problem.base.matrix().nrows();
        if let Some(covariance) = covariance {
            expect("rows of the covariance", base, covariance.nrows())?;
            expect("columns of the covariance", base, covariance.ncols())?;
            finite("an entry of the covariance", covariance.as_slice())?;
        }
        let (best, on_the_way) = physical_fit_near(problem, &settings.physical, None)?;
        let information = problem.triangle.transpose() * &problem.triangle;
        let sizes = sizes(problem);
        // What is known of π without constraints, beside the weakest of priors: information in units of the sizes.
        let map = problem.base.matrix();
        let scaled = DMatrix::from_fn(map.nrows(), map.ncols(), |i, j| map[(i, j)] * sizes[j]);
        let mut hessian = scaled.transpose() * &information * &scaled;
        let weakest = 1.0 / settings.open_beyond.powi(2);
        for k in 0..hessian.nrows() {
            hessian[(k, k)] += weakest;
        }
        let inverse = hessian.cholesky().map(|factor| factor.inverse());
        let deviations = (0..sizes.len())
            .map(|k| sizes[k] * inverse.as_ref().map_or(1.0, |inverse| inverse[(k, k)].max(0.0).sqrt()))
            .collect();
        let mean_inflation = covariance.map_or(1.0, |covariance| mean_inflation(covariance, &information));
        Ok(Self {
            quantile: student_half_width(settings.level, degrees_of_freedom),
            problem: problem.clone(),
            covariance: covariance.cloned(),
            settings,
            best,
            on_the_way,
            information,
            mean_inflation,
            deviations,
            sizes,
        })
    }

    /// The best consistent set that all intervals hold.
    pub fn best(&self) -> &PhysicalFit {
        &self.best
    }

    /// The interval of standard parameter `index` (ten for each body, then the scalars). A parameter of a known body
    /// has no width.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] if there is no such parameter, and those of [`physical_fit`](super::physical_fit).
    pub fn of(&self, index: usize) -> Result<ConsistentInterval, PhysicalError> {
        if index >= self.sizes.len() {
            return Err(PhysicalError::Mismatch {
                what: "index of a standard parameter, below".into(),
                expected: self.sizes.len(),
                found: index,
            });
        }
        let value = self.best.parameters[index];
        let known = self.problem.bodies.get(index / 10).is_some_and(|body| body.known.is_some());
        if known {
            let held_by = [IntervalEnd::Constraint; 2];
            return Ok(ConsistentInterval { value, lower: Some(value), upper: Some(value), held_by });
        }
        let (lower, below) = self.end(index, -1.0)?;
        let (upper, above) = self.end(index, 1.0)?;
        Ok(ConsistentInterval { value, lower, upper, held_by: [below, above] })
    }

    /// One end. The parameter is pulled by a spring whose other end moves out until the data's cost has risen by the
    /// threshold: √cost rises with the spring's end, in proportion as long as no constraint joins in.
    fn end(&self, index: usize, side: f64) -> Result<(Option<f64>, IntervalEnd), PhysicalError> {
        let (value, size) = (self.best.parameters[index], self.sizes[index]);
        let far = self.settings.open_beyond * size;
        // Where data say little the spring is as soft as the reference is large, so that no fit starts far outside of
        // what is physically consistent.
        let softness = self.deviations[index].clamp(1.0e-9 * size, size);
        let guess = self.quantile * self.mean_inflation.sqrt();
        // Unconstrained, a parameter with this deviation gives way by half of it.
        let mut reach = 2.0 * guess * softness;
        let mut wanted = None;
        let mut below = Point { reach: 0.0, root: 0.0, parameter: value };
        let mut above: Option<Point> = None;
        // Where the solver gave up: a pull so strong that doubles cannot determine the cost beside it.
        let mut hopeless = f64::INFINITY;
        // Each fit begins near the one before, which the same spring pulled less or more.
        let mut near = self.on_the_way.clone();
        for _ in 0..self.settings.max_fits {
            let Some((parameter, moved)) = self.pulled(index, 1.0 / softness, value + side * reach, &mut near)? else {
                hopeless = reach;
                if hopeless < 1.2 * below.reach {
                    break;
                }
                reach = 0.5 * (below.reach + hopeless);
                continue;
            };
            let root = (2.0 * (self.cost(&moved) - self.best.data_objective).max(0.0)).sqrt();
            let wanted = *wanted.get_or_insert_with(|| self.quantile * self.inflation(&moved).sqrt());
            let point = Point { reach, root, parameter };
            if (root - wanted).abs() <= CLOSE * wanted {
                return Ok((Some(parameter), IntervalEnd::Data));
            }
            let distance = (parameter - value).abs();
            if root > wanted {
                above = Some(point);
            } else {
                let still = (parameter - below.parameter).abs() <= STILL * distance.max(softness);
                let last = std::mem::replace(&mut below, point);
                if above.is_none() && distance >= far {
                    return Ok((None, IntervalEnd::Open));
                }
                if above.is_none() && still && last.reach > 0.0 && reach >= 2.0 * last.reach {
                    return Ok((Some(parameter), IntervalEnd::Constraint));
                }
            }
            reach = match above {
                Some(above) if (above.parameter - below.parameter).abs() <= CLOSE * (above.parameter - value).abs() => {
                    return Ok((Some(between(below, above, wanted, |point| point.parameter)), IntervalEnd::Data));
                }
                Some(above) => between(below, above, wanted, |point| point.reach),
                None if root > 0.1 * wanted => (reach * 1.1 * wanted / root).clamp(2.0 * reach, GROWTH * reach),
                None => GROWTH * reach,
            };
            reach = reach.min(0.5 * (below.reach + hopeless));
        }
        let parameter = above
            .map_or(below.parameter, |above| between(below, above, wanted.unwrap_or(guess), |point| point.parameter));
        Ok((Some(parameter), IntervalEnd::Unsettled))
    }

    /// The parameter and the shift of the base parameters from the best set, when a spring pulls; none when the solver
    /// did not reach an optimum.
    fn pulled(
        &self,
        index: usize,
        stiffness: f64,
        target: f64,
        near: &mut Option<OnTheWay>,
    ) -> Result<Option<(f64, DVector<f64>)>, PhysicalError> {
        let Self { problem, best, .. } = self;
        let (base, rows) = (problem.base.matrix(), problem.triangle.nrows());
        let (own, all) = base.shape();
        // The parameter itself as one more base parameter, measured to be at the target.
        let mut matrix = DMatrix::zeros(own + 1, all);
        matrix.rows_mut(0, own).copy_from(base);
        matrix[(own, index)] = 1.0;
        let mut triangle = DMatrix::zeros(rows + 1, own + 1);
        triangle.view_mut((0, 0), (rows, own)).copy_from(&problem.triangle);
        triangle[(rows, own)] = stiffness;
        let rotated = problem.rotated.clone().push(stiffness * target);
        let problem = PhysicalProblem { base: BaseMap::new(matrix)?, triangle, rotated, ..problem.clone() };
        let (fit, next) = physical_fit_near(&problem, &self.settings.physical, near.as_ref())?;
        *near = next.or_else(|| near.take());
        let moved = DVector::from_fn(own, |k, _| fit.base_values[k] - best.base_values[k]);
        Ok((fit.kkt_residual() <= SOLVED).then(|| (fit.parameters[index], moved)))
    }

    /// `½‖R₁ θ − ρ₁‖²` at a shift of the base parameters from the best set.
    fn cost(&self, moved: &DVector<f64>) -> f64 {
        let theta = DVector::from_column_slice(&self.best.base_values) + moved;
        0.5 * (&self.problem.triangle * theta - &self.problem.rotated).norm_squared()
    }

    /// κ from the direction in which the base parameters gave way.
    fn inflation(&self, moved: &DVector<f64>) -> f64 {
        let Some(covariance) = &self.covariance else { return 1.0 };
        let direction = &self.information * moved;
        let white = moved.dot(&direction);
        if white < 1.0e-12 {
            return self.mean_inflation;
        }
        let inflation = direction.dot(&(covariance * &direction)) / white;
        if inflation.is_finite() && inflation > 0.0 { inflation } else { self.mean_inflation }
    }
}

/// Relative accuracy of √cost at an end that the data hold: a hundredth of the half width.
const CLOSE: f64 = 0.01;
/// A parameter that moves by less than this share while it is pulled twice as far is held by a constraint.
const STILL: f64 = 1.0e-3;
/// Largest certificate of a fit that counts: the pull's energy is a few thousand, the cost's rise a few units.
const SOLVED: f64 = 1.0e-6;
/// Largest growth of the pull from one fit to the next.
const GROWTH: f64 = 8.0;

/// One point of a profile.
#[derive(Clone, Copy)]
struct Point {
    /// How far out the spring's end is.
    reach: f64,
    /// √(2 rise of the cost).
    root: f64,
    parameter: f64,
}

fn between(below: Point, above: Point, wanted: f64, of: impl Fn(&Point) -> f64) -> f64 {
    // Not nearer to an end than a tenth: the secant of a bent curve creeps otherwise.
    let share = ((wanted - below.root) / (above.root - below.root)).clamp(0.1, 0.9);
    of(&below) + share * (of(&above) - of(&below))
}

/// What is ordinary for each standard parameter: the reference's mass, its mass times its radius of gyration, its
/// moment; a scalar's scale.
fn sizes(problem: &PhysicalProblem) -> Vec<f64> {
    let mut sizes = Vec::new();
    for body in &problem.bodies {
        let [mass, moment] = [body.reference[0], (body.reference[4] + body.reference[7] + body.reference[9]) / 3.0];
        sizes.extend([mass].into_iter().chain([(mass * moment).sqrt(); 3]).chain([moment; 6]));
    }
    sizes.extend(problem.scalars.iter().map(|scalar| scalar.scale));
    sizes
}

/// Mean of the base parameters' variances over those of white residuals; one where the data leave a base parameter
/// without a white variance.
fn mean_inflation(covariance: &DMatrix<f64>, information: &DMatrix<f64>) -> f64 {
    let Some(white) = information.clone().cholesky().map(|factor| factor.inverse()) else { return 1.0 };
    let ratios: Vec<f64> = (0..white.nrows())
        .filter(|&k| white[(k, k)] > 0.0 && covariance[(k, k)] > 0.0)
        .map(|k| covariance[(k, k)] / white[(k, k)])
        .collect();
    if ratios.is_empty() { 1.0 } else { ratios.iter().sum::<f64>() / ratios.len() as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consistent::{PhysicalBody, PhysicalScalar, rough_body};
    use crate::factor::TriangularFactor;

    /// Free quantile of ordinary intervals at many degrees of freedom.
    const T: f64 = 1.959_964;

    fn body() -> PhysicalBody {
        let reference = rough_body(2.0, 0.2);
        PhysicalBody { name: "link".into(), reference, known: None, mass_kg: None, com_box_m: None, inside: None }
    }

    fn friction(name: &str) -> PhysicalScalar {
        PhysicalScalar { name: name.into(), lower: Some(0.0), upper: None, prior: 0.0, scale: 1.0 }
    }

    /// One body and one friction, measured one by one: `(column, value, standard deviation)`.
    fn problem(measured: &[(usize, f64, f64)]) -> PhysicalProblem {
        let count = measured.len();
        let matrix = DMatrix::from_fn(count, 11, |row, column| f64::from(measured[row].0 == column));
        let mut columns = vec![0.0; count * (count + 1)];
        for (row, (_, value, deviation)) in measured.iter().enumerate() {
            columns[row * count + row] = 1.0 / deviation;
            columns[count * count + row] = value / deviation;
        }
        let factor = TriangularFactor::from_rows(count, &columns, count).unwrap();
        PhysicalProblem::new(BaseMap::new(matrix).unwrap(), vec![body()], vec![friction("fv")], &factor).unwrap()
    }

    fn intervals(measured: &[(usize, f64, f64)], covariance: Option<&DMatrix<f64>>) -> ConsistentIntervals {
        ConsistentIntervals::new(&problem(measured), covariance, 1.0e6, IntervalSettings::default()).unwrap()
    }

    /// All ten parameters of a body well inside the cone, and friction.
    fn all(deviation: f64) -> Vec<(usize, f64, f64)> {
        let body = rough_body(2.0, 0.2);
        let mut rows: Vec<_> = (0..10).map(|k| (k, body[k], deviation * if k == 0 { 1.0 } else { 0.1 })).collect();
        rows.push((10, 0.5, 0.1));
        rows
    }

    #[test]
    fn without_active_constraints_they_are_the_usual_intervals() {
        let found = intervals(&all(0.01), None);
        for (index, value, deviation) in all(0.01) {
            let interval = found.of(index).unwrap();
            assert_eq!(interval.held_by, [IntervalEnd::Data; 2], "{index}");
            // CLOSE is a hundredth of the half width; the prior of weight 1e-5 moves less.
            let [lower, upper] = [interval.lower.unwrap(), interval.upper.unwrap()];
            assert!((lower - (value - T * deviation)).abs() < 0.02 * T * deviation, "{index}: {interval:?}");
            assert!((upper - (value + T * deviation)).abs() < 0.02 * T * deviation, "{index}: {interval:?}");
        }
    }

    #[test]
    fn an_honest_covariance_widens_them() {
        let white = DMatrix::from_diagonal(&DVector::from_iterator(11, all(0.01).iter().map(|row| row.2.powi(2))));
        let mut honest = white;
        honest[(10, 10)] *= 9.0;
        let found = intervals(&all(0.01), Some(&honest));
        let [friction, mass] = [10, 0].map(|index| found.of(index).unwrap());
        // The lower end meets zero before 0.5 - 3 * 0.196; the upper is free.
        assert_eq!(friction.held_by, [IntervalEnd::Constraint, IntervalEnd::Data]);
        assert!(friction.lower.unwrap().abs() < 1e-3);
        assert!((friction.upper.unwrap() - (0.5 + 3.0 * T * 0.1)).abs() < 0.02 * 3.0 * T * 0.1, "{friction:?}");
        assert!((mass.upper.unwrap() - (2.0 + T * 0.01)).abs() < 0.02 * T * 0.01, "{mass:?}");
    }

    /// Data that say −0.1 ± 0.1 of a friction: the best consistent one is zero, and the profile above it is ½((p +
    /// 0.1)/0.1)² − ½.
    #[test]
    fn friction_that_the_data_want_negative() {
        let mut measured = all(0.01);
        measured[10].1 = -0.1;
        let interval = intervals(&measured, None).of(10).unwrap();
        let upper = -0.1 + 0.1 * (1.0 + T * T).sqrt();
        assert!(interval.value.abs() < 1e-3 && interval.lower.unwrap().abs() < 1e-3, "{interval:?}");
        assert_eq!(interval.held_by[0], IntervalEnd::Constraint);
        assert!((interval.upper.unwrap() - upper).abs() < 0.02 * upper, "{interval:?}");
    }

    /// Mass and first moment measured, inertia not at all: the parallel axis theorem holds it from below, nothing from
    /// above.
    #[test]
    fn an_unmeasured_moment_is_held_by_physical_consistency() {
        let measured = [(0, 2.0, 1e-4), (1, 0.0, 1e-4), (2, 0.6, 1e-4), (3, 0.0, 1e-4), (10, 0.5, 0.1)];
        let found = intervals(&measured, None);
        let interval = found.of(4).unwrap();
        assert_eq!(interval.held_by, [IntervalEnd::Constraint, IntervalEnd::Open], "{interval:?}");
        // Ixx ≥ (m ry)²/m = 0.18; mass and moment give way by their own errors, of which Ixx has √((0.6 · 1e-4)² +
        // (0.09 · 1e-4)²). The margin of 1e-4 reference bodies lies above it, and an end is as exact as a thousandth of
        // the half width: 2e-4 in all.
        let expected = 0.18 - T * 6.07e-5;
        assert!((interval.lower.unwrap() - expected).abs() < 2e-4, "{interval:?}");
        // A product of inertia nobody measured is open on both sides.
        assert_eq!(found.of(5).unwrap().held_by, [IntervalEnd::Open; 2]);
    }

    /// Only Ixx measured: of a body with Ixx = Σyy + Σzz, |Σyz| is at most half of it, and the sums are no less than
    /// the margin; what involves x is open.
    #[test]
    fn one_moment_holds_what_it_contains() {
        let found = intervals(&[(4, 0.02, 1e-6), (10, 0.5, 0.1)], None);
        let product = found.of(8).unwrap();
        assert_eq!(product.held_by, [IntervalEnd::Constraint; 2]);
        for end in [-product.lower.unwrap(), product.upper.unwrap()] {
            // A prior of weight 1e-5 and the margin keep it off the boundary by less than a hundredth.
            assert!((end - 0.01).abs() < 1e-4, "{product:?}");
        }
        let mass = found.of(0).unwrap();
        assert_eq!(mass.held_by, [IntervalEnd::Constraint, IntervalEnd::Open], "{mass:?}");
        assert!((0.0..1e-3).contains(&mass.lower.unwrap()), "{mass:?}");
    }

    #[test]
    fn wrong_input_is_named() {
        let found = intervals(&all(0.01), None);
        assert!(matches!(found.of(11), Err(PhysicalError::Mismatch { .. })));
        let settings = IntervalSettings { level: 1.0, ..IntervalSettings::default() };
        assert!(ConsistentIntervals::new(&problem(&all(0.01)), None, 10.0, settings).is_err());
        let wrong = DMatrix::identity(3, 3);
        assert!(
            ConsistentIntervals::new(&problem(&all(0.01)), Some(&wrong), 10.0, IntervalSettings::default()).is_err()
        );
    }
}
