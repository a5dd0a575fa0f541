//! Payload as a body with mass, centre of mass and inertia: from an estimate, and the nearest physically consistent
//! body.

use super::columns::PayloadColumns;
use dynident_estimation::consistent::{
    BaseMap, PhysicalBody, PhysicalError, PhysicalFit, PhysicalProblem, PhysicalSettings, physical_fit, rough_body,
};
use dynident_estimation::{Estimate, EstimationError, TriangularFactor};
use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// Radius of gyration of the reference body about the link's origin, m; the reference body determines parameters that
/// the logs do not.
const GYRATION_RADIUS_M: f64 = 0.1;
/// Relative tolerance of a known mass; the interior-point solver cannot satisfy it exactly.
const MASS_TOLERANCE: f64 = 1.0e-4;
/// Minimum mass of the reference body, kg.
const MIN_MASS_KG: f64 = 0.01;
/// Minimum standard deviation relative to the values of a body of this size. With noise-free logs, the prior would
/// otherwise be lost in rounding errors.
const MIN_RELATIVE_STD: f64 = 1.0e-5;

pub(crate) fn at_centre_of_mass(p: &[f64; 10]) -> [f64; 10] {
    let (m, h) = (p[0], [p[1], p[2], p[3]]);
    let square: f64 = h.iter().map(|h| h * h).sum();
    let mut out = [m, h[0] / m, h[1] / m, h[2] / m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (k, (a, b)) in PAIRS.into_iter().enumerate() {
        out[4 + k] = p[4 + k] - (if a == b { square } else { 0.0 } - h[a] * h[b]) / m;
    }
    out
}

pub(crate) fn jacobian(p: &[f64; 10]) -> DMatrix<f64> {
    let (m, h) = (p[0], [p[1], p[2], p[3]]);
    let square: f64 = h.iter().map(|h| h * h).sum();
    let mut jacobian = DMatrix::identity(10, 10);
    for k in 0..3 {
        jacobian[(1 + k, 0)] = -h[k] / (m * m);
        jacobian[(1 + k, 1 + k)] = 1.0 / m;
    }
    for (row, (a, b)) in PAIRS.into_iter().enumerate() {
        let same = f64::from(u8::from(a == b));
        jacobian[(4 + row, 0)] = (same * square - h[a] * h[b]) / (m * m);
        for k in 0..3 {
            let change = 2.0 * same * h[k] - f64::from(u8::from(k == a)) * h[b] - f64::from(u8::from(k == b)) * h[a];
            jacobian[(4 + row, 1 + k)] = -change / m;
        }
    }
    jacobian
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Reason why there is no physically consistent body.
#[derive(Debug, Error)]
pub(crate) enum NoBodyError {
    /// The training logs hardly determine the payload, so that no body can be computed from its estimate. Record a
    /// motion that turns the last joints, with the payload (`dynident design`).
    #[error("the logs hardly determine the payload: the covariance of its estimate is not positive definite")]
    Covariance,
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    #[error("{0}")]
    Physical(#[from] PhysicalError),
}

/// Estimate of a payload as rows of a least-squares problem for its ten parameters, scaled to unit noise.
pub(crate) struct Determined {
    /// Name of the payload.
    pub(crate) name: String,
    /// Matrix `L⁻¹ S B`, shape (determined, 10): `S B π` are the determined parameters, or sums of the parameters π,
    /// and `L Lᵀ` is their covariance.
    pub(crate) rows: DMatrix<f64>,
    /// Right side `L⁻¹ x̂` with the estimates x̂ of the determined parameters or sums.
    pub(crate) target: DVector<f64>,
    /// Minimum and maximum mass, if the study states the mass.
    pub(crate) mass_kg: Option<[f64; 2]>,
    mass: f64,
}

impl Determined {
    pub(crate) fn of(name: &str, columns: &PayloadColumns, estimate: &Estimate) -> Result<Self, NoBodyError> {
        let fixed = |place: &usize| estimate.rank.fixed.iter().any(|fixed| fixed.column == columns.first + place);
        let places: Vec<usize> = (0..columns.kept.len()).filter(|place| !fixed(place)).collect();
        let value = |place: usize| estimate.values[columns.first + place];
        let known_mass = columns.mass.as_ref().map(|(mass, _)| *mass);
        let estimated = if columns.kept.first() == Some(&0) { value(0).abs() } else { 1.0 }.max(MIN_MASS_KG);
        let mass = known_mass.unwrap_or(estimated);
        // The covariance for white noise is added, because a covariance from few time segments is singular.
        let entry = |i: usize, j: usize| estimate.covariance[(i, j)] + estimate.covariance_white[(i, j)];
        let mut covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            entry(columns.first + places[i], columns.first + places[j])
        });
        for (i, &place) in places.iter().enumerate() {
            let length = match columns.kept[place] {
                0 => 1.0,
                1..=3 => GYRATION_RADIUS_M,
                _ => GYRATION_RADIUS_M * GYRATION_RADIUS_M,
            };
            covariance[(i, i)] += (MIN_RELATIVE_STD * mass * length).powi(2);
        }
        // With the covariance V = L Lᵀ, the rows L⁻¹ φ = L⁻¹ φ̂ have unit noise.
        let lower = covariance.cholesky().ok_or(NoBodyError::Covariance)?.l();
        let values = DVector::from_iterator(places.len(), places.iter().map(|&place| value(place)));
        let (Some(white), Some(target)) = (lower.clone().try_inverse(), lower.solve_lower_triangular(&values)) else {
            return Err(NoBodyError::Covariance);
        };
        let map = BaseMap::from_regrouping(&columns.kept, &columns.dropped, &columns.regrouping)?;
        let rows = white * map.matrix().select_rows(&places);
        let mass_kg = known_mass.map(|mass| [mass * (1.0 - MASS_TOLERANCE), mass * (1.0 + MASS_TOLERANCE)]);
        Ok(Self { name: name.to_owned(), rows, target, mass_kg, mass })
    }

    /// Rows for estimates of all ten parameters with this covariance.
    #[cfg(test)]
    pub(super) fn of_ten(values: &[f64; 10], covariance: DMatrix<f64>) -> Self {
        let lower = covariance.cholesky().unwrap().l();
        let target = lower.solve_lower_triangular(&DVector::from_column_slice(values)).unwrap();
        Self { name: String::new(), rows: lower.try_inverse().unwrap(), target, mass_kg: None, mass: values[0] }
    }

    /// All ten parameters with their covariance; `None` if the logs do not determine them all.
    pub(crate) fn all_ten(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        if self.rows.nrows() < 10 {
            return None;
        }
        let inverse = self.rows.clone().try_inverse()?;
        Some((&inverse * &self.target, &inverse * inverse.transpose()))
    }

    /// The physically consistent body that is nearest to the estimate, with the distance weighted by the inverse
    /// covariance.
    pub(crate) fn nearest_consistent_body(&self) -> Result<PhysicalFit, NoBodyError> {
        let count = self.rows.nrows();
        let panel: Vec<f64> = self.rows.as_slice().iter().chain(self.target.as_slice()).copied().collect();
        let factor = TriangularFactor::from_rows(10, &panel, count)?;
        let body = PhysicalBody {
            name: self.name.clone(),
            reference: rough_body(self.mass, GYRATION_RADIUS_M),
            known: None,
            mass_kg: self.mass_kg,
            com_box_m: None,
            inside: None,
        };
        let map = BaseMap::new(DMatrix::identity(10, 10))?;
        let problem = PhysicalProblem::new(map, vec![body], Vec::new(), &factor)?;
        Ok(physical_fit(&problem, &PhysicalSettings::default())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::InertialParameters;

    const BODY: [f64; 10] = [2.5, 0.3, -0.2, 0.5, 0.21, 0.01, -0.06, 0.19, 0.03, 0.09];

    #[test]
    fn values_are_those_of_the_body() {
        let (found, body) = (at_centre_of_mass(&BODY), InertialParameters(BODY));
        let inertia = body.inertia_at_com().map(|inertia| inertia.0).unwrap_or_default();
        let com = body.com_m().map(|com| com.0).unwrap_or_default();
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            assert!((found[4 + k] - inertia[a][b]).abs() < 1e-14);
        }
        assert!((0..3).all(|k| (found[1 + k] - com[k]).abs() < 1e-15));
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_values() {
        let jacobian = jacobian(&BODY);
        for k in 0..10 {
            let h = 1e-6;
            let mut sides = [BODY; 2];
            (sides[0][k], sides[1][k]) = (BODY[k] - h, BODY[k] + h);
            let [low, high] = sides.map(|side| at_centre_of_mass(&side));
            for row in 0..10 {
                // Central differences: h² of curvature, rounding over h.
                assert!(((high[row] - low[row]) / (2.0 * h) - jacobian[(row, k)]).abs() < 1e-8, "{row} {k}");
            }
        }
    }
}
