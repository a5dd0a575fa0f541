//! Audit of a model's physics: impossible values in a robot description, and likely mistakes.
//!
//! The thresholds were chosen so that the published descriptions of common arms pass. A finding is advice: the
//! identification does not use the prior inertials unless the user requests it.

mod inertials;
mod joints;
mod settings;
mod sizes;
mod slips;

pub use settings::AuditSettings;
pub use slips::{Correction, DescriptionError, SlipKind, SlipSettings, Slips, slips, slips_with};

use crate::error::ModelError;
use crate::tree::Model;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AuditLevel {
    /// Information.
    Info,
    /// A likely mistake, or a value that is missing for a later step.
    Warning,
    /// Physically inconsistent, or unusable.
    Problem,
}

impl AuditLevel {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// One finding of the audit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditFinding {
    /// Severity.
    pub level: AuditLevel,
    /// Name of the check; names are the same in all versions.
    pub check: &'static str,
    /// `model`, `link NAME` or `joint NAME`.
    pub place: String,
    /// Problem, reason and fix.
    pub message: String,
}

/// Audits the inertials of a model's moving links, and the limits, lengths and units of its joints. Findings are in
/// the order of the tree; the first finding is a summary of the model.
///
/// Checks (`check` of the findings): `summary`, `mass-not-positive`, `mass-absurd`, `inertia-not-positive`,
/// `triangle-inequality`, `centre-of-mass-outside`, `inertia-too-large`, `inertia-too-small`, `inertia-against-size`,
/// `inertia-at-origin`, `base-fixed`,
/// `placeholder`, `equal-inertials`, `inertial-unknown`, `massless-subtree`, `length-unit`, `limit-missing`,
/// `limit-order`, `limit-range`, `limit-unit`, `velocity-limit`, `effort-limit`, `friction-negative`, `mimic`.
pub fn audit(model: &Model) -> Vec<AuditFinding> {
    findings(model, &AuditSettings::default())
}

/// Like [`audit`], with other thresholds.
///
/// # Errors
/// Invalid settings.
pub fn audit_with(model: &Model, settings: &AuditSettings) -> Result<Vec<AuditFinding>, ModelError> {
    settings.validate()?;
    Ok(findings(model, settings))
}

fn findings(model: &Model, settings: &AuditSettings) -> Vec<AuditFinding> {
    let mass: f64 = model.inertials().iter().map(crate::InertialParameters::mass_kg).sum();
    let lengths = Lengths::of(model);
    let mut findings = Findings(Vec::new());
    let summary = format!(
        "{} joints; the moving bodies have {mass:.4} kg in total; link lengths from the base to the farthest joint add up to {:.3} m",
        model.dof(),
        lengths.reach
    );
    findings.add(AuditLevel::Info, "summary", "model".to_owned(), summary);
    joints::check(model, &lengths, settings, &mut findings);
    inertials::check(model, &lengths, settings, &mut findings);
    sizes::check(model, &lengths, settings, &mut findings);
    findings.0
}

struct Findings(Vec<AuditFinding>);

impl Findings {
    fn add(&mut self, level: AuditLevel, check: &'static str, place: String, message: String) {
        self.0.push(AuditFinding { level, check, place, message });
    }
}

/// Smallest assumed length of a body, m. The joints of a wrist often intersect in one point, so their distance is
/// zero.
const MIN_BODY_LENGTH_M: f64 = 0.1;

struct Lengths {
    /// Largest sum of joint offsets from the base to a joint, m.
    reach: f64,
    /// Size of each body, m: the largest distance between its frame and a joint or link on it, or its parent joint; at
    /// least [`MIN_BODY_LENGTH_M`].
    bodies: Vec<f64>,
}

impl Lengths {
    fn of(model: &Model) -> Self {
        let mut from_base: Vec<f64> = Vec::with_capacity(model.body_count());
        let mut bodies = vec![MIN_BODY_LENGTH_M; model.body_count()];
        for (index, joint) in model.tree_joints().iter().enumerate() {
            let offset = joint.placement.translation.norm();
            from_base.push(offset + joint.parent.map_or(0.0, |parent| from_base[parent]));
            bodies[index] = bodies[index].max(offset);
            if let Some(parent) = joint.parent {
                bodies[parent] = bodies[parent].max(offset);
            }
            for link in &model.bodies()[index].links {
                bodies[index] = bodies[index].max(link.placement.translation.norm());
            }
        }
        Self { reach: from_base.iter().copied().fold(0.0, f64::max), bodies }
    }
}
