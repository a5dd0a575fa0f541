//! Output of `compare` as JSON.

use dynident_identification::changes::RestoredBody;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ComparisonFile`].
pub const COMPARISON_SCHEMA: &str = "dynident/comparison/1";

/// Results of one type of robot side by side, with the changes between them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparisonFile {
    /// [`COMPARISON_SCHEMA`].
    pub schema: String,
    /// The results in the order of the command line; all lists of values have this order.
    pub results: Vec<ComparedResult>,
    /// Base parameters that all results contain and excite.
    pub parameters: Vec<ComparedParameter>,
    /// Parameters that are not compared, with the reason.
    pub not_compared: Vec<String>,
    /// Mass of each body.
    pub bodies: Vec<ComparedBody>,
    /// Friction law of each joint.
    pub friction: Vec<ComparedFriction>,
    /// Changes of each later result from the first one. For a single result: its changes from the robot description.
    pub changes: Vec<ChangesFrom>,
    /// Limits of the comparison.
    pub notes: Vec<String>,
}

/// A compared result.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparedResult {
    /// The file as given.
    pub file: String,
    /// Name of the result.
    pub name: String,
    /// Name of the robot.
    pub robot: String,
    /// Held-out logs with the error of the exported model, percent; null if the torque is zero.
    pub held_out: Vec<(String, Option<f64>)>,
}

/// A base parameter of all results.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparedParameter {
    /// Symbol of the regressor column.
    pub symbol: String,
    /// Expression of the base parameter as a sum of inertial and friction parameters.
    pub expression: String,
    /// Unit at a revolute joint.
    pub unit: String,
    /// Estimate of each result.
    pub values: Vec<f64>,
    /// Half-width of the 95 % interval of each estimate.
    pub half_widths_95: Vec<f64>,
    /// Largest difference of an estimate from that of the first result, divided by the standard deviation of the
    /// difference; 0 for a single result.
    pub largest_z: f64,
}

/// A body of all results.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparedBody {
    /// Name of its main link.
    pub name: String,
    /// Mass in each result, kg.
    pub mass_kg: Vec<f64>,
    /// Half-width of the 95 % interval of each mass, kg; assumes 30 % uncertainty of the masses in the robot
    /// description. Null if not known.
    pub half_width_95_kg: Vec<Option<f64>>,
}

/// Friction laws of a joint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparedFriction {
    /// The joint.
    pub joint: String,
    /// The selected law of each result.
    pub laws: Vec<String>,
}

/// Changes between a result and the first one (or the robot description).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChangesFrom {
    /// Index of the result.
    pub result: usize,
    /// Index of the result that it is compared with; null for the robot description.
    pub from: Option<usize>,
    /// Test statistic `dᵀ C⁻¹ d` of all compared parameters: `d` is the difference of the two results, `C` the sum of
    /// their covariances.
    pub chi_squared: f64,
    /// Number of compared parameters.
    pub degrees_of_freedom: usize,
    /// Probability of a larger test statistic if nothing changed.
    pub p_value: f64,
    /// Explanations, the most probable first; those below 1 % are omitted.
    pub explanations: Vec<ChangeExplanation>,
}

/// A set of parts that changed together.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChangeExplanation {
    /// The parts that changed; empty if nothing changed.
    pub parts: Vec<ChangedPart>,
    /// Whether every part of the robot changed; `parts` is then empty.
    #[serde(default)]
    pub everything: bool,
    /// Probability of this explanation among the compared explanations.
    pub probability: f64,
    /// Test statistic `dᵀ C⁻¹ d` after this change is taken into account, divided by the number of parameters; about 1
    /// if the explanation is complete.
    pub remaining: f64,
}

/// Differences of an identified robot from its description.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DescriptionComparison {
    /// Explanations, the most probable first; those below 1 % are omitted.
    pub explanations: Vec<ChangeExplanation>,
    /// For every body, the probability that it differs from the description, and the torque error if the body gets the
    /// values of the description again.
    pub bodies: Vec<RestoredBody>,
    /// Whether the exported model follows the most probable explanation. In that case, bodies that the explanation does
    /// not name keep the values of the description.
    pub is_followed: bool,
}

/// A part of the robot.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChangedPart {
    /// Name of the body or joint in a sentence.
    pub part: String,
    /// Change of the body's mass, kg; null for a joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Half-width of the 95 % interval of `mass_kg`, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_width_95_kg: Option<f64>,
    /// Centre of the added or removed mass in the body frame, m; null if the change of mass is not significant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_m: Option<[f64; 3]>,
}
