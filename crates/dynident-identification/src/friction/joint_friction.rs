//! Friction of a joint, selected or stated, with the compared candidates.

use super::candidates::FrictionKind;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Serialize};

/// Result of the selection of one joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFriction {
    /// Name of the joint.
    pub joint: String,
    /// Selected friction, or the reason why the stated terms are kept.
    pub chosen: String,
    /// Friction terms of the joint; `None` if nothing was selected.
    pub terms: Option<Vec<TorqueTerm>>,
    /// Nonlinear constants of these terms, estimated together with all parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constants: Vec<FrictionConstant>,
    /// Number of time blocks of the cross-validation.
    pub folds: usize,
    /// Compared candidates, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
    /// Friction that would be selected among all laws, if the study restricts the laws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrestricted: Option<UnrestrictedFriction>,
}

/// Loss of accuracy because the study restricts the friction laws: the selection without the restriction, for
/// comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UnrestrictedFriction {
    /// Friction that would be selected among all laws.
    pub chosen: String,
    /// Root mean square residual of the joint with this friction on left-out time blocks, Nm (N).
    pub cv_error_nm: f64,
    /// Root mean square residual of the joint with the friction that was selected among the permitted laws, on left-out
    /// time blocks, Nm (N).
    pub restricted_cv_error_nm: f64,
}

impl JointFriction {
    /// Result for a joint that keeps its stated friction, with the reason.
    pub fn as_stated(joint: impl Into<String>, reason: &str) -> Self {
        let chosen = format!("as stated or by default: {reason}");
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

/// A nonlinear constant of a selected friction term.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionConstant {
    /// Name of the term: `coulomb`, `directional-coulomb`, `stribeck`, `sigmoid` or `load`.
    pub term: String,
    /// Name of the constant: `width`, `speed`, `exponent`, `steepness` or `offset_speed`.
    pub constant: String,
    /// Value: widths and velocities in rad/s (m/s), steepness in s/rad (s/m).
    pub value: f64,
    /// The 95 % interval, from the residuals and a weak prior that spans a factor of 10 in both directions. It is
    /// symmetric on a logarithmic scale.
    pub interval_95: [f64; 2],
}

impl FrictionConstant {
    /// Width of the narrowest smoothed sign of `term` within the 95 % interval, rad/s (m/s). `None` if the constant
    /// belongs to another term or does not determine the width.
    pub fn narrowest_step(&self, term: &TorqueTerm) -> Option<f64> {
        let widths = self.interval_95.iter().filter_map(|&end| term.kind().step_width_by(&self.constant, end));
        widths.reduce(f64::min).filter(|_| term.kind_name() == self.term)
    }
}

/// One candidate model for a joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionCandidate {
    /// Friction terms of the candidate.
    #[serde(rename = "law")]
    pub term: String,
    /// Symbols of the parameters that are not zero.
    pub parameters: Vec<String>,
    /// Number of parameters and of tuned constants.
    pub complexity: usize,
    /// Root mean square residual of the joint on left-out time blocks, Nm (N).
    pub cv_error_nm: f64,
    /// Mean square error minus the minimum over all candidates, in standard errors of this difference; 0 for the
    /// candidate with the minimum.
    pub excess_standard_errors: f64,
    /// Whether the candidate was selected.
    pub chosen: bool,
}

fn name_of(terms: &[TorqueTerm]) -> String {
    let mut kinds: Vec<FrictionKind> = terms.iter().filter_map(TorqueTerm::candidate).collect();
    kinds.sort_by_key(|kind| kind.rank());
    kinds.dedup();
    let names: Vec<&str> = kinds.into_iter().map(|kind| kind.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(" + ") }
}
