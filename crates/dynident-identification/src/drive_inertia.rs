//! Whether the torque is that of motors, which turn with their rotors, or that of sensors behind them.
//!
//! Rotor and gear add `I_a q̈` to the torque of their own joint and nothing to that of any other; what is measured
//! behind the gear does not hold it. Which of the two a recording holds is one property of a robot and not of a joint,
//! so there is one test for all drives: each joint's drive inertia in units of its standard deviation, summed and
//! divided by the deviation of the sum (Stouffer's method, *The American Soldier* 1, 1949, 45),
//!
//! ```text
//! Z = Σ_i z_i / √max(n, Σ_ij R_ij),    z_i = Φ⁻¹(F_ν(I_i / s_i))
//! ```
//!
//! with R the correlations of the n estimates: standard normal where no drive has inertia, whatever their number.
//! Friction and offsets are free in every log (`friction_by_log.rs`): one friction for all days leaves what differs
//! from day to day to the drives. Rotors only add, so a negative one speaks against the others. F is Student's
//! distribution with the ν degrees of freedom of s_i, and Φ⁻¹ F in Wallace's form (Ann. Math. Statist. 30 (1959) 1121).

use crate::error::IdentificationError;
use crate::estimators::EstimationSettings;
use crate::friction_by_log::{is_friction_column, with_friction_by_log};
use crate::left_to_the_logs::{joints_left_to_the_logs, with_drives};
use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use crate::training::{TrainingPasses, plain_estimate};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::{CovarianceMethod, Estimate, EstimationError};
use dynident_model::terms::{DriveInertia, TorqueTerm};
use dynident_rows::{Logs, RegressorModel};
use serde::{Deserialize, Serialize};

/// Standard deviations from which drive inertia counts as seen: by chance once in some 740 studies. A drive that is not
/// there costs a column, which the bars of the others widen for; one that is missed costs its torque. More cannot be
/// asked of one drive whose deviation was found from three squares: thirty of them are 3.7 normal ones.
const SEEN: f64 = 3.0;

/// Whether drives have inertia that the training logs show, and how that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveInertiaChoice {
    /// The joints that it is about: those whose drive inertia was left to the logs.
    pub joints: Vec<String>,
    /// Whether the model has the drive inertia of these joints.
    pub seen: bool,
    /// All drives together in standard deviations; none where no test was made.
    pub standard_deviations: Option<f64>,
    /// Standard deviations that were asked for.
    pub needed: f64,
    /// Why no test was made; none where one was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub untested: Option<String>,
    /// Every drive's inertia as the test found it; those that torque cannot tell from their bodies' are not among them.
    pub drives: Vec<DriveInertiaEstimate>,
}

/// The inertia of one joint's drive in the test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveInertiaEstimate {
    /// The joint.
    pub joint: String,
    /// Reflected inertia, kg m² (kg).
    pub inertia: f64,
    /// Half the width of its 95 % interval.
    pub half_width_95: f64,
}

impl DriveInertiaChoice {
    /// No drive inertia for these joints, untested for this reason.
    pub fn untested(joints: Vec<String>, reason: &str) -> Self {
        let untested = Some(reason.to_owned());
        Self { joints, seen: false, standard_deviations: None, needed: SEEN, untested, drives: Vec::new() }
    }

    /// What was found, in words.
    pub fn sentence(&self) -> String {
        match (self.standard_deviations, &self.untested) {
            (Some(found), _) if self.seen => {
                let needed = self.needed;
                format!(
                    "seen, {found:.0} standard deviations where {needed:.0} are asked for: the torque is the motors'"
                )
            }
            (Some(found), _) => {
                let needed = self.needed;
                format!("not seen, {found:.1} standard deviations where {needed:.0} are asked for: the model has none")
            }
            (None, Some(reason)) => format!("not tested, the model has none: {reason}"),
            (None, None) => "not tested, the model has none".to_owned(),
        }
    }
}

/// Tests the drive inertia of the joints that `settings.drive_inertia` names inside the recordings `training`, by least
/// squares with the other terms as stated; the robot with it where it is seen. Filters are those of `logs`.
///
/// The choice is none where no joint is named that could be tested: all of them have a drive inertia by their terms.
///
/// # Errors
/// Recordings that cannot be read, payloads and gains that do not go together. Rows that do not carry an estimate leave
/// the robot as it is.
pub fn choose_drive_inertia(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    training: &[usize],
    payloads: &[Payload],
) -> Result<(ParametricModel, Option<DriveInertiaChoice>), IdentificationError> {
    let tested = joints_left_to_the_logs(robot, settings);
    if tested.is_empty() {
        return Ok((robot.clone(), None));
    }
    let name = |joint: usize| robot.model().joints()[joint].name.clone();
    let names: Vec<String> = tested.iter().map(|&joint| name(joint)).collect();
    let untested = |reason: &str| Ok((robot.clone(), Some(DriveInertiaChoice::untested(names.clone(), reason))));
    let with_drives = with_drives(robot, &tested)?;
    let apart = standing_apart(&with_drives, &tested);
    if apart.is_empty() {
        return untested("torque cannot tell it from the inertia of the links");
    }
    if !settings.estimation.held.is_empty() {
        return untested("base parameters are held, which others would take the place of");
    }

    // Bars that hold what residuals of one segment have in common, whatever the estimate is to have.
    let estimation = EstimationSettings { covariance: CovarianceMethod::Jackknife, ..settings.estimation.clone() };
    let settings = IdentificationSettings { estimation, ..settings.clone() };
    let passes = TrainingPasses { logs, settings: &settings, training, payloads, known_arm: None };
    let fit = || -> Result<Estimate, IdentificationError> {
        let rows = passes.with_gains(passes.rows_once(RegressorModel::from(with_drives.clone()))?)?;
        if let Some((estimate, _)) = rows.gains {
            return Ok(estimate);
        }
        // Friction that is another on another day looks like drives where it is one for all logs.
        let is_friction: Vec<bool> = rows.model.layout().columns().iter().map(is_friction_column).collect();
        let apart = with_friction_by_log(&rows.problem, &is_friction)?;
        Ok(plain_estimate(&settings.estimation, apart.as_ref().unwrap_or(&rows.problem))?)
    };
    let fit = match fit() {
        Ok(fit) => fit,
        Err(IdentificationError::Estimation(EstimationError::TooFewRows { .. })) => {
            return untested("fewer rows than it would take");
        }
        Err(error) => return Err(error),
    };
    let excited: Vec<(usize, usize)> = apart.into_iter().filter(|(_, column)| fit.std[*column] > 0.0).collect();
    if excited.is_empty() {
        return untested("no joint of which torque could tell it is moved");
    }
    let columns: Vec<usize> = excited.iter().map(|(_, column)| *column).collect();
    let found = together(&fit, &columns);
    let seen = found >= SEEN;
    let drives = excited.iter().map(|&(joint, column)| DriveInertiaEstimate {
        joint: name(joint),
        inertia: fit.values[column],
        half_width_95: fit.half_width_95[column],
    });
    let choice = DriveInertiaChoice {
        joints: names.clone(),
        seen,
        standard_deviations: Some(found),
        needed: SEEN,
        untested: None,
        drives: drives.collect(),
    };
    Ok((if seen { with_drives } else { robot.clone() }, Some(choice)))
}

/// Those of the joints whose drive inertia is a base parameter by itself, with its column; about the first axes it
/// joins with that of the links.
fn standing_apart(robot: &ParametricModel, joints: &[usize]) -> Vec<(usize, usize)> {
    let expressions = robot.base().expressions();
    let own = |joint: usize| {
        let drive = TorqueTerm::DriveInertia(DriveInertia { joint });
        let is_drive = |column: &Column| matches!(column, Column::Term(term) if *term == drive);
        let column = robot.layout().columns().iter().position(is_drive)?;
        (expressions.get(column)? == &drive.symbol()).then_some((joint, column))
    };
    joints.iter().filter_map(|&joint| own(joint)).collect()
}

/// The values of these columns, which noise leaves at zero, together: of standard normal distribution then.
fn together(fit: &Estimate, columns: &[usize]) -> f64 {
    let sum: f64 = columns.iter().map(|&column| as_normal(fit, column)).sum();
    let correlation = |a: usize, b: usize| fit.covariance[(a, b)] / (fit.std[a] * fit.std[b]);
    let variance: f64 = columns.iter().flat_map(|&a| columns.iter().map(move |&b| correlation(a, b))).sum();
    sum / variance.max(columns.len() as f64).sqrt()
}

/// The normal deviate that is as unlikely as an estimate over its standard deviation is by Student's distribution.
fn as_normal(fit: &Estimate, column: usize) -> f64 {
    let t = fit.values[column] / fit.std[column];
    let nu = fit.std_degrees_of_freedom[column].clamp(1.0, 1.0e6);
    let scale = (8.0 * nu + 1.0) / (8.0 * nu + 3.0);
    (scale * (nu * (t * t / nu).ln_1p()).sqrt()).copysign(t)
}
