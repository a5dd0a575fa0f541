//! What is kept of a run.

use crate::estimate::RunEstimate;
use crate::evidence::RunEvidence;
use crate::forecast::MotionForecast;
use crate::held_out_motion::HeldOutRun;
use crate::model_parameters::ModelParameters;
use crate::rehearsal::Rehearsal;
use crate::run_motion::RunMotion;
use crate::torque_check::{TorqueCause, TorqueCheck};
use crate::warm_up::WarmUp;
use dynident_dynamics::ParametricModel;
use serde::{Deserialize, Serialize};

/// What controlled a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UsedController {
    /// The controller's name.
    pub name: String,
    /// Its model; none for controllers without.
    pub model: Option<ModelParameters>,
    /// Share of the step from the last good parameters to the new ones that was taken.
    pub damping: f64,
    /// Factor of the gains of a controller without a model.
    pub stiffness: f64,
}

/// A run, as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunRecord {
    /// Its number, from 1.
    pub run: usize,
    /// Its trajectories, where they are not those of the task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<RunMotion>,
    /// What its motion was expected to bring; none where motions are not planned, and where nothing was known before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forecast: Option<MotionForecast>,
    /// What controlled it.
    pub controller: UsedController,
    /// Whether every trajectory was run to its end.
    pub done: bool,
    /// How it ended, in words.
    pub outcome: String,
    /// Per joint: the largest distance from the reference, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// Whether it counts as good.
    pub accepted: bool,
    /// Why not, or why there is no estimate.
    pub reason: Option<String>,
    /// What its rehearsal had shown; none where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rehearsal: Option<Rehearsal>,
    /// What the warm-up before it has shown; none where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warm_up: Option<WarmUp>,
    /// What it says about the parameters by itself; none if it determines nothing.
    pub estimate: Option<RunEstimate>,
    /// What all good runs up to this one say together; none where this is the first or no good one, and where runs are
    /// not pooled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pooled: Option<RunEstimate>,
    /// What its log shows beside parameters; none where it did not get to its end, and in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<RunEvidence>,
    /// Whether its logged torque is the torque that the controller commanded; none where too little was recorded, and
    /// in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_check: Option<TorqueCheck>,
    /// The run of the held-out motion that came after it; kept in a folder of its own.
    #[serde(skip)]
    pub held_out: Option<HeldOutRun>,
}

impl RunRecord {
    /// That its numbers are those of `robot`, the robot with the friction in force: a file from outside may hold
    /// anything.
    pub(crate) fn check(&self, robot: &ParametricModel) -> Result<(), String> {
        let (joints, columns) = (robot.dof(), robot.layout().columns().len());
        let all = robot.model().inertial_count() + robot.terms().len();
        let length = |what: &str, found: usize, expected: usize| {
            if found == expected {
                return Ok(());
            }
            Err(format!(
                "holds {found} numbers as {what} where this robot has {expected}: remove its folder and those of the runs after it"
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
                    "names base parameter {column} as fixed where this robot has {columns}: remove its folder"
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

    /// Why its logged torque is not the commanded one; empty if it is, or where it was not checked.
    pub fn torque_causes(&self) -> &[TorqueCause] {
        self.torque_check.as_ref().map_or(&[], |check| &check.causes)
    }

    /// Whether a joint's logged torque is known to be the torque that was commanded.
    pub(crate) fn has_commanded_torque(&self, joint: usize) -> bool {
        let Some(check) = &self.torque_check else { return false };
        check.causes.is_empty() && check.joints.get(joint).is_some_and(|own| own.difference_percent.is_some())
    }

    /// What is known after it: what all good runs say together, or else what it says alone.
    pub fn knowledge(&self) -> Option<&RunEstimate> {
        self.pooled.as_ref().or(self.estimate.as_ref())
    }

    /// Mean over the joints of the largest tracking error, rad (m).
    pub fn tracking_error(&self) -> f64 {
        let errors = &self.max_tracking_error_rad;
        errors.iter().sum::<f64>() / errors.len().max(1) as f64
    }
}
