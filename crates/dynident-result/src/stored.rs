//! Reads a model from `result.json` for later jobs.

use super::identification::{RESULT_SCHEMA, ResultFile};
use super::seal::{HASH_KEY, content_sha256, stated_sha256};
use super::servo::SERVO_SCHEMA;
use crate::error::ResultFileError;
use crate::read::{parsed, read_result, schema_of};
use dynident_dynamics::ParametricModel;
use dynident_identification::RegressorModel;
use dynident_identification::payload::{KnownArm, Refit, known_payloads};
use dynident_study::{JointDrive, Study, StudyError, StudyFile, StudyFileError};
use nalgebra::DMatrix;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// Whether edited results are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Edits {
    Refused,
    Accepted,
}

/// Reads the keys of `T` from a result of `identify` with this version's schema; other keys are ignored.
///
/// # Errors
/// A file that cannot be read, is not a result, has another version, or was edited or damaged.
pub fn read_part<T: DeserializeOwned>(path: &Path) -> Result<T, ResultFileError> {
    let bytes = read_result(path)?;
    part_of(&bytes, path, Edits::Refused)
}

/// As [`read_part`], but reads from the text of a result.
fn part_of<T: DeserializeOwned>(bytes: &[u8], path: &Path, edits: Edits) -> Result<T, ResultFileError> {
    let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
    let schema = schema_of(bytes, path)?;
    if schema == SERVO_SCHEMA {
        let message = "a result of commands and positions holds no torque model: use its report, its JSON or the robot \
                       description next to it (page \"Arms without torque\")";
        return Err(wrong(message.to_owned()));
    }
    if schema != RESULT_SCHEMA {
        return Err(wrong(format!("schema `{schema}`, not `{RESULT_SCHEMA}`: identify again with this version")));
    }
    let part = parsed(bytes, path)?;
    if edits == Edits::Refused {
        let content: Value = parsed(bytes, path)?;
        if stated_sha256(&content).is_some_and(|stated| stated != content_sha256(&content)) {
            return Err(wrong(format!(
                "the content does not match {HASH_KEY}: the file was edited or damaged; identify again, or call `export` or `validate` with --accept-edited if you trust the changes"
            )));
        }
    }
    Ok(part)
}

impl ResultFile {
    /// Reads a result of `identify`.
    ///
    /// # Errors
    /// A file that cannot be read, is not a result, has another version, was edited or damaged, or contains implausible
    /// numbers.
    pub fn read(path: &Path) -> Result<Self, ResultFileError> {
        let bytes = read_result(path)?;
        Self::parse(&bytes, path)
    }

    /// Reads a result of `identify` that may have been edited: its hash is not checked. Implausible numbers are still
    /// rejected.
    ///
    /// # Errors
    /// As [`read`](Self::read), except for the hash.
    pub fn read_edited(path: &Path) -> Result<Self, ResultFileError> {
        let bytes = read_result(path)?;
        Self::checked(&bytes, path, Edits::Accepted)
    }

    /// Reads a result of `identify` from text; `path` is its name in messages.
    ///
    /// # Errors
    /// A text that is not a result, has another version, was edited or damaged, or contains implausible numbers.
    pub fn parse(text: &[u8], path: &Path) -> Result<Self, ResultFileError> {
        Self::checked(text, path, Edits::Refused)
    }

    fn checked(text: &[u8], path: &Path, edits: Edits) -> Result<Self, ResultFileError> {
        let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
        let stored: Self = part_of(text, path, edits)?;
        stored.require_sound_numbers().map_err(wrong)?;
        for joint in &stored.friction_choice {
            let mut terms = joint.drive.iter().flat_map(|drive| drive.terms.iter().flatten());
            terms
                .try_for_each(|term| term.law().check().map_err(StudyError::from))
                .map_err(|error| wrong(format!("friction_choice of joint `{}`: {error}", joint.joint)))?;
        }
        Ok(stored)
    }

    /// The study with the drive inertia, friction and lag that were selected for the model.
    pub fn as_fitted(&self, study: &Study) -> Study {
        let mut study = study.clone();
        if study.motion.torque_lag_s.is_none() {
            study.motion.torque_lag_s.clone_from(&self.method.motion.torque_lag_s);
        }
        for joint in &self.friction_choice {
            if let Some(drive) = &joint.drive {
                let own = study.drive.joints.entry(joint.joint.clone()).or_default();
                *own = JointDrive { drive_inertia: own.drive_inertia, offset: own.offset, ..drive.clone() };
            }
        }
        if let Some(choice) = &self.drive_inertia_choice {
            for joint in &choice.joints {
                study.drive.joints.entry(joint.clone()).or_default().drive_inertia = Some(choice.seen);
            }
        }
        study
    }

    /// Cut-off of the low-pass on the positions, Hz.
    pub fn cutoff_hz(&self) -> Option<f64> {
        self.method.motion.differentiator.cutoff_hz()
    }

    /// Cut-off of the frequency band of held-out errors, Hz, if it differs from the cut-off of the fit.
    pub fn motion_hz(&self) -> Option<f64> {
        self.method.motion_hz
    }

    /// The base parameters of the result, which must be the base parameters of `model`.
    ///
    /// # Errors
    /// Different base parameters, or values that are not finite.
    pub fn base_values(&self, path: &Path, model: &ParametricModel) -> Result<Vec<f64>, ResultFileError> {
        let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
        let expressions = model.base().expressions();
        if self.base_parameters.len() != expressions.len() {
            return Err(wrong(format!(
                "{} base parameters, but the study's robot has {}: use the study that the result was made with",
                self.base_parameters.len(),
                expressions.len()
            )));
        }
        let mut values = Vec::with_capacity(expressions.len());
        let complete = model.base().complete_expressions();
        for ((stored, expression), complete) in self.base_parameters.iter().zip(&expressions).zip(&complete) {
            if stored.expression != *expression && stored.expression != *complete {
                return Err(wrong(format!(
                    "base parameter `{}`, but the study's robot has `{expression}`: use the study that the result was made with",
                    stored.expression
                )));
            }
            if !stored.value.is_finite() {
                return Err(wrong(format!("the value of `{expression}` is not finite")));
            }
            values.push(stored.value);
        }
        self.require_laws(path, model)?;
        Ok(values)
    }

    /// Checks that torques declared by `[[torque]]` have the same functions as in the result; equal symbols alone do
    /// not guarantee this.
    fn require_laws(&self, path: &Path, model: &ParametricModel) -> Result<(), ResultFileError> {
        for term in model.terms() {
            let (Some(function), symbol) = (term.state_function(), term.symbol()) else { continue };
            let stored = self.joints.iter().flat_map(|joint| &joint.terms).find(|stored| stored.symbol == symbol);
            let law = stored.and_then(|stored| stored.law.clone()).unwrap_or_default();
            let own = function.description();
            if law != own {
                let message = format!(
                    "torque `{symbol}` was `{law}`, but is `{own}` in the study: use the study that the result was made with"
                );
                return Err(ResultFileError::Content { path: path.to_owned(), message });
            }
        }
        Ok(())
    }

    /// The base parameters of the physically consistent model, if the result contains one. `path` is that of the
    /// result, for messages.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn consistent_values(&self, path: &Path) -> Result<Option<Vec<f64>>, ResultFileError> {
        let values: Option<Vec<f64>> = self.base_parameters.iter().map(|stored| stored.physical).collect();
        if values.as_ref().is_some_and(|values| values.iter().any(|value| !value.is_finite())) {
            let message = "a physical value of a base parameter is not finite".to_owned();
            return Err(ResultFileError::Content { path: path.to_owned(), message });
        }
        Ok(values)
    }

    /// The model with the parameters of load-dependent friction and the torque gains of this result.
    ///
    /// # Errors
    /// Load parameters or gains that do not match `model`.
    pub fn regressor_model(&self, path: &Path, model: &ParametricModel) -> Result<RegressorModel, ResultFileError> {
        let wrong = |message: &str| ResultFileError::Content { path: path.to_owned(), message: message.to_owned() };
        if let Some(load) = &self.method.load_parameters
            && (load.len() != self.base_parameters.len() || load.iter().any(|value| !value.is_finite()))
        {
            return Err(wrong("load_parameters does not contain one finite number per base parameter: identify again"));
        }
        let torque_gains: Vec<f64> = self.drive_gains.iter().flatten().map(|stored| stored.gain).collect();
        let usable = torque_gains.iter().all(|gain| gain.is_finite());
        if !(torque_gains.is_empty() || torque_gains.len() == model.dof() && usable) {
            return Err(wrong("drive_gains does not contain one finite number per joint: identify again"));
        }
        let load_parameters = self.method.load_parameters.clone();
        Ok(RegressorModel { parametric: model.clone(), load_parameters, torque_gains })
    }

    /// The known arm for payload identification.
    ///
    /// # Errors
    /// [`ResultFileError::Content`] for another robot, or without a usable covariance.
    pub fn known_arm(&self, path: &Path, model: &ParametricModel, refit: Refit) -> Result<KnownArm, ResultFileError> {
        let wrong = |message: &str| ResultFileError::Content { path: path.to_owned(), message: message.to_owned() };
        let values = self.base_values(path, model)?;
        let (rows, n) = (&self.base_parameter_covariance, values.len());
        if rows.len() != n || rows.iter().any(|row| row.len() != n || row.iter().any(|value| !value.is_finite())) {
            return Err(wrong(
                "base_parameter_covariance does not contain one finite number per pair of base parameters: identify the arm again with this version",
            ));
        }
        if self.drive_gains.is_some() {
            return Err(wrong(
                "the arm was identified with unknown gains: write the gains as scale under [format.torque] and identify the arm again",
            ));
        }
        let covariance = DMatrix::from_fn(n, n, |row, column| rows[row][column]);
        KnownArm::new(values, covariance, refit, self.cutoff_hz()).map_err(|error| wrong(&error.to_string()))
    }

    /// Changes of the base parameters by the payloads of the study.
    ///
    /// # Errors
    /// Payloads that do not match `model`, or an unknown payload of a log.
    pub fn payloads(
        &self,
        path: &Path,
        study: StudyFile<'_>,
        model: &RegressorModel,
    ) -> Result<StoredPayloads, ResultFileError> {
        let known = known_payloads(&study.payloads(), model);
        let mut added = known.map_err(StudyFileError::study(study.path))?;
        let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
        for payload in &self.payloads {
            let values = &payload.base_parameters_added;
            if values.len() != model.layout().columns().len() || values.iter().any(|value| !value.is_finite()) {
                let name = &payload.name;
                return Err(wrong(format!(
                    "payload `{name}`: base_parameters_added does not contain one finite number per base parameter"
                )));
            }
            added.push((payload.name.clone(), values.clone()));
        }
        for name in study.log.iter().filter_map(|log| log.payload.as_ref()) {
            if added.iter().all(|(known, _)| known != name) {
                return Err(wrong(format!(
                    "unknown payload `{name}` of a [[log]]: give its mass_kg and com_m in the study, or identify it"
                )));
            }
        }
        Ok(StoredPayloads { added })
    }
}

/// Changes of the base parameters by payloads, identified and known ones.
pub struct StoredPayloads {
    added: Vec<(String, Vec<f64>)>,
}

impl StoredPayloads {
    /// Base parameters for a log with this payload.
    pub fn base_values(&self, carried: Option<&String>, theta: &[f64]) -> Vec<f64> {
        let added = self.added.iter().find(|(name, _)| Some(name) == carried);
        theta.iter().enumerate().map(|(k, value)| value + added.map_or(0.0, |(_, added)| added[k])).collect()
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edited_result_is_a_regular_file_too() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("r.json");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [&*pipe, Path::new("/dev/zero")] {
            let error = ResultFile::read_edited(path).unwrap_err().to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
    }
}
