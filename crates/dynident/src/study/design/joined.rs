//! `family = { kind = "joined", .. }`: families one after another within the duration.

use super::FamilyChoice;
use dynident_excitation::families::{FamilyError, JoinedFamily, JoinedSettings};
use serde::{Deserialize, Serialize};

const NAME: &str = "joined";

/// Parts one after another with a move between each two: for instance a series, then a friction ladder, then static
/// postures.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JoinedChoice {
    /// The parts in their order, each with its own `kind` and settings; none of them joined itself.
    pub parts: Vec<FamilyChoice>,
    /// How the parts share what the moves leave of the duration; equally by default.
    #[serde(default)]
    pub shares: Option<Vec<f64>>,
    /// Seconds of each move; 2 by default.
    #[serde(default = "move_s")]
    pub move_s: f64,
    /// Posture from which the experiment starts at rest, rad (m); by default it starts with the first part.
    #[serde(default)]
    pub start: Option<Vec<f64>>,
    /// Posture at which it ends at rest; by default it ends with the last part.
    #[serde(default)]
    pub end: Option<Vec<f64>>,
}

fn move_s() -> f64 {
    JoinedSettings::default().move_s
}

impl JoinedChoice {
    /// The family, for so many joints and so many seconds in all.
    ///
    /// # Errors
    /// If a setting of it or of a part has no meaning, or the moves leave no time.
    pub fn family(&self, joints: usize, duration_s: f64) -> Result<JoinedFamily, FamilyError> {
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
            return Err(setting("parts", part as f64, "this part is joined itself: list its parts in its place"));
        }
        let moves = count.saturating_sub(1) + usize::from(self.start.is_some()) + usize::from(self.end.is_some());
        let left_s = duration_s - moves as f64 * self.move_s;
        // False for NaN; that a move has a sensible length is for the family to say.
        if !(left_s > 0.0 || self.move_s.is_nan()) {
            return Err(setting(
                "move_s",
                self.move_s,
                "the moves take the whole duration_s: shorten them, or lengthen the motion",
            ));
        }
        let all: f64 = shares.iter().sum();
        let members = self.parts.iter().zip(&shares).map(|(part, share)| part.family(joints, left_s * share / all));
        let settings = JoinedSettings { move_s: self.move_s, start: self.start.clone(), end: self.end.clone() };
        JoinedFamily::new(members.collect::<Result<_, _>>()?, &settings)
    }
}
