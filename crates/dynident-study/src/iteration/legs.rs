//! `[[iteration.leg]]`: several trajectories (legs), each with some joints held. They run together or one after the
//! other.

use super::super::{DesignSection, StudyRobot};
use super::IterationSection;
use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Order of several trajectories (legs).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LegOrder {
    /// Every run contains all trajectories; the model is identified from all of them.
    #[default]
    Together,
    /// Each trajectory has a separate iteration until it converges or reaches its maximum number of runs. Its
    /// estimates are then fixed in the iterations of the following trajectories. *Iterative Identification of Robot
    /// Dynamic Parameters Based on Logistic Function* does this, beginning with the tip joint.
    OneAfterAnother,
}

/// Section `[[iteration.leg]]`: one trajectory.
///
/// ```
/// let section: dynident_study::IterationSection = toml::from_str(
///     r#"
///     order = "one-after-another"
///     leg = [{ hold = { joint1 = 0.0 } }, { hold = { joint2 = 0.5 }, trajectory = "joint1.csv", windows = { joint1 = [[2.0, 8.0]] } }]
///     "#,
/// )?;
/// assert_eq!(section.leg[1].hold["joint2"], 0.5);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LegSection {
    /// Held joints with their positions, rad (m); none by default. The torque of held joints is not used. In a
    /// step-wise design only the other joints move.
    pub hold: BTreeMap<String, f64>,
    /// Whether the simulator locks the held joints (true, the default); otherwise the controller holds them. A robot
    /// outside the simulator receives them as joints that must rest.
    pub locked: bool,
    /// Trajectory file; by default that of the study.
    pub trajectory: Option<PathBuf>,
    /// Design of this trajectory; by default the study's `[design]`.
    pub design: Option<DesignSection>,
    /// Time ranges by joint name (from, to; s) that are used in the fit. By default those of the design, or the whole
    /// motion. If ranges are given, joints without an entry are not used.
    pub windows: BTreeMap<String, Vec<[f64; 2]>>,
    /// Name of the `[[payload]]` that the robot carries; no payload by default.
    pub payload: Option<String>,
}

impl Default for LegSection {
    fn default() -> Self {
        Self {
            hold: BTreeMap::new(),
            locked: true,
            trajectory: None,
            design: None,
            windows: BTreeMap::new(),
            payload: None,
        }
    }
}

impl IterationSection {
    /// Indices of the trajectories of each iteration: all in one iteration, or one per iteration.
    pub fn stages(&self) -> Vec<Vec<usize>> {
        match self.order {
            LegOrder::OneAfterAnother if self.leg.len() > 1 => (0..self.leg.len()).map(|leg| vec![leg]).collect(),
            _ => vec![(0..self.leg.len().max(1)).collect()],
        }
    }

    /// Checks the trajectories (legs) of the iteration against the joints of the robot.
    ///
    /// # Errors
    /// Two keys that exclude each other, unknown joints, a position that is not finite, or a trajectory in which no
    /// joint moves.
    pub fn check_legs(&self, robot: &StudyRobot) -> Result<(), StudyError> {
        let names = robot.parametric.joint_names();
        for (number, leg) in (1..).zip(&self.leg) {
            leg.check(&names).map_err(StudyError::at(format!("leg {number}")))?;
        }
        Ok(())
    }
}

impl LegSection {
    fn check(&self, names: &[String]) -> Result<(), StudyError> {
        if self.trajectory.is_some() && self.design.is_some() {
            return Err(StudyError::Exclusive { keys: vec!["trajectory", "design"] });
        }
        for (key, mut joints) in
            [("hold", self.hold.keys().collect::<Vec<_>>()), ("windows", self.windows.keys().collect())]
        {
            joints.retain(|name| !names.contains(name));
            if let Some(&name) = joints.first() {
                let known = names.to_vec();
                return Err(StudyError::Unknown { key, what: "joint", name: name.clone(), known });
            }
        }
        if let Some(both) = self.hold.keys().find(|name| self.windows.contains_key(*name)) {
            let (joint, key, other) = (both.clone(), "windows", "hold");
            return Err(StudyError::JointInBoth { joint, key, other, state: "held" });
        }
        for (name, position) in &self.hold {
            Expected::Finite.check(format!("hold.{name}"), *position)?;
        }
        if self.hold.len() == names.len() {
            return Err(StudyError::conflict("hold", "all joints are held: at least one must move"));
        }
        Ok(())
    }
}
