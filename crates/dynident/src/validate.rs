//! A model against logs that were not used for its fit.

use crate::error::Error;
use crate::identify::friction_choice::{JointFriction, with_friction};
use crate::identify::result::{BaseParameterResult, LogSummary, LogValidation};
use crate::job::{RunOptions, joint_names, log_files, log_summary, of_role, study_name};
use crate::load::columns::known_payloads;
use crate::load::payload_result::StoredPayload;
use crate::machine::Machine;
use crate::measured::evidence::{Evidence, predicted};
use crate::measured::lag::LagCheck;
use crate::measured::residuals::{JointWatch, Uncertainty};
use crate::measured::rows::{JointRows, Pass, RawSamples, RowSink, estimated_rows, motion_in_force};
use crate::measured::torque_trace::{LogTrace, TraceSink};
use crate::study::{Folders, Role, Study};
use dynident_estimation::Validation;
use dynident_recording::MotionSettings;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name and version of the schema of [`ValidationFile`].
pub const VALIDATION_SCHEMA: &str = "dynident/validation/1";

/// What `validate` prints as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct ValidationFile {
    /// [`VALIDATION_SCHEMA`].
    pub schema: &'static str,
    /// Name of the study.
    pub name: String,
    /// Figures by log.
    pub validation: Vec<LogValidation>,
    /// What the importer found.
    pub logs: Vec<LogSummary>,
}

/// The part of `result.json` that a model is.
#[derive(Deserialize)]
pub(crate) struct StoredModel {
    schema: String,
    pub(crate) method: StoredMethod,
    #[serde(default)]
    pub(crate) friction_choice: Vec<JointFriction>,
    base_parameters: Vec<BaseParameterResult>,
    #[serde(default)]
    pub(crate) base_parameter_covariance: Vec<Vec<f64>>,
    #[serde(default)]
    payloads: Vec<StoredPayload>,
    #[serde(default)]
    pub(crate) drive_gains: Option<Vec<StoredGain>>,
}

/// The part of a stored gain that a model needs.
#[derive(Deserialize)]
pub(crate) struct StoredGain {
    gain: f64,
}

#[derive(Deserialize)]
pub(crate) struct StoredMethod {
    pub(crate) motion: MotionSettings,
    #[serde(default)]
    load_parameters: Option<Vec<f64>>,
}

/// Tests the model of a `result.json` on the logs of a study that have the role `validate`, or on all its logs if none has.
///
/// # Errors
/// If the result does not belong to the study's machine, and everything that reading logs can give.
pub fn validate(
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<ValidationFile, Error> {
    study.require_log(study_path)?;
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let stored = read_model(result_path)?;
    // With the friction that was chosen when the model was made.
    let chosen = with_friction(study, &stored.friction_choice);
    let study = &chosen;
    let machine = Machine::new(study, study_path, &folders)?;
    let loads = StoredLoads::new(result_path, study, study_path, &stored, &machine)?;
    let (theta, possible, made_with, machine) = stored_model(result_path, stored, machine)?;
    let files = log_files(study, &folders)?;
    let mut chosen = of_role(study, Role::Validate);
    if chosen.is_empty() {
        chosen = (0..study.log.len()).collect();
    }
    let of_model_hz = made_with.differentiator.cutoff_hz();
    let motion = motion_in_force(study, &machine, &files, &chosen, of_model_hz)?;
    let mut file = ValidationFile {
        schema: VALIDATION_SCHEMA,
        name: study_name(study, study_path),
        validation: Vec::new(),
        logs: Vec::new(),
    };
    for index in chosen {
        let theta = loads.base_values(study, index, &theta);
        let possible = possible.as_ref().map(|values| loads.base_values(study, index, values));
        let tested = Tested { theta: &theta, physical: possible.as_deref(), uncertainty: None, traced: false };
        let (summary, figures, _) = validate_log(study, &machine, &motion, index, &files[index], &tested, options)?;
        file.logs.push(summary);
        file.validation.push(figures);
    }
    Ok(file)
}

pub(crate) fn read_model(path: &Path) -> Result<StoredModel, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let bytes = std::fs::read(path).map_err(|source| Error::File { path: path.to_owned(), source })?;
    let stored: StoredModel = serde_json::from_slice(&bytes).map_err(|error| {
        wrong(format!("line {}, column {}: not a result of `identify`: {error}", error.line(), error.column()))
    })?;
    if stored.schema != crate::identify::result::RESULT_SCHEMA {
        let expected = crate::identify::result::RESULT_SCHEMA;
        return Err(wrong(format!("schema `{}`, not `{expected}`: identify again with this version", stored.schema)));
    }
    for joint in &stored.friction_choice {
        joint
            .drive
            .iter()
            .flat_map(|drive| drive.laws.iter().flatten())
            .try_for_each(|law| law.validate(&format!("friction_choice of joint `{}`", joint.joint)).map_err(wrong))?;
    }
    Ok(stored)
}

/// Base parameters, those of the possible set if the result has one, the motion settings that they were found with, and the machine with its load.
type Stored = (Vec<f64>, Option<Vec<f64>>, MotionSettings, Machine);

/// The base parameters of a stored result, in the machine's order, the motion settings that they were found with, and the machine with its load.
fn stored_model(path: &Path, stored: StoredModel, mut machine: Machine) -> Result<Stored, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let values = same_machine(path, &stored, &machine)?;
    let possible: Option<Vec<f64>> = stored.base_parameters.iter().map(|stored| stored.physical).collect();
    if possible.as_ref().is_some_and(|values| values.iter().any(|value| !value.is_finite())) {
        return Err(wrong("a physical value of a base parameter is not a finite number".to_owned()));
    }
    if let Some(load) = &stored.method.load_parameters
        && (load.len() != values.len() || load.iter().any(|value| !value.is_finite()))
    {
        return Err(wrong("load_parameters are not one finite number per base parameter: identify again".to_owned()));
    }
    machine.load_parameters = stored.method.load_parameters;
    machine.torque_gains = stored.drive_gains.iter().flatten().map(|stored| stored.gain).collect();
    let usable = machine.torque_gains.iter().all(|gain| gain.is_finite());
    if !(machine.torque_gains.is_empty() || machine.torque_gains.len() == machine.model().dof() && usable) {
        return Err(wrong("drive_gains are not one finite number for each joint: identify again".to_owned()));
    }
    Ok((values, possible, stored.method.motion, machine))
}

/// The base parameters of a stored result, which must be those of this machine.
pub(crate) fn same_machine(path: &Path, stored: &StoredModel, machine: &Machine) -> Result<Vec<f64>, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let expressions = machine.base().expressions();
    if stored.base_parameters.len() != expressions.len() {
        return Err(wrong(format!(
            "{} base parameters, but the study's machine has {}: use the study that the result was made with",
            stored.base_parameters.len(),
            expressions.len()
        )));
    }
    let mut values = Vec::with_capacity(expressions.len());
    for (stored, expression) in stored.base_parameters.iter().zip(&expressions) {
        if stored.expression != *expression {
            return Err(wrong(format!(
                "base parameter `{}` where the study's machine has `{expression}`: use the study that the result was made with",
                stored.expression
            )));
        }
        if !stored.value.is_finite() {
            return Err(wrong(format!("the value of `{expression}` is not a finite number")));
        }
        values.push(stored.value);
    }
    Ok(values)
}

/// What payloads add to the base parameters: those of the result, and those that the study knows.
struct StoredLoads {
    added: Vec<(String, Vec<f64>)>,
}

impl StoredLoads {
    fn new(
        path: &Path,
        study: &Study,
        study_path: &Path,
        stored: &StoredModel,
        machine: &Machine,
    ) -> Result<Self, Error> {
        let mut added = known_payloads(study, study_path, machine)?;
        for payload in &stored.payloads {
            let values = &payload.base_parameters_added;
            if values.len() != machine.layout().columns().len() || values.iter().any(|value| !value.is_finite()) {
                let message = format!("payload `{}`: not one finite number per base parameter", payload.name);
                return Err(Error::Result { path: path.to_owned(), message });
            }
            added.push((payload.name.clone(), values.clone()));
        }
        let carried = study.log.iter().filter_map(|log| log.payload.as_ref());
        for name in carried {
            if added.iter().all(|(known, _)| known != name) {
                let message = format!(
                    "payload `{name}`, which a [[log]] carries, is not among its payloads: give its mass_kg and com_m in the study, or identify it"
                );
                return Err(Error::Result { path: path.to_owned(), message });
            }
        }
        Ok(Self { added })
    }

    fn base_values(&self, study: &Study, log: usize, theta: &[f64]) -> Vec<f64> {
        let carried = study.log[log].payload.as_ref();
        let added = self.added.iter().find(|(name, _)| Some(name) == carried);
        theta.iter().enumerate().map(|(k, value)| value + added.map_or(0.0, |(_, added)| added[k])).collect()
    }
}

struct TestSink<'a> {
    machine: &'a Machine,
    file: PathBuf,
    theta: &'a [f64],
    watches: Vec<JointWatch>,
    model: Validation,
    physical: Option<(&'a [f64], Validation)>,
    raw: Validation,
    prior: Option<(&'a [f64], Validation)>,
    evidence: Option<Evidence<'a>>,
    lag: LagCheck<'a>,
    trace: Option<TraceSink<'a>>,
    buffer: Vec<f64>,
}

impl TestSink<'_> {
    fn failed(&self, source: dynident_estimation::EstimationError) -> Error {
        Error::Estimation { path: self.file.clone(), source }
    }
}

impl RowSink for TestSink<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        let columns = self.machine.layout().joint_columns(rows.joint);
        let measured = &rows.panel[columns.len() * rows.rows..];
        predicted(rows.panel, rows.rows, columns, self.theta, &mut self.buffer);
        self.model.add_joint(rows.joint, measured, &self.buffer).map_err(|source| self.failed(source))?;
        self.watches[rows.joint].add(rows.panel, rows.rows, &self.buffer);
        for (prior, validation) in [&mut self.prior, &mut self.physical].into_iter().flatten() {
            predicted(rows.panel, rows.rows, columns, prior, &mut self.buffer);
            let added = validation.add_joint(rows.joint, measured, &self.buffer);
            added.map_err(|source| Error::Estimation { path: self.file.clone(), source })?;
        }
        if let Some(evidence) = &mut self.evidence {
            evidence.filtered(rows, &mut self.buffer);
        }
        if let Some(trace) = &mut self.trace {
            trace.filtered(rows);
        }
        self.lag.filtered(rows);
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), Error> {
        let rows = samples.panels.samples();
        for joint in 0..self.machine.model().dof() {
            let columns = self.machine.layout().joint_columns(joint);
            let panel = samples.panels.joint(joint);
            predicted(panel, rows, columns, self.theta, &mut self.buffer);
            let added = self.raw.add_joint(joint, &panel[columns.len() * rows..], &self.buffer);
            added.map_err(|source| self.failed(source))?;
        }
        if let Some(trace) = &mut self.trace {
            trace.raw(samples);
        }
        self.lag.raw(samples);
        Ok(())
    }
}

/// What is tested on a log.
pub(crate) struct Tested<'a> {
    /// Base parameters.
    pub(crate) theta: &'a [f64],
    /// Those of the physically possible set.
    pub(crate) physical: Option<&'a [f64]>,
    /// What the band of the predicted torque is made from.
    pub(crate) uncertainty: Option<&'a Uncertainty>,
    /// Whether the torque over time is kept.
    pub(crate) traced: bool,
}

/// Tests base parameters on one log, those of the possible set beside them; with their uncertainty also the band of the predicted torque, and the torque over time if it is asked for.
pub(crate) fn validate_log(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
    tested: &Tested<'_>,
    options: &RunOptions<'_>,
) -> Result<(LogSummary, LogValidation, Option<LogTrace>), Error> {
    let Tested { theta, physical, uncertainty, traced } = *tested;
    let joints = joint_names(machine);
    let columns = (0..machine.model().dof()).map(|joint| machine.layout().joint_columns(joint)).collect();
    let mut sink = TestSink {
        machine,
        file: file.to_owned(),
        theta,
        watches: (0..joints.len()).map(|joint| JointWatch::new(machine.layout(), joint, uncertainty)).collect(),
        model: Validation::new(joints.clone()),
        physical: physical.map(|physical| (physical, Validation::new(joints.clone()))),
        raw: Validation::new(joints.clone()),
        prior: machine.nominal_base().map(|prior| (prior, Validation::new(joints.clone()))),
        evidence: machine.nominal_base().map(|prior| Evidence::new(columns, prior)),
        lag: LagCheck::new(machine, theta),
        trace: traced.then(|| TraceSink::new(machine, theta)),
        buffer: Vec::new(),
    };
    options.progress.begin(&format!("testing on {}", study.log_name(index)), estimated_rows([file]));
    let pass = Pass {
        study,
        machine,
        motion,
        index,
        file,
        reader_thread: options.threads > 1,
        most_samples: None,
        progress: options.progress,
    };
    let passed = pass.run(&mut sink);
    options.progress.end();
    let passed = passed?;
    let agreement = sink.evidence.as_ref().map(|evidence| evidence.agreement(&joints));
    let lags = sink.lag.lags(study, motion);
    let figures = LogValidation {
        log: study.log_name(index),
        model: sink.model.report(),
        raw: sink.raw.report(),
        physical: sink.physical.map(|(_, validation)| validation.report()),
        prior: sink.prior.map(|(_, validation)| validation.report()),
        residuals: sink
            .watches
            .iter()
            .zip(&joints)
            .map(|(watch, name)| watch.report(&study.log_name(index), name))
            .collect(),
    };
    let name = study.log_name(index);
    let trace = sink.trace.map(|trace| trace.finished(name, "validate", passed.filtered_rate_hz));
    Ok((log_summary(study, index, passed, agreement, &lags, &joints), figures, trace))
}
