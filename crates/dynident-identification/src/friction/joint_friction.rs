//! The friction of a joint, as it was chosen or stated, and the candidates that were compared.

use super::candidates::FrictionKind;
use dynident_model::terms::TorqueTerm;
use serde::{Deserialize, Serialize};

/// How the friction of one joint was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFriction {
    /// The joint.
    pub joint: String,
    /// The friction that was chosen, or why the stated terms stay in force.
    pub chosen: String,
    /// The joint's friction; none when nothing was chosen.
    pub terms: Option<Vec<TorqueTerm>>,
    /// The constants of these terms, estimated together with all parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constants: Vec<FrictionConstant>,
    /// Blocks of time that were left out in turn.
    pub folds: usize,
    /// The candidates that were compared, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
}

impl JointFriction {
    /// A joint whose friction stays as it is stated, for this reason.
    pub fn as_stated(joint: impl Into<String>, reason: &str) -> Self {
        let chosen = format!("as the study states: {reason}");
        Self { joint: joint.into(), chosen, terms: None, constants: Vec::new(), folds: 0, candidates: Vec::new() }
    }

    /// The same with these terms in the place of what was chosen before: with other constants, or fewer.
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

/// A constant of a friction term that the recordings chose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionConstant {
    /// The term: `coulomb`, `directional-coulomb`, `stribeck`, `sigmoid` or `load`.
    pub term: String,
    /// The constant: `width`, `speed`, `exponent`, `steepness` or `offset_speed`.
    pub constant: String,
    /// Its value: widths and velocities in rad/s (m/s), steepness in s/rad (s/m).
    pub value: f64,
    /// 95 % interval by the torque that the model leaves, with little known of the constant beforehand: a factor of 10
    /// either way. It is symmetric on a logarithmic scale.
    pub interval_95: [f64; 2],
}

impl FrictionConstant {
    /// The narrowest step at rest of `term` within the 95 % interval, rad/s (m/s). `None` if it is a constant of
    /// another term, or does not set the width of the step.
    pub fn narrowest_step(&self, term: &TorqueTerm) -> Option<f64> {
        let widths = self.interval_95.iter().filter_map(|&end| term.kind().step_width_by(&self.constant, end));
        widths.reduce(f64::min).filter(|_| term.kind_name() == self.term)
    }
}

/// One model of a joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionCandidate {
    /// Its terms.
    #[serde(rename = "law")]
    pub term: String,
    /// Symbols of the parameters that are not zero.
    pub parameters: Vec<String>,
    /// Parameters and tuned constants.
    pub complexity: usize,
    /// Root mean square of the joint's residual on blocks that were left out, Nm (N).
    pub cv_error_nm: f64,
    /// Mean square error above the least of all candidates, in standard errors of this difference; 0 for the least.
    pub excess_standard_errors: f64,
    /// Whether it was chosen.
    pub chosen: bool,
}

/// The kinds of some terms, as candidates are named.
fn name_of(terms: &[TorqueTerm]) -> String {
    let mut kinds: Vec<FrictionKind> = terms.iter().filter_map(TorqueTerm::candidate).collect();
    kinds.sort_by_key(|kind| kind.rank());
    kinds.dedup();
    let names: Vec<&str> = kinds.into_iter().map(|kind| kind.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(" + ") }
}
