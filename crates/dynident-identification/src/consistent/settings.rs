//! Settings of the physically consistent fit, and prior knowledge of bodies and terms.

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
    /// The prior body instead of the nominal one: m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the origin of
    /// the link frame.
    #[serde(deserialize_with = "optional")]
    pub prior: Option<[f64; 10]>,
    /// Standard deviation of the prior body relative to itself: of its mass, its inertia, and its extent for the centre
    /// of mass. 0.02 keeps a body that was weighed and measured near its values. Without it, masses have 30 % and
    /// shapes are hardly restricted.
    pub prior_std: Option<f64>,
    /// The same ten parameters if they are known; they are not fitted.
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
    /// Distance from the prior bodies; entropic by default.
    pub prior: PhysicalPrior,
    /// Weight of that distance against half of the squared residual in standard deviations; 0.01 by default.
    pub prior_weight: f64,
    /// Smallest whitened eigenvalue of every pseudo-inertia; 1e-4 by default.
    pub margin: f64,
    /// The solver; interior point by default.
    pub route: PhysicalRoute,
    /// Largest certificate of a solved fit; 5e-8 by default.
    pub tolerance: f64,
    /// Largest number of iterations; 2000 by default.
    pub max_iterations: usize,
    /// Minimum and maximum total mass of all moving bodies, kg.
    #[serde(deserialize_with = "optional")]
    pub total_mass_kg: Option<[f64; 2]>,
    /// Prior knowledge of single bodies, by the name of their link.
    pub bodies: BTreeMap<String, BodyKnowledge>,
    /// Minimum and maximum parameter of a term, by its symbol (`fv1 = [0.0, 5.0]`). Friction and drive inertia are
    /// never negative.
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
    /// The solver's settings.
    pub fn fit(&self) -> PhysicalSettings {
        let Self { prior, prior_weight, margin, route, tolerance, max_iterations, .. } = *self;
        PhysicalSettings { route, prior, prior_weight, margin, tolerance, max_iterations }
    }

    /// Checks the settings of the solver. Limits are checked later, with the bodies.
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

/// An array of exactly `N` values; serde alone ignores further values.
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
