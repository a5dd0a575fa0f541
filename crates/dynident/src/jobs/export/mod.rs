//! `export`: an identified model for a controller or a simulator.

mod servo;
mod simulator;
mod validation;

pub use servo::{ServoExport, ServoTarget, export_servos};
pub use simulator::export_simulator;
pub use validation::{
    EXPORT_VALIDATION_SUFFIX, export_validation, payload_validation, servo_validation, table_validation,
};

use crate::error::Error;
use crate::jobs::recorded_velocities::recorded_velocities;
use crate::jobs::violations::violations;
use crate::result::{FormResult, JointResult, ResultFile, TermResult, ValueSource};
use crate::study::{Folders, Study, StudyRobot};
use dynident_export::{
    CodeOptions, ControllerBrand, ExportError, Exported, PayloadBody, RobotModel, Target, export_with,
    notes_on_omitted, payload_command,
};
use dynident_identification::Role;
use dynident_identification::payload::{ControllerPayload, ControllerValue, PayloadResult};
use dynident_model::terms::{TermClass, TorqueTerm};
use dynident_model::{InertialParameters, Mat3, Vec3};
use std::path::Path;

/// An export format with its options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExportSettings {
    /// Export format.
    pub target: Target,
    /// Options for exported code.
    pub code: CodeOptions,
}

impl From<Target> for ExportSettings {
    fn from(target: Target) -> Self {
        Self { target, code: CodeOptions::default() }
    }
}

/// Exports the model of a `result.json` in the format `form`: bodies, friction and drives as in `identified.urdf`
/// (physically consistent unless the study disables this). `study` is the study of the result; the robot file is also
/// searched in the folder `data`.
///
/// # Errors
/// If the result does not belong to the study's robot; [`Error::Export`] if the form cannot represent the model.
pub fn export_model(
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    data: Option<&Path>,
    form: impl Into<ExportSettings>,
) -> Result<Exported, Error> {
    export_result(&ResultFile::read(result_path)?, result_path, study, study_path, data, form)
}

/// Like [`export_model()`] with a result in memory; `result_path` is its name in messages.
///
/// # Errors
/// Same as for [`export_model()`].
pub fn export_result(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    data: Option<&Path>,
    form: impl Into<ExportSettings>,
) -> Result<Exported, Error> {
    let robot = robot_model(stored, result_path, study, study_path, data)?;
    written(stored, result_path, &robot, form.into())
}

/// Like [`export_result()`] without the study: for a result that contains its robot.
///
/// # Errors
/// A result of an older version, which does not hold its robot; [`Error::Export`] for what the form cannot hold at all.
pub fn export_stored(
    stored: &ResultFile,
    result_path: &Path,
    form: impl Into<ExportSettings>,
) -> Result<Exported, Error> {
    let Some(model) = &stored.model else {
        let message = "does not contain the robot: name the study that the result was made with (--study STUDY.toml)";
        return Err(Error::Result { path: result_path.to_owned(), message: message.to_owned() });
    };
    let of_model = model.robot.joints.iter().map(|joint| (&joint.body.name, joint.body.parameters));
    if !of_model.eq(stored.bodies.iter().map(|body| (&body.name, body.parameters))) {
        let message =
            "its `bodies` differ from `model`: name the study to export the edited bodies (--study STUDY.toml)";
        return Err(Error::Result { path: result_path.to_owned(), message: message.to_owned() });
    }
    let cannot = |source: ExportError| Error::Export { path: result_path.to_owned(), source: Box::new(source) };
    let robot = model.robot().and_then(|robot| with_velocities(stored, robot)).map_err(cannot)?;
    written(stored, result_path, &robot, form.into())
}

/// The identified robot for an export format, with the terms that were fitted for the format's class.
fn written(
    stored: &ResultFile,
    result_path: &Path,
    robot: &RobotModel,
    settings: ExportSettings,
) -> Result<Exported, Error> {
    let ExportSettings { target, code } = settings;
    let mut notes = reservations(stored);
    let of_class = |class| stored.forms.iter().find(|form| form.class == class);
    let form = target.class().and_then(of_class);
    let with_state = of_class(TermClass::WithState).filter(|form| target.has_state() && form.has_memory());
    if let Some(form) = form {
        if form.refitted {
            let note = "Friction and drives were fitted again to the training logs, because this form lacks torque terms \
                        of the result or has wider steps near zero velocity.";
            notes.push(note.to_owned());
        }
        notes.extend(form.sentences("this file"));
        let terms: Vec<TorqueTerm> = form.terms.iter().map(|one| one.term.clone()).collect();
        notes.extend(notes_on_omitted(robot, &terms));
    }
    if let Some(form) = with_state {
        notes.push("Friction with memory is contained in the function step, which has a state.".to_owned());
        notes.extend(form.sentences("the function step"));
    }
    if let Some(width) = code.step_width {
        notes.push(format!("Steps near zero velocity have a width of at least {width:?} rad/s (m/s), as requested; the errors are those of the fitted widths."));
    }
    let terms_of = |form: &FormResult| -> (Vec<TorqueTerm>, Vec<f64>) {
        form.terms.iter().map(|one| (one.term.clone(), one.value)).unzip()
    };
    let made = || {
        let (terms, values) = match (form, target.class()) {
            (Some(form), _) => terms_of(form),
            // Without fitted terms, the terms of the result are used with the sign functions of the class.
            (None, Some(class)) => {
                robot.terms().map(|(term, value)| (class.in_form(robot.model(), term), value)).unzip()
            }
            (None, None) => return export_with(robot, target, code, &notes),
        };
        let mut robot = robot.with_terms(terms, values)?;
        if let Some((terms, values)) = with_state.map(terms_of) {
            robot = robot.with_state_terms(terms, values)?;
        }
        let robot = if form.is_some() && !target.is_code() { robot } else { with_velocities(stored, robot)? };
        export_with(&robot, target, code, &notes)
    };
    made().map_err(|source| Error::Export { path: result_path.to_owned(), source: Box::new(source) })
}

fn reservations(stored: &ResultFile) -> Vec<String> {
    let mut notes: Vec<String> =
        stored.problems.iter().map(|problem| format!("The result has a PROBLEM: {problem}")).collect();
    if let Some(provenance) = &stored.provenance {
        notes.insert(0, format!("From the result {} of study {}.", provenance.identity, stored.name));
    }
    if stored.drive_gains.is_some() {
        notes.push("Torques are in Nm, by the drive gains that were identified.".to_owned());
    }
    if !stored.payloads.is_empty() {
        let names: Vec<&str> = stored.payloads.iter().map(|payload| payload.name.as_str()).collect();
        notes.push(format!("The arm without its payloads ({}).", names.join(", ")));
    }
    notes.extend(value_sources(stored));
    notes.extend(drives_in_sums(stored));
    notes
}

/// Friction and drive parameters that the logs determine only in a sum with values of bodies.
fn drives_in_sums(stored: &ResultFile) -> Option<String> {
    let of_joint = |joint: &JointResult| {
        let is_in_sum = |term: &&TermResult| term.std.is_none() && term.base_parameter.is_some();
        let terms = joint.terms.iter().filter(is_in_sum);
        terms.map(|term| format!("{} of {}", term.symbol, joint.name)).collect::<Vec<_>>()
    };
    let all: Vec<String> = stored.joints.iter().flat_map(of_joint).collect();
    (!all.is_empty()).then(|| {
        format!("Known only in a sum with values of bodies, so the separate value may be wrong: {}.", all.join(", "))
    })
}

/// Which values of the bodies were measured, and which only in sums; `None` for a result of an earlier version.
fn value_sources(stored: &ResultFile) -> Option<String> {
    let sources: Vec<_> = stored.bodies.iter().map(|body| Some((body, body.sources?))).collect::<Option<_>>()?;
    let with = |wanted: ValueSource| {
        // Bodies with the same values are listed together.
        let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
        for (body, sources) in &sources {
            let names = stored.robot.parameter_order.iter().zip(sources);
            let own: Vec<&str> =
                names.filter(|(_, source)| **source == wanted).map(|(name, _)| name.as_str()).collect();
            let own = own.join(" ");
            match groups.iter_mut().find(|(values, _)| *values == own) {
                _ if own.is_empty() => {}
                Some((_, bodies)) => bodies.push(&body.name),
                None => groups.push((own, vec![&body.name])),
            }
        }
        let all: Vec<String> =
            groups.iter().map(|(values, bodies)| format!("{values} of {}", bodies.join(", "))).collect();
        if all.is_empty() { "none".to_owned() } else { all.join("; ") }
    };
    Some(format!(
        "Values of bodies measured from torque: {}. Measured only in sums with other values: {}. All other values are near \
         the robot description.",
        with(ValueSource::Measured),
        with(ValueSource::Partly)
    ))
}

fn robot_model(
    stored: &ResultFile,
    path: &Path,
    study: &Study,
    study_path: &Path,
    data: Option<&Path>,
) -> Result<RobotModel, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let study = &stored.as_fitted(study);
    let robot = StudyRobot::new(study, study_path, &Folders::new(study, study_path, data))?;
    // Checks that study and result belong together.
    stored.base_values(path, &robot.parametric)?;
    let of = |name: &str| {
        let body = stored.bodies.iter().find(|body| body.name == name);
        body.map(|body| InertialParameters(body.parameters))
            .ok_or_else(|| wrong(format!("no body `{name}`: use the study that the result was made with")))
    };
    let inertials: Vec<_> = robot.model().bodies().iter().map(|body| of(body.name())).collect::<Result<_, _>>()?;
    let model = robot.model().with_inertials(&inertials).map_err(|error| wrong(error.to_string()))?;
    let model = model.with_missing_limits(|joint| study.joint_limits(joint));
    let known = stored.joints.iter().flat_map(|joint| &joint.terms).chain(&stored.couplings);
    let value = |symbol: String| {
        let term = known.clone().find(|term| term.symbol == symbol);
        term.map(|term| term.value)
            .ok_or_else(|| wrong(format!("no value of `{symbol}`: use the study that the result was made with")))
    };
    let values: Vec<f64> = robot.terms().iter().map(|term| value(term.symbol())).collect::<Result<_, _>>()?;
    let violations = violations(&robot.parametric, &inertials, &values);
    if stored.physical.consistent && !violations.is_empty() {
        return Err(wrong(format!(
            "physical.consistent is true, but the model is not physically consistent ({}): the file was edited or damaged; identify again",
            violations.join("; ")
        )));
    }
    let load = stored.regressor_model(path, &robot.parametric)?.load_bodies();
    let made = RobotModel::new(model, robot.terms().to_vec(), values);
    let made = made.and_then(|made| match load {
        Some(bodies) => made.with_load(bodies),
        None => Ok(made),
    });
    made.and_then(|made| with_velocities(stored, made))
        .map_err(|source| Error::Export { path: path.to_owned(), source: Box::new(source) })
}

/// The robot with the recorded velocities of the training logs; results of earlier versions contain none.
fn with_velocities(stored: &ResultFile, robot: RobotModel) -> Result<RobotModel, ExportError> {
    let training = stored.logs.iter().filter(|log| log.role == Role::Identify);
    let velocities = recorded_velocities(training.map(|log| &log.velocities[..]), robot.model().dof());
    robot.with_velocities(velocities)
}

/// Exports a payload of a `result.json` as a command for the controller of manufacturer `reader`: the physically
/// consistent body, in the frame of its link. `name` can be `None` if there is only one payload; `result_path` is the
/// name of the result in messages.
///
/// # Errors
/// A result without payloads or without this one, a payload without a physically consistent body.
pub fn export_payload(
    stored: &ResultFile,
    result_path: &Path,
    name: Option<&str>,
    reader: ControllerBrand,
) -> Result<Exported, Error> {
    let wrong = |message: String| Error::Result { path: result_path.to_owned(), message };
    let found = selected_payload(stored, result_path, name)?;
    let inconsistent = || {
        let why = found.failure.as_deref().unwrap_or("its mass is zero");
        wrong(format!("payload `{}` has no body that can be real: {why}", found.name))
    };
    let (mass_kg, com_m, inertia) = match (&found.controller, &found.possible) {
        (Some(body), _) => (body.mass_kg, body.com_m, body.inertia_at_com_kgm2),
        // For results of earlier versions.
        (None, Some(body)) => (body.mass_kg, body.com_m, body.inertia_at_com_kgm2),
        (None, None) => return Err(inconsistent()),
    };
    let [xx, xy, xz, yy, yz, zz] = inertia;
    let inertia = Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    let inertial = InertialParameters::from_centre_of_mass(mass_kg, Vec3(com_m), &inertia);
    let mut notes = vec![format!("In the frame of the link {}; the controller must use the same frame.", found.link)];
    match &found.controller {
        Some(body) => notes.extend(value_notes(body)),
        None => notes
            .extend(found.mass_kg.map(|mass| format!("Mass {:.4} ± {:.4} kg (95 %).", mass.value, mass.half_width_95))),
    }
    notes.extend(found.not_identified.iter().map(|what| format!("Not measured: {what}")));
    notes.extend(stored.problems.iter().map(|problem| format!("The result has a PROBLEM: {problem}")));
    let payload = PayloadBody { name: found.name.clone(), inertial };
    // Results of earlier versions have no intervals for the comment.
    let comment = if found.controller.is_some() { &notes[..] } else { &[] };
    let text = payload_command(&payload, reader, comment).ok_or_else(inconsistent)?;
    Ok(Exported { text, notes })
}

/// The payload of a result with this name, or its only payload.
///
/// # Errors
/// A result without payloads, without this one, or with several if `name` is `None`.
pub fn selected_payload<'a>(
    stored: &'a ResultFile,
    result_path: &Path,
    name: Option<&str>,
) -> Result<&'a PayloadResult, Error> {
    let wrong = |message: String| Error::Result { path: result_path.to_owned(), message };
    let names = stored.payloads.iter().map(|payload| format!("`{}`", payload.name)).collect::<Vec<_>>().join(", ");
    match (name, &stored.payloads[..]) {
        (_, []) => Err(wrong("no payload was estimated: add [[payload]] to the study".to_owned())),
        (None, [only]) => Ok(only),
        (None, _) => Err(wrong(format!("several payloads ({names}): select one (--payload)"))),
        (Some(name), all) => (all.iter().find(|payload| payload.name == name))
            .ok_or_else(|| wrong(format!("no payload `{name}`; it has {names}"))),
    }
}

/// The ten values of a payload with their intervals, one sentence each, and the rule for values that were assumed for
/// a round body.
fn value_notes(body: &ControllerPayload) -> Vec<String> {
    let value = |one: &ControllerValue| {
        let start = format!("{} = {:.5e} {}", one.name, one.value, one.unit);
        match (one.estimate, one.half_width_95, one.lower_95, one.upper_95) {
            (Some(estimate), Some(half), Some(lower), Some(upper)) => format!(
                "{start}; 95 % interval of the logs {lower:.3e} to {upper:.3e} (estimate {estimate:.3e} ± {half:.2e})."
            ),
            _ => format!("{start}; the logs do not determine it."),
        }
    };
    let rule = format!(
        "Inertia that the logs do not determine is that of a sphere of the payload's size: radius {:.3} m, moment {:.3e} kg m^2.",
        body.round_radius_m, body.round_moment_kgm2
    );
    body.values.iter().map(value).chain([rule]).collect()
}
