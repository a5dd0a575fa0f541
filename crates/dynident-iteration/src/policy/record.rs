use crate::estimation::estimate::RunEstimate;
use crate::estimation::forecast::MotionForecast;
use crate::estimation::run_motion::RunMotion;
use crate::evidence::held_out_motion::HeldOutRun;
use crate::evidence::run_evidence::RunEvidence;
use crate::setup::model_parameters::ModelParameters;
use crate::setup::rehearsal::Rehearsal;
use crate::setup::warm_up::WarmUp;
use crate::torque_check::{TorqueCause, TorqueCheck};
use dynident_dynamics::ParametricModel;
use serde::{Deserialize, Serialize};

/// Controller of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UsedController {
    /// Name of the controller.
    pub name: String,
    /// Model in the controller; `None` for controllers without a model.
    pub model: Option<ModelParameters>,
    /// Share of the change from the last good parameters to the new parameters.
    pub damping: f64,
    /// Factor on the gains of a controller without a model.
    pub stiffness: f64,
}

/// Record of a run, as it is stored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunRecord {
    /// Number of the run, from 1.
    pub run: usize,
    /// Trajectories of the run, if they differ from those of the task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<RunMotion>,
    /// Forecast for the motion of the run; `None` without planned motions or before the first estimate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forecast: Option<MotionForecast>,
    /// Controller of the run.
    pub controller: UsedController,
    /// Whether every trajectory was completed.
    pub done: bool,
    /// Description of how the run ended.
    pub outcome: String,
    /// Largest distance of each joint from the reference, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Whether the run is good and its data are used.
    pub accepted: bool,
    /// Why the run was rejected, or why there is no estimate.
    pub reason: Option<String>,
    /// Result of the rehearsal (simulation before the run), if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rehearsal: Option<Rehearsal>,
    /// Result of the warm-up before the run, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warm_up: Option<WarmUp>,
    /// Estimate from this run alone, if any.
    pub estimate: Option<RunEstimate>,
    /// Estimate from all good runs up to this one together. `None` for the first run, for rejected runs, and if runs
    /// are not fitted together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pooled: Option<RunEstimate>,
    /// Evidence in the log; `None` if the run was not completed, and in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Comparison of the logged with the commanded torque; `None` if too little was recorded, and in runs of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_check: Option<TorqueCheck>,
    /// The run of the held-out motion after this run; it is stored in a separate folder.
    #[serde(skip)]
    pub held_out: Option<HeldOutRun>,
}

impl RunRecord {
    /// Checks that the lengths of all arrays agree with `robot` (with the selected friction), because a file from
    /// outside can contain anything.
    pub(crate) fn check(&self, robot: &ParametricModel) -> Result<(), String> {
        let (joints, columns) = (robot.dof(), robot.layout().columns().len());
        let all = robot.model().inertial_count() + robot.terms().len();
        let length = |what: &str, found: usize, expected: usize| {
            if found == expected {
                return Ok(());
            }
            Err(format!(
                "has {found} numbers in {what}, this robot needs {expected}: remove its folder and those of the runs after it"
            ))
        };
        length("max_tracking_error_rad", self.max_tracking_error_rad.len(), joints)?;
        match &self.controller.model {
            Some(ModelParameters::All(values)) => length("controller.model", values.len(), all)?,
            Some(ModelParameters::Base(values)) => length("controller.model", values.len(), columns)?,
            None => {}
        }
        if let Some(evidence) = &self.evidence {
            length("evidence.joints", evidence.joints.len(), joints)?;
        }
        if let Some(held_out) = &self.held_out {
            length("max_tracking_error_rad", held_out.max_tracking_error_rad.len(), joints)?;
            if let Some(evidence) = &held_out.evidence {
                length("evidence.joints", evidence.joints.len(), joints)?;
            }
        }
        for (name, estimate) in [("estimate", &self.estimate), ("pooled", &self.pooled)] {
            let Some(estimate) = estimate else { continue };
            length(&format!("{name}.values"), estimate.values.len(), columns)?;
            length(&format!("{name}.std"), estimate.std.len(), columns)?;
            length(&format!("{name}.covariance"), estimate.covariance.len(), columns)?;
            for row in &estimate.covariance {
                length(&format!("a row of {name}.covariance"), row.len(), columns)?;
            }
            length(&format!("{name}.joint_sigma"), estimate.joint_sigma.len(), joints)?;
            if let Some(possible) = &estimate.possible {
                length(&format!("{name}.possible"), possible.len(), all)?;
            }
            if let Some(column) = estimate.fixed.iter().find(|&&column| column >= columns) {
                return Err(format!(
                    "lists base parameter {column} as fixed, this robot has {columns}: remove its folder"
                ));
            }
            if !estimate.near_rest.is_empty() {
                length(&format!("{name}.near_rest"), estimate.near_rest.len(), joints)?;
            }
            if !estimate.torque_lags.is_empty() {
                length(&format!("{name}.torque_lags"), estimate.torque_lags.len(), joints)?;
            }
        }
        Ok(())
    }

    /// Reasons why the logged torque differs from the commanded torque; empty if it agrees or was not checked.
    pub fn torque_causes(&self) -> &[TorqueCause] {
        self.torque_check.as_ref().map_or(&[], |check| &check.causes)
    }

    /// Whether a joint's logged torque is known to be the commanded torque.
    pub(crate) fn has_commanded_torque(&self, joint: usize) -> bool {
        let Some(check) = &self.torque_check else { return false };
        check.causes.is_empty() && check.joints.get(joint).is_some_and(|own| own.difference_percent.is_some())
    }

    /// Returns the newest estimate: from all good runs, otherwise from this run alone.
    pub fn knowledge(&self) -> Option<&RunEstimate> {
        self.pooled.as_ref().or(self.estimate.as_ref())
    }

    /// Mean over the joints of the largest tracking error, rad (m).
    pub fn tracking_error(&self) -> f64 {
        let errors = &self.max_tracking_error_rad;
        errors.iter().sum::<f64>() / errors.len().max(1) as f64
    }
}
