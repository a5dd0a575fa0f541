//! `start_posture`: posture at the start of the motion.

use crate::error::{Expected, StudyError};
use dynident_excitation::limits::Limits;
use dynident_model::Model;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Positions at the start, rad (m): by joint name (other joints are free), or a list of all joints in the order of
/// the model.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "positions by joint, { elbow = 1.5 }, or a list with one per joint (rad, m)")]
pub enum StartPosture {
    /// Positions by joint name.
    ByJoint(BTreeMap<String, f64>),
    /// Positions of all joints, in the order of the model.
    List(Vec<f64>),
}

impl StartPosture {
    /// Finds the positions of the joints of the model; `key` is the study key for messages. `None` for a free joint.
    ///
    /// # Errors
    /// An unknown joint, or a list whose length differs from the number of joints.
    pub fn named(&self, key: &'static str, model: &Model) -> Result<Vec<Option<f64>>, StudyError> {
        let names: Vec<&str> = model.joints().iter().map(|joint| &*joint.name).collect();
        match self {
            Self::List(list) if list.len() != names.len() => {
                let (found, expected) = (list.len(), names.len());
                Err(StudyError::Length { key, found, expected })
            }
            Self::List(list) => Ok(list.iter().copied().map(Some).collect()),
            Self::ByJoint(named) => {
                if let Some(unknown) = named.keys().find(|name| !names.contains(&name.as_str())) {
                    let known = names.iter().map(|&name| name.to_owned()).collect();
                    let (what, name) = ("moving joint", unknown.clone());
                    return Err(StudyError::Unknown { key, what, name, known });
                }
                Ok(names.iter().map(|name| named.get(*name).copied()).collect())
            }
        }
    }

    /// Finds the positions and checks them against the limits. `None` for a free joint.
    ///
    /// # Errors
    /// An unknown joint, a list with the wrong length, a position that is not finite or outside of its limits. A
    /// posture with all joints is checked at rest against every limit, a partial one against position limits only.
    pub fn of_joints(&self, model: &Model, limits: &Limits) -> Result<Vec<Option<f64>>, StudyError> {
        let posture = self.named("start_posture", model)?;
        let names = model.joints().iter().map(|joint| &*joint.name);
        for (name, start) in names.zip(&posture) {
            let Some(start) = start else { continue };
            let key = format!("start_posture.{name}");
            Expected::Finite.check(&key, *start)?;
            if let Some([lower, upper]) = limits.of(name).and_then(|limit| limit.position) {
                Expected::PositionLimits(lower, upper).check(key, *start)?;
            }
        }
        if let Some(whole) = posture.iter().copied().collect::<Option<Vec<f64>>>() {
            limits.check_start(model, &whole).map_err(StudyError::at("start_posture"))?;
        }
        Ok(posture)
    }
}
