//! Output of `inspect` as JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`Inspection`].
pub const INSPECTION_SCHEMA: &str = "dynident/inspection/1";

/// Output of `inspect` as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Inspection {
    /// [`INSPECTION_SCHEMA`].
    pub schema: String,
    /// Name of the robot.
    pub name: String,
    /// The file.
    pub file: String,
    /// Degrees of freedom.
    pub dof: usize,
    /// Mass of the moving bodies with known inertials, kg.
    pub moving_mass_kg: f64,
    /// Gravity in the base frame, m/s².
    pub gravity_m_s2: [f64; 3],
    /// Joints in the order of all vectors.
    pub joints: Vec<JointSummary>,
    /// Moving bodies; body `i` moves with joint `i`.
    pub bodies: Vec<BodySummary>,
    /// Base parameters of the bodies.
    pub base_parameters: BaseSummary,
    /// Findings about implausible values in the robot description.
    pub audit: Vec<AuditEntry>,
    /// Mistakes in the robot description that explain implausible inertias; `inspect --fix` corrects them.
    #[serde(default)]
    pub slips: Vec<SlipEntry>,
}

/// An error in the inertials of a URDF.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SlipEntry {
    /// `negated-moments`, `negated-products`, `row-major`, `lower-triangle`, `units`, `about-origin`, `defaults`,
    /// `total-mass`, `twins`, or `unexplained` if the numbers have no or several explanations.
    pub slip: String,
    /// Affected links.
    pub links: Vec<String>,
    /// Description and fix.
    pub what: String,
    /// Evidence, with numbers.
    pub evidence: String,
    /// Corrected numbers; empty if they are unknown.
    pub corrections: Vec<CorrectionEntry>,
}

/// Correction of one number of one `<inertial>`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CorrectionEntry {
    /// The link.
    pub link: String,
    /// `mass`, `x`, `y` or `z` of the centre of mass, `ixx`, `ixy`, `ixz`, `iyy`, `iyz` or `izz`.
    pub number: String,
    /// Stated value.
    pub from: f64,
    /// Corrected value.
    pub to: f64,
}

/// One joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointSummary {
    /// Name.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Parent body; null for the base.
    pub parent: Option<String>,
    /// Lower position limit, rad or m.
    pub lower: Option<f64>,
    /// Upper position limit, rad or m.
    pub upper: Option<f64>,
    /// Velocity limit, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Effort limit, Nm or N.
    pub effort: Option<f64>,
    /// The joint that this joint mimics.
    pub mimic: Option<String>,
}

/// One body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodySummary {
    /// Name of its main link.
    pub name: String,
    /// Mass, kg; null if none of its links has an inertial.
    pub mass_kg: Option<f64>,
    /// Centre of mass in the body frame, m.
    pub com_m: Option<[f64; 3]>,
    /// All links merged into it.
    pub links: Vec<String>,
}

/// Base parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BaseSummary {
    /// Number of base parameters.
    pub count: usize,
    /// Expressions, with the shortest factors that convert back to the same number.
    pub expressions: Vec<String>,
    /// Names: the expressions with six digits, without factors that rounded angles cause.
    #[serde(default)]
    pub names: Vec<String>,
    /// Inertial parameters that do not change any torque, so that no motion identifies them.
    pub unidentifiable: Vec<String>,
    /// Rank of the bodies' regressor at random states, from
    /// [`numerical_rank_by_body`](dynident_dynamics::numerical_rank_by_body); it should equal `count`.
    pub numerical_rank: usize,
    /// Margin of the classification of columns: the smallest relative residual of an independent column, and the
    /// largest of a dependent one.
    pub gap: [f64; 2],
}

/// One finding about the robot description.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct AuditEntry {
    /// `info`, `warning` or `problem`.
    pub level: String,
    /// Short name of the check.
    pub check: String,
    /// The link or joint.
    #[serde(rename = "where")]
    pub place: String,
    /// Problem, consequence and fix.
    pub what: String,
}
