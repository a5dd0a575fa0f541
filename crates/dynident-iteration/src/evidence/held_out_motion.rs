use crate::evidence::run_evidence::RunEvidence;
use crate::setup::leg::Leg;
use serde::{Deserialize, Serialize};

/// A motion that is never used for a fit, only for validation.
#[derive(Clone, Debug)]
pub struct HeldOutMotion {
    /// The motion.
    pub leg: Leg,
    /// The motion runs after every N good runs; `None`: only at the end. In any case, an iteration converges only
    /// after its newest model was validated on this motion.
    pub every: Option<usize>,
}

/// A run of the held-out motion with the model of the previous run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HeldOutRun {
    /// Whether the run was completed.
    pub done: bool,
    /// Description of how the run ended.
    pub outcome: String,
    /// Largest distance of each joint from the reference, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Evidence in the log of the run, including the prediction by the newest model; `None` if the run was not
    /// completed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Why a completed run has no evidence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl HeldOutRun {
    /// Returns a summary, with the names of the joints.
    pub fn sentence(&self, joints: &[String]) -> String {
        let tracking = self.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
        let Some(evidence) = &self.evidence else {
            let why = self.reason.as_ref().unwrap_or(&self.outcome);
            return format!("the held-out run is unusable: {why}");
        };
        let shown = joints.iter().zip(&evidence.joints).filter_map(|(name, shown)| Some((name, shown.prediction?)));
        let worst = shown.min_by(|a, b| a.1.inside.total_cmp(&b.1.inside));
        let Some((name, worst)) = worst else { return "the held-out run has no usable rows".to_owned() };
        format!(
            "of the held-out motion the model holds {:.0} % of the torque or more in its 95 % band (least at {name}, off by {:.3} Nm root mean square, band {:.3}), largest distance from the path {tracking:.2e} rad (m)",
            100.0 * worst.inside,
            worst.rms_error,
            worst.half_width
        )
    }
}
