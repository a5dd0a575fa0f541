//! Additional formats of a motion for robots without a Dynident program: ROS 2, URScript, waypoints, torques and
//! currents.

use super::handover::{model_torques, write_atomically};
use super::{RobotFault, RunRequest};
use core::fmt::Write as _;
use dynident_excitation::Motion;
use dynident_excitation::export::{
    ExportError, Sampled, UrScriptSettings, ros2_joint_trajectory, urscript, waypoints_csv,
};
use dynident_simulation::Reference;
use dynident_simulation::controllers::ControllerModel;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A format of a motion (the same as of `design --to`) or of the torques along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FolderForm {
    /// `trajectory.ros2.yaml`: a ROS 2 `JointTrajectory`.
    Ros2,
    /// `trajectory.script`: a URScript program of `servoj` calls, for the six joints of a UR arm.
    Urscript,
    /// `waypoints.csv`: time and positions.
    Waypoints,
    /// `torque.csv`: time and the model torque, Nm (N), for a controller with feed-forward.
    Torque,
    /// `current.csv`: time and the model torque as currents, A, computed with `torque_constants`.
    Current,
}

#[derive(Clone, Debug)]
pub(super) struct FormSettings {
    pub(super) forms: Vec<FolderForm>,
    pub(super) urscript_rate_hz: f64,
    /// Torque per ampere of each joint, Nm/A (N/A).
    pub(super) torque_constants: Option<Vec<f64>>,
}

/// Writes the formats of a run's motion, and of the paths from and to the home posture, into the run's folder. Torque
/// files are omitted without a model.
pub(super) fn write_forms(
    request: &RunRequest<'_>,
    joints: &[String],
    settings: &FormSettings,
    folder: &Path,
) -> Result<(), RobotFault> {
    let ways = request.ways.map(|ways| [("approach", &ways.approach), ("return", &ways.back)]);
    for (part, reference) in [("trajectory", request.reference)].into_iter().chain(ways.into_iter().flatten()) {
        for form in &settings.forms {
            let path = folder.join(file_name(part, *form));
            let text = text(*form, reference, request.model, joints, settings);
            let fault = |error: ExportError| RobotFault::File { path: path.clone(), reason: error.to_string() };
            match text.map_err(fault)? {
                Some(text) => write_atomically(&path, &text)?,
                // Removes the file of an earlier call whose controller had a model.
                None if path.exists() => {
                    let fault =
                        |error: std::io::Error| RobotFault::File { path: path.clone(), reason: error.to_string() };
                    std::fs::remove_file(&path).map_err(fault)?;
                }
                None => {}
            }
        }
    }
    Ok(())
}

/// File names as in `design`; file names of approach and return paths have a prefix.
fn file_name(part: &str, form: FolderForm) -> String {
    let table = |name: &str| if part == "trajectory" { name.to_owned() } else { format!("{part}_{name}") };
    match form {
        FolderForm::Ros2 => format!("{part}.ros2.yaml"),
        FolderForm::Urscript => format!("{part}.script"),
        FolderForm::Waypoints => table("waypoints.csv"),
        FolderForm::Torque => table("torque.csv"),
        FolderForm::Current => table("current.csv"),
    }
}

fn text(
    form: FolderForm,
    reference: &Reference,
    model: Option<&ControllerModel>,
    joints: &[String],
    settings: &FormSettings,
) -> Result<Option<String>, ExportError> {
    let exported = |rate_hz: f64, write: &dyn Fn(&Sampled<'_>) -> Result<String, ExportError>| {
        let (times_s, motion) = sampled(reference, rate_hz);
        write(&Sampled { joints, times_s: &times_s, motion: &motion }).map(Some)
    };
    match form {
        FolderForm::Ros2 => exported(reference.rate_hz(), &ros2_joint_trajectory),
        FolderForm::Waypoints => exported(reference.rate_hz(), &waypoints_csv),
        FolderForm::Urscript => {
            let own = UrScriptSettings { rate_hz: settings.urscript_rate_hz, ..UrScriptSettings::default() };
            exported(own.rate_hz, &|sampled| urscript(sampled, &own))
        }
        FolderForm::Torque => Ok(model.map(|model| torque_csv(reference, model, "tau", None))),
        FolderForm::Current => {
            let constants = settings.torque_constants.as_deref();
            Ok(model.zip(constants).map(|(model, constants)| torque_csv(reference, model, "i", Some(constants))))
        }
    }
}

/// The motion at another sampling rate, by linear interpolation; the last time is the end of the motion.
fn sampled(reference: &Reference, rate_hz: f64) -> (Vec<f64>, Motion) {
    let own = reference.motion();
    let duration_s = reference.duration_s();
    let whole = (duration_s * rate_hz + 1e-9).floor() as usize;
    let mut times_s: Vec<f64> = (0..=whole).map(|k| k as f64 / rate_hz).collect();
    if duration_s - times_s[whole] > 1e-9 {
        times_s.push(duration_s);
    }
    let at = |values: &[f64]| -> Vec<f64> {
        let of_joint = |joint: usize| {
            let values = &values[own.of(joint)];
            times_s.iter().map(move |time| {
                let place = (time * reference.rate_hz()).clamp(0.0, (own.samples - 1) as f64);
                let from = (place + 1e-9).floor() as usize;
                let next = (from + 1).min(own.samples - 1);
                values[from] + (place - from as f64).max(0.0) * (values[next] - values[from])
            })
        };
        (0..own.joints).flat_map(of_joint).collect()
    };
    let (q, dq, ddq) = (at(&own.q), at(&own.dq), at(&own.ddq));
    let motion = Motion { samples: times_s.len(), joints: own.joints, q, dq, ddq, dddq: Vec::new() };
    (times_s, motion)
}

/// Table of `t_s` and the model torque of every joint, divided by the joint's torque constant if there is one.
fn torque_csv(reference: &Reference, model: &ControllerModel, prefix: &str, constants: Option<&[f64]>) -> String {
    let mut text = String::from("t_s");
    for joint in 1..=reference.joints() {
        // Writing to a string cannot fail.
        let _ = write!(text, ",{prefix}{joint}");
    }
    text.push('\n');
    for (sample, torques) in model_torques(reference, model).enumerate() {
        let _ = write!(text, "{}", sample as f64 / reference.rate_hz());
        for (joint, torque) in torques.iter().enumerate() {
            let _ = write!(text, ",{}", torque / constants.map_or(1.0, |constants| constants[joint]));
        }
        text.push('\n');
    }
    text
}
