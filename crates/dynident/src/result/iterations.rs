//! What `iterations.json` holds.

use super::identification::BaseParameterResult;
use super::provenance::Provenance;
use crate::error::Error;
use crate::inputs::read_result;
use dynident_identification::examination::TorqueLag;
use dynident_iteration::{
    CommandSource, DifferentiatorChoice, HeldOutRun, LoweredBandwidth, Oscillation, RunEvidence, RunOffset, Shortfall,
    TorqueCheck, WarmUp,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Schema of `iterations.json`.
pub const ITERATIONS_SCHEMA: &str = "dynident/iterations/1";

/// The status of an iteration that a stop ended.
pub const INTERRUPTED: &str = "interrupted";

/// `iterations.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationsFile {
    /// [`ITERATIONS_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Where it comes from; none in files of before it was written.
    #[serde(default)]
    pub provenance: Option<Provenance>,
    /// Whether everything is met that makes a success: see `unmet`.
    pub converged: bool,
    /// `converged`, `settled` (nothing changes any more, but something is unmet), `runs-used-up`, `refused`, `waiting`
    /// or `interrupted`.
    pub status: String,
    /// The status in words.
    pub reason: String,
    /// What is not met after the last run; empty if the iteration has converged, and in files of before it was written.
    #[serde(default)]
    pub unmet: Vec<UnmetCondition>,
    /// Where motions are designed with what is known and everything is met: what a further run was expected to bring,
    /// too little for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declined: Option<RunForecast>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Joints whose loops are slower than `bandwidth_hz`, so that a late controller holds them; empty where the gains
    /// are stated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lowered_bandwidths: Vec<LoweredBandwidth>,
    /// Length of each run, s; of legs one after another, of all of them once.
    pub duration_s: f64,
    /// The runs.
    pub runs: Vec<IterationRun>,
    /// Largest tracking error (mean over the joints) of the first good run over that of the last; none before there are
    /// two.
    pub tracking_improvement: Option<f64>,
    /// Root mean square over the parameters of the error of what the last good run says alone, in units of the
    /// Cramér-Rao bound; for simulated robots with torque noise.
    pub error_over_bound: Option<f64>,
    /// The Cramér-Rao bound of every parameter for one run of the first motion: white torque noise of the simulated
    /// sensors at every recorded sample, exact positions.
    pub bound: Option<Vec<f64>>,
    /// The base parameters by all good runs together, as in `result.json`; empty while runs are still being made.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub base_parameters: Vec<BaseParameterResult>,
    /// Why there is no `result.json` although a run was good; none where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_result: Option<String>,
    /// All parameters of the last good physically consistent set: ten for each body, one for each term.
    pub possible_parameters: Option<Vec<f64>>,
}

impl IterationsFile {
    /// Reads what an iteration has written so far.
    ///
    /// # Errors
    /// A file that cannot be read or is none of this version.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let bytes = read_result(path)?;
        let wrong = |message: String| Error::Result { path: path.to_owned(), message };
        let file: Self =
            serde_json::from_slice(&bytes).map_err(|error| wrong(format!("not what `iterate` writes: {error}")))?;
        if file.schema != ITERATIONS_SCHEMA {
            return Err(wrong(format!(
                "schema `{}`, not `{ITERATIONS_SCHEMA}`: iterate again with this version",
                file.schema
            )));
        }
        Ok(file)
    }

    /// Which loops are slower than asked for, and what would make them faster.
    pub fn lowered_bandwidths_sentence(&self) -> Option<String> {
        let in_words = |model: &str| match model {
            "none" => "without a model",
            "nominal" => "with the description's model",
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
                "Gains are lower than bandwidth_hz asks for, so that a controller which acts late holds the robot in \
                 every posture of the motion and joints with light drives do not oscillate ({}); if sensors and drives \
                 are faster, state rehearsal.delay_s, if drives are heavier, rehearsal.lightest_drive",
                each.join("; ")
            )
        })
    }

    /// What the torque check of the last good run could not check; empty where it checked everything.
    pub fn unchecked_torque(&self) -> Vec<String> {
        let Some(last) = self.runs.iter().rfind(|run| run.accepted) else { return Vec::new() };
        let Some(check) = &last.torque_check else { return vec!["the logged against the commanded torque".to_owned()] };
        let alone = self.joints.iter().zip(&check.joints).filter(|(_, joint)| joint.row_scale.is_none());
        let alone: Vec<&str> = alone.map(|(name, _)| &**name).collect();
        let common = "a torque scale that all joints share, because the drives close their own loop";
        let gains = format!(
            "whether the drives of {} deliver the logged torque: their masses and inertias enter no other joint's torque \
             clearly enough",
            alone.join(", ")
        );
        let is_path_only = check.source == CommandSource::PathOnly;
        is_path_only.then(|| common.to_owned()).into_iter().chain((!alone.is_empty()).then_some(gains)).collect()
    }

    /// Joints whose torque oscillates in the log of a run, a sentence for each.
    pub fn oscillation_sentences(&self) -> Vec<String> {
        let of_run = |run: &IterationRun| -> Vec<String> {
            let joints = run.evidence.iter().flat_map(|evidence| self.joints.iter().zip(&evidence.joints));
            let oscillating = joints.filter_map(|(name, shown)| Some((name, shown.oscillation?)));
            let sentence = |(name, own): (&String, Oscillation)| {
                format!(
                    "Torque of joint {name} oscillates at {:.0} Hz with an amplitude of {:.3} Nm (N) in {:.0} % of the \
                     samples of run {}: a loop that is too fast for its inertia and its delay, or a drive that \
                     switches; give this joint a lower bandwidth_hz or lower gains, and look at its torque",
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

    /// The state in one line: how it stands, runs, tracking, what is unmet.
    pub fn status_line(&self) -> String {
        let good = self.runs.iter().filter(|run| run.accepted).count();
        let last = self.runs.iter().rfind(|run| run.accepted);
        let tracking = last.map_or_else(String::new, |last| {
            let worst = last.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
            format!("; tracking {worst:.2e} rad (m)")
        });
        let unmet = if self.converged { String::new() } else { format!("; {} unmet", self.unmet.len()) };
        format!("{}: {}; {good} good of {} runs{tracking}{unmet}", self.name, self.reason, self.runs.len())
    }
}

/// What the motion of a run was expected to bring by all that was known before it, and what came of it. Bars are those
/// of the (at most) ten directions that were known worst, by the torque that they leave uncertain wherever the arm may
/// be: their root mean square.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunForecast {
    /// Whether the motion is another than that of the good run before.
    pub redesigned: bool,
    /// Why it is not, although another was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// By how much the bars were to become narrower, percent.
    pub gain_percent: f64,
    /// The same with the motion of the good run before, once more.
    pub repeat_gain_percent: f64,
    /// By how much they did; none for a run that was not made or does not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached_gain_percent: Option<f64>,
    /// The standard deviation expected of every base parameter after the run; none for what it will not determine.
    pub std: Vec<Option<f64>>,
    /// For each joint the largest torque along the motion by any model in the uncertainty (95 %), Nm (N).
    pub largest_torque: Vec<f64>,
}

impl RunForecast {
    /// In words: what the motion is, what it was to bring, and what came of it.
    pub fn sentence(&self) -> String {
        let motion = match (&self.reason, self.redesigned) {
            (_, true) => "another motion".to_owned(),
            (Some(reason), false) => format!("the motion before ({reason})"),
            (None, false) => "the motion before".to_owned(),
        };
        let reached = self.reached_gain_percent.map_or_else(String::new, |reached| match reached {
            narrower if narrower >= 0.0 => format!(", and made them {narrower:.0} % narrower"),
            wider => format!(", and made them {:.0} % wider", -wider),
        });
        let again = if self.redesigned {
            format!(" (the motion before once more: {:.0} %)", self.repeat_gain_percent)
        } else {
            String::new()
        };
        format!("{motion}, which was to narrow the worst bars by {:.0} %{again}{reached}", self.gain_percent)
    }
}

/// Something that stands between an iteration and success.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UnmetCondition {
    /// What it is, with its numbers.
    #[serde(flatten)]
    pub shortfall: Shortfall,
    /// The same in words.
    pub message: String,
    /// What would help.
    pub remedy: String,
}

/// One run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationRun {
    /// Its number, from 1.
    pub run: usize,
    /// Which leg it belongs to, from 1, where each has an iteration of its own; none otherwise.
    pub leg: Option<usize>,
    /// The controller.
    pub controller: String,
    /// Whether it had a model.
    pub model_based: bool,
    /// Of which run the physically consistent set (or the estimate) was its model; none for the description, a step
    /// between two runs' robots, or no model.
    pub model_of_run: Option<usize>,
    /// Share of the step from the last good parameters that was taken.
    pub damping: f64,
    /// Factor of the gains of the controller without a model.
    pub stiffness: f64,
    /// Whether it counts as good.
    pub accepted: bool,
    /// How the robot ended.
    pub outcome: String,
    /// Why it does not count.
    pub reason: Option<String>,
    /// For each joint the largest distance from the trajectory, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// What the warm-up before it has shown; none where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warm_up: Option<WarmUp>,
    /// The run of the held-out motion after it, and how well the model that it gave predicts that; none where there was
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutRun>,
    /// What it determines by itself.
    pub parameters: Vec<IterationParameter>,
    /// What all good runs up to this one determine together; empty for the first, for those that do not count, and
    /// where runs are not pooled.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pooled: Vec<IterationParameter>,
    /// Where the good runs up to this one have constant torques of their own, by how much each deviates from their
    /// mean; empty where they share one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub run_offsets: Vec<RunOffset>,
    /// What its log shows beside parameters, joint by joint; none where it did not get to its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Whether its logged torque is the torque that its controller commanded; none where too little was recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_check: Option<TorqueCheck>,
    /// What its motion was expected to bring, and what came of it; none where motions are not designed with what is
    /// known, and where nothing was known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forecast: Option<RunForecast>,
    /// The Cramér-Rao bound of a run along its motion where that is not the first's; for simulated robots with torque
    /// noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<Vec<f64>>,
    /// By how much each joint's torque comes after the motion, by this run alone; none where the run does not
    /// determine it or windows leave rows out, empty step by step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_lags: Vec<Option<TorqueLag>>,
    /// The way from positions to velocities and accelerations that the run chose, and the others; none where it was
    /// stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differentiator: Option<DifferentiatorChoice>,
}

impl IterationRun {
    /// The largest constant torque that a run has of its own, in words, with the joints' names; none where runs share
    /// theirs.
    pub fn run_offsets_sentence(&self, joints: &[String]) -> Option<String> {
        let largest = self.run_offsets.iter().max_by(|a, b| a.deviation.abs().total_cmp(&b.deviation.abs()))?;
        let RunOffset { run, joint, deviation, std } = largest;
        let name = joints.get(*joint).map_or("a joint", String::as_str);
        Some(format!(
            "runs have constant torques of their own, most run {run} at {name}, {deviation:+.3} +- {:.3} Nm (95 %) off the mean of all: look for zeros of sensors that drift, or a cable that pulls",
            1.96 * std
        ))
    }

    /// What is known after it: by all good runs together, or else by it alone.
    pub fn known(&self) -> &[IterationParameter] {
        if self.pooled.is_empty() { &self.parameters } else { &self.pooled }
    }
}

/// One base parameter by one run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IterationParameter {
    /// Symbol of its column.
    pub symbol: String,
    /// What it sums.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; none where the run does not determine it.
    pub std: Option<f64>,
    /// Value less the simulated robot's; none for a real one.
    pub error: Option<f64>,
}
