//! The model in each class of forms, with its own held-out error.

use dynident_export::{ExportError, ModelFile, RobotModel};
use dynident_model::terms::{TermClass, TorqueTerm};
use serde::{Deserialize, Serialize};

/// The model with the torque terms that a class of forms can hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormResult {
    /// The class of terms.
    pub class: TermClass,
    /// Forms of `dynident export` that have this class.
    pub forms: Vec<String>,
    /// Whether terms of the identified model are missing in these forms, so that the others were fitted again.
    pub refitted: bool,
    /// The terms with their values.
    pub terms: Vec<FormTerm>,
    /// Error of the predicted torque, log by log.
    pub held_out: Vec<FormError>,
}

/// The identified robot, complete: what `dynident export` needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StoredModel {
    /// Links, joints, limits and bodies.
    pub robot: ModelFile,
    /// All torque terms with their values.
    pub terms: Vec<FormTerm>,
}

impl StoredModel {
    /// The robot with its terms.
    ///
    /// # Errors
    /// A model that cannot be read, or terms that do not match it.
    pub fn robot(&self) -> Result<RobotModel, ExportError> {
        let terms = self.terms.iter().map(|one| one.term.clone()).collect();
        self.robot.robot(terms, self.terms.iter().map(|one| one.value).collect())
    }
}

/// A term of a form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormTerm {
    /// Its symbol.
    pub symbol: String,
    /// Its value.
    pub value: f64,
    /// The unit of the value.
    pub unit: String,
    /// The term with its constants; joints by their numbers in `robot.joints`, from 0.
    pub term: TorqueTerm,
}

/// The error of a form on one held-out log, next to that of the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormError {
    /// The log.
    pub log: String,
    /// RMS error of the form's torque, percent of the RMS of the measured torque; `None` if the torque is zero.
    pub relative_error_percent: Option<f64>,
    /// The same of the identified model: of the consistent set, if there is one.
    pub model_relative_error_percent: Option<f64>,
}

impl FormResult {
    /// The errors of the form in sentences, one for each held-out log.
    pub fn sentences(&self) -> impl Iterator<Item = String> {
        let percent = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:.2} %"));
        self.held_out.iter().map(move |error| {
            format!(
                "Held-out torque error of this file: {} on {}; of the identified model: {}.",
                percent(error.relative_error_percent),
                error.log,
                percent(error.model_relative_error_percent)
            )
        })
    }
}
