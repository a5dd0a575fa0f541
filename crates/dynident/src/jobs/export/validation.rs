//! `NAME.validation.json`: the held-out error of an exported file.

use crate::digest::hexadecimal;
use crate::result::{
    EXPORT_VALIDATION_SCHEMA, ExportValidationFile, FormError, FormJointError, Provenance, ResultFile, ServoFile,
    ServoForm,
};
use dynident_export::{Target, terms_left_out};
use dynident_identification::examination::LogValidation;
use dynident_identification::payload::ControllerPayload;
use dynident_model::terms::{TermClass, TorqueTerm};
use sha2::{Digest, Sha256};

/// Ending of the name of the file with the held-out error of an exported file: `arm.urdf.validation.json`.
pub const EXPORT_VALIDATION_SUFFIX: &str = ".validation.json";

/// Content of the validation file of an exported file: the held-out errors of the exported format and of the model on
/// each log, the omitted terms, and the SHA-256 of `text`. `file` is the name of the exported file.
pub fn export_validation(stored: &ResultFile, target: Target, file: &str, text: &str) -> ExportValidationFile {
    of_class(stored, target.name(), target.class(), file, text)
}

/// Like [`export_validation()`] for a D-H table, which can represent the same terms as URDF.
pub fn table_validation(stored: &ResultFile, file: &str, text: &str) -> ExportValidationFile {
    of_class(stored, "dh", Target::Urdf.class(), file, text)
}

/// Like [`export_validation()`] for a payload in the format with this name: the interval of each value.
pub fn payload_validation(
    stored: &ResultFile,
    payload: Option<&ControllerPayload>,
    form: &str,
    file: &str,
    text: &str,
) -> ExportValidationFile {
    ExportValidationFile { payload: payload.cloned(), ..empty(stored, form, file, text) }
}

/// Like [`export_validation()`] for drives identified from commands: the error of the motion that is simulated with
/// the file.
pub fn servo_validation(
    stored: &ServoFile,
    forms: &[ServoForm],
    form: &str,
    file: &str,
    text: &str,
) -> ExportValidationFile {
    let empty = without_errors(stored.provenance.as_ref(), &stored.study, &stored.problems, form, file, text);
    ExportValidationFile { servo_forms: forms.to_vec(), ..empty }
}

fn of_class(stored: &ResultFile, name: &str, class: Option<TermClass>, file: &str, text: &str) -> ExportValidationFile {
    let mut validation = empty(stored, name, file, text);
    match class.map(|class| stored.forms.iter().find(|form| form.class == class)) {
        // The format contains the complete model.
        None => validation.held_out = errors_of_model(stored),
        Some(None) => {}
        Some(Some(form)) => {
            validation.refitted = form.refitted;
            validation.held_out.clone_from(&form.held_out);
            let kept: Vec<TorqueTerm> = form.terms.iter().map(|one| one.term.clone()).collect();
            let robot = stored.model.as_ref().and_then(|model| model.robot().ok());
            validation.left_out = robot.map(|robot| terms_left_out(&robot, &kept)).unwrap_or_default();
        }
    }
    validation
}

fn errors_of_model(stored: &ResultFile) -> Vec<FormError> {
    let error = |log: &LogValidation| {
        let model = log.physical.as_ref().unwrap_or(&log.model);
        FormError {
            log: log.log.clone(),
            relative_error_percent: model.relative_error_percent,
            model_relative_error_percent: model.relative_error_percent,
            joints: FormJointError::of_joints(model, model),
        }
    };
    stored.validation.iter().map(error).collect()
}

fn empty(stored: &ResultFile, form: &str, file: &str, text: &str) -> ExportValidationFile {
    without_errors(stored.provenance.as_ref(), &stored.name, &stored.problems, form, file, text)
}

/// Validation of an exported file with this provenance, name and problems, without errors.
fn without_errors(
    provenance: Option<&Provenance>,
    name: &str,
    problems: &[String],
    form: &str,
    file: &str,
    text: &str,
) -> ExportValidationFile {
    let mut provenance = provenance.cloned();
    if let Some(provenance) = &mut provenance {
        // The hash belongs to another file.
        provenance.content_sha256 = None;
    }
    ExportValidationFile {
        schema: EXPORT_VALIDATION_SCHEMA.to_owned(),
        provenance,
        name: name.to_owned(),
        form: form.to_owned(),
        file: file.to_owned(),
        sha256: hexadecimal(&Sha256::digest(text.as_bytes())),
        refitted: false,
        held_out: Vec::new(),
        left_out: Vec::new(),
        payload: None,
        servo_forms: Vec::new(),
        problems: problems.to_vec(),
    }
}
