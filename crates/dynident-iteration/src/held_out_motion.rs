//! A motion that is never fitted, and what a run of it shows.

use crate::evidence::RunEvidence;
use crate::leg::Leg;
use serde::{Deserialize, Serialize};

/// A motion that is never fitted.
#[derive(Clone, Debug)]
pub struct HeldOutMotion {
    /// The motion.
    pub leg: Leg,
    /// It is run after every so many runs, if the run is good; none for the end alone. Whatever stands here, an
    /// iteration has not converged before its newest model has been judged by it.
    pub every: Option<usize>,
}

/// A run of the held-out motion, under the model that the run before it gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HeldOutRun {
    /// Whether it was run to its end.
    pub done: bool,
    /// How it ended, in words.
    pub outcome: String,
    /// Per joint: the largest distance from the reference, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// What its log shows, the prediction by the newest model in it; none where it did not get to its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Why there is none although it got there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl HeldOutRun {
    /// In words, with the joints' names.
    pub fn sentence(&self, joints: &[String]) -> String {
        let tracking = self.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
        let Some(evidence) = &self.evidence else {
            let why = self.reason.as_ref().unwrap_or(&self.outcome);
            return format!("the held-out run tells nothing: {why}");
        };
        let shown = joints.iter().zip(&evidence.joints).filter_map(|(name, shown)| Some((name, shown.prediction?)));
        let worst = shown.min_by(|a, b| a.1.inside.total_cmp(&b.1.inside));
        let Some((name, worst)) = worst else { return "the held-out run has no rows that count".to_owned() };
        format!(
            "of the held-out motion the model holds {:.0} % of the torque or more in its 95 % band (least at {name}, off by {:.3} Nm root mean square, band {:.3}), largest distance from the path {tracking:.2e} rad (m)",
            100.0 * worst.inside,
            worst.rms_error,
            worst.half_width
        )
    }
}
