//! Friction in the study file.

use crate::error::{Expected, StudyError};
use dynident_model::terms::{StatedFault, TermClass};
use serde::{Deserialize, Serialize};

pub use dynident_model::terms::FrictionTerm;

/// Source of a joint's friction model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FrictionChoice {
    /// The keys of the study.
    #[default]
    Stated,
    /// Selection by cross-validation within the training logs. `offset` and `drive_inertia` remain as given; the
    /// friction of the keys is one of the candidates.
    Auto,
}

/// Export format that must represent the selected friction without loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ExportableForm {
    /// URDF or SDF: viscous and Coulomb friction.
    Urdf,
    /// MJCF: the same friction.
    Mjcf,
    /// Generated functions of the current motion: all laws without hysteresis.
    Code,
}

impl From<ExportableForm> for TermClass {
    fn from(form: ExportableForm) -> Self {
        match form {
            ExportableForm::Urdf => Self::DampingAndFriction,
            ExportableForm::Mjcf => Self::DampingFrictionAndInertia,
            ExportableForm::Code => Self::FunctionsOfMotion,
        }
    }
}

impl From<StatedFault> for StudyError {
    fn from(fault: StatedFault) -> Self {
        match fault {
            StatedFault::Range { key, value, range: [least, most] } => {
                Self::Number { key: key.to_owned(), value, expected: Expected::Range(least, most) }
            }
            StatedFault::Twice { key, value } => {
                Self::Twice { what: key.to_owned(), name: value.to_string(), fix: "give it once" }
            }
            StatedFault::Empty { problem, fix } => Self::conflict(problem, fix),
        }
    }
}
