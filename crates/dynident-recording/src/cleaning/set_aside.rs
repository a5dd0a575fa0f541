//! Samples that were rejected from a log, with one example of each kind.

use crate::log::{Quantity, RawBlock};
use serde::{Deserialize, Serialize};

/// Reason why samples were rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Reason {
    /// The torque is far from its neighbours. The sample is excluded from torque and regressor.
    Outlier,
    /// The torque is repeated while its joint moves. The sample is excluded from torque and regressor.
    Held,
    /// The torque is clipped at an extreme of its channel while its joint moves. The sample is excluded from torque and
    /// regressor.
    Saturated,
    /// A single position deviates from its neighbours. It is replaced by the cubic through the neighbours.
    Spike,
}

impl Reason {
    /// Channel in which such samples occur.
    pub fn channel(self) -> Quantity {
        match self {
            Self::Outlier | Self::Held | Self::Saturated => Quantity::Torque,
            Self::Spike => Quantity::Position,
        }
    }

    /// Code of the corresponding finding.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Self::Outlier => "import-outliers",
            Self::Held => "import-held-torque",
            Self::Saturated => "import-saturated-torque",
            Self::Spike => "import-spikes",
        }
    }
}

/// Rejected samples of one channel of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RejectedSamples {
    /// Channel.
    pub channel: Quantity,
    /// Joint name.
    pub joint: String,
    /// Reason.
    pub reason: Reason,
    /// Number of samples.
    pub samples: u64,
    /// Number of runs of held or saturated torque; otherwise the number of samples.
    pub places: u64,
    /// Share of the rows that are used, 0 to 1.
    pub share: f64,
    /// Data row in the file (from 0) of the sample that deviates most; for held or saturated torque, of the first
    /// sample.
    pub row: u64,
    /// Time of that row, in seconds after the first data row of the file.
    pub time_s: f64,
    /// Value of that sample (SI).
    pub value: f64,
    /// Value estimated from its neighbours (SI).
    pub expected: f64,
}

impl RejectedSamples {
    pub(crate) fn sentence(&self) -> String {
        let Self { samples, places, row, time_s, value, expected, .. } = self;
        let share = 100.0 * self.share;
        match self.reason {
            Reason::Outlier => format!(
                "{samples} samples ({share:.2} %) differ strongly from their neighbours, e.g. {value:.4} for \
                 about {expected:.4} at {time_s:.3} s (row {row}); they are left out of torque and regressor"
            ),
            Reason::Held => format!(
                "is repeated {places} times while the joint moves, {samples} samples ({share:.2} %) in all, e.g. \
                 {value:.4} from {time_s:.3} s (row {row}) on; they are left out of torque and regressor"
            ),
            Reason::Saturated => format!(
                "saturated: constant at an extreme of the channel {places} times while the joint moves, {samples} \
                 samples ({share:.2} %) in all, e.g. {value:.4} from {time_s:.3} s (row {row}) on; they are left out \
                 of torque and regressor"
            ),
            Reason::Spike => format!(
                "{samples} single samples ({share:.2} %) are spikes, e.g. {value:.6} instead of about {expected:.6} at \
                 {time_s:.3} s (row {row}); they are replaced by interpolation"
            ),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Tally {
    joints: Vec<String>,
    pub(super) rows: u64,
    found: Vec<(usize, RejectedSamples)>,
}

impl Tally {
    pub(super) fn new(joints: &[String]) -> Self {
        Self { joints: joints.to_vec(), rows: 0, found: Vec::new() }
    }

    /// Adds one sample of `block`. `values` are its value and the estimate from its neighbours.
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

    /// Adds `samples` samples in `places` new runs.
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
            let first = RejectedSamples {
                channel,
                joint: name,
                reason,
                samples,
                places,
                share: 0.0,
                row,
                time_s,
                value,
                expected,
            };
            self.found.push((joint, first));
            return;
        };
        known.samples += samples;
        known.places += places;
        if (value - expected).abs() > (known.value - known.expected).abs() {
            (known.row, known.time_s, known.value, known.expected) = (row, time_s, value, expected);
        }
    }

    pub(super) fn all(&self) -> Vec<RejectedSamples> {
        let mut all = self.found.clone();
        all.sort_by_key(|(joint, found)| (*joint, found.reason as u8));
        let rows = self.rows.max(1) as f64;
        all.into_iter().map(|(_, found)| RejectedSamples { share: found.samples as f64 / rows, ..found }).collect()
    }
}
