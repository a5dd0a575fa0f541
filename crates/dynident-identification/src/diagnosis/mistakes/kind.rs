//! The properties that each kind of mistake defines.

use super::Mistake;
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_model::Model;

/// Which mistakes are tried.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) enum Breadth<'a> {
    /// Common mistakes. The only free numbers are zeros and mountings.
    Usual,
    /// Rarer ones: units of single joints, other rates, coupled columns, the size of gravity.
    Rare,
    /// Further ones of a log whose base parameters are known, with the torque of each joint that these predict.
    KnownRobot(&'a [Vec<f64>]),
}

/// The study that a mistake may have been made in.
#[derive(Clone, Copy)]
pub(in crate::diagnosis) struct Setup<'a> {
    pub(in crate::diagnosis) robot: &'a ParametricModel,
    pub(in crate::diagnosis) rows: &'a MotionRows,
}

impl Setup<'_> {
    pub(super) fn model(&self) -> &Model {
        self.robot.model()
    }

    /// Numbers of the revolute joints.
    pub(super) fn turning(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.robot.dof()).filter(|&joint| self.model().joints()[joint].turns())
    }
}

/// The evidence that has to improve before a correction is accepted, beyond the score of all joints.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnosis) enum Proof {
    /// Nothing else.
    #[default]
    Score,
    /// The torque of this joint must be explained: a dead or noisy channel is as good in any unit.
    Joint(usize),
    /// The same for a mistake that is tried only where the joint travels far beyond its range.
    Travel(usize),
    /// The torque of this joint must be explained, and clearly better than before: a gain of one torque may only serve
    /// other joints.
    JointGain(usize),
    /// The torque, limits aside: any offset brings a joint back between stops, which may be wrong themselves.
    Torque,
    /// The fit of base parameters: no other length makes bodies possible.
    BaseParameters,
    /// The fit of a consistent robot: bodies that are described too heavy have no influence on it.
    ConsistentRobot,
}

/// The torque column that a joint gets by a correction.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) struct TorqueSource {
    pub(in crate::diagnosis) joint: usize,
    /// The joint that the column belongs to now.
    pub(in crate::diagnosis) from: usize,
    pub(in crate::diagnosis) factor: f64,
}

/// One row of the table of mistakes.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnosis) struct Facts {
    /// `kind` of the finding in the JSON of `check`.
    pub(in crate::diagnosis) key: &'static str,
    /// Cost as an explanation, in units of the score: of two equal explanations the commoner one comes first, and a
    /// free number has to improve the score.
    pub(in crate::diagnosis) rarity: f64,
    /// The channels, where the same mistake could be made in others.
    pub(in crate::diagnosis) channels: Option<Channels>,
    /// The joints that it is about; none for all.
    pub(in crate::diagnosis) joints: Option<Vec<usize>>,
    /// Changed torque columns.
    pub(in crate::diagnosis) torques: Vec<TorqueSource>,
    /// Whether the correction adds to torques, so that unexplained shares fall by this alone.
    pub(in crate::diagnosis) adds_torques: bool,
    /// The joint whose torque has another gain.
    pub(in crate::diagnosis) torque_gain: Option<usize>,
    /// The factor of the joints' positions. Another unit needs another width of the friction step.
    pub(in crate::diagnosis) position_factor: Option<f64>,
    /// Whether it is another rate of the recorder, and no unit of time.
    pub(in crate::diagnosis) is_other_rate: bool,
    /// Whether all logs have it, since they have the same robot at the same place.
    pub(in crate::diagnosis) is_of_all_logs: bool,
    /// The channels that are named first, where logs seldom distinguish the same mistake of other channels.
    pub(in crate::diagnosis) likelier_channels: Option<Channels>,
    /// The evidence that has to improve.
    pub(in crate::diagnosis) proof: Proof,
    /// Its free number; none where it has none, or a unit's.
    pub(in crate::diagnosis) number: Option<Number>,
    /// Numbers that may be found of other robots, where its own was chosen to gain most.
    pub(in crate::diagnosis) other_numbers: Vec<f64>,
}

impl Facts {
    /// Those of a common mistake of all joints without a number.
    pub(super) fn of(key: &'static str) -> Self {
        Self { key, ..Self::default() }
    }
}

/// One kind of mistake: everything that depends on the kind.
pub(super) trait MistakeKind {
    /// Mistakes of this kind to try, the likelier ones first.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self>
    where
        Self: Sized;

    /// Its row of the table.
    fn facts(&self) -> Facts;

    /// The mistake in a sentence with the names of the joints.
    fn sentence(&self, names: &[String]) -> String;

    /// Keys that correct the study; none where no key does.
    fn changes(&self, _keys: &StudyKeys) -> Vec<KeyChange> {
        Vec::new()
    }

    /// The range of factors that the logs do not distinguish from its own, as the end of a sentence.
    fn other_factors(&self, _range: [f64; 2]) -> String {
        String::new()
    }

    /// Corrects the motion and torque of `rows`.
    fn correct(&self, _robot: &ParametricModel, _rows: &mut MotionRows) {}

    /// The corrected robot; none where the robot is not changed.
    fn corrected_robot(&self, _robot: &ParametricModel) -> Option<ParametricModel> {
        None
    }

    /// The same mistake with another number; `None` for a kind without a number.
    fn with_number(&self, _number: f64) -> Option<Mistake> {
        None
    }

    /// The mistake with the number 1, to compare its subject with that of others; `None` for a kind without a number.
    fn subject(&self) -> Option<Mistake> {
        self.with_number(1.0)
    }

    /// The same of other channels; none where it cannot be made in others.
    fn with_channels(&self, _channels: Channels) -> Option<Mistake> {
        None
    }

    /// The same with the number near its own at which `value` is least; none where it has no free number.
    fn between(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let of_number = |number| self.with_number(number).map_or(f64::INFINITY, |mistake| value(&mistake));
        self.with_number(self.facts().number?.least(of_number))
    }
}

/// The robot with another model, with nominal values only if it had them.
pub(super) fn with_model(robot: &ParametricModel, model: Model) -> Option<ParametricModel> {
    let again = ParametricModel::new(model, robot.terms().to_vec()).ok()?;
    if robot.nominal_base().is_none() { Some(again) } else { again.with_nominal(robot.nominal().to_vec()).ok() }
}

/// Joints in a sentence.
pub(super) fn joint_list(joints: &[usize], names: &[String]) -> String {
    if joints.len() > 1 && joints.len() == names.len() {
        return "all joints".to_owned();
    }
    let names: Vec<String> = joints.iter().map(|&joint| format!("joint `{}`", names[joint])).collect();
    names.join(", ")
}

/// Multiplies the values of a column.
pub(super) fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}
