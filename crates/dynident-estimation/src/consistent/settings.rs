//! Settings of a physical fit.

use super::error::PhysicalError;
use super::priors::PhysicalPrior;
use serde::{Deserialize, Serialize};

/// Solver of the convex problem. Both have the same optimum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PhysicalRoute {
    /// Primal-dual interior point on the pseudo-inertias: fast, and equally accurate inside the cone and on its
    /// boundary. If it does not reach the tolerance in double precision, the other route is tried and the better
    /// result is used.
    #[default]
    InteriorPoint,
    /// Gauss-Newton in log-Cholesky coordinates with a decreasing barrier: an independent check.
    LogCholesky,
}

/// Settings of [`physical_fit`](super::physical_fit).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicalSettings {
    /// The solver. Default `interior-point`.
    pub route: PhysicalRoute,
    /// Distance measure from the prior bodies. Default `entropic`.
    pub prior: PhysicalPrior,
    /// γ: weight of that distance against half the squared distance from the optimum of the data in standard
    /// deviations. Default 0.01: the fit to the data is worse by at most 0.01 times the distance, which is not
    /// significant, and directions without data get the prior's values.
    pub prior_weight: f64,
    /// ε of `P ⪰ ε P0` for every body. Default 1e-4: mass extends over a hundredth of the reference's size in every
    /// direction, which is true for any real link.
    pub margin: f64,
    /// Maximum certificate (relative stationarity and duality gap) of a solved fit. Default 5e-8.
    pub tolerance: f64,
    /// Maximum number of iterations. Default 2000; the interior point takes 15 to 80, log-Cholesky 60 to 350.
    pub max_iterations: usize,
}

impl Default for PhysicalSettings {
    fn default() -> Self {
        Self {
            route: PhysicalRoute::default(),
            prior: PhysicalPrior::default(),
            prior_weight: 1.0e-2,
            margin: 1.0e-4,
            tolerance: 5.0e-8,
            max_iterations: 2000,
        }
    }
}

impl PhysicalSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`PhysicalError::Setting`] for a prior weight outside 1e-9 to 1e9, a margin outside 1e-9 to 0.5, a tolerance
    /// outside 1e-10 to 1e-2, or zero iterations.
    pub fn validate(&self) -> Result<(), PhysicalError> {
        let within = |setting, value: f64, least: f64, greatest: f64, fix| {
            if (least..=greatest).contains(&value) {
                Ok(())
            } else {
                Err(PhysicalError::Setting { setting, value, fix })
            }
        };
        let fix = "use a weight from 1e-9 to 1e9; without a prior, directions without data are undetermined";
        within("prior_weight", self.prior_weight, 1.0e-9, 1.0e9, fix)?;
        within("margin", self.margin, 1.0e-9, 0.5, "use a share of the reference body from 1e-9 to 0.5")?;
        within("tolerance", self.tolerance, 1.0e-10, 1.0e-2, "use a relative accuracy from 1e-10 to 1e-2")?;
        within("max_iterations", self.max_iterations as f64, 1.0, f64::INFINITY, "use at least 1")
    }
}
