//! Confidence intervals of standard parameters (mass, moment of inertia, friction) within the physically consistent
//! sets.

use super::assembly::AssembledProgram;
use super::conic::Program;
use super::description::{PhysicalProblem, expect, finite};
use super::fit::{PhysicalFit, physical_fit_with_path};
use super::interior_point::{CentralPath, Iterate, Next, interior_point_within_limit};
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
    /// Solver, margin and prior. The prior only selects among bodies that fit the data equally well, so its default
    /// weight, 1e-5, is far below that of a fit.
    pub physical: PhysicalSettings,
    /// An end of an interval is open if its distance from the best value exceeds this multiple of the typical size of
    /// the parameter (from the reference body; for a scalar its `scale`). Default 100.
    pub open_beyond: f64,
    /// Maximum number of iterations per end. Each computes the threshold again from the change of the residuals at
    /// the previous end. Default 5; one or two are usual.
    pub max_limits: usize,
}

impl Default for IntervalSettings {
    fn default() -> Self {
        let physical = PhysicalSettings { prior_weight: 1.0e-5, ..PhysicalSettings::default() };
        Self { level: 0.95, physical, open_beyond: 100.0, max_limits: 5 }
    }
}

impl IntervalSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`PhysicalError::Setting`] for a level outside 0.5 to 0.9999, a size below 10, zero thresholds, or as
    /// [`PhysicalSettings::validate`].
    pub fn validate(&self) -> Result<(), PhysicalError> {
        self.physical.validate()?;
        let error = |setting, value, fix| Err(PhysicalError::Setting { setting, value, fix });
        if !(0.5..=0.9999).contains(&self.level) {
            return error("level", self.level, "use a level from 0.5 to 0.9999, for example 0.95");
        }
        if !(10.0..=1.0e9).contains(&self.open_beyond) {
            return error("open_beyond", self.open_beyond, "use 10 to 1e9 times the size of the reference");
        }
        if self.max_limits == 0 {
            return error("max_limits", 0.0, "use at least 1");
        }
        Ok(())
    }
}

/// The limit that determines an end of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IntervalEnd {
    /// The data: beyond this value the fit is significantly worse.
    Data,
    /// Physical consistency: the body's cone or a limit is reached before the data's threshold.
    Constraint,
    /// Nothing: the value is unbounded.
    Open,
    /// The solver did not converge: the true end may be farther out.
    Unsettled,
}

/// Confidence interval of one standard parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ConsistentInterval {
    /// Value of the best consistent set.
    pub value: f64,
    /// Lower end; `None` if open.
    pub lower: Option<f64>,
    /// Upper end; `None` if open.
    pub upper: Option<f64>,
    /// The limits that determine the lower and the upper end.
    pub held_by: [IntervalEnd; 2],
}

/// Profile-likelihood intervals of standard parameters within the constraints of a [`PhysicalProblem`]:
///
/// ```text
///     { p : min over consistent π with π_i = p of ½‖R₁ B π − ρ₁‖²  ≤  C_min + ½ t² κ_i }
/// ```
///
/// C_min is the cost of the best consistent set and t Student's quantile. κ_i is the factor by which correlated
/// residuals increase the variance in the direction of π_i, `κ_i = gᵀΣg / gᵀ(R₁ᵀR₁)⁻¹g`, from the covariance Σ of the
/// base parameters. Without active constraints this is the usual interval `π̂_i ± t σ_i`. Open ends and ends that
/// only physical consistency limits are marked. Profile likelihood: Venzon and Moolgavkar, Applied Statistics 37
/// (1988) 87. Here every end is a convex problem (the extreme value of the parameter below the threshold), solved to
/// a hundredth of the half-width.
#[derive(Clone, Debug)]
pub struct ConsistentIntervals {
    problem: PhysicalProblem,
    settings: IntervalSettings,
    best: PhysicalFit,
    assembled: AssembledProgram,
    central_path: Option<CentralPath>,
    quantile: f64,
    /// Residuals of the best set, `ρ₁ − R₁ B π`.
    left: DVector<f64>,
    covariance: Option<DMatrix<f64>>,
    mean_inflation: f64,
    /// κ (variance inflation by correlated residuals) of each standard parameter without constraints.
    inflations: Vec<f64>,
    /// Approximate standard deviation of each standard parameter without constraints; large without data.
    deviations: Vec<f64>,
    sizes: Vec<f64>,
}

struct ExtremeProgram {
    program: Program,
    /// Largest coefficient of the parameter over the variables.
    steepest: f64,
}

impl ConsistentIntervals {
    /// Finds the best consistent set, from which intervals are computed. `covariance` of the base parameters, shape
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
        let (best, central_path) = physical_fit_with_path(problem, &settings.physical)?;
        let weak = PhysicalSettings {
            prior_weight: PRIOR_SHARE * settings.physical.prior_weight,
            ..settings.physical.clone()
        };
        let assembled = AssembledProgram::new(problem, &weak);
        let left = &problem.rotated - &problem.triangle * DVector::from_column_slice(&best.base_values);
        let information = problem.triangle.transpose() * &problem.triangle;
        let sizes = sizes(problem);
        // Information about π without constraints plus that of the weakest prior, in units of the sizes.
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
        let inflations = (0..sizes.len())
            .map(|k| {
                let (covariance, inverse) = (covariance?, inverse.as_ref()?);
                inflation(problem, covariance, &(&problem.triangle * (&scaled * inverse.column(k))))
            })
            .map(|found| found.unwrap_or(mean_inflation))
            .collect();
        Ok(Self {
            quantile: student_half_width(settings.level, degrees_of_freedom),
            problem: problem.clone(),
            covariance: covariance.cloned(),
            settings,
            best,
            assembled,
            central_path,
            left,
            mean_inflation,
            inflations,
            deviations,
            sizes,
        })
    }

    /// The best consistent set, which all intervals include.
    pub fn best(&self) -> &PhysicalFit {
        &self.best
    }

    /// Interval of standard parameter `index` (ten per body, then the scalars). It has zero width for a known body.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] if there is no such parameter.
    pub fn of(&self, index: usize) -> Result<ConsistentInterval, PhysicalError> {
        if index >= self.sizes.len() {
            return Err(PhysicalError::Mismatch {
                what: "index of a standard parameter, below the number of parameters".into(),
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
        let (lower, below) = self.end(index, -1.0);
        let (upper, above) = self.end(index, 1.0);
        Ok(ConsistentInterval { value, lower, upper, held_by: [below, above] })
    }

    /// The program that maximises a parameter, without the limit of the data; `weight` is the unit of the objective.
    /// The search ends slightly beyond the distance of an open end.
    fn extreme_program(&self, index: usize, side: f64, weight: f64) -> ExtremeProgram {
        let Self { problem, best, assembled, .. } = self;
        let far = self.settings.open_beyond * self.sizes[index];
        let functional = assembled.functional(problem, &[(index, side)]);
        let steepest = functional.iter().map(|(_, factor)| factor.abs()).fold(0.0, f64::max);
        let mut program = assembled.program.clone();
        for &(variable, factor) in &functional {
            program.linear[variable] -= weight * factor;
        }
        let end = side * best.parameters[index] + SEARCH_RANGE_FACTOR * far;
        program.rows.push(assembled.row(problem, &[(index, -side)], end, usize::MAX));
        ExtremeProgram { program, steepest }
    }

    /// Computes one end: the extreme value of the parameter in consistent sets whose data cost is below the threshold.
    fn end(&self, index: usize, side: f64) -> (Option<f64>, IntervalEnd) {
        let Self { problem, best, assembled, quantile, .. } = self;
        let (value, size) = (best.parameters[index], self.sizes[index]);
        let far = self.settings.open_beyond * size;
        let softness = self.deviations[index].clamp(1.0e-9 * size, size);
        let least = best.data_objective;
        let rise = |inflation: f64| 0.5 * quantile.powi(2) * inflation;
        let mut inflation = self.inflations[index];
        let distance = |x: &DVector<f64>| side * (assembled.parameters(problem, x)[index] - value);
        let Some(central_path) = &self.central_path else { return (Some(value), IntervalEnd::Unsettled) };
        let begins_beyond = |inflation: f64| {
            central_path.start((least, least + rise(inflation))).is_some_and(|start| distance(start) >= far)
        };
        if begins_beyond(inflation) {
            return (None, IntervalEnd::Open);
        }

        // Scaled so that the limit's multiplier is about one.
        let weight = quantile * inflation.sqrt() / softness;
        let ExtremeProgram { mut program, steepest } = self.extreme_program(index, side, weight);
        program.data_limit = Some(least + rise(inflation));
        let mut reached = 0.0;
        let mut held_by = IntervalEnd::Unsettled;
        let mut limits = 1;
        let mut look = |seen: &Iterate<'_>| {
            reached = distance(seen.x);
            // This set is consistent and the data do not reject it, even if it is not optimal.
            if reached >= far {
                held_by = IntervalEnd::Open;
                return Next::Stop;
            }
            let (room, force) = seen.limit;
            // The parameter grows with this power of the cost, because the multiplier is its slope: ½ without active
            // constraints, 0 if constraints alone limit it.
            let power = force * rise(inflation) / (weight * reached.max(MIN_WIDTH_SHARE * softness));
            let is_free = power < room / rise(inflation);
            // Possible further change of the parameter, in units of the objective.
            let exact = |share: f64| weight * (share * reached).max(MIN_WIDTH_SHARE * softness);
            let enough = exact(if is_free { CONSTRAINED_END_TOLERANCE } else { END_TOLERANCE });
            let is_balanced = seen.certificate.imbalance <= MAX_IMBALANCE * weight * steepest;
            if !is_balanced || seen.certificate.absolute_gap() > enough {
                return Next::On(GAP_SHARE_OF_TOLERANCE * exact(CONSTRAINED_END_TOLERANCE));
            }
            if is_free {
                held_by = IntervalEnd::Constraint;
                return Next::Stop;
            }
            let now = self.inflation(&(&self.left - seen.left));
            let ratio = now / inflation;
            if (ratio - 1.0).abs() > MAX_THRESHOLD_CHANGE && limits < self.settings.max_limits {
                (inflation, limits) = (now, limits + 1);
                if begins_beyond(inflation) {
                    held_by = IntervalEnd::Open;
                    return Next::Stop;
                }
                return Next::Limit(least + rise(inflation));
            }
            held_by = IntervalEnd::Data;
            reached *= ratio.powf(power.min(1.0));
            Next::Stop
        };
        interior_point_within_limit(&mut program, central_path, least, MAX_ITERATIONS, &mut look);
        let [lower, upper] = self.own_limits(index);
        // The interval must include the best set despite rounding.
        let end = (value + side * reached.max(0.0)).max(lower.min(value)).min(upper.max(value));
        (Some(end).filter(|_| held_by != IntervalEnd::Open), held_by)
    }

    /// Limits of the parameter alone: masses and moments of inertia are not negative.
    fn own_limits(&self, index: usize) -> [f64; 2] {
        let bodies = &self.problem.bodies;
        let Some(body) = bodies.get(index / 10) else {
            let scalar = &self.problem.scalars[index - 10 * bodies.len()];
            return [scalar.lower.unwrap_or(f64::NEG_INFINITY), scalar.upper.unwrap_or(f64::INFINITY)];
        };
        match index % 10 {
            0 => body.mass_kg.unwrap_or([0.0, f64::INFINITY]),
            4 | 7 | 9 => [0.0, f64::INFINITY],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// κ (variance inflation) in the direction of the moved rows, R₁ times the shift of the base parameters.
    fn inflation(&self, moved: &DVector<f64>) -> f64 {
        let Some(covariance) = &self.covariance else { return 1.0 };
        inflation(&self.problem, covariance, moved).unwrap_or(self.mean_inflation)
    }
}

/// Variance with correlated residuals relative to that with white ones in the direction of the moved rows; `None` for
/// a negligible move.
fn inflation(problem: &PhysicalProblem, covariance: &DMatrix<f64>, moved: &DVector<f64>) -> Option<f64> {
    let direction = problem.triangle.tr_mul(moved);
    let white = moved.norm_squared();
    let inflation = direction.dot(&(covariance * &direction)) / white;
    (white >= 1.0e-12 && inflation.is_finite() && inflation > 0.0).then_some(inflation)
}

/// Relative accuracy of an end: a hundredth of the half-width.
const END_TOLERANCE: f64 = 0.01;
/// Relative accuracy of an end that constraints alone limit.
const CONSTRAINED_END_TOLERANCE: f64 = 1.0e-4;
/// Minimum accuracy relative to the unconstrained deviation, for a best set at the end itself.
const MIN_WIDTH_SHARE: f64 = 1.0e-7;
/// μ stops decreasing when the gap is this share of the allowed error of an end.
const GAP_SHARE_OF_TOLERANCE: f64 = 0.5;
/// Maximum imbalance of gradient and multipliers of a usable point, relative to the objective's slope.
const MAX_IMBALANCE: f64 = 1.0e-3;
/// Thresholds that differ by less than this share are treated as equal; the ends then differ by a few hundredths.
const MAX_THRESHOLD_CHANGE: f64 = 0.3;
/// End of the search relative to the distance of an open end.
const SEARCH_RANGE_FACTOR: f64 = 1.1;
const MAX_ITERATIONS: usize = 200;
/// Prior weight in the programs of the ends relative to that of the best set. A larger prior would limit parameters as
/// data do; a tenth of this share moves ends by less than a hundredth.
const PRIOR_SHARE: f64 = 1.0e-3;

/// Typical size of each standard parameter: the reference's mass, mass times radius of gyration, moment; a scalar's
/// scale.
fn sizes(problem: &PhysicalProblem) -> Vec<f64> {
    let mut sizes = Vec::new();
    for body in &problem.bodies {
        let [mass, moment] = [body.reference[0], (body.reference[4] + body.reference[7] + body.reference[9]) / 3.0];
        sizes.extend([mass].into_iter().chain([(mass * moment).sqrt(); 3]).chain([moment; 6]));
    }
    sizes.extend(problem.scalars.iter().map(|scalar| scalar.scale));
    sizes
}

/// Mean ratio of the base parameters' variances to those of white residuals; one if a base parameter has no white
/// variance.
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
    use crate::consistent::{BaseMap, PhysicalBody, PhysicalScalar, rough_body};
    use crate::factor::TriangularFactor;

    /// Normal quantile.
    const T: f64 = 1.959_964;

    fn body() -> PhysicalBody {
        let reference = rough_body(2.0, 0.2);
        PhysicalBody { name: "link".into(), reference, known: None, mass_kg: None, com_box_m: None, inside: None }
    }

    fn friction(name: &str) -> PhysicalScalar {
        PhysicalScalar { name: name.into(), lower: Some(0.0), upper: None, prior: 0.0, scale: 1.0 }
    }

    /// One body and one friction parameter with separate measurements: `(column, value, standard deviation)`.
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
    fn intervals_without_active_constraints_are_the_usual_ones() {
        let found = intervals(&all(0.01), None);
        for (index, value, deviation) in all(0.01) {
            let interval = found.of(index).unwrap();
            assert_eq!(interval.held_by, [IntervalEnd::Data; 2], "{index}");
            // The relative accuracy is a hundredth of the half-width; the prior of weight 1e-5 moves less.
            let [lower, upper] = [interval.lower.unwrap(), interval.upper.unwrap()];
            assert!((lower - (value - T * deviation)).abs() < 0.02 * T * deviation, "{index}: {interval:?}");
            assert!((upper - (value + T * deviation)).abs() < 0.02 * T * deviation, "{index}: {interval:?}");
        }
    }

    #[test]
    fn clustered_covariance_widens_intervals() {
        let white = DMatrix::from_diagonal(&DVector::from_iterator(11, all(0.01).iter().map(|row| row.2.powi(2))));
        let mut clustered = white;
        clustered[(10, 10)] *= 9.0;
        let found = intervals(&all(0.01), Some(&clustered));
        let [friction, mass] = [10, 0].map(|index| found.of(index).unwrap());
        // The lower end is at zero, above 0.5 - 3 * 0.196; the upper end is unconstrained.
        assert_eq!(friction.held_by, [IntervalEnd::Constraint, IntervalEnd::Data]);
        assert!(friction.lower.unwrap().abs() < 1e-3);
        assert!((friction.upper.unwrap() - (0.5 + 3.0 * T * 0.1)).abs() < 0.02 * 3.0 * T * 0.1, "{friction:?}");
        assert!((mass.upper.unwrap() - (2.0 + T * 0.01)).abs() < 0.02 * T * 0.01, "{mass:?}");
    }

    /// Measured friction −0.1 ± 0.1: the best consistent value is zero, and the profile above it is ½((p + 0.1)/0.1)²
    /// − ½.
    #[test]
    fn negative_friction_estimates_end_at_zero() {
        let mut measured = all(0.01);
        measured[10].1 = -0.1;
        let interval = intervals(&measured, None).of(10).unwrap();
        let upper = -0.1 + 0.1 * (1.0 + T * T).sqrt();
        assert!(interval.value.abs() < 1e-3 && interval.lower.unwrap().abs() < 1e-3, "{interval:?}");
        assert_eq!(interval.held_by[0], IntervalEnd::Constraint);
        assert!((interval.upper.unwrap() - upper).abs() < 0.02 * upper, "{interval:?}");
    }

    /// Mass and first moment measured, inertia not: the parallel axis theorem limits it from below only.
    #[test]
    fn physical_consistency_limits_an_unmeasured_moment() {
        let measured = [(0, 2.0, 1e-4), (1, 0.0, 1e-4), (2, 0.6, 1e-4), (3, 0.0, 1e-4), (10, 0.5, 0.1)];
        let found = intervals(&measured, None);
        let interval = found.of(4).unwrap();
        assert_eq!(interval.held_by, [IntervalEnd::Constraint, IntervalEnd::Open], "{interval:?}");
        // Ixx ≥ (m ry)²/m = 0.18; mass and moment vary by their own errors, which gives √((0.6 · 1e-4)² + (0.09 ·
        // 1e-4)²) for Ixx. Margin (1e-4 reference bodies) and accuracy of the end together: 2e-4.
        let expected = 0.18 - T * 6.07e-5;
        assert!((interval.lower.unwrap() - expected).abs() < 2e-4, "{interval:?}");
        // An unmeasured product of inertia is open on both sides.
        assert_eq!(found.of(5).unwrap().held_by, [IntervalEnd::Open; 2]);
    }

    /// Only Ixx = Σyy + Σzz measured: |Σyz| is at most half of it, and the sums are at least the margin; parameters
    /// that involve x are open.
    #[test]
    fn a_measured_moment_limits_the_parameters_in_it() {
        let found = intervals(&[(4, 0.02, 1e-6), (10, 0.5, 0.1)], None);
        let product = found.of(8).unwrap();
        assert_eq!(product.held_by, [IntervalEnd::Constraint; 2]);
        for end in [-product.lower.unwrap(), product.upper.unwrap()] {
            // A prior of weight 1e-5 and the margin move it by less than a hundredth.
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
