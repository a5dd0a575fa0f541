//! What a robot description says, and what is wrong with it.

use crate::error::Error;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, numerical_rank};
use dynident_model::{InertialParameters, audit, load_robot};
use serde::Serialize;
use std::path::Path;

/// Name and version of the schema of [`Inspection`].
pub const INSPECTION_SCHEMA: &str = "dynident/inspection/1";

/// What `inspect` prints as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// [`INSPECTION_SCHEMA`].
    pub schema: &'static str,
    /// The machine's name.
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
}

/// One joint.
#[derive(Clone, Debug, Serialize)]
pub struct JointSummary {
    /// Its name.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Body that it stands on; none for the base.
    pub parent: Option<String>,
    /// Lowest position, rad or m.
    pub lower: Option<f64>,
    /// Highest position, rad or m.
    pub upper: Option<f64>,
    /// Highest speed, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Highest torque, Nm or N.
    pub effort: Option<f64>,
    /// The joint that it mimics.
    pub mimic: Option<String>,
}

/// One body.
#[derive(Clone, Debug, Serialize)]
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
#[derive(Clone, Debug, Serialize)]
pub struct BaseSummary {
    /// How many.
    pub count: usize,
    /// What each sums.
    pub expressions: Vec<String>,
    /// Parameters that no motion can tell.
    pub unidentifiable: Vec<String>,
    /// Rank of regressors at random states: the cross-check.
    pub numerical_rank: usize,
    /// Smallest share of a column that counted as independent, largest that counted as dependent.
    pub gap: [f64; 2],
}

/// One finding.
#[derive(Clone, Debug, Serialize)]
pub struct AuditEntry {
    /// `info`, `warning` or `problem`.
    pub level: &'static str,
    /// Short name of the check.
    pub check: &'static str,
    /// Which link or joint.
    #[serde(rename = "where")]
    pub place: String,
    /// What, why it matters, and the mend.
    pub what: String,
}

/// Reads and audits a robot description.
///
/// # Errors
/// If the description cannot be read.
pub fn inspect(path: &Path) -> Result<Inspection, Error> {
    let robot = load_robot(path)?;
    let model = &robot.model;
    let settings = BaseParameterSettings::default();
    let base = BaseParameters::new(model, &[], &settings);
    let (weakest, strongest) = base.gap();
    let joints = model.joints().iter().map(|joint| JointSummary {
        name: joint.name.clone(),
        kind: joint.kind.name(),
        parent: joint.parent.map(|parent| model.bodies()[parent].name().to_owned()),
        lower: joint.limits.lower,
        upper: joint.limits.upper,
        velocity: joint.limits.velocity,
        effort: joint.limits.effort,
        mimic: joint.mimic.as_ref().map(|mimic| mimic.source.clone()),
    });
    let bodies = model.bodies().iter().map(|body| {
        let prior = body.prior();
        BodySummary {
            name: body.name().to_owned(),
            mass_kg: prior.map(|prior| prior.mass_kg()),
            com_m: prior.and_then(|prior| prior.com_m()).map(|com| com.0),
            links: body.links.iter().map(|link| link.name.clone()).collect(),
        }
    });
    let mut entries: Vec<AuditEntry> = audit(model)
        .into_iter()
        .map(|finding| AuditEntry {
            level: finding.level.name(),
            check: finding.check,
            place: finding.place,
            what: finding.message,
        })
        .collect();
    entries.extend(robot.unread.iter().map(|unread| AuditEntry {
        level: "info",
        check: "not-read",
        place: format!("line {}", unread.line),
        what: format!("<{}> under <{}> was not read: misspelt, or given twice", unread.element, unread.parent),
    }));
    Ok(Inspection {
        schema: INSPECTION_SCHEMA,
        name: model.name().to_owned(),
        file: path.display().to_string(),
        dof: model.dof(),
        moving_mass_kg: model.inertials().iter().map(InertialParameters::mass_kg).sum(),
        gravity_m_s2: model.gravity().0,
        joints: joints.collect(),
        bodies: bodies.collect(),
        base_parameters: BaseSummary {
            count: base.count(),
            expressions: base.expressions(),
            unidentifiable: base.unidentifiable().iter().map(|&column| base.all_columns()[column].symbol()).collect(),
            numerical_rank: numerical_rank(model, &[], 1, settings.tolerance).independent.len(),
            gap: [weakest, strongest],
        },
        audit: entries,
    })
}
