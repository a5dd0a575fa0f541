//! One element of the generalised Maxwell-slip model: a spring in series with a Coulomb slider, `τ = W z/Δ`.
//!
//! The spring's deflection z follows the joint and is limited by the yield displacement Δ: `z ← clamp(z + q_k -
//! q_{k-1}, -Δ, Δ)`. Parallel elements with a grid of `Δ` give friction with hysteresis after reversals, linear in
//! their yield torques `W`. The deflection is the only state of a term between samples ([`HysteresisState`]). A
//! recording starts without deflection; the initial state has no effect after a motion of 2Δ in one direction.
//! Source: Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control 50 (2005) 1883 (without its sliding
//! dynamics); Lampaert, Swevers and Al-Bender (2002).

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedFault, StatedJoint, StudyLaw, check};
use super::{FrictionTerm, JointMotion, TermInput, TorqueTerm};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// One Maxwell-slip element of one joint; the parameter is its yield torque, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MaxwellSlip {
    /// The joint.
    pub joint: usize,
    /// Yield displacement `Δ`, rad or m, positive; part of the parameter's symbol.
    pub yield_displacement: f64,
}

/// State of a term before a block of samples; [`Default`] is the start of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HysteresisState {
    last: Option<[f64; 2]>,
}

impl HysteresisState {
    /// Resets the state: the next sample starts a recording.
    pub fn restart(&mut self) {
        self.last = None;
    }
}

/// Candidate yield displacements, rad, or m of a typical arm.
const CANDIDATE_YIELDS: [f64; 6] = [3.0e-4, 1.0e-3, 3.0e-3, 1.0e-2, 3.0e-2, 1.0e-1];
/// Maximum number of elements of one joint; each element is a regressor column.
const MAX_ELEMENTS: f64 = 50.0;

impl MaxwellSlip {
    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let of = |usual| Self { joint: own.joint, yield_displacement: usual * own.position };
        CANDIDATE_YIELDS.map(|usual| GridPoint::alone(TorqueTerm::MaxwellSlip(of(usual)))).to_vec()
    }
}

impl VelocityLaw for MaxwellSlip {}

impl Law for MaxwellSlip {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw {
        is_near_rest: true,
        ..CandidateLaw::new("maxwell-slip", CandidateRole::Addition, Self::grid)
    }];

    fn torque<S: Real>(&self, _: usize, _: &[S]) -> Result<S, &'static str> {
        Err("the motion before")
    }
}

/// The law `maxwell-slip` of a study: friction with hysteresis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StatedMaxwellSlip {
    /// Yield displacements of the elements, rad or m.
    pub yield_displacements: Vec<f64>,
}

impl StudyLaw for StatedMaxwellSlip {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        let of = |&yield_displacement| TorqueTerm::MaxwellSlip(MaxwellSlip { joint: own.joint, yield_displacement });
        self.yield_displacements.iter().map(of).collect()
    }

    fn check(&self) -> Result<(), StatedFault> {
        let (key, yields) = ("yield_displacements", &self.yield_displacements);
        check("number of yield_displacements", yields.len() as f64, [1.0, MAX_ELEMENTS])?;
        for (place, &value) in yields.iter().enumerate() {
            check(key, value, [1.0e-7, 100.0])?;
            if yields[..place].contains(&value) {
                return Err(StatedFault::Twice { key, value });
            }
        }
        Ok(())
    }

    fn join(&mut self, other: &FrictionTerm) -> bool {
        let FrictionTerm::MaxwellSlip(more) = other else { return false };
        self.yield_displacements.extend(&more.yield_displacements);
        true
    }
}

impl TermKind for MaxwellSlip {
    fn label(&self) -> TermLabel<'_> {
        TermLabel {
            kind: "maxwell-slip",
            symbol: format!("slip{}_{}", self.joint + 1, self.yield_displacement),
            unit: "Nm",
        }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Hysteresis
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("yield_displacement", TermConstant::Number(self.yield_displacement, "rad"))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        let (limit, memory) = (self.yield_displacement, &mut *input.memory);
        for (to, &q) in out.iter_mut().zip(motion.q_of(self.joint)) {
            let [before, deflection] = memory.last.unwrap_or([q, 0.0]);
            let deflection = (deflection + q - before).clamp(-limit, limit);
            memory.last = Some([q, deflection]);
            *to = deflection / limit;
        }
    }

    fn sliding_distance(&self) -> Option<f64> {
        Some(2.0 * self.yield_displacement)
    }

    fn stated(&self) -> Option<FrictionTerm> {
        let yield_displacements = vec![self.yield_displacement];
        Some(FrictionTerm::MaxwellSlip(StatedMaxwellSlip { yield_displacements }))
    }
}
