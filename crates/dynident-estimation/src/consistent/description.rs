//! Input of a physical fit: bodies, scalars, the map to base parameters, and the data.

use super::cone::least_eigenvalue;
use super::coordinates::{Whitening, pseudo_inertia, vector_of};
use super::error::PhysicalError;
use crate::factor::TriangularFactor;
use nalgebra::{DMatrix, DVector};

/// Interval of a mass or a coordinate, lower limit first.
pub type Limits = [f64; 2];

/// Ten consecutive standard parameters `[m, m rx, m ry, m rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]` of one body, about the
/// origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalBody {
    /// Name for messages.
    pub name: String,
    /// Prior body P0, also the unit of the margin: from CAD, or a rough one from [`rough_body`].
    pub reference: [f64; 10],
    /// Fixed values for a body that is not fitted (all zero for a body without mass).
    pub known: Option<[f64; 10]>,
    /// Limits of the mass, kg.
    pub mass_kg: Option<Limits>,
    /// Opposite corners of a box around the centre of mass (axes of the body frame, metres).
    pub com_box_m: Option<[[f64; 3]; 2]>,
    /// Ellipsoid that contains the whole mass of the body, and therefore its centre of mass: `tr(P Q) ≥ 0` for the
    /// pseudo-inertia P and the matrix Q of the ellipsoid (Wensing, Kim and Slotine 2018, eq. 24).
    pub inside: Option<Ellipsoid>,
}

/// An ellipsoid with its axes along those of the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre in the body frame, metres.
    pub centre_m: [f64; 3],
    /// Half-lengths along the three axes, metres.
    pub semi_axes_m: [f64; 3],
}

/// A standard parameter that belongs to no body: friction, drive inertia, offset.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalScalar {
    /// Name for messages.
    pub name: String,
    /// Lower limit; zero for parameters that dissipate or store energy.
    pub lower: Option<f64>,
    /// Upper limit.
    pub upper: Option<f64>,
    /// Value in the absence of data.
    pub prior: f64,
    /// Usual deviation from the prior: the unit of its term `½ γ ((π − prior)/scale)²`. Greater than zero.
    pub scale: f64,
}

/// `θ = B π`: base parameters (the data's columns) as combinations of standard parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseMap {
    matrix: DMatrix<f64>,
}

impl BaseMap {
    /// From B, shape (base parameters, standard parameters).
    ///
    /// # Errors
    /// [`PhysicalError::NotFinite`].
    pub fn new(matrix: DMatrix<f64>) -> Result<Self, PhysicalError> {
        finite("an entry of the base map", matrix.as_slice())?;
        Ok(Self { matrix })
    }

    /// From `θ = π[independent] + K π[dependent]`, the form of structural base parameters; K has shape (independent,
    /// dependent).
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] for a wrong shape of K or unless every column is in exactly one of the lists;
    /// [`PhysicalError::NotFinite`].
    pub fn from_regrouping(
        independent: &[usize],
        dependent: &[usize],
        regrouping: &DMatrix<f64>,
    ) -> Result<Self, PhysicalError> {
        let columns = independent.len() + dependent.len();
        expect("rows of the regrouping", independent.len(), regrouping.nrows())?;
        expect("columns of the regrouping", dependent.len(), regrouping.ncols())?;
        let mut seen = vec![false; columns];
        for &column in independent.iter().chain(dependent) {
            if column >= columns || std::mem::replace(&mut seen[column], true) {
                return Err(PhysicalError::Mismatch {
                    what: "columns of the base map, not duplicate".into(),
                    expected: columns,
                    found: column,
                });
            }
        }
        let mut matrix = DMatrix::zeros(independent.len(), columns);
        for (row, &column) in independent.iter().enumerate() {
            matrix[(row, column)] = 1.0;
        }
        for (d, &column) in dependent.iter().enumerate() {
            matrix.set_column(column, &regrouping.column(d));
        }
        Self::new(matrix)
    }

    /// The matrix B of `θ = B π`.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }
}

/// Physical problem over the standard parameters π: bodies first (ten columns each), then scalars.
///
/// The data are rows `R₁ θ ≈ ρ₁` over the base parameters `θ = B π` in units of their noise, so that `½‖R₁ B π − ρ₁‖²`
/// is half the squared distance from the least-squares solution in standard deviations.
#[derive(Clone, Debug)]
pub struct PhysicalProblem {
    pub(super) base: BaseMap,
    pub(super) bodies: Vec<PhysicalBody>,
    pub(super) whitenings: Vec<Whitening>,
    pub(super) scalars: Vec<PhysicalScalar>,
    pub(super) triangle: DMatrix<f64>,
    pub(super) rotated: DVector<f64>,
    pub(super) total_mass_kg: Option<Limits>,
    /// Prior of the mass of each body: expected value and standard deviation, kg.
    pub(super) mass_beliefs: Vec<Option<[f64; 2]>>,
    /// Prior of all ten values of each body.
    pub(super) body_priors: Vec<Option<BodyPrior>>,
}

/// Gaussian prior of all ten values of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyPrior {
    /// The expected values.
    pub parameters: [f64; 10],
    /// Relative standard deviation: of the mass and the inertia relative to their values, of the centre of mass
    /// relative to the extent of the body.
    pub share: f64,
}

/// Minimum relative width of an interval; a narrower one has no interior in double precision.
const MIN_RELATIVE_WIDTH: f64 = 1.0e-6;

impl PhysicalProblem {
    /// Creates a problem from a weighted factor over the base parameters
    /// ([`LinearProblem::combined`](crate::LinearProblem::combined) with weights 1/σ_j).
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] for wrong shapes, and the errors of single bodies and scalars:
    /// [`PhysicalError::InfeasiblePrior`], [`PhysicalError::InfeasibleKnown`], [`PhysicalError::EmptyInterval`],
    /// [`PhysicalError::NotFinite`].
    pub fn new(
        base: BaseMap,
        bodies: Vec<PhysicalBody>,
        scalars: Vec<PhysicalScalar>,
        factor: &TriangularFactor,
    ) -> Result<Self, PhysicalError> {
        expect("columns of the base map", 10 * bodies.len() + scalars.len(), base.matrix.ncols())?;
        expect("columns of the factor", base.matrix.nrows(), factor.columns())?;
        let whitenings = bodies.iter().map(checked_body).collect::<Result<Vec<_>, _>>()?;
        scalars.iter().try_for_each(checked_scalar)?;
        let (triangle, rotated) = (factor.regressor_triangle(), factor.rotated_torque());
        finite("an entry of the factor", triangle.as_slice())?;
        finite("an entry of the factor", rotated.as_slice())?;
        Ok(Self {
            base,
            bodies,
            whitenings,
            scalars,
            triangle,
            rotated,
            total_mass_kg: None,
            mass_beliefs: Vec::new(),
            body_priors: Vec::new(),
        })
    }

    /// Adds prior masses for the bodies: value and standard deviation, kg. Each is one more measurement, `½((m −
    /// m₀)/σ)²`, added to the data's half squares. It is negligible if the data determine the mass. Otherwise it
    /// determines the mass, because a prior on shape alone does not distinguish bodies that differ only in mass.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] for a wrong number of priors, [`PhysicalError::NotFinite`].
    pub fn with_mass_beliefs(mut self, beliefs: Vec<Option<[f64; 2]>>) -> Result<Self, PhysicalError> {
        expect("beliefs of masses", self.bodies.len(), beliefs.len())?;
        finite("a belief of a mass", &beliefs.iter().flatten().flatten().copied().collect::<Vec<_>>())?;
        self.mass_beliefs = beliefs;
        Ok(self)
    }

    /// Adds Gaussian priors of all values of a body, `½‖(Q − Q₀)/ρ‖²` in coordinates whitened by its reference, with
    /// the relative standard deviation ρ. They are added to the data's half squares.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] for a wrong number of priors, [`PhysicalError::NotFinite`],
    /// [`PhysicalError::EmptyInterval`] for a standard deviation that is not positive.
    pub fn with_body_priors(mut self, priors: Vec<Option<BodyPrior>>) -> Result<Self, PhysicalError> {
        expect("priors of bodies", self.bodies.len(), priors.len())?;
        for (prior, body) in priors.iter().zip(&self.bodies) {
            let Some(prior) = prior else { continue };
            let name = &body.name;
            finite(&format!("body {name}: a prior value"), &prior.parameters)?;
            interval(&format!("body {name}: standard deviation of the prior"), [0.0, prior.share])?;
        }
        self.body_priors = priors;
        Ok(self)
    }

    /// Rows over the whitened coordinates of a body, in units of their standard deviation, from the priors of its mass
    /// and of all its values.
    pub(super) fn prior_rows(&self, body: usize) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let whitening = &self.whitenings[body];
        let mut rows = Vec::new();
        if let Some([mass, sigma]) = self.mass_beliefs.get(body).copied().flatten() {
            let functional = whitening.functional(&core::array::from_fn(|k| if k == 0 { sigma.recip() } else { 0.0 }));
            rows.push((DMatrix::from_row_slice(1, 10, functional.as_slice()), DVector::from_element(1, mass / sigma)));
        }
        if let Some(prior) = self.body_priors.get(body).and_then(Option::as_ref) {
            let target = vector_of(&whitening.whitened(&prior.parameters)) / prior.share;
            rows.push((
                DMatrix::from_diagonal_element(10, 10, prior.share.recip()),
                DVector::from_column_slice(target.as_slice()),
            ));
        }
        rows
    }

    /// Sets limits of the sum of all bodies' masses, including known ones.
    ///
    /// # Errors
    /// [`PhysicalError::EmptyInterval`], and [`PhysicalError::TotalMass`] if the bodies' limits exclude it.
    pub fn with_total_mass_kg(mut self, limits: Limits) -> Result<Self, PhysicalError> {
        interval("total mass", limits)?;
        let own = |body: &PhysicalBody, side: usize, free: f64| {
            body.known.map_or_else(|| body.mass_kg.map_or(free, |limits| limits[side]), |known| known[0])
        };
        let least: f64 = self.bodies.iter().map(|body| own(body, 0, 0.0)).sum();
        let greatest: f64 = self.bodies.iter().map(|body| own(body, 1, f64::INFINITY)).sum();
        let [lower, upper] = limits;
        if lower >= greatest || upper <= least {
            return Err(PhysicalError::TotalMass { lower, upper, least, greatest });
        }
        self.total_mass_kg = Some(limits);
        Ok(self)
    }

    /// Copies the problem with data whose optimum is at the base parameters `theta`. Its fit is the consistent set
    /// nearest to `theta`, with distances measured in standard deviations of the data.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`], [`PhysicalError::NotFinite`].
    pub fn around(&self, theta: &[f64]) -> Result<Self, PhysicalError> {
        expect("base parameters", self.base.matrix.nrows(), theta.len())?;
        finite("a base parameter", theta)?;
        Ok(Self { rotated: &self.triangle * DVector::from_column_slice(theta), ..self.clone() })
    }

    /// The bodies.
    pub fn bodies(&self) -> &[PhysicalBody] {
        &self.bodies
    }

    /// The scalars.
    pub fn scalars(&self) -> &[PhysicalScalar] {
        &self.scalars
    }

    /// The map from standard to base parameters.
    pub fn base(&self) -> &BaseMap {
        &self.base
    }
}

/// A body of a given mass with radius of gyration `length_m` about each axis, centred at the frame's origin: a
/// reference if no better one is known.
///
/// ```
/// let body = dynident_estimation::consistent::rough_body(2.0, 0.1);
/// assert_eq!(body[0], 2.0);
/// assert!((body[4] - 0.04).abs() < 1e-15); // Ixx = 2 m ℓ²
/// ```
pub fn rough_body(mass_kg: f64, length_m: f64) -> [f64; 10] {
    let moment = 2.0 * mass_kg * length_m * length_m;
    [mass_kg, 0.0, 0.0, 0.0, moment, 0.0, 0.0, moment, 0.0, moment]
}

fn checked_body(body: &PhysicalBody) -> Result<Whitening, PhysicalError> {
    let name = &body.name;
    finite(&format!("body {name}: a prior value"), &body.reference)?;
    let whitening = Whitening::new(&body.reference).ok_or_else(|| PhysicalError::InfeasiblePrior {
        body: name.clone(),
        least_eigenvalue: least_eigenvalue(&pseudo_inertia(&body.reference)),
    })?;
    if let Some(known) = &body.known {
        finite(&format!("body {name}: a known value"), known)?;
        let least = least_eigenvalue(&pseudo_inertia(known));
        // Rounding of a thin body's inertia relative to its largest entry.
        if least < -1.0e-12 * known.iter().fold(0.0, |a: f64, b| a.max(b.abs())) {
            return Err(PhysicalError::InfeasibleKnown { body: name.clone(), least_eigenvalue: least });
        }
    }
    if let Some(limits) = body.mass_kg {
        interval(&format!("body {name}: mass"), limits)?;
        if limits[1] <= 0.0 {
            return Err(PhysicalError::EmptyInterval {
                what: format!("body {name}: mass"),
                lower: 0.0,
                upper: limits[1],
            });
        }
    }
    if let Some([low, high]) = body.com_box_m {
        for axis in 0..3 {
            interval(&format!("body {name}: centre of mass along {}", ["x", "y", "z"][axis]), [low[axis], high[axis]])?;
        }
    }
    if let Some(ellipsoid) = body.inside {
        finite(&format!("body {name}: the ellipsoid's centre"), &ellipsoid.centre_m)?;
        for half in ellipsoid.semi_axes_m {
            interval(&format!("body {name}: half-length of the ellipsoid"), [0.0, half])?;
        }
    }
    Ok(whitening)
}

fn checked_scalar(scalar: &PhysicalScalar) -> Result<(), PhysicalError> {
    let name = &scalar.name;
    let limits = [scalar.lower, scalar.upper];
    for value in limits.into_iter().flatten().chain([scalar.prior, scalar.scale]) {
        finite(name, &[value])?;
    }
    if scalar.scale <= 0.0 {
        return Err(PhysicalError::EmptyInterval { what: format!("{name}: scale"), lower: 0.0, upper: scalar.scale });
    }
    match limits {
        [Some(lower), Some(upper)] => interval(name, [lower, upper]),
        _ => Ok(()),
    }
}

fn interval(what: &str, range: Limits) -> Result<(), PhysicalError> {
    let [lower, upper] = range;
    finite(what, &[lower, upper])?;
    if upper - lower > MIN_RELATIVE_WIDTH * lower.abs().max(upper.abs()) {
        Ok(())
    } else {
        Err(PhysicalError::EmptyInterval { what: what.into(), lower, upper })
    }
}

pub(super) fn expect(what: &str, expected: usize, found: usize) -> Result<(), PhysicalError> {
    if expected == found { Ok(()) } else { Err(PhysicalError::Mismatch { what: what.into(), expected, found }) }
}

pub(super) fn finite(what: &str, values: &[f64]) -> Result<(), PhysicalError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(PhysicalError::NotFinite { what: what.into(), value }),
        None => Ok(()),
    }
}
