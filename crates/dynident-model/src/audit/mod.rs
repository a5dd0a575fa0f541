//! Audit of a model's physics: what a description says that no robot can be, or that is likely a slip.
//!
//! The limits below were chosen so that the published descriptions of common arms pass. A finding is advice: the
//! identification itself does not use the prior inertials unless asked to.

mod inertials;
mod joints;
mod slips;

pub use slips::{Correction, Slip, SlipKind, Slips, slips};

use crate::tree::Model;

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AuditLevel {
    /// Good to know.
    Info,
    /// Likely a slip, or something that a later step will need.
    Warning,
    /// Physically inconsistent, or unusable.
    Problem,
}

impl AuditLevel {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditFinding {
    /// How much it matters.
    pub level: AuditLevel,
    /// Which check found it: a short name that does not change.
    pub check: &'static str,
    /// `model`, `link NAME` or `joint NAME`.
    pub place: String,
    /// What it is, why it matters, and the fix.
    pub message: String,
}

/// Audits a model: the inertials of its moving links, its joints' limits, lengths and units. Findings stand in the
/// order of the tree; the first sums the model up.
///
/// Checks (`check` of the findings): `summary`, `mass-not-positive`, `mass-absurd`, `inertia-not-positive`,
/// `triangle-inequality`, `centre-of-mass-outside`, `inertia-too-large`, `inertia-too-small`, `inertia-at-origin`,
/// `placeholder`, `equal-inertials`, `inertial-unknown`, `massless-subtree`, `length-unit`, `limit-missing`,
/// `limit-order`, `limit-range`, `limit-unit`, `velocity-limit`, `effort-limit`, `friction-negative`, `mimic`.
pub fn audit(model: &Model) -> Vec<AuditFinding> {
    let mass: f64 = model.inertials().iter().map(crate::InertialParameters::mass_kg).sum();
    let lengths = Lengths::of(model);
    let mut findings = Findings(Vec::new());
    let summary = format!(
        "{} joints; the bodies that move have {mass:.4} kg in all; joint origins reach {:.3} m from the base",
        model.dof(),
        lengths.reach
    );
    findings.add(AuditLevel::Info, "summary", "model".to_owned(), summary);
    joints::check(model, &lengths, &mut findings);
    inertials::check(model, &lengths, &mut findings);
    findings.0
}

struct Findings(Vec<AuditFinding>);

impl Findings {
    fn add(&mut self, level: AuditLevel, check: &'static str, place: String, message: String) {
        self.0.push(AuditFinding { level, check, place, message });
    }
}

/// Lengths to compare with.
struct Lengths {
    /// Largest sum of joint offsets from the base to a joint, m.
    reach: f64,
    /// Of each body: the largest distance between its frame and a joint or link on it, or its parent joint; at least a
    /// tenth of a metre (a wrist or a finger often has all its joints in one point).
    bodies: Vec<f64>,
}

impl Lengths {
    fn of(model: &Model) -> Self {
        let mut from_base: Vec<f64> = Vec::with_capacity(model.body_count());
        let mut bodies = vec![0.1_f64; model.body_count()];
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
