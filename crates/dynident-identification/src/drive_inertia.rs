//! Test whether the torque contains the inertia of the drives.
//!
//! Rotor and gear add `I_a q̈` to the torque of their own joint only. Torque measured after the gear does not contain
//! it. Whether the torque is measured at the motors (which turn with their rotors) or after the gears is a property of
//! the robot, not of a joint. Therefore one test covers all drives: the estimated drive inertias I_i are divided by
//! their standard deviations s_i, summed, and divided by the standard deviation of the sum (Stouffer's method, *The
//! American Soldier* 1, 1949, 45):
//!
//! ```text
//! Z = Σ_i z_i / √max(n, Σ_ij R_ij),    z_i = Φ⁻¹(F_ν(I_i / s_i))
//! ```
//!
//! R is the correlation matrix of the n estimates. F_ν is Student's distribution with the ν degrees of freedom of s_i;
//! Φ⁻¹(F_ν) is computed with Wallace's approximation (Ann. Math. Statist. 30 (1959) 1121). If no drive has inertia, Z
//! is standard normal for any number of drives. Rotors can only add inertia, so a negative estimate is evidence against
//! drive inertia. Friction and offsets are separate parameters in every log (`friction_by_log.rs`), because otherwise
//! their variation from day to day would appear as drive inertia.

use crate::error::IdentificationError;
use crate::estimators::EstimationSettings;
use crate::friction_by_log::{is_friction_column, with_friction_by_log};
use crate::left_to_the_logs::{joints_left_to_the_logs, with_drives};
use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use crate::thresholds::DriveInertiaThresholds;
use crate::training::{TrainingPasses, plain_estimate};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::{CovarianceMethod, Estimate, EstimationError};
use dynident_model::terms::{DriveInertia, TorqueTerm};
use dynident_rows::{Logs, RegressorModel};
use serde::{Deserialize, Serialize};

/// Result of the test for drive inertia.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveInertiaChoice {
    /// Names of the tested joints: those whose drive inertia the study does not state.
    pub joints: Vec<String>,
    /// Whether the test is positive, so that the model contains the drive inertia of these joints.
    pub seen: bool,
    /// Test statistic for all drives together, in standard deviations; `None` without a test.
    pub standard_deviations: Option<f64>,
    /// Threshold of the test statistic, in standard deviations.
    pub needed: f64,
    /// Reason why the test was not made; `None` if it was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub untested: Option<String>,
    /// Estimated drive inertia of each joint, except those that cannot be distinguished from the inertia of the links.
    pub drives: Vec<DriveInertiaEstimate>,
}

/// Estimated drive inertia of one joint, from the rows of the test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveInertiaEstimate {
    /// Name of the joint.
    pub joint: String,
    /// Inertia of rotor and gear at the joint, kg m² (kg).
    pub inertia: f64,
    /// Half-width of the 95 % interval of the inertia.
    pub half_width_95: f64,
}

impl DriveInertiaChoice {
    /// Result for joints that were not tested and get no drive inertia, with the reason.
    pub fn untested(joints: Vec<String>, reason: &str) -> Self {
        let untested = Some(reason.to_owned());
        let needed = DriveInertiaThresholds::default().min_std;
        Self { joints, seen: false, standard_deviations: None, needed, untested, drives: Vec::new() }
    }

    /// Result of the test in a sentence.
    pub fn sentence(&self) -> String {
        match (self.standard_deviations, &self.untested) {
            (Some(found), _) if self.seen => {
                let needed = self.needed;
                format!(
                    "detected ({found:.0} standard deviations, {needed:.0} required): the torque is measured at the motors"
                )
            }
            (Some(found), _) => {
                let needed = self.needed;
                format!(
                    "not detected ({found:.1} standard deviations, {needed:.0} required): the model has no drive inertia"
                )
            }
            (None, Some(reason)) => format!("not tested, the model has no drive inertia: {reason}"),
            (None, None) => "not tested, the model has no drive inertia".to_owned(),
        }
    }
}

/// Tests the drive inertia of the joints in `settings.drive_inertia` by least squares on the recordings `training`,
/// with all other terms as the study states them. Returns the robot, with drive inertia if the test is positive. The
/// filters of `logs` are used.
///
/// The choice is `None` if the drive inertia of all named joints is stated.
///
/// # Errors
/// Recordings cannot be read, or payloads and gains contradict each other. If rows do not determine an estimate, the
/// robot is unchanged.
pub fn choose_drive_inertia(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    training: &[usize],
    payloads: &[Payload],
) -> Result<(ParametricModel, Option<DriveInertiaChoice>), IdentificationError> {
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    drives_with_friction(&passes, robot, &robot.clone().into())
}

/// As [`choose_drive_inertia`], with the friction terms of `with_friction`.
pub(crate) fn drives_with_friction(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    with_friction: &RegressorModel,
) -> Result<(ParametricModel, Option<DriveInertiaChoice>), IdentificationError> {
    let settings = passes.settings;
    let tested = joints_left_to_the_logs(robot, settings);
    if tested.is_empty() {
        return Ok((robot.clone(), None));
    }
    let name = |joint: usize| robot.model().joints()[joint].name.clone();
    let names: Vec<String> = tested.iter().map(|&joint| name(joint)).collect();
    let untested = |reason: &str| Ok((robot.clone(), Some(DriveInertiaChoice::untested(names.clone(), reason))));
    let model = RegressorModel::from(with_drives(&with_friction.parametric, &tested)?);
    let apart = separate_columns(&model.parametric, &tested);
    if apart.is_empty() {
        return untested("torque cannot tell it from the inertia of the links");
    }
    if !settings.estimation.held.is_empty() {
        return untested("base parameters are held, and additional terms would change their columns");
    }

    // For any setting of the estimate, the error bars of this test must include the correlation of residuals within a
    // time segment.
    let estimation = EstimationSettings { covariance: CovarianceMethod::Jackknife, ..settings.estimation.clone() };
    let settings = IdentificationSettings { estimation, ..settings.clone() };
    let passes = TrainingPasses { settings: &settings, ..*passes };
    let fit = || -> Result<Estimate, IdentificationError> {
        let rows = passes.with_gains(passes.fit(model)?)?;
        if let Some((estimate, _)) = rows.gains {
            return Ok(estimate);
        }
        // Friction that varies between logs would appear as drive inertia if all logs shared its parameters.
        let is_friction: Vec<bool> = rows.model.layout().columns().iter().map(is_friction_column).collect();
        let apart = with_friction_by_log(&rows.problem, &is_friction)?;
        Ok(plain_estimate(&settings.estimation, apart.as_ref().unwrap_or(&rows.problem))?)
    };
    let fit = match fit() {
        Ok(fit) => fit,
        Err(IdentificationError::Estimation(EstimationError::TooFewRows { .. })) => {
            return untested("there are too few rows");
        }
        Err(error) => return Err(error),
    };
    let excited: Vec<(usize, usize)> = apart.into_iter().filter(|(_, column)| fit.std[*column] > 0.0).collect();
    if excited.is_empty() {
        return untested("the logs move no joint whose torque could show it");
    }
    let columns: Vec<usize> = excited.iter().map(|(_, column)| *column).collect();
    let found = combined_statistic(&fit, &columns);
    let needed = settings.thresholds.drive_inertia.min_std;
    let seen = found >= needed;
    let drives = excited.iter().map(|&(joint, column)| DriveInertiaEstimate {
        joint: name(joint),
        inertia: fit.values[column],
        half_width_95: fit.half_width_95[column],
    });
    let choice = DriveInertiaChoice {
        joints: names.clone(),
        seen,
        standard_deviations: Some(found),
        needed,
        untested: None,
        drives: drives.collect(),
    };
    Ok((if seen { with_drives(robot, &tested)? } else { robot.clone() }, Some(choice)))
}

/// Joints whose drive inertia is a separate base parameter, with its column. At the first axes, drive inertia is only
/// identifiable in a sum with the inertia of the links.
fn separate_columns(robot: &ParametricModel, joints: &[usize]) -> Vec<(usize, usize)> {
    let expressions = robot.base().expressions();
    let own = |joint: usize| {
        let drive = TorqueTerm::DriveInertia(DriveInertia { joint });
        let is_drive = |column: &Column| matches!(column, Column::Term(term) if *term == drive);
        let column = robot.layout().columns().iter().position(is_drive)?;
        (expressions.get(column)? == &drive.symbol()).then_some((joint, column))
    };
    joints.iter().filter_map(|&joint| own(joint)).collect()
}

/// Test statistic for all of these columns together. It is standard normal if all true values are zero.
fn combined_statistic(fit: &Estimate, columns: &[usize]) -> f64 {
    let sum: f64 = columns.iter().map(|&column| normal_deviate(fit, column)).sum();
    let correlation = |a: usize, b: usize| fit.covariance[(a, b)] / (fit.std[a] * fit.std[b]);
    let variance: f64 = columns.iter().flat_map(|&a| columns.iter().map(move |&b| correlation(a, b))).sum();
    sum / variance.max(columns.len() as f64).sqrt()
}

/// Standard normal value with the same probability as the ratio of the estimate to its standard deviation in Student's
/// distribution.
fn normal_deviate(fit: &Estimate, column: usize) -> f64 {
    let t = fit.values[column] / fit.std[column];
    let nu = fit.std_degrees_of_freedom[column].clamp(1.0, 1.0e6);
    let scale = (8.0 * nu + 1.0) / (8.0 * nu + 3.0);
    (scale * (nu * (t * t / nu).ln_1p()).sqrt()).copysign(t)
}
