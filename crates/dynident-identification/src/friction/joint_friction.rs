//! Friction of a joint, selected or stated, with the compared candidates.

use super::candidates::FrictionKind;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Serialize};

/// Selection of one joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFriction {
    /// Name of the joint.
    pub joint: String,
    /// Selected friction, or the reason for keeping the stated terms.
    pub chosen: String,
    /// Friction terms of the joint; `None` if nothing was selected.
    pub terms: Option<Vec<TorqueTerm>>,
    /// Constants of these terms, estimated together with all parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constants: Vec<FrictionConstant>,
    /// Number of time blocks of the cross-validation.
    pub folds: usize,
    /// Compared candidates, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
    /// The selection among all laws, if the study restricts them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrestricted: Option<UnrestrictedFriction>,
}

/// What a restriction of the laws costs: the selection without it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UnrestrictedFriction {
    /// Friction that would be selected among all laws.
    pub chosen: String,
    /// Root mean square of the joint's residual on left-out blocks with it, Nm (N).
    pub cv_error_nm: f64,
    /// The same with the friction that was selected among the permitted laws, Nm (N).
    pub restricted_cv_error_nm: f64,
}

impl JointFriction {
    /// Keeps the stated friction for this reason.
    pub fn as_stated(joint: impl Into<String>, reason: &str) -> Self {
        let chosen = format!("as the study states: {reason}");
        Self {
            joint: joint.into(),
            chosen,
            terms: None,
            constants: Vec::new(),
            folds: 0,
            candidates: Vec::new(),
            unrestricted: None,
        }
    }

    pub(crate) fn choose(&mut self, terms: &[TorqueTerm]) {
        let name = name_of(terms);
        if self.terms.as_deref().map(name_of).is_some_and(|before| before != name) {
            if self.candidates.iter().any(|candidate| candidate.term == name) {
                self.candidates.iter_mut().for_each(|candidate| candidate.chosen = candidate.term == name);
            }
            self.chosen = name;
        }
        self.terms = Some(terms.to_vec());
    }
}

/// A constant of a selected friction term.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionConstant {
    /// Term: `coulomb`, `directional-coulomb`, `stribeck`, `sigmoid` or `load`.
    pub term: String,
    /// Constant: `width`, `speed`, `exponent`, `steepness` or `offset_speed`.
    pub constant: String,
    /// Value: widths and velocities in rad/s (m/s), steepness in s/rad (s/m).
    pub value: f64,
    /// 95 % interval from the residual, with a weak prior of a factor of 10 in both directions. It is symmetric on a
    /// logarithmic scale.
    pub interval_95: [f64; 2],
}

impl FrictionConstant {
    /// The narrowest step at rest of `term` within the 95 % interval, rad/s (m/s). `None` if the constant belongs to
    /// another term or does not set the width of the step.
    pub fn narrowest_step(&self, term: &TorqueTerm) -> Option<f64> {
        let widths = self.interval_95.iter().filter_map(|&end| term.kind().step_width_by(&self.constant, end));
        widths.reduce(f64::min).filter(|_| term.kind_name() == self.term)
    }
}

/// One candidate model of a joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionCandidate {
    /// Terms of the model.
    #[serde(rename = "law")]
    pub term: String,
    /// Symbols of the parameters that are not zero.
    pub parameters: Vec<String>,
    /// Number of parameters and tuned constants.
    pub complexity: usize,
    /// Root mean square of the joint's residual on left-out blocks, Nm (N).
    pub cv_error_nm: f64,
    /// Mean square error above the minimum of all candidates, in standard errors of this difference; 0 for the minimum.
    pub excess_standard_errors: f64,
    /// Whether it was selected.
    pub chosen: bool,
}

fn name_of(terms: &[TorqueTerm]) -> String {
    let mut kinds: Vec<FrictionKind> = terms.iter().filter_map(TorqueTerm::candidate).collect();
    kinds.sort_by_key(|kind| kind.rank());
    kinds.dedup();
    let names: Vec<&str> = kinds.into_iter().map(|kind| kind.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(" + ") }
}
