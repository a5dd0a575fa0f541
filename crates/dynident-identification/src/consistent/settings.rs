//! Settings of the physically consistent fit, and prior knowledge of bodies and friction.

use super::error::ConsistencyError;
use dynident_estimation::consistent::{PhysicalError, PhysicalPrior, PhysicalRoute, PhysicalSettings};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// An ellipsoid with its axes along those of the link frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EllipsoidSettings {
    /// Centre in the link frame, m.
    #[serde(deserialize_with = "exactly")]
    pub centre_m: [f64; 3],
    /// Half-lengths along the three axes, m.
    #[serde(deserialize_with = "exactly")]
    pub semi_axes_m: [f64; 3],
}

/// Prior knowledge of one body; empty by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct BodyKnowledge {
    /// Minimum and maximum mass, kg.
    #[serde(deserialize_with = "optional")]
    pub mass_kg: Option<[f64; 2]>,
    /// Corners of a box that contains the centre of mass, in the link frame, m.
    #[serde(deserialize_with = "corners")]
    pub com_box_m: Option<[[f64; 3]; 2]>,
    /// An ellipsoid that contains all of the mass.
    pub inside: Option<EllipsoidSettings>,
    /// Prior body in place of the body in the robot description: m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz
    /// about the origin of the link frame.
    #[serde(deserialize_with = "optional")]
    pub prior: Option<[f64; 10]>,
    /// Relative standard deviation of the prior body: of its mass, of its inertia, and of its centre of mass in units
    /// of the extent of the body. With 0.02, a body that was weighed and measured remains near its values. Without this
    /// setting, masses have a standard deviation of 30 %, and the mass distribution is hardly restricted.
    pub prior_std: Option<f64>,
    /// Known inertial parameters of the body, in the same order as `prior`; they are not fitted.
    #[serde(deserialize_with = "optional")]
    pub known: Option<[f64; 10]>,
}

/// Settings of the physically consistent fit, and prior knowledge. See [`PhysicalSettings`] and
/// [`PhysicalBody`](dynident_estimation::consistent::PhysicalBody).
///
/// ```
/// use dynident_identification::consistent::ConsistencySettings;
/// let settings: ConsistencySettings = toml::from_str(
///     "prior = \"euclidean\"\nprior_weight = 0.1\ntotal_mass_kg = [25.0, 35.0]\nbodies.forearm = { mass_kg = [1.0, 3.0] }",
/// )?;
/// assert!(settings.validate().is_ok());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ConsistencySettings {
    /// Measure of the distance from the prior bodies; entropic by default.
    pub prior: PhysicalPrior,
    /// Weight of this distance, relative to half of the squared residual in units of its variance; 0.01 by default.
    pub prior_weight: f64,
    /// Minimum eigenvalue of every pseudo-inertia, relative to the prior body (whitened); 1e-4 by default.
    pub margin: f64,
    /// Solver of the optimisation problem; interior point by default.
    pub route: PhysicalRoute,
    /// Largest value of the optimality certificate at which a fit is treated as solved; 5e-8 by default.
    pub tolerance: f64,
    /// Largest number of iterations; 2000 by default.
    pub max_iterations: usize,
    /// Minimum and maximum total mass of all moving bodies, kg.
    #[serde(deserialize_with = "optional")]
    pub total_mass_kg: Option<[f64; 2]>,
    /// Prior knowledge of single bodies, by the name of their link.
    pub bodies: BTreeMap<String, BodyKnowledge>,
    /// Minimum and maximum of a friction or drive parameter, by its symbol (`fv1 = [0.0, 5.0]`). Friction and drive
    /// inertia are never negative.
    #[serde(deserialize_with = "intervals")]
    #[serde(rename = "laws")]
    pub terms: BTreeMap<String, [f64; 2]>,
}

impl Default for ConsistencySettings {
    fn default() -> Self {
        let PhysicalSettings { route, prior, prior_weight, margin, tolerance, max_iterations } =
            PhysicalSettings::default();
        Self {
            prior,
            prior_weight,
            margin,
            route,
            tolerance,
            max_iterations,
            total_mass_kg: None,
            bodies: BTreeMap::new(),
            terms: BTreeMap::new(),
        }
    }
}

impl ConsistencySettings {
    /// Settings for the solver.
    pub fn fit(&self) -> PhysicalSettings {
        let Self { prior, prior_weight, margin, route, tolerance, max_iterations, .. } = *self;
        PhysicalSettings { route, prior, prior_weight, margin, tolerance, max_iterations }
    }

    /// Checks the settings of the solver. Limits of bodies are checked later, together with the robot.
    ///
    /// # Errors
    /// As [`PhysicalSettings::validate`].
    pub fn validate(&self) -> Result<(), PhysicalError> {
        self.fit().validate()
    }

    /// Checks the names of all bodies and terms.
    ///
    /// # Errors
    /// An unknown name.
    pub fn check_names(&self, model: &Model, terms: &[TorqueTerm]) -> Result<(), ConsistencyError> {
        for name in self.bodies.keys() {
            if model.bodies().iter().any(|body| body.name() == name) {
                continue;
            }
            if let Some(body) = model.bodies().iter().find(|body| body.links.iter().any(|link| link.name == *name)) {
                return Err(ConsistencyError::MergedLink { link: name.clone(), body: body.name().to_owned() });
            }
            let known = model.bodies().iter().map(|body| body.name().to_owned()).collect();
            return Err(ConsistencyError::UnknownBody { name: name.clone(), known });
        }
        let known: Vec<String> = terms.iter().map(TorqueTerm::symbol).collect();
        match self.terms.keys().find(|symbol| !known.contains(symbol)) {
            Some(symbol) => Err(ConsistencyError::UnknownTerm { symbol: symbol.clone(), known }),
            None => Ok(()),
        }
    }
}

/// Reads an array of exactly `N` values; serde alone ignores further values.
fn array<T, const N: usize, E: serde::de::Error>(values: Vec<T>) -> Result<[T; N], E> {
    let found = values.len();
    values.try_into().map_err(|_| E::custom(format!("{found} values where {N} are expected")))
}

fn exactly<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error> {
    array(Vec::deserialize(deserializer)?)
}

fn optional<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; N]>, D::Error> {
    Option::<Vec<f64>>::deserialize(deserializer)?.map(array).transpose()
}

fn corners<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[[f64; 3]; 2]>, D::Error> {
    let Some(corners) = Option::<Vec<Vec<f64>>>::deserialize(deserializer)? else { return Ok(None) };
    array(corners.into_iter().map(array).collect::<Result<Vec<_>, _>>()?).map(Some)
}

fn intervals<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, [f64; 2]>, D::Error> {
    BTreeMap::<String, Vec<f64>>::deserialize(deserializer)?
        .into_iter()
        .map(|(name, values)| Ok((name, array(values)?)))
        .collect()
}
