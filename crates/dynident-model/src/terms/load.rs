//! Friction that grows with the torque that a joint transmits (its load): `τ = k |τ_load| s(q̇)` with a smoothed or
//! unsmoothed sign function `s`.
//!
//! `τ_load` is the torque that the gear transmits: the rigid-body torque of an earlier estimate. It is passed
//! together with the motion (see [`TermInput`](super::TermInput)); without it the column is zero. Source: Hamon,
//! Gautier and Garrec, IROS 2010, 6187.

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
use super::kind::{StepRole, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFriction};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedFault, StatedJoint, StudyLaw, VALID_VELOCITIES, check, step_or, width_of};
use super::{CoulombShape, FrictionTerm, JointMotion, TermInput, TorqueTerm};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Share of the transmitted torque that a joint loses to friction, dimensionless.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LoadFriction {
    /// The joint.
    pub joint: usize,
    /// The smoothed or unsmoothed sign function.
    pub shape: CoulombShape,
}

impl LoadFriction {
    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let shape = CoulombShape::Smooth { width: own.width };
        vec![GridPoint::alone(TorqueTerm::Load(Self { joint: own.joint, shape }))]
    }
}

impl VelocityLaw for LoadFriction {}

impl Law for LoadFriction {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw::new("load", CandidateRole::Addition, Self::grid)];

    fn torque<S: Real>(&self, _: usize, _: &[S]) -> Result<S, &'static str> {
        Err("the torque that the gear carries")
    }
}

/// The law `load` of a study: friction proportional to the transmitted torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StatedLoad {
    /// Width of the smoothed sign function, rad/s or m/s; by default the sign function of the joint's Coulomb
    /// friction is used.
    #[serde(default)]
    pub width: Option<f64>,
}

impl StudyLaw for StatedLoad {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        vec![TorqueTerm::Load(LoadFriction { joint: own.joint, shape: step_or(self.width, own) })]
    }

    fn check(&self) -> Result<(), StatedFault> {
        self.width.map_or(Ok(()), |width| check("width", width, VALID_VELOCITIES))
    }
}

impl TermKind for LoadFriction {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "load", symbol: format!("fl{}", self.joint + 1), unit: "1" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction { by_load: true, ..VelocityFriction::of(self.shape.curve()) })
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("shape", TermConstant::Step(self.shape))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        let Some(load) = input.load else { return out.fill(0.0) };
        assert_eq!(load.len(), motion.samples, "one load per sample");
        for ((to, &dq), load) in out.iter_mut().zip(motion.dq_of(self.joint)).zip(load) {
            *to = load.abs() * self.shape.step(dq);
        }
    }

    fn stated(&self) -> Option<FrictionTerm> {
        Some(FrictionTerm::Load(StatedLoad { width: width_of(self.shape) }))
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        Some(&mut self.shape)
    }

    fn step_role(&self) -> StepRole {
        StepRole::AsJointIfSmooth
    }
}
