//! `[design] optimiser`: algorithm of the trajectory search.

use crate::error::StudyError;
use dynident_excitation::DerivativeFree;
use dynident_excitation::optimisers::{BinaryGeneticSettings, CmaEsSettings};
use serde::{Deserialize, Serialize};

/// An optimiser by its `kind`, with its settings in the same table; the name alone selects the default settings.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum OptimiserChoice {
    /// Many starts, exact gradients, augmented Lagrangian.
    #[default]
    Gradient,
    /// CMA-ES with a penalty proportional to the constraint violation.
    CmaEs(CmaEsSettings),
    /// Genetic algorithm with binary coding, as in *Iterative Identification of Robot Dynamic Parameters Based on
    /// Logistic Function*.
    Genetic(BinaryGeneticSettings),
}

impl OptimiserChoice {
    /// Value of `kind` in study files and results.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Gradient => "gradient",
            Self::CmaEs(_) => "cma-es",
            Self::Genetic(_) => "genetic",
        }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is out of range, or a seed, because the search has its own.
    pub fn validate(&self) -> Result<(), StudyError> {
        let (valid, seed) = match self {
            Self::Gradient => return Ok(()),
            Self::CmaEs(settings) => (settings.validate(), settings.seed),
            Self::Genetic(settings) => (settings.validate(), settings.seed),
        };
        valid.map_err(StudyError::at("optimiser"))?;
        if seed != 0 {
            return Err(StudyError::conflict("optimiser.seed", "give the seed as search.seed (or --seed)"));
        }
        Ok(())
    }

    /// The optimiser without derivatives; `None` for the gradient method.
    pub fn derivative_free(&self) -> Option<DerivativeFree> {
        match self {
            Self::Gradient => None,
            Self::CmaEs(settings) => Some(DerivativeFree::CmaEs(settings.clone())),
            Self::Genetic(settings) => Some(DerivativeFree::Genetic(settings.clone())),
        }
    }
}
