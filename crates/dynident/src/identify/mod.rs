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
pub(crate) mod sign;
pub(crate) mod simulated;
mod simulated_loop;
pub(crate) mod standard_parameters;
pub(crate) mod written_urdf;

use crate::error::Error;
use crate::identify::fit::{Fitted, Logs};
use crate::identify::friction_candidates::{candidate_columns, joints_to_choose};
use crate::identify::friction_choice::{JointFriction, choose_friction, with_friction};
use crate::identify::instruments::InstrumentSource;
use crate::identify::intervals::{Asked, possible_intervals};
use crate::identify::physical::{physical_fit_result, possible_parameters, source_of};
use crate::identify::result::{LogSummary, RESULT_SCHEMA, ResultFile, Timings};
use crate::identify::result_sections::{
    base_parameters, bodies, joint_results, law_results, method_summary, offset_results, robot_summary,
    training_result, verdict,
};
use crate::identify::sign::{sign_evidence, sign_findings};
use crate::identify::standard_parameters::{inertials, nearest_to_prior};
use crate::identify::written_urdf::written_urdf;
use crate::job::{RunOptions, joint_names, log_files, log_summary, note_lags, of_role, study_name};
use crate::load::arm::KnownArm;
use crate::load::columns::LoadColumns;
use crate::load::gains::{DriveGain, Gains, drive_gains};
use crate::load::payload_result::payload_results;
use crate::machine::{Machine, prior_parameters};
use crate::measured::evidence::Evidence;
use crate::measured::lag::{self, LAG_SAMPLES, LagCheck, TorqueLag};
use crate::measured::residuals::Uncertainty;
use crate::measured::rows::{JointRows, Pass, RawSamples, RowSink, motion_in_force};
use crate::measured::torque_trace::{LogTrace, TraceSink};
use crate::progress::Silent;
use crate::study::friction::FrictionChoice;
use crate::study::{EstimatorMethod, Folders, GainChoice, Role, Study};
use crate::validate::{Tested, read_model, validate_log};
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, LinearProblem, OrdinarySettings, SegmentedFactor, WeightedSettings, essential, ordinary_least_squares,
    strongest_correlations, weighted_least_squares,
};
use dynident_experiment::iteration::impossible_priors;
use dynident_model::InertialParameters;
use dynident_model::laws::Law;
use dynident_recording::MotionSettings;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
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
        let checked = named.check_names(&machine.model, &machine.laws);
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
    let prior = prior_parameters(&machine.model, &machine.laws);
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
            match possible_parameters(machine, arm_problem, &arm_estimate, &prior, asked) {
                Ok(fit) => (Some(fit), None),
                Err(reason) => (None, Some(reason)),
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
            let asked =
                Asked { machine, problem: arm_problem, estimate: &arm_estimate, prior: &prior, method, settings };
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
    for fit in fits {
        let mut summary = fit.summary.clone();
        let theta = columns.base_values(fit.index, &estimate.values);
        let (lags, trace) = second_look(study, machine, &motion, fit.index, &files[fit.index], &theta)?;
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
        .map_or_else(|| nearest_to_prior(&machine.model, &machine.base, theta, &prior), |fit| fit.parameters.clone());
    let inertials = inertials(&machine.model, &parameters);
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
        let impossible = impossible_priors(&source_of(machine, &prior), settings);
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

/// What fitting needs beside study and machine.
struct Training<'a> {
    study_path: &'a Path,
    folders: &'a Folders,
    motion: &'a MotionSettings,
    files: &'a [PathBuf],
    /// The logs to fit to.
    logs: &'a [usize],
    options: &'a RunOptions<'a>,
}

/// A fit, and the study and machine with the friction that it was made with.
struct TrainingFit {
    study: Study,
    machine: Machine,
    fits: Vec<LogFit>,
    problem: LinearProblem,
    estimate: Estimate,
    columns: LoadColumns,
    friction_choice: Vec<JointFriction>,
}

impl Training<'_> {
    /// Fits the stated model; where friction is to be chosen or depends on the load, once more with what that fit says.
    fn fit(&self, study: &Study, machine: Machine, timings: &mut Timings) -> Result<TrainingFit, Error> {
        let first = self.fit_once(study.clone(), machine, timings)?;
        let choose = joints_to_choose(study, &first.machine);
        if choose.is_empty() {
            let machine = first.machine.clone().with_load_of(&first.machine, &first.estimate.values);
            return if machine.load_parameters.is_some() {
                self.fit_once(first.study, machine, timings)
            } else {
                Ok(first)
            };
        }
        let in_study = |source| Error::Estimation { path: self.study_path.to_owned(), source };
        let columns = candidate_columns(study, &first.machine, &choose);
        let known = first.machine.layout.columns();
        let further = columns.iter().flatten().map(|column| column.law.clone());
        let further = further.filter(|law| !known.contains(&Column::Law(law.clone())));
        let wide = first.machine.with_columns_of(further).with_load_of(&first.machine, &first.estimate.values);
        let started = Instant::now();
        let fits = read_logs(study, &wide, self.motion, self.files, self.logs, self.options)?;
        timings.logs += started.elapsed().as_secs_f64();
        let started = Instant::now();
        let columns_of = |study: &Study, machine: &Machine| LoadColumns::new(study, self.study_path, machine);
        let wide_problem = problem(study, &wide, &columns_of(study, &wide)?, &fits).map_err(in_study)?;
        let friction_choice =
            choose_friction(study, &first.machine, &wide, &wide_problem, &choose, &columns, &first.estimate)
                .map_err(in_study)?;
        let study = with_friction(study, &friction_choice);
        let machine =
            Machine::new(&study, self.study_path, self.folders)?.with_load_of(&first.machine, &first.estimate.values);
        let fits =
            fits.into_iter().map(|fit| fit.of(&wide, &machine)).collect::<Result<Vec<_>, _>>().map_err(in_study)?;
        let load = columns_of(&study, &machine)?;
        let problem = problem(&study, &machine, &load, &fits).map_err(in_study)?;
        let estimate = estimate(&study, &problem).map_err(in_study)?;
        timings.estimation += started.elapsed().as_secs_f64();
        Ok(TrainingFit { study, machine, fits, problem, estimate, columns: load, friction_choice })
    }

    fn fit_once(&self, study: Study, machine: Machine, timings: &mut Timings) -> Result<TrainingFit, Error> {
        let columns = LoadColumns::new(&study, self.study_path, &machine)?;
        let started = Instant::now();
        let fits = read_logs(&study, &machine, self.motion, self.files, self.logs, self.options)?;
        timings.logs += started.elapsed().as_secs_f64();
        let started = Instant::now();
        let in_study = |source| Error::Estimation { path: self.study_path.to_owned(), source };
        let problem = problem(&study, &machine, &columns, &fits).map_err(in_study)?;
        let estimate = estimate(&study, &problem).map_err(in_study)?;
        timings.estimation += started.elapsed().as_secs_f64();
        Ok(TrainingFit { study, machine, fits, problem, estimate, columns, friction_choice: Vec::new() })
    }

    /// Where the study asks for gains: the estimate with them. The machine then has them, and the problem is in newton metres.
    fn gains(&self, fitted: &mut TrainingFit) -> Result<Option<(Estimate, Vec<DriveGain>)>, Error> {
        if fitted.study.drive.gains == GainChoice::Stated {
            return Ok(None);
        }
        let Gains { of_joints: gains, estimate, problem } =
            drive_gains(&fitted.study, self.study_path, &fitted.columns, &fitted.problem, self.logs)?;
        fitted.machine.torque_gains = gains.iter().map(|gain| gain.gain).collect();
        fitted.problem = problem;
        Ok(Some((estimate, gains)))
    }
}

/// The estimate that friction is chosen and loads are taken by: least squares, whatever estimator comes in the end.
fn estimate(study: &Study, problem: &LinearProblem) -> Result<Estimate, dynident_estimation::EstimationError> {
    let (rank, covariance) = (study.estimator.rank, study.estimator.covariance);
    if study.estimator.method == EstimatorMethod::Ordinary {
        ordinary_least_squares(problem, &OrdinarySettings { rank, covariance })
    } else {
        weighted_least_squares(problem, &WeightedSettings { rank, covariance, ..WeightedSettings::default() })
    }
}

/// What is left of one log for fitting.
struct LogFit {
    index: usize,
    factors: Vec<SegmentedFactor>,
    summary: LogSummary,
}

impl LogFit {
    /// The same rows as another machine sees them, whose columns are among those of `wide`.
    fn of(mut self, wide: &Machine, machine: &Machine) -> Result<Self, dynident_estimation::EstimationError> {
        for (joint, factor) in self.factors.iter_mut().enumerate() {
            let seen = wide.layout.joint_columns(joint);
            // A column that is not there gets a number out of range, which the selection refuses.
            let place = |&column: &usize| {
                let wanted = &machine.layout.columns()[column];
                seen.iter().position(|&global| wide.layout.columns()[global] == *wanted).unwrap_or(usize::MAX)
            };
            let places: Vec<usize> = machine.layout.joint_columns(joint).iter().map(place).collect();
            *factor = factor.selected(&places)?;
        }
        Ok(self)
    }
}

struct FitSink<'a> {
    file: String,
    factors: Vec<SegmentedFactor>,
    evidence: Option<Evidence<'a>>,
    buffer: Vec<f64>,
}

impl RowSink for FitSink<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        if let Some(evidence) = &mut self.evidence {
            evidence.filtered(rows, &mut self.buffer);
        }
        self.factors[rows.joint]
            .absorb(rows.panel, rows.rows)
            .map_err(|source| Error::Estimation { path: PathBuf::from(&self.file), source })
    }

    fn raw(&mut self, _samples: &RawSamples<'_>) -> Result<(), Error> {
        Ok(())
    }
}

fn read_logs(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    files: &[PathBuf],
    training: &[usize],
    options: &RunOptions<'_>,
) -> Result<Vec<LogFit>, Error> {
    options
        .progress
        .begin("logs to factors", crate::measured::rows::estimated_rows(training.iter().map(|&i| &*files[i])));
    // Logs side by side, or one log with its reader on a second thread; results stand in the study's order either way.
    let one = |index: &usize| read_log(study, machine, motion, *index, &files[*index], training.len() == 1, options);
    let fits = if training.len() > 1 && options.threads > 1 {
        training.par_iter().map(one).collect::<Result<Vec<_>, _>>()
    } else {
        training.iter().map(one).collect()
    };
    options.progress.end();
    fits
}

fn read_log(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
    alone: bool,
    options: &RunOptions<'_>,
) -> Result<LogFit, Error> {
    let columns: Vec<&[usize]> = (0..machine.model.dof()).map(|joint| machine.layout.joint_columns(joint)).collect();
    let in_log = |source| Error::Estimation { path: file.to_owned(), source };
    let factors = columns
        .iter()
        .map(|columns| SegmentedFactor::new(columns.len(), study.estimator.segments))
        .collect::<Result<Vec<_>, _>>()
        .map_err(in_log)?;
    let mut sink = FitSink {
        file: file.display().to_string(),
        factors,
        // Torque in a unit that nobody knows says nothing about the description.
        evidence: machine
            .prior
            .as_ref()
            .filter(|_| study.drive.gains == GainChoice::Stated)
            .map(|prior| Evidence::new(columns, prior)),
        buffer: Vec::new(),
    };
    let pass = Pass {
        study,
        machine,
        motion,
        index,
        file,
        reader_thread: alone && options.threads > 1,
        most_samples: None,
        progress: options.progress,
    };
    let passed = pass.run(&mut sink)?;
    let joints = joint_names(machine);
    let agreement = sink.evidence.as_ref().map(|evidence| evidence.agreement(&joints));
    let summary = log_summary(study, index, passed, agreement, &[], &joints);
    Ok(LogFit { index, factors: sink.factors, summary })
}

/// What a second look gathers.
struct SecondLook<'a> {
    lag: LagCheck<'a>,
    trace: TraceSink<'a>,
}

impl RowSink for SecondLook<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        self.trace.filtered(rows);
        self.lag.filtered(rows);
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), Error> {
        self.trace.raw(samples);
        self.lag.raw(samples);
        Ok(())
    }
}

/// A second look at the first samples of a log, now that there is a model to predict them with: the torque's lags, and the torque over time.
fn second_look(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
    theta: &[f64],
) -> Result<(Vec<Option<TorqueLag>>, LogTrace), Error> {
    let mut look = SecondLook { lag: LagCheck::new(machine, theta), trace: TraceSink::new(machine, theta) };
    let most_samples = Some(LAG_SAMPLES as u64);
    let pass = Pass { study, machine, motion, index, file, reader_thread: false, most_samples, progress: &Silent };
    let passed = pass.run(&mut look)?;
    let lags = look.lag.lags(study, motion);
    Ok((lags, look.trace.finished(study.log_name(index), "identify", passed.filtered_rate_hz)))
}

fn problem(
    study: &Study,
    machine: &Machine,
    columns: &LoadColumns,
    fits: &[LogFit],
) -> Result<LinearProblem, dynident_estimation::EstimationError> {
    let mut problem = LinearProblem::new(columns.symbols(machine), joint_names(machine));
    for fit in fits {
        // Two logs may share a name; their numbers keep them apart.
        let log = format!("{} ({})", study.log_name(fit.index), fit.index + 1);
        for (joint, factor) in fit.factors.iter().enumerate() {
            let own = machine.layout.joint_columns(joint);
            let keep_known = study.drive.gains == GainChoice::Unknown;
            columns.add(&mut problem, (fit.index, &log), joint, (own, factor), keep_known)?;
        }
    }
    match &machine.prior {
        Some(prior) => {
            let mut prior = prior.clone();
            prior.resize(columns.count(), 0.0);
            problem.with_fallback(prior)
        }
        None => Ok(problem),
    }
}
