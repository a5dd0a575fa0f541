//! `[robot]`: robot description and installation.

use super::arrays::exactly;
use crate::error::StudyError;
use crate::robot_file::XacroSettings;
use dynident_model::{LoopClosure, Mimic, MimicSource, Robot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// `[robot]`: robot description and installation.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// URDF, MJCF, SDF, or D-H table in TOML; for a description in memory, its name.
    pub file: PathBuf,
    /// The robot description, instead of the file. Not serialised.
    #[serde(skip)]
    pub description: Option<Box<Robot>>,
    /// Arguments of the program `xacro`, which expands a file with macros if permitted (`--allow-command`): `{ ur_type
    /// = "ur5e" }` runs `xacro FILE ur_type:=ur5e`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub xacro: BTreeMap<String, String>,
    /// Time limit of the program `xacro`, s. Default 30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xacro_limit_s: Option<f64>,
    /// The joints in the log, in the order of its columns; every other joint is locked. By default all joints of the
    /// robot description that `lock` does not name, in the order of the tree.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Locked joints with their positions (rad, m).
    #[serde(default)]
    pub lock: BTreeMap<String, f64>,
    /// Links to remove from the robot description: a fixed link alone, a moving link with its whole subtree.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop: Vec<String>,
    /// Joints that follow others, in addition to those of the robot description.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follow: Vec<FollowSection>,
    /// Closed chains: pairs of links that meet.
    #[serde(default, rename = "loop", skip_serializing_if = "Vec::is_empty")]
    pub loops: Vec<LoopSection>,
    /// Gravitational acceleration in the world, m/s²; by default (0, 0, -9.81), or that of the MJCF or D-H table.
    #[serde(default, deserialize_with = "exactly")]
    pub gravity_m_s2: Option<[f64; 3]>,
    /// Orientation of the base in the world: roll, pitch, yaw about fixed axes, rad.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_rad: Option<[f64; 3]>,
    /// The same orientation in degrees; give only one of the two keys.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_deg: Option<[f64; 3]>,
}

/// Section `[[robot.follow]]`: a joint that follows others and has no degree of freedom.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FollowSection {
    /// The joint.
    pub joint: String,
    /// The joints that this joint follows, each with the ratio of this joint's velocity to its velocity.
    pub joints: BTreeMap<String, f64>,
    /// Position of this joint when the followed joints are at zero, rad or m.
    #[serde(default)]
    pub offset: f64,
}

/// Section `[[robot.loop]]`: a closed chain (parallelogram), cut at a joint that the robot description does not
/// contain.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LoopSection {
    /// The two links that meet at the cut.
    pub links: [String; 2],
    /// The point where they meet, in the frame of each link, m.
    pub points_m: [[f64; 3]; 2],
    /// The joints of the chain that have no drive; Dynident computes from the geometry how they follow other joints.
    pub passive: Vec<String>,
}

/// Largest accepted component of gravity; it prevents overflow. Robots in millimetres have 9810; other units of time
/// give larger values.
const MAX_GRAVITY_M_S2: f64 = 1e9;

impl FollowSection {
    pub(super) fn mimic(&self) -> Mimic {
        let source =
            |(joint, multiplier): (&String, &f64)| MimicSource { joint: joint.clone(), multiplier: *multiplier };
        Mimic { sources: self.joints.iter().map(source).collect(), offset: self.offset }
    }
}

impl LoopSection {
    pub(super) fn closure(&self) -> LoopClosure {
        LoopClosure { links: self.links.clone(), points_m: self.points_m, passive: self.passive.clone() }
    }
}

impl RobotSection {
    /// Arguments and time limit of the program `xacro`.
    pub fn xacro_settings(&self) -> XacroSettings {
        let limit_s = self.xacro_limit_s.unwrap_or(XacroSettings::DEFAULT_LIMIT_S);
        XacroSettings { arguments: self.xacro.clone(), limit_s }
    }

    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if let Some(gravity) = self.gravity_m_s2
            && gravity.iter().any(|g| g.abs().is_nan() || g.abs() > MAX_GRAVITY_M_S2)
        {
            return Err(StudyError::Numbers {
                key: "robot.gravity_m_s2".to_owned(),
                values: gravity.to_vec(),
                expected: "finite numbers in m/s^2, with an absolute value of at most 1e9",
            });
        }
        self.xacro_settings().validate()?;
        if self.base_rpy_rad.is_some() && self.base_rpy_deg.is_some() {
            return Err(StudyError::Exclusive { keys: vec!["robot.base_rpy_rad", "robot.base_rpy_deg"] });
        }
        Ok(())
    }
}
