//! `[design] optimiser`: what looks for the motion.

use crate::error::StudyError;
use dynident_excitation::DerivativeFree;
use dynident_excitation::optimisers::{BinaryGeneticSettings, CmaEsSettings};
use serde::{Deserialize, Serialize};

/// An optimiser by its `kind`, with its own settings beside it; the name alone stands for the defaults.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum OptimiserChoice {
    /// Many starts, exact gradients, augmented Lagrangian.
    #[default]
    Gradient,
    /// CMA-ES with a penalty in proportion to what is broken.
    CmaEs(CmaEsSettings),
    /// The paper's genetic algorithm.
    Genetic(BinaryGeneticSettings),
}

impl OptimiserChoice {
    /// The `kind` in study files and results.
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
    /// The first that is out of range, and a seed: the search has one already.
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

    /// The optimiser for the ordinary problem; none for gradients.
    pub(crate) fn derivative_free(&self) -> Option<DerivativeFree> {
        match self {
            Self::Gradient => None,
            Self::CmaEs(settings) => Some(DerivativeFree::CmaEs(settings.clone())),
            Self::Genetic(settings) => Some(DerivativeFree::Genetic(settings.clone())),
        }
    }
}
