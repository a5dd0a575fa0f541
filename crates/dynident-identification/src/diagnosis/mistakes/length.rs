//! Mistake: a wrong distance between a joint and the previous joint.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Proof, Setup, with_model};
use super::numbers::Number;
use dynident_dynamics::ParametricModel;

/// Factors to try: a diameter in place of a radius, a radius in place of a diameter, and the opposite direction. A
/// search finds factors between these.
const LENGTH_FACTORS: [f64; 3] = [0.5, 2.0, -1.0];

/// A wrong distance between a joint and the previous joint in the robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct Length {
    /// The joint.
    pub joint: usize,
    /// Correct distance divided by the described distance; negative for the opposite direction.
    pub factor: f64,
}

impl MistakeKind for Length {
    /// Candidates for every joint except the first, whose location has no influence on torque. None for a robot with
    /// coupled joints, whose tree has more joints than the log.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let model = setup.model();
        if !matches!(breadth, Breadth::Rare) || model.coupling().is_some() {
            return Vec::new();
        }
        let is_apart = |joint: &usize| {
            let description = &model.joints()[*joint];
            description.parent.is_some() && description.placement.translation.norm() > 0.0
        };
        let joints = (0..model.dof()).filter(is_apart);
        joints.flat_map(|joint| LENGTH_FACTORS.map(|factor| Self { joint, factor })).collect()
    }

    fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        with_model(robot, robot.model().clone().with_joint_distances(&[self.joint], self.factor).ok()?)
    }

    fn facts(&self) -> Facts {
        Facts {
            // Robot descriptions have far more errors in their bodies than in their joints.
            rarity: 0.3,
            joints: Some(vec![self.joint]),
            is_of_all_logs: true,
            proof: Proof::BaseParameters,
            number: Some(Number { is_round: true, ..Number::factor(self.factor, 0.7) }),
            ..Facts::of("description")
        }
    }

    fn sentence(&self, names: &[String]) -> String {
        let place = match self.factor {
            factor if factor < 0.0 => "on the other side of",
            factor if factor > 1.0 => "too near to",
            _ => "too far from",
        };
        format!(
            "the robot description has joint `{}` {place} the joint before it: multiply `xyz` of the origin of this joint by {:.3}",
            names[self.joint], self.factor
        )
    }

    fn with_number(&self, factor: f64) -> Option<Mistake> {
        Some(Self { factor, ..*self }.into())
    }
}
