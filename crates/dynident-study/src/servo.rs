//! `[drive.servo]`: drives with a position controller, for logs of commands and positions.

use crate::error::{Expected, StudyError};
use dynident_model::{Model, Transform, Vec3};
use dynident_servo::{Drive, Floor, FloorPoint, ServoDesignSettings, ServoSettings};
use serde::{Deserialize, Serialize};

/// Contact force per depth of penetration of the floor, N/m: a small arm presses by less than a millimetre.
const FLOOR_STIFFNESS: f64 = 5000.0;

/// One value for all joints, or one value per joint.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum PerJoint {
    /// All joints have this value.
    Same(f64),
    /// One value for each joint, in the robot's order.
    Each(Vec<f64>),
}

/// Section `[drive.servo]`: position-controlled drives. `identify` estimates their values from commands and
/// positions; values given here are the start of the search.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ServoSection {
    /// Position gain, Nm/rad (N/m). By default estimated from the responses in the logs.
    pub stiffness: Option<PerJoint>,
    /// Velocity gain (torque per velocity), Nm s/rad (N s/m). By default estimated from the responses in the logs.
    pub damping: Option<PerJoint>,
    /// Inertia of rotor and gear at the joint, kg m² (kg). By default estimated from the responses in the logs.
    pub armature: Option<PerJoint>,
    /// Coulomb friction, Nm (N). By default estimated from the responses in the logs.
    pub coulomb: Option<PerJoint>,
    /// Time from a command to its effect, s. By default estimated from the responses in the logs.
    pub delay_s: Option<PerJoint>,
    /// Largest torque, Nm (N), in the scale of the other values. No limit by default.
    pub torque_limit: Option<PerJoint>,
    /// Largest acceleration of the set point, rad/s² (m/s²), if the servo moves the set point to a command with a
    /// profile. This is the register "acceleration" of Feetech servos times 100 counts/s², or "profile acceleration"
    /// of Dynamixel servos. No limit by default.
    pub profile_acceleration: Option<PerJoint>,
    /// Largest velocity of the set point, rad/s (m/s). No limit by default.
    pub profile_speed: Option<PerJoint>,
    /// Smallest and largest command that each servo accepts, rad (m); the servo limits commands to this range. No
    /// limit by default.
    pub command_range: Option<Vec<[f64; 2]>>,
    /// A floor that the robot can touch. No floor by default.
    pub floor: Option<FloorSection>,
    /// Prior knowledge, and settings of the search.
    pub fit: ServoSettings,
    /// The commands that `design` computes.
    pub design: ServoDesignSettings,
}

/// Section `[drive.servo.floor]`: a horizontal floor.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FloorSection {
    /// Height in the robot's base frame, m.
    pub height_m: f64,
    /// Points of the robot that touch the floor first.
    pub points: Vec<FloorPointSection>,
}

/// A point of a link.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FloorPointSection {
    /// Name of the link.
    pub link: String,
    /// Position in the link's frame, m.
    pub at_m: [f64; 3],
}

impl ServoSection {
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        self.fit.validate().map_err(StudyError::at("drive.servo.fit"))?;
        self.design.validate().map_err(StudyError::at("drive.servo"))?;
        for range in self.command_range.iter().flatten() {
            if range[0] >= range[1] {
                return Err(StudyError::Numbers {
                    key: "drive.servo.command_range".to_owned(),
                    values: range.to_vec(),
                    expected: "the least command, then a greater one",
                });
            }
        }
        for (key, values) in self.stated() {
            let list: &[f64] = match values {
                PerJoint::Same(value) => core::slice::from_ref(value),
                PerJoint::Each(list) => list,
            };
            for value in list {
                let expected = if key == "delay_s" { Expected::NotNegative } else { Expected::Positive };
                expected.check(format!("drive.servo.{key}"), *value)?;
            }
        }
        Ok(())
    }

    /// Values given in the study, with their keys.
    fn stated(&self) -> impl Iterator<Item = (&'static str, &PerJoint)> {
        let all = [
            ("stiffness", &self.stiffness),
            ("damping", &self.damping),
            ("armature", &self.armature),
            ("coulomb", &self.coulomb),
            ("delay_s", &self.delay_s),
            ("torque_limit", &self.torque_limit),
            ("profile_acceleration", &self.profile_acceleration),
            ("profile_speed", &self.profile_speed),
        ];
        all.into_iter().filter_map(|(key, value)| Some((key, value.as_ref()?)))
    }

    /// The drives of a study without logs: typical drives with the values given in the study.
    ///
    /// # Errors
    /// A missing value; a list whose length differs from the number of joints.
    pub fn stated_drives(&self, joints: usize) -> Result<Vec<Drive>, StudyError> {
        let needed = [
            ("stiffness", &self.stiffness),
            ("damping", &self.damping),
            ("armature", &self.armature),
            ("coulomb", &self.coulomb),
        ];
        let missing: Vec<&str> = needed.iter().filter(|(_, value)| value.is_none()).map(|(key, _)| *key).collect();
        if !missing.is_empty() {
            return Err(StudyError::conflict(
                format!("no log with commands, and no {} in [drive.servo]", missing.join(", ")),
                "state them, for example from an earlier result or from the data sheet, or add a [[log]] with commands",
            ));
        }
        let stated = self.drives(vec![Drive::typical(1.0, 1.0, 1.0, 1.0); joints])?;
        let with_limits = |own: &Drive| Drive {
            torque_limit: own.torque_limit,
            profile_acceleration: own.profile_acceleration,
            profile_speed: own.profile_speed,
            ..Drive::typical(own.stiffness, own.damping, own.armature, own.coulomb)
        };
        Ok(stated.iter().map(with_limits).collect())
    }

    /// The drives with which the search begins: `start` with the values given in the study.
    ///
    /// # Errors
    /// A list whose length differs from the number of joints.
    pub fn drives(&self, mut start: Vec<Drive>) -> Result<Vec<Drive>, StudyError> {
        for (key, values) in self.stated() {
            if let PerJoint::Each(list) = values
                && list.len() != start.len()
            {
                return Err(StudyError::Length { key, found: list.len(), expected: start.len() });
            }
            for (joint, drive) in start.iter_mut().enumerate() {
                let value = match values {
                    PerJoint::Same(value) => *value,
                    PerJoint::Each(list) => list[joint],
                };
                match key {
                    "stiffness" => drive.stiffness = value,
                    "damping" => drive.damping = value,
                    "armature" => drive.armature = value,
                    "coulomb" => drive.coulomb = value,
                    "delay_s" => drive.delay_s = value,
                    "torque_limit" => drive.torque_limit = value,
                    "profile_acceleration" => drive.profile_acceleration = value,
                    _ => drive.profile_speed = value,
                }
            }
        }
        Ok(start)
    }

    /// The floor for the robot's simulation.
    ///
    /// # Errors
    /// A link that the robot does not have, or that does not move.
    pub fn floor(&self, model: &Model) -> Result<Option<Floor>, StudyError> {
        let Some(section) = &self.floor else { return Ok(None) };
        let mut points = Vec::new();
        for point in &section.points {
            let Some((body, placement)) = moving_link(model, &point.link) else {
                let links = model.bodies().iter().flat_map(|body| &body.links);
                return Err(StudyError::Unknown {
                    key: "drive.servo.floor",
                    what: "moving link",
                    name: point.link.clone(),
                    known: links.map(|link| link.name.clone()).collect(),
                });
            };
            points.push(FloorPoint { body, at_m: placement.point(Vec3(point.at_m)) });
        }
        Ok(Some(Floor { height_m: section.height_m, stiffness: FLOOR_STIFFNESS, points }))
    }

    /// Limits the commands of joint `joint` to what its servo accepts.
    pub fn limit(&self, joint: usize, commands: &mut [f64]) {
        let Some([least, greatest]) = self.command_range.as_ref().and_then(|ranges| ranges.get(joint)) else { return };
        for command in commands {
            *command = command.clamp(*least, *greatest);
        }
    }
}

/// The body of a link that moves, and the pose of the link in the body.
pub fn moving_link(model: &Model, name: &str) -> Option<(usize, Transform)> {
    model
        .bodies()
        .iter()
        .enumerate()
        .find_map(|(body, links)| links.links.iter().find(|link| link.name == name).map(|link| (body, link.placement)))
}
