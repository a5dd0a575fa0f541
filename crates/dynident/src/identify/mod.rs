//! Logs to a model: the main job.

pub(crate) mod fit;
pub(crate) mod friction_candidates;
pub(crate) mod friction_choice;
pub(crate) mod further_passes;
pub(crate) mod instrument_rows;
pub(crate) mod instruments;
pub(crate) mod intervals;
pub(crate) mod periodic;
pub(crate) mod physical;
pub(crate) mod report;
pub(crate) mod result;
pub(crate) mod result_sections;
mod second_look;
pub(crate) mod sign;
pub(crate) mod simulated;
mod simulated_loop;
pub(crate) mod standard_parameters;
mod training;
pub(crate) mod written_urdf;

use crate::error::Error;
use crate::identify::fit::{Fitted, Logs};
use crate::identify::friction_choice::with_friction;
use crate::identify::instruments::InstrumentSource;
use crate::identify::intervals::{Asked, possible_intervals};
use crate::identify::physical::{physical_fit_result, possible_parameters};
use crate::identify::result::{RESULT_SCHEMA, ResultFile, Timings};
use crate::identify::result_sections::{
    base_parameters, bodies, joint_results, law_results, method_summary, offset_results, robot_summary,
    training_result, verdict,
};
use crate::identify::second_look::second_look;
use crate::identify::sign::{sign_evidence, sign_findings};
use crate::identify::standard_parameters::{inertials, nearest_to_prior};
use crate::identify::training::{LogFit, Training};
use crate::identify::written_urdf::written_urdf;
use crate::job::{RunOptions, joint_names, log_files, note_lags, of_role, study_name};
use crate::load::arm::KnownArm;
use crate::load::payload_result::payload_results;
use crate::machine::Machine;
use crate::measured::lag::{self, TorqueLag};
use crate::measured::residuals::Uncertainty;
use crate::measured::rows::motion_in_force;
use crate::measured::torque_trace::LogTrace;
use crate::study::friction::FrictionChoice;
use crate::study::{EstimatorMethod, Folders, Role, Study};
use crate::validate::{Tested, read_model, validate_log};
use dynident_estimation::{Estimate, essential, strongest_correlations};
use dynident_identification::consistent::inconsistent_nominal_bodies;
use dynident_model::InertialParameters;
use dynident_model::laws::Law;
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;

/// Correlations that a result tells.
const CORRELATIONS: usize = 10;

/// A finished identification.
#[derive(Debug)]
pub struct Identification {
    /// What `result.json` holds.
    pub result: ResultFile,
    /// The estimate with its covariance.
    pub estimate: Estimate,
    /// Inertial parameters of the bodies, as in `result.bodies`.
    pub inertials: Vec<InertialParameters>,
    /// The user's own URDF with the new values; without it, [`ResultFile::no_urdf`] says why.
    pub urdf: Option<String>,
    /// Measured and predicted torque over time, training logs first: at most the first 20 000 samples of a log that was fitted to, the first 100 000 filtered rows of a held-out one.
    pub traces: Vec<LogTrace>,
}

impl Identification {
    /// The report as one self-contained HTML page: torque measured against predicted, residuals, parameters with error bars, friction, bodies, what was found in the logs, where the time went.
    ///
    /// # Errors
    /// [`Error::Report`], which would be a defect of this program.
    pub fn report(&self) -> Result<String, Error> {
        crate::identify::report::identification_report(self)
    }
}

/// Fits a study's model to its logs and tests it on the held-out ones.
///
/// # Errors
/// Everything that [`Error`] names: files, study, logs. A poor fit is not an error.
pub fn identify(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<Identification, Error> {
    identified(study, study_path, options, None)
}

/// As [`identify()`] with the method `"instrumental"`, whatever the study asks for, and instruments from `source`: the closed loop simulated with the model so far (IDIM-IV: call again with a new
/// simulation until the parameters settle), or a repeated run.
///
/// # Errors
/// As [`identify()`], and what `source` returns.
pub fn identify_with_instruments(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    source: &mut dyn InstrumentSource,
) -> Result<Identification, Error> {
    let mut study = study.clone();
    study.estimator.method = EstimatorMethod::Instrumental;
    identified(&study, study_path, options, Some(source))
}

fn identified(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    source: Option<&mut dyn InstrumentSource>,
) -> Result<Identification, Error> {
    let start = Instant::now();
    study.require_training_log(study_path)?;
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let stored = study.arm.as_ref().map(|arm| folders.find(&arm.result, None)).transpose()?;
    let stored = stored.map(|path| read_model(&path).map(|model| (path, model))).transpose()?;
    // With the friction that was chosen when the arm was identified.
    let with_arm = stored.as_ref().map(|(_, arm)| with_friction(study, &arm.friction_choice));
    let study = with_arm.as_ref().unwrap_or(study);
    let machine = Machine::new(study, study_path, &folders)?;
    let arm = stored.as_ref().map(|(path, arm)| KnownArm::new(path, arm, &machine)).transpose()?;
    let arm_cutoff_hz = stored.as_ref().and_then(|(_, arm)| arm.method.motion.differentiator.cutoff_hz());
    let possible_settings = study.estimator.physical.settings();
    if let Some(settings) = &possible_settings {
        let mut named = settings.clone();
        if study.drive.friction == FrictionChoice::Auto {
            // Laws that the logs are to choose are not there yet.
            named.laws.clear();
        }
        let checked = named.check_names(machine.model(), machine.laws());
        checked.map_err(|error| Error::study(study_path, format!("[estimator.physical]: {error}")))?;
    }
    let mut timings = Timings { machine: start.elapsed().as_secs_f64(), ..Timings::default() };
    let files = log_files(study, &folders)?;

    let training: Vec<usize> = of_role(study, Role::Identify);
    let motion = motion_in_force(study, &machine, &files, &training, arm_cutoff_hz)?;
    let job = Training { study_path, folders: &folders, motion: &motion, files: &files, logs: &training, options };
    let mut fitted = job.fit(study, machine, &mut timings)?;
    let gains = job.gains(&mut fitted)?;
    let (study, machine, columns) = (&fitted.study, &fitted.machine, &fitted.columns);
    let (fits, problem) = (&fitted.fits, &fitted.problem);
    let in_study = |source| Error::Estimation { path: study_path.to_owned(), source };
    let passes =
        Logs { study, path: study_path, machine, motion: &motion, files: &files, training: &training, options };
    let started = Instant::now();
    let fitted_parts = match (&arm, &study.arm, &gains) {
        (Some(arm), Some(section), _) => {
            Fitted::alone(arm.estimate(section, machine, columns, problem, &study.estimator).map_err(in_study)?)
        }
        (_, _, Some((estimate, _))) => Fitted::alone(estimate.clone()),
        _ => crate::identify::fit::fitted(&passes, problem, source)?,
    };
    let Fitted { estimate, noise_in_regressor, gross_errors, noise_correlation, noise_levels, periodic, simulated } =
        fitted_parts;
    let (estimate, dropped) = match &study.estimator.essential {
        Some(settings) => {
            essential(&estimate, settings).map(|(rest, report)| (rest, Some(report))).map_err(in_study)?
        }
        None => (estimate, None),
    };
    let prior = machine.nominal().to_vec();
    let theta = &estimate.values[..columns.base()];
    // Without the columns of payloads and offsets of single logs.
    let alone = (arm.is_none() && !columns.is_plain()).then(|| columns.arm_problem(problem, &estimate.values));
    let alone = alone.transpose().map_err(in_study)?;
    let (arm_problem, arm_estimate) = (alone.as_ref().unwrap_or(problem), columns.arm_estimate(&estimate));
    let (possible, failure) = match &possible_settings {
        _ if arm.is_some() => {
            (None, Some("the arm is known from an earlier result, which has its bodies and its URDF".to_owned()))
        }
        Some(settings) => {
            let asked = (study.estimator.method, settings);
            match possible_parameters(machine, arm_problem, &arm_estimate, asked) {
                Ok(fit) => (Some(fit), None),
                Err(reason) => (None, Some(reason.to_string())),
            }
        }
        None => (None, None),
    };
    let sign = if arm.is_some() { None } else { sign_evidence(machine, arm_problem, &arm_estimate) };
    let physical = possible.as_ref().map(|fit| &fit.base_values[..]);
    let possible_intervals = match &possible_settings {
        // Where there is no possible machine, `physical.failure` says why.
        Some(settings) if study.estimator.intervals && possible.is_some() => {
            let method = study.estimator.method;
            let asked = Asked { machine, problem: arm_problem, estimate: &arm_estimate, method, settings };
            let found = possible_intervals(&asked, options.progress);
            Some(found.map_err(|reason| Error::study(study_path, format!("estimator.intervals: {reason}")))?)
        }
        _ => None,
    };
    timings.estimation += started.elapsed().as_secs_f64();

    let started = Instant::now();
    let joints = joint_names(machine);
    let (mut logs, mut traces) = (Vec::new(), Vec::new());
    let mut lags_by_joint = vec![Vec::new(); joints.len()];
    let look = |fit: &LogFit| {
        let theta = columns.base_values(fit.index, &estimate.values);
        second_look(study, machine, &motion, fit.index, &files[fit.index], &theta)
    };
    let looks: Vec<_> = if options.threads > 1 {
        fits.par_iter().map(look).collect::<Result<_, _>>()?
    } else {
        fits.iter().map(look).collect::<Result<_, _>>()?
    };
    for (fit, (lags, trace)) in fits.iter().zip(looks) {
        let mut summary = fit.summary.clone();
        note_lags(&mut summary, &lags);
        traces.push(trace);
        summary.model_findings.extend(lag::findings(&lags, &joints));
        summary.model_findings.extend(sign.as_ref().and_then(sign_findings));
        for (all, lag) in lags_by_joint.iter_mut().zip(lags) {
            all.extend(lag);
        }
        logs.push(summary);
    }
    let lags: Vec<Option<TorqueLag>> = lags_by_joint.iter().map(|lags| lag::pooled(lags)).collect();
    let mut validation = Vec::new();
    for index in of_role(study, Role::Validate) {
        let theta = columns.base_values(index, &estimate.values);
        let uncertainty = Uncertainty::of(&estimate, columns.base_covariance(index, &estimate.covariance));
        let physical =
            physical.map(|values| columns.base_values(index, &[values, &estimate.values[columns.base()..]].concat()));
        let tested =
            Tested { theta: &theta, physical: physical.as_deref(), uncertainty: Some(&uncertainty), traced: true };
        let (summary, figures, trace) = validate_log(study, machine, &motion, index, &files[index], &tested, options)?;
        logs.push(summary);
        validation.push(figures);
        traces.extend(trace);
    }
    timings.validation = started.elapsed().as_secs_f64();
    timings.total = start.elapsed().as_secs_f64();

    let parameters = possible
        .as_ref()
        .map_or_else(|| nearest_to_prior(machine.model(), machine.base(), theta, &prior), |fit| fit.parameters.clone());
    let inertials = inertials(machine.model(), &parameters);
    let mut verdict = verdict(machine, &inertials, &parameters);
    if let Some(fit) = &possible {
        verdict.fit = Some(physical_fit_result(fit, &arm_estimate));
        verdict.note = if study.estimator.method.is_plain() {
            "of the possible set that fits the logs best; the base parameters above it are the unconstrained estimate"
        } else {
            "of the possible set nearest to the estimate; the base parameters above it are that unconstrained estimate"
        };
    }
    verdict.failure = failure;
    verdict.sign = sign;
    if let Some(settings) = &possible_settings {
        let impossible = inconsistent_nominal_bodies(&machine.parametric, settings);
        verdict.impossible_priors = impossible
            .into_iter()
            .map(|(body, least)| format!("{body}: least eigenvalue of the pseudo-inertia {least:.2e}"))
            .collect();
    }
    // Parameters that URDF cannot express leave a result without one; it is no reason to lose the result.
    let written = if arm.is_some() {
        Err(verdict.failure.clone().unwrap_or_default())
    } else if possible_settings.is_some() && (verdict.failure.is_some() || !verdict.consistent) {
        let reason = verdict.failure.clone().unwrap_or_else(|| verdict.violations.join("; "));
        Err(format!(
            "the bodies are not physically possible: {reason} (estimator.physical = false writes them as they are)"
        ))
    } else {
        written_urdf(machine, &inertials, &parameters)
    };
    let (urdf, no_urdf) = match written {
        Ok(urdf) => (Some(urdf), None),
        Err(reason) => (None, Some(reason)),
    };
    let covariance = estimate.covariance.view((0, 0), (columns.base(), columns.base())).into_owned();
    let result = ResultFile {
        schema: RESULT_SCHEMA,
        name: study_name(study, study_path),
        robot: robot_summary(machine),
        method: method_summary(study, machine, &motion, &estimate),
        noise_in_regressor,
        gross_errors,
        noise_correlation,
        noise_levels,
        periodic,
        simulated,
        base_parameters: base_parameters(machine, &estimate, physical),
        base_parameter_covariance: covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        bodies: bodies(machine, &inertials),
        possible_intervals,
        essential: dropped,
        correlations: strongest_correlations(&estimate, CORRELATIONS),
        joints: joint_results(machine, &estimate, &parameters, &lags),
        friction_choice: fitted.friction_choice,
        payloads: payload_results(study, &training, columns, &estimate),
        offsets: offset_results(study, machine, &training, columns, &estimate),
        drive_gains: gains.map(|(_, gains)| gains),
        couplings: law_results(machine, &estimate, &parameters, |law| matches!(law, Law::Coupling(_))),
        training: training_result(study, machine, problem, &training, &estimate).map_err(in_study)?,
        torque_band: validation.iter().flat_map(|log| &log.residuals).filter_map(|joint| joint.band.clone()).collect(),
        validation,
        physical: verdict,
        logs,
        no_urdf,
        timings_s: timings,
    };
    Ok(Identification { result, estimate, inertials, urdf, traces })
}
