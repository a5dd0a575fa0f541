//! `start_posture`: where the motion begins.

use crate::error::{Expected, StudyError};
use dynident_excitation::limits::Limits;
use dynident_model::Model;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Position of joints at the start, rad (m): by name (what is not named stays free), or all joints in the model's
/// order.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "positions by joint, { elbow = 1.5 }, or a list with one per joint (rad, m)")]
pub enum StartPosture {
    /// By the joints' names.
    ByJoint(BTreeMap<String, f64>),
    /// All joints, in the model's order.
    List(Vec<f64>),
}

impl StartPosture {
    /// The position of every joint that is named under a key of a study.
    ///
    /// # Errors
    /// A joint that the model does not have, another number of positions than joints.
    pub(crate) fn named(&self, key: &'static str, model: &Model) -> Result<Vec<Option<f64>>, StudyError> {
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

    /// The position of every joint that is named.
    ///
    /// # Errors
    /// A joint that the model does not have, another number of positions than joints, a position that is not finite or
    /// that the limits do not allow: at rest in a whole posture every limit is asked, in a part of one those of
    /// position.
    pub(crate) fn of_joints(&self, model: &Model, limits: &Limits) -> Result<Vec<Option<f64>>, StudyError> {
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
