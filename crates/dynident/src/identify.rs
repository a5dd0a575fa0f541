//! Logs to a model: the main job.

use crate::error::Error;
use crate::evidence::{Evidence, PriorAgreement, findings};
use crate::lag::{self, LAG_SAMPLES, LagCheck};
use crate::machine::{Machine, prior_parameters};
use crate::progress::{Progress, Silent};
use crate::result::{
    BaseParameterResult, BodyResult, JointResult, LawResult, LogSummary, MethodSummary, PhysicalVerdict, RESULT_SCHEMA,
    ResultFile, RobotSummary, Timings, TrainingJoint, TrainingResult,
};
use crate::rows::{JointRows, Pass, Passed, RawSamples, RowSink, motion_in_force};
use crate::standard_parameters::{inertials, nearest_to_prior};
use crate::study::{EstimatorMethod, Folders, Role, Study};
use crate::validate::validate_log;
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, EstimateStatus, LinearProblem, OrdinarySettings, SegmentedFactor, WeightedSettings,
    ordinary_least_squares, weighted_least_squares,
};
use dynident_model::laws::Law;
use dynident_model::{
    DescriptionFormat, INERTIAL_NAMES, InertialParameters, JointChange, LinkChange, link_changes, rewrite_urdf,
};
use dynident_recording::MotionSettings;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How a job runs; not what it computes.
pub struct RunOptions<'a> {
    /// Folder of the recordings, in place of the study's own.
    pub data: Option<PathBuf>,
    /// Threads; the result is the same for any number.
    pub threads: usize,
    /// Hears how far the job has come.
    pub progress: &'a dyn Progress,
}

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
}

/// Fits a study's model to its logs and tests it on the held-out ones.
///
/// # Errors
/// Everything that [`Error`] names: files, study, logs. A poor fit is not an error.
pub fn identify(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<Identification, Error> {
    let start = Instant::now();
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let machine = Machine::new(study, study_path, &folders)?;
    let mut timings = Timings { machine: start.elapsed().as_secs_f64(), ..Timings::default() };
    let files = log_files(study, &folders)?;

    let started = Instant::now();
    let training: Vec<usize> = of_role(study, Role::Identify);
    let motion = motion_in_force(study, &machine, &files, &training, None)?;
    let fits = read_logs(study, &machine, &motion, &files, &training, options)?;
    timings.logs = started.elapsed().as_secs_f64();

    let started = Instant::now();
    let in_study = |source| Error::Estimation { path: study_path.to_owned(), source };
    let problem = problem(study, &machine, &fits).map_err(in_study)?;
    let estimate = match study.estimator.method {
        EstimatorMethod::Ordinary => {
            let settings = OrdinarySettings { rank: study.estimator.rank, covariance: study.estimator.covariance };
            ordinary_least_squares(&problem, &settings)
        }
        EstimatorMethod::Weighted => {
            let settings = WeightedSettings {
                rank: study.estimator.rank,
                covariance: study.estimator.covariance,
                ..WeightedSettings::default()
            };
            weighted_least_squares(&problem, &settings)
        }
    }
    .map_err(in_study)?;
    timings.estimation = started.elapsed().as_secs_f64();

    let started = Instant::now();
    let joints = joint_names(&machine);
    let mut logs = Vec::new();
    for fit in &fits {
        let mut summary = fit.summary.clone();
        summary.torque_lag_s = training_lags(study, &machine, &motion, fit.index, &files[fit.index], &estimate.values)?;
        summary.model_findings.extend(lag::findings(&summary.torque_lag_s, &joints));
        logs.push(summary);
    }
    let mut validation = Vec::new();
    for index in of_role(study, Role::Validate) {
        let (summary, figures) =
            validate_log(study, &machine, &motion, index, &files[index], &estimate.values, options)?;
        logs.push(summary);
        validation.push(figures);
    }
    timings.validation = started.elapsed().as_secs_f64();
    timings.total = start.elapsed().as_secs_f64();

    let prior = prior_parameters(&machine.model, &machine.laws);
    let parameters = nearest_to_prior(&machine.model, &machine.base, &estimate.values, &prior);
    let inertials = inertials(&machine.model, &parameters);
    // Parameters that URDF cannot express leave a result without one; it is no reason to lose the result.
    let (urdf, no_urdf) = match written_urdf(&machine, &inertials, &parameters) {
        Ok(urdf) => (Some(urdf), None),
        Err(reason) => (None, Some(reason)),
    };
    let result = ResultFile {
        schema: RESULT_SCHEMA,
        name: study_name(study, study_path),
        robot: robot_summary(&machine),
        method: method_summary(study, &machine, &motion, &estimate),
        base_parameters: base_parameters(&machine, &estimate),
        bodies: bodies(&machine, &inertials),
        joints: joint_results(&machine, &estimate, &parameters),
        couplings: law_results(&machine, &estimate, &parameters, |law| matches!(law, Law::Coupling(_))),
        training: training_result(study, &machine, &problem, &training, &estimate).map_err(in_study)?,
        validation,
        physical: verdict(&machine, &inertials, &parameters),
        logs,
        no_urdf,
        timings_s: timings,
    };
    Ok(Identification { result, estimate, inertials, urdf })
}

/// What a study is called.
pub(crate) fn study_name(study: &Study, path: &Path) -> String {
    let stem = || path.file_stem().map_or_else(|| "study".to_owned(), |stem| stem.to_string_lossy().into_owned());
    study.name.clone().unwrap_or_else(stem)
}

/// All logs' files, found before any work starts.
pub(crate) fn log_files(study: &Study, folders: &Folders) -> Result<Vec<PathBuf>, Error> {
    study.log.iter().map(|log| folders.find(&log.file, study.source.as_deref())).collect()
}

pub(crate) fn of_role(study: &Study, role: Role) -> Vec<usize> {
    (0..study.log.len()).filter(|&index| study.log[index].role == role).collect()
}

/// What is left of one log for fitting.
struct LogFit {
    index: usize,
    factors: Vec<SegmentedFactor>,
    summary: LogSummary,
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
    options.progress.begin("logs to factors", crate::rows::estimated_rows(training.iter().map(|&i| &*files[i])));
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
        evidence: machine.prior.as_ref().map(|prior| Evidence::new(columns, prior)),
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
    let summary = log_summary(study, index, passed, agreement, Vec::new(), &joints);
    Ok(LogFit { index, factors: sink.factors, summary })
}

/// A second look at the first samples of a log, now that there is a model to predict them with.
fn training_lags(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
    theta: &[f64],
) -> Result<Vec<Option<f64>>, Error> {
    let mut check = LagCheck::new(machine, theta);
    let most_samples = Some(LAG_SAMPLES as u64);
    let pass = Pass { study, machine, motion, index, file, reader_thread: false, most_samples, progress: &Silent };
    let passed = pass.run(&mut check)?;
    Ok(check.lags(passed.motion_cutoff_hz))
}

pub(crate) fn joint_names(machine: &Machine) -> Vec<String> {
    machine.model.joints().iter().map(|joint| joint.name.clone()).collect()
}

pub(crate) fn log_summary(
    study: &Study,
    index: usize,
    passed: Passed,
    prior_agreement: Option<PriorAgreement>,
    torque_lag_s: Vec<Option<f64>>,
    joints: &[String],
) -> LogSummary {
    let mut model_findings = prior_agreement.as_ref().map_or_else(Vec::new, findings);
    model_findings.extend(lag::findings(&torque_lag_s, joints));
    LogSummary {
        log: study.log_name(index),
        role: match study.log[index].role {
            Role::Identify => "identify",
            Role::Validate => "validate",
        },
        motion_cutoff_hz: passed.motion_cutoff_hz,
        filter_cutoff_hz: passed.filter_cutoff_hz,
        filtered_rate_hz: passed.filtered_rate_hz,
        filtered_rows: passed.filtered_rows,
        model_findings,
        torque_lag_s,
        prior_agreement,
        import: passed.report,
    }
}

fn problem(
    study: &Study,
    machine: &Machine,
    fits: &[LogFit],
) -> Result<LinearProblem, dynident_estimation::EstimationError> {
    let symbols = machine.layout.columns().iter().map(Column::symbol).collect();
    let mut problem = LinearProblem::new(symbols, joint_names(machine));
    for fit in fits {
        // Two logs may share a name; their numbers keep them apart.
        let log = format!("{} ({})", study.log_name(fit.index), fit.index + 1);
        for (joint, factor) in fit.factors.iter().enumerate() {
            problem.add(&log, joint, machine.layout.joint_columns(joint).to_vec(), factor.clone())?;
        }
    }
    match &machine.prior {
        Some(prior) => problem.with_fallback(prior.clone()),
        None => Ok(problem),
    }
}

fn robot_summary(machine: &Machine) -> RobotSummary {
    RobotSummary {
        name: machine.model.name().to_owned(),
        file: machine.robot.path.display().to_string(),
        dof: machine.model.dof(),
        joints: joint_names(machine),
        gravity_m_s2: machine.model.gravity().0,
        parameter_order: INERTIAL_NAMES,
    }
}

fn method_summary(study: &Study, machine: &Machine, motion: &MotionSettings, estimate: &Estimate) -> MethodSummary {
    let (weakest, strongest) = machine.base.gap();
    MethodSummary {
        estimator: match study.estimator.method {
            EstimatorMethod::Ordinary => "ordinary",
            EstimatorMethod::Weighted => "weighted",
        }
        .to_owned(),
        status: match estimate.status {
            EstimateStatus::Complete => "complete",
            EstimateStatus::NotAllExcited => "not-all-excited",
            EstimateStatus::IterationLimit => "iteration-limit",
        }
        .to_owned(),
        iterations: estimate.iterations,
        covariance: if estimate.clusters > 0 {
            "time segments: accounts for residuals correlated in time".to_owned()
        } else {
            "white residuals".to_owned()
        },
        clusters: estimate.clusters,
        motion: motion.clone(),
        condition_number: estimate.condition_number_raw,
        condition_number_scaled: estimate.condition_number_scaled,
        base_columns: "from the machine's structure: columns from base to tip, bodies then laws; a column that depends on earlier ones is regrouped into them"
            .to_owned(),
        base_gap: [weakest, strongest],
        not_excited: estimate.rank.fixed.iter().map(|fixed| fixed.name.clone()).collect(),
    }
}

fn base_parameters(machine: &Machine, estimate: &Estimate) -> Vec<BaseParameterResult> {
    let expressions = machine.base.expressions();
    let columns = machine.layout.columns();
    (0..columns.len())
        .map(|index| BaseParameterResult {
            symbol: columns[index].symbol(),
            expression: expressions[index].clone(),
            unit: columns[index].unit().to_owned(),
            value: estimate.values[index],
            std: estimate.std[index],
            std_white: estimate.covariance_white[(index, index)].max(0.0).sqrt(),
            relative_std_percent: estimate.relative_std_percent[index],
            prior: machine.prior.as_ref().map(|prior| prior[index]),
            excited: !estimate.rank.fixed.iter().any(|fixed| fixed.column == index),
        })
        .collect()
}

fn bodies(machine: &Machine, inertials: &[InertialParameters]) -> Vec<BodyResult> {
    machine
        .model
        .bodies()
        .iter()
        .zip(inertials)
        .map(|(body, inertial)| BodyResult {
            name: body.name().to_owned(),
            links: body.links.iter().map(|link| link.name.clone()).collect(),
            mass_kg: inertial.mass_kg(),
            com_m: inertial.com_m().map(|com| com.0),
            inertia_at_origin_kgm2: core::array::from_fn(|k| inertial.0[4 + k]),
            parameters: inertial.0,
            prior: body.prior().map(|prior| prior.0),
            pseudo_inertia_min_eigenvalue: inertial.pseudo_inertia().symmetric_eigenvalues().min(),
        })
        .collect()
}

fn law_results(
    machine: &Machine,
    estimate: &Estimate,
    parameters: &[f64],
    wanted: impl Fn(&Law) -> bool,
) -> Vec<LawResult> {
    let first_law = 10 * machine.model.dof();
    let expressions = machine.base.expressions();
    let of_law = |(x, law): (usize, &Law)| {
        let column = first_law + x;
        let place = machine.base.independent().iter().position(|&index| index == column);
        // A law that other parameters were regrouped into has no value of its own either.
        let alone = place.filter(|&place| expressions[place] == law.symbol());
        let home = place.or_else(|| {
            let d = machine.base.dependent().iter().position(|&index| index == column)?;
            let column = machine.base.regrouping().column(d);
            (0..column.len()).find(|&b| column[b].abs() > 1e-9)
        });
        LawResult {
            symbol: law.symbol(),
            unit: law.unit().to_owned(),
            value: alone.map_or(parameters[column], |place| estimate.values[place]),
            std: alone.map(|place| estimate.std[place]),
            base_parameter: home.map(|place| expressions[place].clone()),
        }
    };
    machine.laws.iter().enumerate().filter(|(_, law)| wanted(law)).map(of_law).collect()
}

fn joint_results(machine: &Machine, estimate: &Estimate, parameters: &[f64]) -> Vec<JointResult> {
    machine
        .model
        .joints()
        .iter()
        .enumerate()
        .map(|(index, joint)| JointResult {
            name: joint.name.clone(),
            laws: law_results(machine, estimate, parameters, |law| {
                !matches!(law, Law::Coupling(_)) && law.joints() == [index]
            }),
            residual_std_nm: estimate.joint_sigma[index],
            residual_correlation: estimate.effective_lag1.get(index).copied().filter(|rho| rho.is_finite()),
        })
        .collect()
}

fn training_result(
    study: &Study,
    machine: &Machine,
    problem: &LinearProblem,
    training: &[usize],
    estimate: &Estimate,
) -> Result<TrainingResult, dynident_estimation::EstimationError> {
    let names = joint_names(machine);
    let mut sums = vec![(0_usize, 0.0, 0.0); names.len()];
    for equation in problem.equations() {
        let theta: Vec<f64> = equation.columns.iter().map(|&column| estimate.values[column]).collect();
        let factor = equation.factor.total();
        let sum = &mut sums[equation.joint];
        sum.0 += factor.rows();
        sum.1 += factor.residual_sum_of_squares(&theta)?;
        sum.2 += factor.torque_norm().powi(2);
    }
    let percent = |error: f64, torque: f64| (torque > 0.0).then(|| 100.0 * (error / torque).sqrt());
    let (error, torque) = sums.iter().fold((0.0, 0.0), |(e, t), sum| (e + sum.1, t + sum.2));
    Ok(TrainingResult {
        logs: training.iter().map(|&index| study.log_name(index)).collect(),
        samples: sums.iter().map(|sum| sum.0).max().unwrap_or(0),
        relative_error_percent: percent(error, torque),
        joints: names
            .into_iter()
            .zip(sums)
            .map(|(name, (rows, error, torque))| TrainingJoint {
                name,
                rmse_nm: (error / rows.max(1) as f64).sqrt(),
                relative_error_percent: percent(error, torque),
            })
            .collect(),
    })
}

fn verdict(machine: &Machine, inertials: &[InertialParameters], parameters: &[f64]) -> PhysicalVerdict {
    let mut violations = Vec::new();
    for (body, inertial) in machine.model.bodies().iter().zip(inertials) {
        let least = inertial.pseudo_inertia().symmetric_eigenvalues().min();
        if inertial.mass_kg() <= 0.0 {
            violations.push(format!("{}: mass {:.4} kg", body.name(), inertial.mass_kg()));
        } else if least <= 0.0 {
            violations
                .push(format!("{}: pseudo-inertia not positive definite (least eigenvalue {least:.2e})", body.name()));
        }
    }
    for (law, value) in machine.laws.iter().zip(&parameters[10 * machine.model.dof()..]) {
        if *value < 0.0 && matches!(law, Law::Viscous(_) | Law::Coulomb(_) | Law::DriveInertia(_)) {
            violations.push(format!("{} = {value:.4} {}", law.symbol(), law.unit()));
        }
    }
    PhysicalVerdict {
        consistent: violations.is_empty(),
        violations,
        note: "of the full set nearest to the prior; plain least squares does not enforce it, and another set with the same torques may pass",
    }
}

/// The user's URDF with the new values; joints that were locked keep theirs. Otherwise the reason why there is none.
fn written_urdf(machine: &Machine, inertials: &[InertialParameters], parameters: &[f64]) -> Result<String, String> {
    if machine.robot.format != DescriptionFormat::Urdf {
        return Err("the robot's description is no URDF".to_owned());
    }
    let mut links = link_changes(&machine.model, inertials).map_err(|error| error.to_string())?;
    note_locked(machine, &mut links);
    let mut joints: Vec<JointChange> = Vec::new();
    let laws = machine.laws.iter().zip(&parameters[10 * machine.model.dof()..]);
    for (law, &value) in laws {
        let (joint, damping, friction) = match law {
            Law::Viscous(law) => (law.joint, Some(value), None),
            Law::Coulomb(law) => (law.joint, None, Some(value)),
            _ => continue,
        };
        let name = &machine.model.joints()[joint].name;
        let place = joints.iter().position(|change| change.joint == *name).unwrap_or_else(|| {
            joints.push(JointChange { joint: name.clone(), damping: None, friction: None });
            joints.len() - 1
        });
        joints[place].damping = damping.or(joints[place].damping);
        joints[place].friction = friction.or(joints[place].friction);
    }
    rewrite_urdf(&machine.robot.text, &links, &joints).map_err(|error| error.to_string())
}

/// Says in a body's comment which of its links are not fixed but stood behind locked joints: its values hold while those stay where they were.
fn note_locked(machine: &Machine, changes: &mut [LinkChange]) {
    for body in machine.model.bodies() {
        let own = machine.robot.model.bodies().iter().find(|original| original.name() == body.name());
        let behind: Vec<&str> = body
            .links
            .iter()
            .map(|link| &link.name[..])
            .filter(|&name| own.is_some_and(|own| own.links.iter().all(|link| link.name != name)))
            .collect();
        let set = changes.iter_mut().find_map(|change| match change {
            LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
            _ => None,
        });
        if let (Some(note), false) = (set, behind.is_empty()) {
            let locked = format!("holds with the joints locked behind which stand: {}", behind.join(", "));
            *note = Some(note.take().map_or(locked.clone(), |note| format!("{note}; {locked}")));
        }
    }
}
