//! `family = { kind = "joined", .. }`: several families in sequence within the duration.

use super::FamilyChoice;
use dynident_excitation::families::{FamilyError, FamilySequence, JoinedSettings};
use serde::{Deserialize, Serialize};

const NAME: &str = "joined";

/// Parts in sequence with a transition between consecutive parts, for example a Fourier series, then a friction ladder,
/// then static postures.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JoinedChoice {
    /// The parts in order, each with its own `kind` and settings; a part cannot be `joined`.
    pub parts: Vec<FamilyChoice>,
    /// Relative durations of the parts, after subtraction of the transitions from the total duration; equal by
    /// default.
    #[serde(default)]
    pub shares: Option<Vec<f64>>,
    /// Duration of each transition, s; 2 by default.
    #[serde(default = "move_s")]
    pub move_s: f64,
    /// Posture at rest at which the experiment starts, rad (m); by default the start of the first part.
    #[serde(default)]
    pub start: Option<Vec<f64>>,
    /// Posture at rest at which the experiment ends, rad (m); by default the end of the last part.
    #[serde(default)]
    pub end: Option<Vec<f64>>,
}

fn move_s() -> f64 {
    JoinedSettings::default().move_s
}

impl JoinedChoice {
    /// Builds the family for `joints` joints and a total duration of `duration_s`.
    ///
    /// # Errors
    /// If a setting is invalid, or the transitions leave no time for the parts.
    pub fn family(&self, joints: usize, duration_s: f64) -> Result<FamilySequence, FamilyError> {
        let setting = |setting, value, fix| FamilyError::Setting { family: NAME, setting, value, fix };
        let count = self.parts.len();
        let shares = self.shares.clone().unwrap_or_else(|| vec![1.0; count]);
        if shares.len() != count {
            return Err(FamilyError::Length { family: NAME, what: "shares", expected: count, found: shares.len() });
        }
        if let Some(share) = shares.iter().find(|share| !(1e-6..=1e6).contains(*share)) {
            return Err(setting("shares", *share, "give 1e-6 to 1e6, one for each part"));
        }
        if let Some(part) = self.parts.iter().position(|part| matches!(part, FamilyChoice::Joined(_))) {
            return Err(setting("parts", part as f64, "this part is `joined`: list its parts here instead"));
        }
        let moves = count.saturating_sub(1) + usize::from(self.start.is_some()) + usize::from(self.end.is_some());
        let left_s = duration_s - moves as f64 * self.move_s;
        // False for NaN; the family checks the range of `move_s`.
        if !(left_s > 0.0 || self.move_s.is_nan()) {
            return Err(setting(
                "move_s",
                self.move_s,
                "the transitions take the whole duration_s: give a shorter move_s, or a longer duration_s",
            ));
        }
        let all: f64 = shares.iter().sum();
        let members = self.parts.iter().zip(&shares).map(|(part, share)| part.family(joints, left_s * share / all));
        let settings = JoinedSettings { move_s: self.move_s, start: self.start.clone(), end: self.end.clone() };
        FamilySequence::new(members.collect::<Result<_, _>>()?, &settings)
    }
}
