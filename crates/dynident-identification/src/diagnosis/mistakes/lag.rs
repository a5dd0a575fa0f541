//! Mistake: a channel that was logged too late or too early.

use super::kind::{Breadth, Facts, MistakeKind, Setup, joint_list};
use super::study_keys::{KeyChange, StudyKeys, at, list, number};
use crate::diagnosis::channels::Channels;

/// The torques of these joints, or the position of one joint, were logged later than the other channels (earlier, if
/// the lag is negative), by more than the lag that a fit compensates. The compared instants depend on the lag
/// (`lag_search`), so lags are not among the candidates of the search, and this correction does not change rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Lag {
    /// The joints.
    pub joints: Vec<usize>,
    /// Torques or positions, never both.
    pub channels: Channels,
    /// Total lag, s; for torques it includes a stated or compensated lag.
    pub lag_s: f64,
}

impl MistakeKind for Lag {
    fn candidates(_: Setup<'_>, _: Breadth<'_>) -> Vec<Self> {
        Vec::new()
    }

    fn facts(&self) -> Facts {
        Facts { rarity: 0.15, joints: Some(self.joints.clone()), ..Facts::of("lag") }
    }

    fn sentence(&self, names: &[String]) -> String {
        format!(
            "{} of {} is logged {:.3} s {} than {}: there are two clocks, or a buffer",
            self.channels.text(),
            joint_list(&self.joints, names),
            self.lag_s.abs(),
            if self.lag_s > 0.0 { "later" } else { "earlier" },
            if self.channels == Channels::Torque { "the motion" } else { "all other channels" }
        )
    }

    /// Key that corrects the lag; it exists only for torques and applies to all logs.
    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        if self.channels != Channels::Torque || !keys.is_common() {
            return Vec::new();
        }
        let dof = keys.places.len();
        let stated = keys.torque_lag_s.as_ref();
        let lag = |joint: usize| if self.joints.contains(&joint) { self.lag_s } else { at(stated, joint, 0.0) };
        let value = if self.joints.len() == dof {
            number(self.lag_s, 3)
        } else {
            list((0..dof).map(|joint| number(lag(joint), 3)))
        };
        vec![KeyChange { table: "motion".to_owned(), line: format!("torque_lag_s = {value}") }]
    }
}
