//! The identified model as each class of export formats can represent it, with its held-out error.

use dynident_estimation::ValidationReport;
use dynident_export::{ExportError, ModelFile, RobotModel};
use dynident_model::InertialParameters;
use dynident_model::terms::{TermClass, TorqueTerm};
use serde::{Deserialize, Serialize};

/// The model restricted to the torque terms that a class of export formats can contain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormResult {
    /// The class of torque terms.
    pub class: TermClass,
    /// Export formats of this class, named as in `dynident export`.
    pub forms: Vec<String>,
    /// Whether these formats lack some torque terms of the identified model. The values of the remaining terms were
    /// then fitted again.
    pub refitted: bool,
    /// The torque terms of this class with their values.
    pub terms: Vec<FormTerm>,
    /// Error of the predicted torque on each held-out log.
    pub held_out: Vec<FormError>,
}

/// The complete identified robot: the input of `dynident export`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StoredModel {
    /// Links, joints, limits and inertial parameters of the robot.
    pub robot: ModelFile,
    /// All torque terms with their values.
    pub terms: Vec<FormTerm>,
    /// Only with load-dependent friction: ten inertial parameters for each body. The rigid-body torque of these bodies
    /// is the load in the friction law (see `method.load_parameters`). The values come from base parameters, so the
    /// bodies need not be physically consistent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_bodies: Option<Vec<[f64; 10]>>,
}

impl StoredModel {
    /// The robot model with its torque terms.
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

/// A torque term of an export format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormTerm {
    /// Symbol of the term's parameter.
    pub symbol: String,
    /// Value of the parameter.
    pub value: f64,
    /// The unit of the value.
    pub unit: String,
    /// Function of the torque term with its constants. Joint numbers are indices of `robot.joints`, from 0.
    pub term: TorqueTerm,
}

/// Torque error of an export format on one held-out log, compared with the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormError {
    /// The log.
    pub log: String,
    /// RMS error of the torque in this format, percent of the RMS of the measured torque; `None` if the measured torque
    /// is zero.
    pub relative_error_percent: Option<f64>,
    /// RMS error of the identified model (of the physically consistent set, if there is one), percent of the RMS of the
    /// measured torque.
    pub model_relative_error_percent: Option<f64>,
    /// The errors of every joint; empty in results of older versions.
    #[serde(default)]
    pub joints: Vec<FormJointError>,
}

/// Torque error of an export format at one joint, compared with the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FormJointError {
    /// The joint.
    pub joint: String,
    /// RMS error of the torque in this format, Nm (N for a prismatic joint).
    pub rmse_nm: f64,
    /// RMS error, percent of the RMS of the measured torque; `None` if the torque is zero.
    pub relative_error_percent: Option<f64>,
    /// RMS error of the identified model, percent of the RMS of the measured torque.
    pub model_relative_error_percent: Option<f64>,
}

impl FormJointError {
    /// Pairs the errors of the export format and of the identified model, joint by joint.
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
    /// Whether friction with hysteresis is among the terms, so that code with state differs from code without state.
    pub fn has_memory(&self) -> bool {
        self.terms.iter().any(|one| one.term.has_memory())
    }

    /// The errors of the export format in sentences, one for each held-out log; `what` is the name of the format.
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
