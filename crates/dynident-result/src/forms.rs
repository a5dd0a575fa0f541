//! The model in each class of forms, with its own held-out error.

use dynident_estimation::ValidationReport;
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
    ///
    /// # Errors
    /// A model that cannot be read, or terms that do not match it.
    pub fn robot(&self) -> Result<RobotModel, ExportError> {
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
    /// The errors of every joint; empty in results of older versions.
    #[serde(default)]
    pub joints: Vec<FormJointError>,
}

/// The error of a form at one joint, next to that of the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormJointError {
    /// The joint.
    pub joint: String,
    /// RMS error of the form's torque, Nm (N for a prismatic joint).
    pub rmse_nm: f64,
    /// RMS error, percent of the RMS of the measured torque; `None` if the torque is zero.
    pub relative_error_percent: Option<f64>,
    /// The same of the identified model.
    pub model_relative_error_percent: Option<f64>,
}

impl FormJointError {
    /// Every joint of the reports of a form and of the model.
    pub fn of_joints(form: &ValidationReport, model: &ValidationReport) -> Vec<Self> {
        let of_model = |name: &String| {
            let joint = model.joints.iter().find(|joint| joint.name == *name)?;
            joint.relative_error_percent
        };
        let joint = form.joints.iter().map(|joint| Self {
            joint: joint.name.clone(),
            rmse_nm: joint.rmse_nm,
            relative_error_percent: joint.relative_error_percent,
            model_relative_error_percent: of_model(&joint.name),
        });
        joint.collect()
    }
}

impl FormResult {
    /// Whether a term has a memory: for the class with state, whether it differs from code without state.
    pub fn has_memory(&self) -> bool {
        self.terms.iter().any(|one| one.term.has_memory())
    }

    /// The errors of the form in sentences, one for each held-out log; `what` is the name of the form.
    pub fn sentences(&self, what: &str) -> impl Iterator<Item = String> {
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
