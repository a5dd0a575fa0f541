//! The model in each class of forms, with its own held-out error.

use dynident_export::{ExportError, ModelFile, RobotModel};
use dynident_model::InertialParameters;
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
    /// With load-dependent friction: the ten inertial parameters of each body whose torque is the load (see
    /// `method.load_parameters`). They are base parameters, not those of physically consistent bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_bodies: Option<Vec<[f64; 10]>>,
}

impl StoredModel {
    /// The robot with its terms.
    pub(crate) fn robot(&self) -> Result<RobotModel, ExportError> {
        let terms = self.terms.iter().map(|one| one.term.clone()).collect();
        let robot = self.robot.robot(terms, self.terms.iter().map(|one| one.value).collect())?;
        match &self.load_bodies {
            Some(bodies) => robot.with_load(bodies.iter().copied().map(InertialParameters).collect()),
            None => Ok(robot),
        }
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
    /// Whether a term has a memory: for the class with state, whether it differs from code without state.
    pub fn has_memory(&self) -> bool {
        self.terms.iter().any(|one| one.term.has_memory())
    }

    /// The errors of the form in sentences, one for each held-out log; `what` is the name of the form.
    pub(crate) fn sentences(&self, what: &str) -> impl Iterator<Item = String> {
        let percent = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:.2} %"));
        self.held_out.iter().map(move |error| {
            format!(
                "Held-out torque error of {what}: {} on {}; of the identified model: {}.",
                percent(error.relative_error_percent),
                error.log,
                percent(error.model_relative_error_percent)
            )
        })
    }
}
