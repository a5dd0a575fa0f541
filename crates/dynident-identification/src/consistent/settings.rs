//! What is known of a robot's bodies and terms before the data: settings of the physically consistent set that fits
//! best.

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

/// What is known of one body; nothing by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct BodyKnowledge {
    /// Least and greatest mass, kg.
    #[serde(deserialize_with = "perhaps")]
    pub mass_kg: Option<[f64; 2]>,
    /// Corners of a box (axes of the link frame, m) that holds the centre of mass.
    #[serde(deserialize_with = "corners")]
    pub com_box_m: Option<[[f64; 3]; 2]>,
    /// An ellipsoid that holds all of the mass.
    pub inside: Option<EllipsoidSettings>,
    /// The prior body in place of the description's: m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link
    /// frame's origin.
    #[serde(deserialize_with = "perhaps")]
    pub prior: Option<[f64; 10]>,
    /// The same ten, if they are known and not to be fitted.
    #[serde(deserialize_with = "perhaps")]
    pub known: Option<[f64; 10]>,
}

/// How the physically consistent set that fits best is found, and what is known of it. See [`PhysicalSettings`] and
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
    /// What one unit of that distance costs against half a squared standard deviation of the data; 0.01 by default.
    pub prior_weight: f64,
    /// Least whitened eigenvalue of every pseudo-inertia; 1e-4 by default.
    pub margin: f64,
    /// The solver; interior point by default.
    pub route: PhysicalRoute,
    /// Largest certificate at which the fit counts as solved; 5e-8 by default.
    pub tolerance: f64,
    /// Most iterations; 2000 by default.
    pub max_iterations: usize,
    /// Least and greatest sum of all moving bodies' masses, kg.
    #[serde(deserialize_with = "perhaps")]
    pub total_mass_kg: Option<[f64; 2]>,
    /// What is known of single bodies, by the name of their link.
    pub bodies: BTreeMap<String, BodyKnowledge>,
    /// Least and greatest parameter of a term, by its symbol (`fv1 = [0.0, 5.0]`); friction and drive inertia stay at
    /// zero or more.
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

    /// Checks the solver's numbers. Limits are checked where the bodies are at hand.
    ///
    /// # Errors
    /// As [`PhysicalSettings::validate`].
    pub fn validate(&self) -> Result<(), PhysicalError> {
        self.fit().validate()
    }

    /// Checks that all bodies and terms named are there.
    ///
    /// # Errors
    /// The name, with those that there are.
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

/// An array of `N` values and no more: serde by itself ignores what follows.
fn counted<T, const N: usize, E: serde::de::Error>(values: Vec<T>) -> Result<[T; N], E> {
    let found = values.len();
    values.try_into().map_err(|_| E::custom(format!("{found} values where {N} are expected")))
}

fn exactly<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; N], D::Error> {
    counted(Vec::deserialize(deserializer)?)
}

fn perhaps<'de, const N: usize, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; N]>, D::Error> {
    Option::<Vec<f64>>::deserialize(deserializer)?.map(counted).transpose()
}

fn corners<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[[f64; 3]; 2]>, D::Error> {
    let Some(corners) = Option::<Vec<Vec<f64>>>::deserialize(deserializer)? else { return Ok(None) };
    counted(corners.into_iter().map(counted).collect::<Result<Vec<_>, _>>()?).map(Some)
}

fn intervals<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, [f64; 2]>, D::Error> {
    BTreeMap::<String, Vec<f64>>::deserialize(deserializer)?
        .into_iter()
        .map(|(name, values)| Ok((name, counted(values)?)))
        .collect()
}
