//! What was set aside of a log, and an example of each.

use crate::log::{Quantity, RawBlock};
use serde::{Deserialize, Serialize};

/// Why samples were set aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Reason {
    /// A torque far from those before and behind it: left out of torque and regressor alike.
    Outlier,
    /// A torque that is repeated while its joint moves: left out of torque and regressor alike.
    Held,
    /// A torque that is cut off at an extreme of its channel while its joint moves: left out of torque and regressor
    /// alike.
    Saturated,
    /// A position that no motion makes: replaced by the cubic through its neighbours.
    Spike,
}

impl Reason {
    /// What it is found in.
    pub fn channel(self) -> Quantity {
        match self {
            Self::Outlier | Self::Held | Self::Saturated => Quantity::Torque,
            Self::Spike => Quantity::Position,
        }
    }
}

/// Samples of one channel of one joint that were set aside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SetAside {
    /// What it measures.
    pub channel: Quantity,
    /// The joint.
    pub joint: String,
    /// Why.
    pub reason: Reason,
    /// How many samples.
    pub samples: u64,
    /// In how many places: runs of a held or saturated torque, else as many as samples.
    pub places: u64,
    /// Their share of the rows used, 0 to 1.
    pub share: f64,
    /// 0-based data row in the file of the one that stands off farthest; of a held or saturated torque, of the first.
    pub row: u64,
    /// Its time, in seconds after the first data row of the file.
    pub time_s: f64,
    /// Its value (SI).
    pub value: f64,
    /// What its neighbours suggest (SI).
    pub expected: f64,
}

impl SetAside {
    /// What was found, as a sentence.
    pub(crate) fn sentence(&self) -> String {
        let Self { samples, places, row, time_s, value, expected, .. } = self;
        let share = 100.0 * self.share;
        match self.reason {
            Reason::Outlier => format!(
                "{samples} samples ({share:.2} %) stand far off those before and behind them, e.g. {value:.4} for about \
                 {expected:.4} at {time_s:.3} s (row {row}); they are left out of torque and regressor alike"
            ),
            Reason::Held => format!(
                "is repeated {places} times while the joint moves, {samples} samples ({share:.2} %) in all, e.g. {value:.4} \
                 from {time_s:.3} s (row {row}) on; they are left out of torque and regressor alike"
            ),
            Reason::Saturated => format!(
                "saturated: stands {places} times at an extreme of the channel while the joint moves, {samples} samples \
                 ({share:.2} %) in all, e.g. at {value:.4} from {time_s:.3} s (row {row}) on; they are left out of torque \
                 and regressor alike"
            ),
            Reason::Spike => format!(
                "{samples} samples ({share:.2} %) stand alone, e.g. {value:.6} for about {expected:.6} at {time_s:.3} s \
                 (row {row}); they are replaced by what their neighbours say"
            ),
        }
    }
}

/// Counts what is set aside.
#[derive(Clone, Debug)]
pub(super) struct Tally {
    joints: Vec<String>,
    pub(super) rows: u64,
    found: Vec<(usize, SetAside)>,
}

impl Tally {
    pub(super) fn new(joints: &[String]) -> Self {
        Self { joints: joints.to_vec(), rows: 0, found: Vec::new() }
    }

    /// One sample of `block`: its value and what its neighbours suggest.
    pub(super) fn add(
        &mut self,
        place: (usize, Reason),
        block: &RawBlock,
        index: usize,
        values: [f64; 2],
        samples: u64,
    ) {
        self.add_run(place, block, index, values, (samples, samples));
    }

    /// Some samples, and how many places begin with them.
    pub(super) fn add_run(
        &mut self,
        (joint, reason): (usize, Reason),
        block: &RawBlock,
        index: usize,
        pair: [f64; 2],
        (samples, places): (u64, u64),
    ) {
        let [value, expected] = pair;
        let (row, time_s) = (block.row[index], block.time_s[index]);
        let known = self.found.iter_mut().find(|(of, known)| *of == joint && known.reason == reason);
        let Some((_, known)) = known else {
            let (channel, name) = (reason.channel(), self.joints[joint].clone());
            let first =
                SetAside { channel, joint: name, reason, samples, places, share: 0.0, row, time_s, value, expected };
            self.found.push((joint, first));
            return;
        };
        known.samples += samples;
        known.places += places;
        if (value - expected).abs() > (known.value - known.expected).abs() {
            (known.row, known.time_s, known.value, known.expected) = (row, time_s, value, expected);
        }
    }

    /// All of it, by joint.
    pub(super) fn all(&self) -> Vec<SetAside> {
        let mut all = self.found.clone();
        all.sort_by_key(|(joint, found)| (*joint, found.reason as u8));
        let rows = self.rows.max(1) as f64;
        all.into_iter().map(|(_, found)| SetAside { share: found.samples as f64 / rows, ..found }).collect()
    }
}
