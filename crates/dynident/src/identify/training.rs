//! From training logs to triangular factors and the estimate that friction is chosen by.

use crate::error::Error;
use crate::identify::friction_candidates::{candidate_columns, joints_to_choose};
use crate::identify::friction_choice::{JointFriction, choose_friction, with_friction};
use crate::identify::result::{LogSummary, Timings};
use crate::job::{RunOptions, joint_names, log_summary};
use crate::load::columns::LoadColumns;
use crate::load::gains::{DriveGain, Gains, drive_gains};
use crate::machine::Machine;
use crate::measured::evidence::Evidence;
use crate::measured::rows::{JointRows, Pass, RawSamples, RowSink};
use crate::study::{EstimatorMethod, Folders, GainChoice, Study};
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, LinearProblem, OrdinarySettings, SegmentedFactor, WeightedSettings, ordinary_least_squares,
    weighted_least_squares,
};
use dynident_recording::MotionSettings;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What fitting needs beside study and machine.
pub(super) struct Training<'a> {
    pub(super) study_path: &'a Path,
    pub(super) folders: &'a Folders,
    pub(super) motion: &'a MotionSettings,
    pub(super) files: &'a [PathBuf],
    /// The logs to fit to.
    pub(super) logs: &'a [usize],
    pub(super) options: &'a RunOptions<'a>,
}

/// A fit, and the study and machine with the friction that it was made with.
pub(super) struct TrainingFit {
    pub(super) study: Study,
    pub(super) machine: Machine,
    pub(super) fits: Vec<LogFit>,
    pub(super) problem: LinearProblem,
    pub(super) estimate: Estimate,
    pub(super) columns: LoadColumns,
    pub(super) friction_choice: Vec<JointFriction>,
}

impl Training<'_> {
    /// Fits the stated model; where friction is to be chosen or depends on the load, once more with what that fit says.
    pub(super) fn fit(&self, study: &Study, machine: Machine, timings: &mut Timings) -> Result<TrainingFit, Error> {
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
        let known = first.machine.layout().columns();
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
    pub(super) fn gains(&self, fitted: &mut TrainingFit) -> Result<Option<(Estimate, Vec<DriveGain>)>, Error> {
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
pub(super) struct LogFit {
    pub(super) index: usize,
    pub(super) factors: Vec<SegmentedFactor>,
    pub(super) summary: LogSummary,
}

impl LogFit {
    /// The same rows as another machine sees them, whose columns are among those of `wide`.
    fn of(mut self, wide: &Machine, machine: &Machine) -> Result<Self, dynident_estimation::EstimationError> {
        for (joint, factor) in self.factors.iter_mut().enumerate() {
            let seen = wide.layout().joint_columns(joint);
            // A column that is not there gets a number out of range, which the selection refuses.
            let place = |&column: &usize| {
                let wanted = &machine.layout().columns()[column];
                seen.iter().position(|&global| wide.layout().columns()[global] == *wanted).unwrap_or(usize::MAX)
            };
            let places: Vec<usize> = machine.layout().joint_columns(joint).iter().map(place).collect();
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
    let columns: Vec<&[usize]> =
        (0..machine.model().dof()).map(|joint| machine.layout().joint_columns(joint)).collect();
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
            .nominal_base()
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
            let own = machine.layout().joint_columns(joint);
            let keep_known = study.drive.gains == GainChoice::Unknown;
            columns.add(&mut problem, (fit.index, &log), joint, (own, factor), keep_known)?;
        }
    }
    match machine.nominal_base() {
        Some(prior) => {
            let mut prior = prior.to_vec();
            prior.resize(columns.count(), 0.0);
            problem.with_fallback(prior)
        }
        None => Ok(problem),
    }
}
