//! Selection of the differentiator (method that computes velocity and acceleration from position) of a run.
//!
//! All candidate differentiators yield regressor rows for the same torques, so the best one has the smallest
//! residual. Noise of velocities and accelerations, motion that a filter removes, and a wrong map from position to
//! velocity all increase the residual.

use crate::estimation::run_logs::{RunLog, identification_settings, recordings};
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::RunIdentificationSettings;
use dynident_identification::estimators::estimate;
use dynident_identification::{Execution, Logs, Recording, Samples, choose_friction, training_rows};
use dynident_recording::{DifferentiatorSettings, ReferenceSettings};
use dynident_simulation::Record;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Smallest relative reduction of the residual for which a later candidate is preferred; smaller differences occur by
/// chance in some thousand rows.
const MIN_RESIDUAL_REDUCTION: f64 = 0.02;
/// Minimum number of usable samples, as a share of those of another candidate; a candidate with fewer samples is
/// excluded.
const MIN_SAMPLES_SHARE: f64 = 0.5;
/// Largest lag in the searches of the logistic map from position (*Iterative Identification of Robot Dynamic
/// Parameters Based on Logistic Function*, Eqs. 15, 16) and of the time warp, s.
const MAX_LAG_S: f64 = 0.5;

/// The selected differentiator and the other candidates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DifferentiatorChoice {
    /// The selected differentiator.
    pub taken: DifferentiatorSettings,
    /// Name of the selected differentiator.
    pub name: String,
    /// All candidates, in order.
    pub candidates: Vec<DifferentiatorCandidate>,
}

/// One candidate for the differentiator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DifferentiatorCandidate {
    /// Name of the candidate.
    pub name: String,
    /// Number of usable samples.
    pub samples: usize,
    /// Ratio of this candidate's residual to that of the selected one, on the samples that all candidates can use.
    /// The residual is the geometric mean, over the rows of all joints, of the standard deviations. `None` if the
    /// candidate was not fitted.
    pub residual_ratio: Option<f64>,
    /// Why the candidate was not fitted.
    pub problem: Option<String>,
}

impl DifferentiatorChoice {
    /// Returns the selection and its reason in a sentence without a full stop.
    pub fn sentence(&self) -> String {
        let others = self.candidates.iter().filter(|candidate| candidate.name != self.name).map(|candidate| {
            match (candidate.residual_ratio, &candidate.problem) {
                (Some(ratio), _) => format!("{} has {ratio:.2} times the residual", candidate.name),
                (None, Some(problem)) => format!("{} was not tried ({problem})", candidate.name),
                (None, None) => format!("{} was not tried", candidate.name),
            }
        });
        let others: Vec<String> = others.collect();
        format!("{} was selected by its torque residual: {}", self.name, others.join(", "))
    }
}

fn candidates() -> [(&'static str, DifferentiatorSettings); 4] {
    let reference = ReferenceSettings::default;
    let smoother = Box::default;
    [
        (
            "deviation",
            DifferentiatorSettings::Deviation { reference: reference(), smoother: smoother(), max_lag_s: None },
        ),
        ("butterworth", DifferentiatorSettings::default()),
        ("position-map", DifferentiatorSettings::PositionMap { reference: reference(), max_lag_s: MAX_LAG_S }),
        ("time-warp", DifferentiatorSettings::TimeWarp { reference: reference(), max_lag_s: MAX_LAG_S }),
    ]
}

/// Selects the differentiator with the smallest torque residual of a run. Friction is selected for each candidate if
/// the settings request friction selection.
///
/// # Errors
/// A run to which no candidate can be applied.
pub(crate) fn choose_differentiator(
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
) -> Result<DifferentiatorChoice, IterationError> {
    // The motion of the run as computed by each candidate.
    let mut tried: Vec<(DifferentiatorCandidate, DifferentiatorSettings, Vec<Recording>)> = Vec::new();
    let mut last_error = None;
    for (name, way) in candidates() {
        let own = settings.with_differentiator(&way);
        let log =
            RunLog { run: 1, legs: &task.legs, records, joint_sigma: &[], differentiator: None, rest_margins: &[] };
        let mut candidate =
            DifferentiatorCandidate { name: name.to_owned(), samples: 0, residual_ratio: None, problem: None };
        let motions = recordings(task, &[log], &own).unwrap_or_else(|error| {
            candidate.problem = Some(error.to_string());
            last_error = Some(error);
            Vec::new()
        });
        candidate.samples = motions.iter().map(usable).sum();
        tried.push((candidate, way, motions));
    }
    let most = tried.iter().map(|(candidate, ..)| candidate.samples).max().unwrap_or(0);
    for (candidate, _, motions) in &mut tried {
        if !motions.is_empty() && (candidate.samples as f64) < MIN_SAMPLES_SHARE * most as f64 {
            let percent = 100.0 * candidate.samples as f64 / most.max(1) as f64;
            candidate.problem = Some(format!("only {percent:.0} % of the samples are usable"));
            motions.clear();
        }
    }

    // Residual of each candidate on the same samples.
    let masks = common_samples(tried.iter().map(|(.., motions)| &motions[..]));
    let mut best: Option<(usize, f64)> = None;
    let mut residuals = vec![None; tried.len()];
    for (place, (candidate, way, motions)) in tried.iter_mut().enumerate().filter(|(_, (.., own))| !own.is_empty()) {
        restrict(motions, &masks);
        match residual(task, motions, &settings.with_differentiator(way)) {
            Ok(left) => {
                residuals[place] = Some(left);
                if best.is_none_or(|(_, least)| left < least + (1.0 - MIN_RESIDUAL_REDUCTION).ln()) {
                    best = Some((place, left));
                }
            }
            Err(error) => {
                candidate.problem = Some(error.to_string());
                last_error = Some(error);
            }
        }
    }
    let none = || IterationError::Record {
        joints: task.robot.joint_names(),
        problem: "no differentiator can be applied to it".to_owned(),
    };
    let Some((best, least)) = best else { return Err(last_error.unwrap_or_else(none)) };
    let (name, taken) = (tried[best].0.name.clone(), tried[best].1.clone());
    let mut candidates: Vec<DifferentiatorCandidate> = tried.into_iter().map(|(candidate, ..)| candidate).collect();
    for (candidate, left) in candidates.iter_mut().zip(&residuals) {
        candidate.residual_ratio = left.map(|left| (left - least).exp());
    }
    Ok(DifferentiatorChoice { taken, name, candidates })
}

fn usable(recording: &Recording) -> usize {
    match &recording.samples {
        Samples::Motion(record) if record.usable.is_empty() => record.motion.rows,
        Samples::Motion(record) => record.usable.iter().filter(|usable| **usable).count(),
        Samples::Log(_) => 0,
    }
}

/// The samples of a recording that all candidates can use, and the torques that at least one candidate excludes.
#[derive(Clone, Default)]
struct CommonSamples {
    usable: Vec<bool>,
    set_aside: Vec<bool>,
}

fn common_samples<'a>(ways: impl Iterator<Item = &'a [Recording]>) -> Vec<CommonSamples> {
    let mut common: Vec<CommonSamples> = Vec::new();
    for motions in ways {
        common.resize(common.len().max(motions.len()), CommonSamples::default());
        for (common, recording) in common.iter_mut().zip(motions) {
            let Samples::Motion(record) = &recording.samples else { continue };
            merge(&mut common.usable, &record.usable, true, |a, b| a && b);
            merge(&mut common.set_aside, &record.motion.set_aside, false, |a, b| a || b);
        }
    }
    common
}

/// Combines two lists of flags; a missing flag has the value `usual`.
fn merge(into: &mut Vec<bool>, other: &[bool], usual: bool, both: impl Fn(bool, bool) -> bool) {
    into.resize(into.len().max(other.len()), usual);
    for (into, other) in into.iter_mut().zip(other) {
        *into = both(*into, *other);
    }
}

fn restrict(motions: &mut [Recording], masks: &[CommonSamples]) {
    for (recording, mask) in motions.iter_mut().zip(masks) {
        if let Samples::Motion(record) = &mut recording.samples {
            record.usable.clone_from(&mask.usable);
            Arc::make_mut(&mut record.motion).set_aside.clone_from(&mask.set_aside);
        }
    }
}

/// Mean, over all rows, of the logarithm of the residual standard deviation of the row's joint.
fn residual(
    task: &IterationTask,
    motions: &[Recording],
    settings: &RunIdentificationSettings,
) -> Result<f64, IterationError> {
    let identification = identification_settings(task, settings, 1);
    let all: Vec<usize> = (0..motions.len()).collect();
    let (robot, execution) = (&task.robot, Execution::default());
    let logs = Logs::new(robot.model(), motions, identification.row_settings(), &all, None, execution)?;
    let chosen = choose_friction(&logs, &identification, robot, &all, &settings.payloads)?;
    let training = training_rows(&logs, &identification, chosen.model, &all, &settings.payloads, None)?;
    let found = estimate(&training.rows(&logs, &identification, &all), None)?.estimate;
    let rows = training.problem.joint_rows();
    let sum: f64 =
        found.joint_sigma.iter().zip(&rows).map(|(sigma, rows)| *rows as f64 * sigma.max(f64::MIN_POSITIVE).ln()).sum();
    Ok(sum / rows.iter().sum::<usize>().max(1) as f64)
}
