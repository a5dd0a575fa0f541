//! Content of `iterations.json`.

use super::parameters::BaseParameterResult;
use super::provenance::Provenance;
use crate::error::ResultFileError;
use crate::read::read_result;
use dynident_identification::examination::TorqueLag;
use dynident_iteration::{
    CommandSource, DifferentiatorChoice, HeldOutRun, LoweredBandwidth, Oscillation, RunEvidence, RunOffset,
    TorqueCheck, UnmetCondition, WarmUp,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Schema of `iterations.json`.
pub const ITERATIONS_SCHEMA: &str = "dynident/iterations/1";

/// Value of `status` if an iteration was stopped by the user.
pub const INTERRUPTED: &str = "interrupted";

/// Content of `iterations.json`: all runs of an iteration with their results.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationsFile {
    /// [`ITERATIONS_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Provenance; null in files of earlier versions.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// Whether all conditions of convergence are met: see `unmet`.
    pub converged: bool,
    /// `converged`, `settled` (no further change, but unmet conditions), `runs-used-up`, `refused`, `waiting` or
    /// `interrupted`.
    pub status: String,
    /// Explanation of the status.
    pub reason: String,
    /// Unmet conditions after the last run; empty if the iteration has converged, and in files of earlier versions.
    #[serde(default)]
    pub unmet: Vec<UnmetConditionEntry>,
    /// Forecast for one more run, which was not worthwhile. Only if motions are redesigned and all conditions of
    /// convergence are met.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declined: Option<RunForecast>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Joints whose control loops had to be slower than `bandwidth_hz` to be stable with the delay of the robot; empty
    /// if the study states the gains.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lowered_bandwidths: Vec<LoweredBandwidth>,
    /// Duration of each run, s. If a run consists of several trajectories (legs), the sum of their durations.
    pub duration_s: f64,
    /// The runs.
    pub runs: Vec<IterationRun>,
    /// Ratio of the tracking errors (largest error of each joint, averaged over the joints): first accepted run divided
    /// by the last. Null for fewer than two runs.
    pub tracking_improvement: Option<f64>,
    /// Parameter error of the last accepted run alone, divided by the Cramér-Rao bound (root mean squares). Only for
    /// simulated robots with torque noise, because the true parameters must be known.
    pub error_over_bound: Option<f64>,
    /// Cramér-Rao bound (smallest possible standard deviation) of every parameter for one run of the first motion. It
    /// assumes exact positions, and white torque noise of the simulated sensors in every recorded sample.
    pub bound: Option<Vec<f64>>,
    /// The base parameters from all accepted runs, as in `result.json`; empty until the last run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub base_parameters: Vec<BaseParameterResult>,
    /// Reason for a missing `result.json` after an accepted run; null if it exists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_result: Option<String>,
    /// All parameters of the last accepted physically consistent set: ten for each body, then one for each friction or
    /// drive term.
    pub possible_parameters: Option<Vec<f64>>,
}

impl IterationsFile {
    /// Reads `iterations.json`.
    ///
    /// # Errors
    /// A file that cannot be read or has another version.
    pub fn read(path: &Path) -> Result<Self, ResultFileError> {
        let bytes = read_result(path)?;
        let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
        let file: Self = serde_json::from_slice(&bytes)
            .map_err(|error| wrong(format!("not a file written by `iterate`: {error}")))?;
        if file.schema != ITERATIONS_SCHEMA {
            return Err(wrong(format!(
                "schema `{}`, not `{ITERATIONS_SCHEMA}`: iterate again with this version",
                file.schema
            )));
        }
        Ok(file)
    }

    /// The text of `iterations.json`.
    ///
    /// # Errors
    /// As [`dynident_text::json::to_string_pretty`].
    pub fn to_json(&self) -> serde_json::Result<String> {
        dynident_text::json::to_string_pretty(self)
    }

    /// Message about loops that are slower than requested, with the keys that change this.
    pub fn lowered_bandwidths_sentence(&self) -> Option<String> {
        let in_words = |model: &str| match model {
            "none" => "without a model",
            "nominal" => "with the nominal model",
            _ => "with the newest model",
        };
        let mut each: Vec<String> = Vec::new();
        for of_model in self.lowered_bandwidths.chunk_by(|one, next| one.model == next.model) {
            let joints: Vec<String> =
                of_model.iter().map(|one| format!("{} {:.2} Hz of {}", one.joint, one.hz, one.asked_hz)).collect();
            each.push(format!("{}: {}", in_words(&of_model[0].model), joints.join(", ")));
        }
        (!each.is_empty()).then(|| {
            format!(
                "Gains are lower than bandwidth_hz requests, so that the robot is stable with the assumed delay in \
                 all postures of the motion and joints with light drives do not oscillate ({}); if sensors and drives \
                 are faster, state rehearsal.delay_s; if drives are heavier, state rehearsal.lightest_drive",
                each.join("; ")
            )
        })
    }

    /// What the torque check of the last accepted run could not check, in words; empty if it checked everything.
    pub fn unchecked_torque(&self) -> Vec<String> {
        let Some(last) = self.runs.iter().rfind(|run| run.accepted) else { return Vec::new() };
        let Some(check) = &last.torque_check else {
            return vec!["the logged torque compared with the commanded torque".to_owned()];
        };
        let alone = self.joints.iter().zip(&check.joints).filter(|(_, joint)| joint.row_scale.is_none());
        let alone: Vec<&str> = alone.map(|(name, _)| &**name).collect();
        let common = "a common torque scale of all joints, because the drives have their own loop";
        let gains = format!(
            "whether the drives of {} deliver the logged torque: their masses and inertias do not affect other joints' \
             torques enough",
            alone.join(", ")
        );
        let is_path_only = check.source == CommandSource::PathOnly;
        is_path_only.then(|| common.to_owned()).into_iter().chain((!alone.is_empty()).then_some(gains)).collect()
    }

    /// Messages about joints whose torque oscillates in the log of a run.
    pub fn oscillation_sentences(&self) -> Vec<String> {
        let of_run = |run: &IterationRun| -> Vec<String> {
            let joints = run.evidence.iter().flat_map(|evidence| self.joints.iter().zip(&evidence.joints));
            let oscillating = joints.filter_map(|(name, shown)| Some((name, shown.oscillation?)));
            let sentence = |(name, own): (&String, Oscillation)| {
                format!(
                    "Torque of joint {name} oscillates at {:.0} Hz with an amplitude of {:.3} Nm (N) in {:.0} % of the \
                     samples of run {}: the loop is too fast for its inertia and delay, or the drive \
                     switches; give this joint a lower bandwidth_hz or lower gains, and check its torque",
                    own.frequency_hz,
                    own.amplitude,
                    100.0 * own.share,
                    run.run
                )
            };
            oscillating.map(sentence).collect()
        };
        self.runs.iter().flat_map(of_run).collect()
    }

    /// Summary in one line: status, runs, tracking, unmet conditions.
    pub fn status_line(&self) -> String {
        let good = self.runs.iter().filter(|run| run.accepted).count();
        let last = self.runs.iter().rfind(|run| run.accepted);
        let tracking = last.map_or_else(String::new, |last| {
            let worst = last.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
            format!("; tracking {worst:.2e} rad (m)")
        });
        let unmet = if self.converged { String::new() } else { format!("; {} unmet", self.unmet.len()) };
        format!("{}: {}; {good} of {} runs accepted{tracking}{unmet}", self.name, self.reason, self.runs.len())
    }
}

/// Predicted and actual improvement of the error bars by the motion of a run. The improvement is that of the root mean
/// square over the (at most) ten least known combinations of parameters, expressed as torque uncertainty over the
/// workspace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunForecast {
    /// Whether the motion differs from that of the previous accepted run.
    pub redesigned: bool,
    /// Reason for repeating the motion although a new one was designed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Predicted reduction of the error bars, percent.
    pub gain_percent: f64,
    /// Predicted reduction of the error bars if the previous motion were repeated, percent.
    pub repeat_gain_percent: f64,
    /// Actual reduction of the error bars, percent; null for a run that was not made or was rejected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached_gain_percent: Option<f64>,
    /// Predicted standard deviation of every base parameter after the run; null for an undetermined one.
    pub std: Vec<Option<f64>>,
    /// Largest torque of each joint along the motion, including the 95 % uncertainty of the model, Nm (N).
    pub largest_torque: Vec<f64>,
}

impl RunForecast {
    /// Motion, prediction and outcome as text.
    pub fn sentence(&self) -> String {
        let motion = match (&self.reason, self.redesigned) {
            (_, true) => "new motion".to_owned(),
            (Some(reason), false) => format!("repeated motion ({reason})"),
            (None, false) => "repeated motion".to_owned(),
        };
        let reached = self.reached_gain_percent.map_or_else(String::new, |reached| match reached {
            narrower if narrower >= 0.0 => format!(", actual reduction {narrower:.0} %"),
            wider => format!(", actual increase {:.0} %", -wider),
        });
        let again =
            if self.redesigned { format!(" (a repetition: {:.0} %)", self.repeat_gain_percent) } else { String::new() };
        format!("{motion}, predicted reduction of the largest error bars by {:.0} %{again}{reached}", self.gain_percent)
    }
}

/// An unmet condition of convergence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UnmetConditionEntry {
    /// The unmet condition with its numbers.
    #[serde(flatten)]
    pub shortfall: UnmetCondition,
    /// The condition in a sentence.
    pub message: String,
    /// How to meet the condition.
    pub remedy: String,
}

/// One run of an iteration: one motion of the robot with its log, its checks and the estimate after it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationRun {
    /// Run number, from 1.
    pub run: usize,
    /// Number of the leg (one of several trajectories), from 1, if each leg is iterated separately; null otherwise.
    pub leg: Option<usize>,
    /// The controller.
    pub controller: String,
    /// Whether the controller used a robot model.
    pub model_based: bool,
    /// Run whose physically consistent set (or estimate) was the controller's model. Null if the controller used the
    /// robot description, a model between two estimates, or no model.
    pub model_of_run: Option<usize>,
    /// Fraction of the step from the last accepted parameters to the new estimate that the controller's model contains;
    /// 1 for the new estimate itself.
    pub damping: f64,
    /// Factor on the gains of the controller without a model.
    pub stiffness: f64,
    /// Whether the run was accepted.
    pub accepted: bool,
    /// Outcome of the robot's run.
    pub outcome: String,
    /// Reason for the rejection.
    pub reason: Option<String>,
    /// Largest tracking error of each joint, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Result of the warm-up before the run; null without a warm-up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warm_up: Option<WarmUp>,
    /// Held-out run that followed this run, with the error of the model's torque prediction; null if there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutRun>,
    /// Parameters from this run alone.
    pub parameters: Vec<IterationParameter>,
    /// Parameters from all accepted runs so far; empty for the first run, for rejected runs, and without pooling.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pooled: Vec<IterationParameter>,
    /// Deviation of the constant torques of each accepted run from their mean; empty if the runs share them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub run_offsets: Vec<RunOffset>,
    /// Further findings from the log of the run, for each joint; null for an incomplete run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Comparison of logged and commanded torque; null if too little was recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_check: Option<TorqueCheck>,
    /// Predicted and actual improvement by the motion; null if motions are not redesigned, or before the first
    /// estimate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forecast: Option<RunForecast>,
    /// Cramér-Rao bound (smallest possible standard deviation of every parameter) of a run with this motion, if the
    /// motion differs from the first one. Only for simulated robots with torque noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<Vec<f64>>,
    /// Time by which each joint's torque is later than its motion, from this run alone. Null if it is not identifiable,
    /// or if only windows of the log are used; empty for the step-by-step scheme.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_lags: Vec<Option<TorqueLag>>,
    /// The selected method for velocities and accelerations, with the compared alternatives; null if the study states
    /// the method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differentiator: Option<DifferentiatorChoice>,
}

impl IterationRun {
    /// Message about the largest deviation of a run's constant torque; `None` if the runs share their offsets.
    pub fn run_offsets_sentence(&self, joints: &[String]) -> Option<String> {
        let largest = self.run_offsets.iter().max_by(|a, b| a.deviation.abs().total_cmp(&b.deviation.abs()))?;
        let RunOffset { run, joint, deviation, std } = largest;
        let name = joints.get(*joint).map_or("a joint", String::as_str);
        Some(format!(
            "constant torques differ between runs, most in run {run} at {name}: {deviation:+.3} +- {:.3} Nm (95 %) from the mean: check for drift of the torque sensors' zero, or a cable that pulls",
            1.96 * std
        ))
    }

    /// Parameters known after this run: from all accepted runs if they are pooled, otherwise from this run alone.
    pub fn known(&self) -> &[IterationParameter] {
        if self.pooled.is_empty() { &self.parameters } else { &self.pooled }
    }
}

/// One base parameter of one run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationParameter {
    /// Symbol of the regressor column.
    pub symbol: String,
    /// Expression.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; null if the run does not determine it.
    pub std: Option<f64>,
    /// Estimate minus true value, for a simulated robot; null for a real one.
    pub error: Option<f64>,
}
