//! The model in each class of export formats, for the result file.

use crate::result::{FormError, FormJointError, FormResult, FormTerm, StoredModel};
use crate::study::Study;
use dynident_estimation::ValidationReport;
use dynident_export::{ModelFile, RobotModel, Target};
use dynident_identification::Identification;
use dynident_identification::forms::FormFit;
use dynident_model::InertialParameters;
use dynident_model::terms::{TermClass, TorqueTerm};

/// The results for all classes of export formats.
pub(super) fn form_results(found: &Identification) -> Vec<FormResult> {
    found.forms.iter().map(|form| form_result(found, form)).collect()
}

fn form_result(found: &Identification, form: &FormFit) -> FormResult {
    let error = |(index, report): &(usize, ValidationReport)| {
        let tested = found.held_out.iter().find(|tested| tested.index == *index)?;
        let model = tested.validation.physical.as_ref().unwrap_or(&tested.validation.model);
        Some(FormError {
            log: tested.validation.log.clone(),
            relative_error_percent: report.relative_error_percent,
            model_relative_error_percent: model.relative_error_percent,
            joints: FormJointError::of_joints(report, model),
        })
    };
    let has_class = |target: &Target| match form.class {
        TermClass::WithState => target.has_state(),
        class => target.class() == Some(class),
    };
    FormResult {
        class: form.class,
        forms: Target::ALL.into_iter().filter(has_class).map(|target| target.name().to_owned()).collect(),
        refitted: form.is_refitted,
        terms: form_terms(&form.terms, &form.values),
        held_out: form.held_out.iter().filter_map(error).collect(),
    }
}

/// The identified robot; `None` if a body has no parameters. If the description has no limit, that of the study is
/// used.
pub(super) fn stored_model(
    study: &Study,
    found: &Identification,
    inertials: &[InertialParameters],
) -> Option<StoredModel> {
    let model = &found.model().parametric;
    let values = &found.consistent.parameters[model.model().inertial_count()..];
    let robot = model.model().with_inertials(inertials).ok()?.with_missing_limits(|joint| study.joint_limits(joint));
    let robot = RobotModel::new(robot, model.terms().to_vec(), values.to_vec()).ok()?;
    let load_bodies = found.model().load_bodies().filter(|_| found.model().needs_load());
    Some(StoredModel {
        robot: ModelFile::of(&robot, &[]),
        terms: form_terms(model.terms(), values),
        load_bodies: load_bodies.map(|bodies| bodies.iter().map(|body| body.0).collect()),
    })
}

fn form_terms(terms: &[TorqueTerm], values: &[f64]) -> Vec<FormTerm> {
    let term = |(term, value): (&TorqueTerm, &f64)| FormTerm {
        symbol: term.symbol(),
        value: *value,
        unit: term.unit().to_owned(),
        term: term.clone(),
    };
    terms.iter().zip(values).map(term).collect()
}
