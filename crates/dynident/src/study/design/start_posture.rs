//! `start_posture`: where the motion begins.

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
    /// The position of every joint that is named.
    ///
    /// # Errors
    /// A joint that the model does not have, another number of positions than joints, a position that is not finite or
    /// that the limits do not allow: at rest in a whole posture every limit is asked, in a part of one those of
    /// position.
    pub(crate) fn of_joints(&self, model: &Model, limits: &Limits) -> Result<Vec<Option<f64>>, String> {
        let names: Vec<&str> = model.joints().iter().map(|joint| &*joint.name).collect();
        let posture: Vec<Option<f64>> = match self {
            Self::List(list) if list.len() != names.len() => {
                return Err(format!(
                    "start_posture has {} entries, the robot {} joints: give one each, or name joints: {{ {} = 0.0 }}",
                    list.len(),
                    names.len(),
                    names[0]
                ));
            }
            Self::List(list) => list.iter().copied().map(Some).collect(),
            Self::ByJoint(named) => {
                if let Some(unknown) = named.keys().find(|name| !names.contains(&name.as_str())) {
                    return Err(format!(
                        "start_posture names joint `{unknown}`, which is not moved; the joints are: {}",
                        names.join(", ")
                    ));
                }
                names.iter().map(|name| named.get(*name).copied()).collect()
            }
        };
        for (name, start) in names.iter().zip(&posture) {
            let Some(start) = start else { continue };
            if !start.is_finite() {
                return Err(format!("start_posture: joint `{name}` = {start}: give a finite position, rad (m)"));
            }
            if let Some([lower, upper]) = limits.of(name).and_then(|limit| limit.position)
                && !(lower..=upper).contains(start)
            {
                return Err(format!(
                    "start_posture: joint `{name}` = {start} is outside its position limits, {lower} to {upper}: move the start or widen the limit"
                ));
            }
        }
        if let Some(whole) = posture.iter().copied().collect::<Option<Vec<f64>>>() {
            limits.check_start(model, &whole).map_err(|error| format!("start_posture: {error}"))?;
        }
        Ok(posture)
    }
}
