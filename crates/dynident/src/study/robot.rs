//! `[robot]`: which robot, and how it stands.

use super::arrays::exactly;
use crate::error::StudyError;
use crate::robot_file::XacroSettings;
use dynident_model::{LoopClosure, Mimic, MimicSource, Robot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// `[robot]`: which robot, and how it stands.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// URDF, MJCF, SDF, or D-H table in TOML; of a description in memory, what it is called.
    pub file: PathBuf,
    /// The description itself, in place of the file's. Not written.
    #[serde(skip)]
    pub description: Option<Box<Robot>>,
    /// Arguments of the program `xacro`, which expands a file with macros if it is permitted (`--allow-command`): `{
    /// ur_type = "ur5e" }` is `xacro FILE ur_type:=ur5e`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub xacro: BTreeMap<String, String>,
    /// Time limit of the program `xacro`, s. Default 30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xacro_limit_s: Option<f64>,
    /// The joints that the log holds, in the order of its columns; every other joint is locked. By default all joints
    /// of the description that `lock` does not name, in the order of the tree.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Joints that are held, and where (rad, m).
    #[serde(default)]
    pub lock: BTreeMap<String, f64>,
    /// Links that are not there: a link fixed to another alone, one that moves with a joint with everything on it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop: Vec<String>,
    /// Joints that follow others, beside those of which the description says so.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follow: Vec<FollowSection>,
    /// Closed chains: where two links of the tree meet.
    #[serde(default, rename = "loop", skip_serializing_if = "Vec::is_empty")]
    pub loops: Vec<LoopSection>,
    /// Gravitational acceleration in the world, m/s²; (0, 0, -9.81), or the MJCF's or D-H table's own, by default.
    #[serde(default, deserialize_with = "exactly")]
    pub gravity_m_s2: Option<[f64; 3]>,
    /// How the base is mounted in the world: roll, pitch, yaw about fixed axes, rad.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_rad: Option<[f64; 3]>,
    /// The same in degrees; give one of the two.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_deg: Option<[f64; 3]>,
}

/// `[[robot.follow]]`: a joint without a degree of freedom of its own.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FollowSection {
    /// The joint.
    pub joint: String,
    /// The joints that it follows, and its velocity per velocity of each.
    pub joints: BTreeMap<String, f64>,
    /// Its position where those stand at zero, rad or m.
    #[serde(default)]
    pub offset: f64,
}

/// `[[robot.loop]]`: a closed chain of the parallelogram kind, cut at a joint that the description does not hold.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LoopSection {
    /// The two links that meet.
    pub links: [String; 2],
    /// Where: a point in the frame of each link, m.
    pub points_m: [[f64; 3]; 2],
    /// The joints of the chain without drives: what they follow is found from the geometry.
    pub passive: Vec<String>,
}

/// Largest component of gravity, beyond which numbers run away. Robots in millimetres have 9810, and in milliseconds a
/// thousandth of a thousandth of it.
const MAX_GRAVITY_M_S2: f64 = 1e9;

impl FollowSection {
    /// What the joint follows.
    pub(super) fn mimic(&self) -> Mimic {
        let source =
            |(joint, multiplier): (&String, &f64)| MimicSource { joint: joint.clone(), multiplier: *multiplier };
        Mimic { sources: self.joints.iter().map(source).collect(), offset: self.offset }
    }
}

impl LoopSection {
    /// Where the chain is cut.
    pub(super) fn closure(&self) -> LoopClosure {
        LoopClosure { links: self.links.clone(), points_m: self.points_m, passive: self.passive.clone() }
    }
}

impl RobotSection {
    /// How the program `xacro` is called.
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
                expected: "finite numbers in m/s^2, at most 1e9 in size",
            });
        }
        self.xacro_settings().validate()?;
        if self.base_rpy_rad.is_some() && self.base_rpy_deg.is_some() {
            return Err(StudyError::Exclusive { keys: vec!["robot.base_rpy_rad", "robot.base_rpy_deg"] });
        }
        Ok(())
    }
}
