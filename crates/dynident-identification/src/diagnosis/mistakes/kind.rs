//! The properties that each kind of mistake defines.

use super::Mistake;
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use crate::diagnosis_settings::DiagnosisSettings;
use dynident_dynamics::ParametricModel;
use dynident_model::Model;

/// Groups of candidates.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) enum Breadth<'a> {
    /// Common mistakes. The only free numbers are zeros and mountings.
    Usual,
    /// Rarer mistakes: units of single joints, other rates, coupled columns, the magnitude of gravity.
    Rare,
    /// Further mistakes of a log with known base parameters; contains their predicted torque of each joint.
    KnownRobot(&'a [Vec<f64>]),
}

#[derive(Clone, Copy)]
pub(in crate::diagnosis) struct Setup<'a> {
    pub(in crate::diagnosis) robot: &'a ParametricModel,
    pub(in crate::diagnosis) rows: &'a MotionRows,
    pub(in crate::diagnosis) settings: &'a DiagnosisSettings,
}

impl Setup<'_> {
    pub(super) fn model(&self) -> &Model {
        self.robot.model()
    }

    /// Numbers of the revolute joints.
    pub(super) fn turning(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.robot.dof()).filter(|&joint| self.model().joints()[joint].is_rotary())
    }
}

/// The evidence that has to improve before a correction is accepted, in addition to the score of all joints.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnosis) enum Proof {
    #[default]
    Score,
    /// This joint must have a small residual: a dead or noisy channel fits equally well in any unit.
    Joint(usize),
    /// The same for a mistake that is tried only where the joint travels far beyond its range.
    Travel(usize),
    /// This joint must have a small and clearly improved residual: another gain may only compensate for other joints.
    JointGain(usize),
    /// The score without limits: any offset brings a joint back between its stops, which may be wrong.
    Torque,
    /// The free fit: another length must not only make the bodies consistent.
    BaseParameters,
    /// The consistent fit: nominal bodies that are too heavy do not influence it.
    ConsistentRobot,
}

/// The torque column of a joint after a correction.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) struct TorqueSource {
    pub(in crate::diagnosis) joint: usize,
    /// The joint that the column belongs to now.
    pub(in crate::diagnosis) from: usize,
    pub(in crate::diagnosis) factor: f64,
}

#[derive(Clone, Debug, Default)]
pub(in crate::diagnosis) struct Facts {
    /// `kind` of the finding in the JSON of `check`.
    pub(in crate::diagnosis) key: &'static str,
    /// Cost in units of the score: a penalty for rare mistakes and for free numbers.
    pub(in crate::diagnosis) rarity: f64,
    /// The channels, if the same mistake is possible in other channels.
    pub(in crate::diagnosis) channels: Option<Channels>,
    /// The joints that it concerns; `None` for all.
    pub(in crate::diagnosis) joints: Option<Vec<usize>>,
    pub(in crate::diagnosis) torques: Vec<TorqueSource>,
    /// Whether the correction adds to torques, which alone reduces unexplained shares.
    pub(in crate::diagnosis) adds_torques: bool,
    pub(in crate::diagnosis) torque_gain: Option<usize>,
    /// The factor of the joints' positions. Another unit needs another width of the friction step.
    pub(in crate::diagnosis) position_factor: Option<f64>,
    /// Whether it is another rate of the recorder, not another unit of time.
    pub(in crate::diagnosis) is_other_rate: bool,
    /// Whether all logs have it, since they have the same robot at the same place.
    pub(in crate::diagnosis) is_of_all_logs: bool,
    /// The channels that are reported first, if logs seldom distinguish the same mistake in other channels.
    pub(in crate::diagnosis) likelier_channels: Option<Channels>,
    pub(in crate::diagnosis) proof: Proof,
    /// Its free number; `None` for a fixed unit or without a number.
    pub(in crate::diagnosis) number: Option<Number>,
    /// Numbers that a search could find for another robot.
    pub(in crate::diagnosis) other_numbers: Vec<f64>,
}

impl Facts {
    /// A common mistake of all joints without a number.
    pub(super) fn of(key: &'static str) -> Self {
        Self { key, ..Self::default() }
    }
}

/// A kind of mistake. [`Mistake`] describes the methods.
pub(super) trait MistakeKind {
    /// Candidates of this kind, the likelier ones first.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self>
    where
        Self: Sized;

    fn facts(&self) -> Facts;

    fn sentence(&self, names: &[String]) -> String;

    fn changes(&self, _keys: &StudyKeys) -> Vec<KeyChange> {
        Vec::new()
    }

    fn other_factors(&self, _range: [f64; 2]) -> String {
        String::new()
    }

    fn correct(&self, _robot: &ParametricModel, _rows: &mut MotionRows) {}

    fn corrected_robot(&self, _robot: &ParametricModel) -> Option<ParametricModel> {
        None
    }

    fn with_number(&self, _number: f64) -> Option<Mistake> {
        None
    }

    /// The mistake with a standard number, for comparison; `None` for a kind without a number.
    fn subject(&self) -> Option<Mistake> {
        self.with_number(1.0)
    }

    /// The same mistake in other channels, if possible.
    fn with_channels(&self, _channels: Channels) -> Option<Mistake> {
        None
    }

    fn with_best_number(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let of_number = |number| self.with_number(number).map_or(f64::INFINITY, |mistake| value(&mistake));
        self.with_number(self.facts().number?.minimum(of_number))
    }
}

/// The robot with another model; nominal values are kept if present.
pub(super) fn with_model(robot: &ParametricModel, model: Model) -> Option<ParametricModel> {
    let again = ParametricModel::new(model, robot.terms().to_vec()).ok()?;
    if robot.nominal_base().is_none() { Some(again) } else { again.with_nominal(robot.nominal().to_vec()).ok() }
}

pub(super) fn joint_list(joints: &[usize], names: &[String]) -> String {
    if joints.len() > 1 && joints.len() == names.len() {
        return "all joints".to_owned();
    }
    let names: Vec<String> = joints.iter().map(|&joint| format!("joint `{}`", names[joint])).collect();
    names.join(", ")
}

pub(super) fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}
