//! What `iterations.json` holds.

use super::provenance::Provenance;
use serde::{Deserialize, Serialize};

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
    /// Whether tracking and parameters have settled.
    pub converged: bool,
    /// `converged`, `runs-used-up`, `refused`, `waiting` or `interrupted`.
    pub status: String,
    /// The status in words.
    pub reason: String,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Length of each run, s; of legs one after another, of all of them once.
    pub duration_s: f64,
    /// The runs.
    pub runs: Vec<IterationRun>,
    /// Largest tracking error (mean over the joints) of the first good run over that of the last; none before there are
    /// two.
    pub tracking_improvement: Option<f64>,
    /// Root mean square over the parameters of the last good estimate's error in units of the Cramér-Rao bound; for
    /// simulated robots with torque noise.
    pub error_over_bound: Option<f64>,
    /// The Cramér-Rao bound of every parameter for one run: white torque noise of the simulated sensors at every
    /// recorded sample, exact positions.
    pub bound: Option<Vec<f64>>,
    /// All parameters of the last good physically consistent set: ten for each body, one for each term.
    pub possible_parameters: Option<Vec<f64>>,
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
    /// What it determines.
    pub parameters: Vec<IterationParameter>,
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
