//! Body of a payload for a robot controller. Values that the logs do not determine are those of a sphere with the
//! payload's mass.
//!
//! A light payload hardly changes the torque, so the error bar of its inertia may be a hundred times its inertia. The
//! physically consistent body nearest to the estimate then has an inertia of the size of the error bar. To avoid this,
//! a sphere with the payload's mass is used as the prior of the inertia about the centre of mass.

use super::body::{Determined, NoBodyError, at_centre_of_mass};
use super::measured::Measured;
use core::f64::consts::PI;
use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{BaseMap, PhysicalBody, PhysicalProblem, PhysicalSettings, physical_fit};
use dynident_model::{InertialParameters, Mat3, Vec3};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Density of the sphere, kg/m³: that of packed boxes. Grippers and machined parts are denser but long, so that their
/// moments of inertia are above those of a sphere of their density. For a given mass, the moment of inertia changes
/// with the power −2/3 of the density: a factor of 3 in density is a factor of 2.1 in inertia.
const DENSITY_KG_M3: f64 = 500.0;
/// Prior standard deviation of the logarithm of the sphere's moment of inertia: a factor of 2, which corresponds to a
/// factor of 3 in density.
const LOG_MOMENT_STD: f64 = 0.7;
/// Search range for the moment of inertia, as a factor in both directions.
const MAX_MOMENT_FACTOR: f64 = 100.0;
/// Number of steps of this search in each direction.
const MOMENT_STEPS: i32 = 60;
/// Prior standard deviation of the moments of inertia around the moment of the sphere, relative to the latter. For
/// example, a cuboid with edges 1:1:3 has moments of 0.27 and 1.36 times their mean.
const SHAPE_STD: f64 = 0.5;
/// Maximum number of times that the prior is weakened by a factor of two if it contradicts the logs.
const WEAKENINGS: usize = 6;
/// Row and column of each of the six entries of the inertia matrix.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
/// Names and units of the ten values.
const VALUES: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("com_x", "m"),
    ("com_y", "m"),
    ("com_z", "m"),
    ("ixx", "kg m^2"),
    ("ixy", "kg m^2"),
    ("ixz", "kg m^2"),
    ("iyy", "kg m^2"),
    ("iyz", "kg m^2"),
    ("izz", "kg m^2"),
];

/// The body that `export` writes for a controller, with the interval of each value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ControllerPayload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, m.
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass, axes of the link's frame: xx, xy, xz, yy, yz, zz.
    pub inertia_at_com_kgm2: [f64; 6],
    /// Radius of the homogeneous sphere with the payload's mass, m. The sphere is the prior of the inertia.
    pub round_radius_m: f64,
    /// Moment of inertia of this sphere, kg m².
    pub round_moment_kgm2: f64,
    /// The ten values, each with its 95 % interval from the logs.
    pub values: Vec<ControllerValue>,
}

/// One of the ten values for a controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ControllerValue {
    /// `mass`, `com_x` to `com_z` (frame of the link), `ixx` to `izz` (about the centre of mass, axes of the link).
    pub name: String,
    /// Unit.
    pub unit: String,
    /// The value for the controller.
    pub value: f64,
    /// Estimate from the logs alone; `None` if the logs do not determine the value separately.
    pub estimate: Option<f64>,
    /// Half width of the 95 % interval of the estimate; zero for a stated mass.
    pub half_width_95: Option<f64>,
    /// Lower end of the 95 % interval; at least zero for masses and moments of inertia.
    pub lower_95: Option<f64>,
    /// Upper end of the 95 % interval.
    pub upper_95: Option<f64>,
}

/// Computes the body for a robot controller. `nearest` is the physically consistent body that is nearest to the
/// estimate, as ten parameters about the origin. `figures` contains the estimates of mass, centre of mass and inertia
/// about the centre of mass.
///
/// A sphere of density ρ = 500 kg/m³ with the mass m and the centre of mass of `nearest` has the radius
/// `r = (3 m / (4 π ρ))^(1/3)` and the moment `J = 2/5 m r²`. If the logs determine all ten parameters, J is the most
/// probable moment for the estimated inertia Î with covariance V,
///
/// ```text
/// max_J  N(Î; J 1, V + (J/2)² D) · N(ln J; ln J_ρ, 0.7²),   D = diag(1, ½, ½, 1, ½, 1)
/// ```
///
/// Among all physically consistent bodies, the result minimises the sum of two squared distances: the distance from the
/// estimate, weighted by its inverse covariance, and the distance of its inertia I from the sphere,
/// `‖I − J 1‖²_F / (J/2)²`. Both are in units of standard deviations. Therefore a value with a small error bar is that
/// of the logs, and a value with a large error bar is that of the sphere (posterior mode of a linear Gaussian model;
/// Gelman et al., Bayesian Data Analysis, 3rd ed., section 14.8; the choice of J is empirical Bayes, section 5.1). If a
/// value is outside of its interval from the logs, the prior is weakened.
pub(super) fn controller_payload(
    data: &Determined,
    nearest: &[f64; 10],
    figures: &[Option<Measured>; 10],
) -> Result<ControllerPayload, NoBodyError> {
    let [mass, cx, cy, cz, ..] = at_centre_of_mass(nearest);
    let about = inertia_about([cx, cy, cz]);
    let by_density = sphere_moment(mass);
    let moment = probable_moment(data, &about, by_density).unwrap_or(by_density);
    let mut shape_std = SHAPE_STD;
    let mut found = *nearest;
    for _ in 0..WEAKENINGS {
        let one = shrunk(data, mass, [cx, cy, cz], &about, moment, shape_std)?;
        if is_inside(&at_centre_of_mass(&one), figures) {
            found = one;
            break;
        }
        shape_std *= 2.0;
    }
    let [mass_kg, x, y, z, xx, xy, xz, yy, yz, zz] = at_centre_of_mass(&found);
    let values = VALUES.iter().zip(at_centre_of_mass(&found)).zip(figures).enumerate();
    Ok(ControllerPayload {
        mass_kg,
        com_m: [x, y, z],
        inertia_at_com_kgm2: [xx, xy, xz, yy, yz, zz],
        round_radius_m: (2.5 * moment / mass).sqrt(),
        round_moment_kgm2: moment,
        values: values.map(|(k, ((&(name, unit), value), figure))| one_value(k, name, unit, value, *figure)).collect(),
    })
}

fn one_value(k: usize, name: &str, unit: &str, value: f64, figure: Option<Measured>) -> ControllerValue {
    let interval = figure.map(|figure| interval(k, &figure));
    ControllerValue {
        name: name.to_owned(),
        unit: unit.to_owned(),
        value,
        estimate: figure.map(|figure| figure.value),
        half_width_95: figure.map(|figure| figure.half_width_95),
        lower_95: interval.map(|[lower, _]| lower),
        upper_95: interval.map(|[_, upper]| upper),
    }
}

/// Whether value number `k` cannot be negative, which applies to the mass and the moments of inertia.
fn is_positive(k: usize) -> bool {
    matches!(k, 0 | 4 | 7 | 9)
}

/// The 95 % interval of a value; the lower end for the mass and the moments of inertia is at least zero.
fn interval(k: usize, figure: &Measured) -> [f64; 2] {
    let [lower, upper] = [figure.value - figure.half_width_95, figure.value + figure.half_width_95];
    if is_positive(k) { [lower.max(0.0), upper.max(0.0)] } else { [lower, upper] }
}

/// Whether all values are within their intervals from the logs. An interval that contains no physically consistent
/// value is ignored: the estimate is then further from any physical body than its error bar.
fn is_inside(values: &[f64; 10], figures: &[Option<Measured>; 10]) -> bool {
    values.iter().zip(figures).enumerate().all(|(k, (&value, figure))| {
        let Some([lower, upper]) = figure.map(|figure| interval(k, &figure)) else { return true };
        // A stated mass has an interval of zero width; the solver satisfies it to 1e-4.
        let slack = 1.0e-3 * value.abs();
        (is_positive(k) && upper <= 0.0) || (lower - slack..=upper + slack).contains(&value)
    })
}

/// Moment of inertia of a homogeneous sphere with this mass, kg m².
fn sphere_moment(mass_kg: f64) -> f64 {
    let radius = (3.0 * mass_kg / (4.0 * PI * DENSITY_KG_M3)).cbrt();
    0.4 * mass_kg * radius * radius
}

/// Matrix that maps ten parameters about the origin to the inertia about the point `c`. This inertia is linear in the
/// parameters, and differs from the inertia about the centre of mass by at most `m ‖com − c‖²`.
fn inertia_about(c: [f64; 3]) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(6, 10);
    let square: f64 = c.iter().map(|c| c * c).sum();
    for (row, (a, b)) in ENTRIES.into_iter().enumerate() {
        let same = f64::from(u8::from(a == b));
        rows[(row, 0)] = same * square - c[a] * c[b];
        for (k, c_k) in c.iter().enumerate() {
            let crossed = f64::from(u8::from(k == a)) * c[b] + f64::from(u8::from(k == b)) * c[a];
            rows[(row, 1 + k)] = crossed - 2.0 * same * c_k;
        }
        rows[(row, 4 + row)] = 1.0;
    }
    rows
}

/// Standard deviation of an entry of the inertia matrix relative to that of a moment of inertia. Products of inertia
/// appear twice in the Frobenius norm; with this ratio, the prior does not depend on the axes.
fn relative_std(row: usize) -> f64 {
    let (a, b) = ENTRIES[row];
    if a == b { 1.0 } else { core::f64::consts::FRAC_1_SQRT_2 }
}

fn is_moment(row: usize) -> f64 {
    let (a, b) = ENTRIES[row];
    f64::from(u8::from(a == b))
}

/// The most probable moment of inertia of the sphere; `None` unless the logs determine all ten parameters.
fn probable_moment(data: &Determined, about: &DMatrix<f64>, by_density: f64) -> Option<f64> {
    let (values, covariance) = data.all_ten()?;
    let (estimate, covariance) = (about * values, about * covariance * about.transpose());
    let cost = |moment: f64| {
        let std = |row: usize| SHAPE_STD * moment * relative_std(row);
        let total = &covariance + DMatrix::from_diagonal(&DVector::from_fn(6, |row, _| std(row).powi(2)));
        let lower = total.cholesky()?.l();
        let rest = DVector::from_fn(6, |row, _| estimate[row] - moment * is_moment(row));
        let white = lower.solve_lower_triangular(&rest)?;
        let half_log_det: f64 = lower.diagonal().iter().map(|x| x.ln()).sum();
        let prior = (moment / by_density).ln() / LOG_MOMENT_STD;
        Some(0.5 * white.norm_squared() + half_log_det + 0.5 * prior * prior)
    };
    let step = MAX_MOMENT_FACTOR.ln() / f64::from(MOMENT_STEPS);
    let moments = (-MOMENT_STEPS..=MOMENT_STEPS).map(|k| by_density * (f64::from(k) * step).exp());
    let costs = moments.filter_map(|moment| Some((cost(moment)?, moment)));
    costs.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, moment)| moment)
}

/// The physically consistent body with the smallest sum of squared distances from the logs and from the sphere.
fn shrunk(
    data: &Determined,
    mass: f64,
    com: [f64; 3],
    about: &DMatrix<f64>,
    moment: f64,
    shape_std: f64,
) -> Result<[f64; 10], NoBodyError> {
    let (own, count) = (data.rows.nrows(), data.rows.nrows() + 6);
    let std = |row: usize| shape_std * moment * relative_std(row);
    let mut panel = DMatrix::zeros(count, 11);
    panel.view_mut((0, 0), (own, 10)).copy_from(&data.rows);
    panel.view_mut((0, 10), (own, 1)).copy_from(&data.target);
    for row in 0..6 {
        panel.view_mut((own + row, 0), (1, 10)).copy_from(&(about.row(row) / std(row)));
        panel[(own + row, 10)] = moment * is_moment(row) / std(row);
    }
    let factor = TriangularFactor::from_rows(10, panel.as_slice(), count)?;
    let diagonal = core::array::from_fn(|a| core::array::from_fn(|b| if a == b { moment } else { 0.0 }));
    let reference = InertialParameters::from_centre_of_mass(mass, Vec3(com), &Mat3(diagonal)).0;
    let body = PhysicalBody {
        name: data.name.clone(),
        reference,
        known: None,
        mass_kg: data.mass_kg,
        com_box_m: None,
        inside: None,
    };
    let problem = PhysicalProblem::new(BaseMap::new(DMatrix::identity(10, 10))?, vec![body], Vec::new(), &factor)?;
    let fit = physical_fit(&problem, &PhysicalSettings::default())?;
    Ok(core::array::from_fn(|k| fit.parameters[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A homogeneous box with edges along the axes.
    fn cuboid(mass: f64, edges: [f64; 3], com: [f64; 3]) -> InertialParameters {
        let [x, y, z] = edges.map(|edge| edge * edge);
        let moments = [y + z, x + z, x + y].map(|sum| mass / 12.0 * sum);
        let inertia = core::array::from_fn(|a| core::array::from_fn(|b| if a == b { moments[a] } else { 0.0 }));
        InertialParameters::from_centre_of_mass(mass, Vec3(com), &Mat3(inertia))
    }

    /// Standard deviations of mass, first moments and inertia about the origin.
    fn covariance(mass: f64, first: f64, inertia: f64) -> DMatrix<f64> {
        let std = |k: usize| [mass, first, first, first].get(k).copied().unwrap_or(inertia);
        DMatrix::from_diagonal(&DVector::from_fn(10, |k, _| std(k).powi(2)))
    }

    /// The body for a controller from estimates that are off by `errors` standard deviations.
    fn found(truth: &InertialParameters, errors: &[f64; 10], covariance: &DMatrix<f64>) -> ControllerPayload {
        let values = core::array::from_fn(|k| truth.0[k] + errors[k] * covariance[(k, k)].sqrt());
        let data = Determined::of_ten(&values, covariance.clone());
        let fit = data.nearest_consistent_body().unwrap();
        let jacobian = crate::payload::body::jacobian(&values);
        let variances = (&jacobian * covariance * jacobian.transpose()).diagonal();
        let figure = |k: usize| {
            let std = variances[k].sqrt();
            Some(Measured { value: at_centre_of_mass(&values)[k], std, half_width_95: 1.96 * std })
        };
        let nearest = core::array::from_fn(|k| fit.parameters[k]);
        controller_payload(&data, &nearest, &core::array::from_fn(figure)).unwrap()
    }

    const ERRORS: [[f64; 10]; 3] = [
        [0.0; 10],
        [0.5, -0.3, 0.8, 0.1, 1.0, -0.7, 0.4, 0.9, -1.2, 0.6],
        [-0.4, 0.9, -0.2, 0.3, -1.1, 0.5, 0.8, -0.6, 0.2, -0.9],
    ];

    fn moments(body: &ControllerPayload) -> [f64; 3] {
        let i = body.inertia_at_com_kgm2;
        [i[0], i[3], i[5]]
    }

    /// The error bar is thirty times the moments of inertia. The body gets the inertia of the sphere, and the reported
    /// intervals are those from the logs.
    #[test]
    fn an_inertia_that_logs_do_not_determine_is_that_of_a_round_body() {
        let truth = cuboid(0.3, [0.06, 0.08, 0.1], [0.02, 0.0, 0.05]);
        let true_moments = at_centre_of_mass(&truth.0);
        for errors in &ERRORS {
            let body = found(&truth, errors, &covariance(0.005, 0.001, 6e-3));
            for (moment, place) in moments(&body).into_iter().zip([4, 7, 9]) {
                assert!((0.5..2.0).contains(&(moment / true_moments[place])), "{body:?}");
                let one = &body.values[place];
                assert!(one.lower_95.unwrap() <= moment && moment <= one.upper_95.unwrap(), "{one:?}");
                assert!(one.half_width_95.unwrap() > 0.011, "{one:?}");
            }
            // Products of inertia of a sphere are zero.
            assert!(body.inertia_at_com_kgm2[1].abs() < 0.2 * body.round_moment_kgm2, "{body:?}");
        }
    }

    /// A long bar is far from round, but the logs determine its inertia.
    #[test]
    fn a_determined_inertia_is_kept() {
        let truth = cuboid(1.0, [0.05, 0.05, 0.6], [0.0, 0.0, 0.3]);
        let true_values = at_centre_of_mass(&truth.0);
        for errors in &ERRORS {
            let body = found(&truth, errors, &covariance(1e-4, 1e-5, 1e-5));
            for (one, truth) in body.values.iter().zip(true_values) {
                let half = one.half_width_95.unwrap();
                assert!((one.value - one.estimate.unwrap()).abs() < 0.2 * half, "{one:?}");
                assert!((one.value - truth).abs() < 1.2 * half, "{one:?} {truth}");
            }
        }
    }

    /// A mixed case: the logs determine two moments of inertia, but not the third. All values are within the intervals.
    #[test]
    fn values_stay_in_their_intervals() {
        let truth = cuboid(2.0, [0.05, 0.05, 0.5], [0.03, -0.02, 0.2]);
        for std in [1e-5, 1e-4, 1e-3, 1e-2, 1e-1] {
            let mut covariance = covariance(0.01, 0.002, 1e-3);
            covariance[(9, 9)] = std * std;
            for errors in &ERRORS {
                let body = found(&truth, errors, &covariance);
                for one in &body.values {
                    let slack = 1.1e-3 * one.value.abs();
                    let (lower, upper) = (one.lower_95.unwrap() - slack, one.upper_95.unwrap() + slack);
                    assert!((lower..=upper).contains(&one.value), "{std}: {one:?}");
                }
            }
        }
    }

    /// A sphere with half the density of water has the moment of inertia that the prior assumes.
    #[test]
    fn the_size_is_that_of_packed_boxes() {
        // 4/3 π 0.1³ m³ of 500 kg/m³, moment 2/5 m r².
        let mass = 2.0 / 3.0 * PI;
        assert!((sphere_moment(mass) - 0.4 * mass * 0.01).abs() < 1e-15);
    }
}
