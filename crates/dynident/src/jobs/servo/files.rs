//! The user's robot description with the identified values.

use crate::result::ServoFile;
use crate::study::StudyRobot;
use dynident_model::mjcf::{ServoChange, included_from, rewrite_servos};
use dynident_model::{DescriptionFormat, JointChange, Model, link_changes, rewrite_mjcf, rewrite_urdf};
use std::path::Path;

/// Robot descriptions with the identified values.
#[derive(Debug, Default)]
pub(in crate::jobs) struct ServoModelFiles {
    pub(in crate::jobs) mjcf: Option<String>,
    pub(in crate::jobs) urdf: Option<String>,
    /// Reason why there is no description.
    pub(in crate::jobs) missing: Option<String>,
}

/// Writes the identified values into the user's MJCF or URDF. Friction is a single number there: the mean over the
/// training logs. Simulators read positions without a delay, so the file contains the delay from a command to its
/// measurement.
pub(in crate::jobs) fn model_files(robot: &StudyRobot, found: &Model, result: &ServoFile) -> ServoModelFiles {
    let description = &robot.robot;
    let written = match description.format {
        DescriptionFormat::Mjcf => mjcf(robot, found, result).map(|text| (Some(text), None)),
        DescriptionFormat::Urdf => urdf(robot, found, result).map(|text| (None, Some(text))),
        DescriptionFormat::Sdf | DescriptionFormat::Dh => {
            Err("this format holds no position drives; result.json has all values".to_owned())
        }
    };
    match written {
        Ok((mjcf, urdf)) => ServoModelFiles { mjcf, urdf, missing: None },
        Err(reason) => ServoModelFiles {
            missing: Some(format!("no robot description was written: {reason}")),
            ..Default::default()
        },
    }
}

fn joint_changes(result: &ServoFile) -> Vec<JointChange> {
    let change = |(joint, drive): (&String, &crate::result::ServoDrive)| JointChange {
        joint: joint.clone(),
        damping: Some(drive.damping),
        friction: Some(drive.mean_friction),
        drive_inertia: Some(drive.armature),
        stiffness: None,
    };
    result.joints.iter().zip(&result.drives).map(change).collect()
}

fn mjcf(robot: &StudyRobot, found: &Model, result: &ServoFile) -> Result<String, String> {
    let links = link_changes(robot.model(), found.inertials()).map_err(|error| error.to_string())?;
    let folder = robot.robot.path.parent().unwrap_or(Path::new(""));
    let text = rewrite_mjcf(&robot.robot.text, &mut included_from(folder), &links, &joint_changes(result))
        .map_err(|error| error.to_string())?;
    let servos: Vec<ServoChange> = result
        .joints
        .iter()
        .zip(&result.drives)
        .map(|(joint, drive)| ServoChange {
            joint: joint.clone(),
            stiffness: drive.stiffness,
            torque_limit: drive.torque_limit,
            delay_s: (drive.delay_s - drive.read_delay_s).max(0.0),
        })
        .collect();
    rewrite_servos(&text, &servos).map_err(|error| error.to_string())
}

fn urdf(robot: &StudyRobot, found: &Model, result: &ServoFile) -> Result<String, String> {
    let links = link_changes(robot.model(), found.inertials()).map_err(|error| error.to_string())?;
    rewrite_urdf(&robot.robot.text, &links, &joint_changes(result)).map_err(|error| error.to_string())
}
