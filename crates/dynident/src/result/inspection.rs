//! What `inspect` prints: the schema of its JSON.

use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`Inspection`].
pub const INSPECTION_SCHEMA: &str = "dynident/inspection/1";

/// What `inspect` prints as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Inspection {
    /// [`INSPECTION_SCHEMA`].
    pub schema: String,
    /// The robot's name.
    pub name: String,
    /// The file.
    pub file: String,
    /// Degrees of freedom.
    pub dof: usize,
    /// Mass of the moving bodies with known inertials.
    pub moving_mass_kg: f64,
    /// Gravity in the base frame.
    pub gravity_m_s2: [f64; 3],
    /// Joints in the order of all vectors.
    pub joints: Vec<JointSummary>,
    /// Moving bodies; body `i` moves with joint `i`.
    pub bodies: Vec<BodySummary>,
    /// Base parameters of the bodies.
    pub base_parameters: BaseSummary,
    /// Findings of the audit.
    pub audit: Vec<AuditEntry>,
    /// Slips that explain what is wrong with the inertials; `inspect --fix` makes their corrections.
    #[serde(default)]
    pub slips: Vec<SlipEntry>,
}

/// One slip in the inertials of a URDF.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SlipEntry {
    /// `negated-moments`, `negated-products`, `row-major`, `lower-triangle`, `units`, `about-origin`, `defaults`,
    /// `total-mass`, `twins`, or `unexplained` where none or several of them would explain the numbers.
    pub slip: String,
    /// The links it concerns.
    pub links: Vec<String>,
    /// What it is, and what to do.
    pub what: String,
    /// Why it is believed, in numbers.
    pub evidence: String,
    /// The numbers that were meant; empty where they cannot be known.
    pub corrections: Vec<CorrectionEntry>,
}

/// One number of one `<inertial>`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CorrectionEntry {
    /// The link.
    pub link: String,
    /// `mass`, `x`, `y` or `z` of the centre of mass, `ixx`, `ixy`, `ixz`, `iyy`, `iyz` or `izz`.
    pub number: String,
    /// As it stands.
    pub from: f64,
    /// As it was meant.
    pub to: f64,
}

/// One joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointSummary {
    /// Its name.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Body that it stands on; none for the base.
    pub parent: Option<String>,
    /// Lowest position, rad or m.
    pub lower: Option<f64>,
    /// Highest position, rad or m.
    pub upper: Option<f64>,
    /// Highest velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Highest torque, Nm or N.
    pub effort: Option<f64>,
    /// The joint that it mimics.
    pub mimic: Option<String>,
}

/// One body.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodySummary {
    /// Name of its own link.
    pub name: String,
    /// Mass; none when no link of it has an inertial.
    pub mass_kg: Option<f64>,
    /// Centre of mass in the body frame.
    pub com_m: Option<[f64; 3]>,
    /// All links lumped into it.
    pub links: Vec<String>,
}

/// Base parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BaseSummary {
    /// How many.
    pub count: usize,
    /// What each sums, every factor in the shortest form that reads back to the same number.
    pub expressions: Vec<String>,
    /// Parameters that no motion can determine.
    pub unidentifiable: Vec<String>,
    /// Rank of the bodies' regressor at random states, by
    /// [`numerical_rank_by_body`](dynident_dynamics::numerical_rank_by_body): the cross-check.
    pub numerical_rank: usize,
    /// Smallest share of a column that counted as independent, largest that counted as dependent.
    pub gap: [f64; 2],
}

/// One finding.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct AuditEntry {
    /// `info`, `warning` or `problem`.
    pub level: String,
    /// Short name of the check.
    pub check: String,
    /// Which link or joint.
    #[serde(rename = "where")]
    pub place: String,
    /// What, why it matters, and the fix.
    pub what: String,
}
