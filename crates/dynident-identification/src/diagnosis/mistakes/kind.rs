//! Interface that each kind of mistake implements.

use super::Mistake;
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys};
use crate::diagnosis::channels::Channels;
use crate::diagnosis::motion_rows::MotionRows;
use crate::diagnosis_settings::DiagnosisSettings;
use dynident_dynamics::ParametricModel;
use dynident_model::Model;

/// Groups of candidate mistakes, by frequency.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) enum Breadth<'a> {
    /// Common mistakes. Their only free numbers are zero positions and mounting orientations.
    Usual,
    /// Rarer mistakes: units of single joints, other sample rates, coupled columns, the magnitude of gravity.
    Rare,
    /// Further mistakes for a log with known base parameters; contains the torque of each joint that these parameters
    /// predict.
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

    /// Indices of the revolute joints.
    pub(super) fn turning(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.robot.dof()).filter(|&joint| self.model().joints()[joint].is_rotary())
    }
}

/// Evidence that must improve, in addition to the score of all joints, before a correction is accepted.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnosis) enum Proof {
    #[default]
    Score,
    /// The mistaken joint must have a small residual. (A dead or noisy channel fits equally well in any unit.)
    Joint(usize),
    /// The mistaken joint must have a small residual. For a mistake that is only tried if the joint travels far beyond
    /// its range.
    Travel(usize),
    /// The mistaken joint must have a small and clearly improved residual. (A wrong gain may otherwise only compensate
    /// for other joints.)
    JointGain(usize),
    /// The score without joint limits must improve. (An offset can always move a joint back between its limits, and
    /// these limits may be wrong.)
    Torque,
    /// The residual of the unconstrained fit must improve. (Another length must not only make the bodies physically
    /// consistent.)
    BaseParameters,
    /// The residual of the physically consistent fit must improve. (Nominal bodies that are too heavy do not influence
    /// it.)
    ConsistentRobot,
}

/// Source of a joint's torque column after a correction.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) struct TorqueSource {
    pub(in crate::diagnosis) joint: usize,
    /// The joint to which the column belongs in the study.
    pub(in crate::diagnosis) from: usize,
    pub(in crate::diagnosis) factor: f64,
}

#[derive(Clone, Debug, Default)]
pub(in crate::diagnosis) struct Facts {
    /// `kind` of the finding in the JSON of `check`.
    pub(in crate::diagnosis) key: &'static str,
    /// Cost of the mistake in units of the score: a penalty for rare mistakes and for free numbers.
    pub(in crate::diagnosis) rarity: f64,
    /// The affected channels, if the same mistake is possible in other channels.
    pub(in crate::diagnosis) channels: Option<Channels>,
    /// The affected joints; `None` for all.
    pub(in crate::diagnosis) joints: Option<Vec<usize>>,
    pub(in crate::diagnosis) torques: Vec<TorqueSource>,
    /// Whether the correction adds columns to torques, which alone reduces unexplained shares.
    pub(in crate::diagnosis) adds_torques: bool,
    pub(in crate::diagnosis) torque_gain: Option<usize>,
    /// Factor on the positions of the affected joints. In another unit, the smoothed friction sign needs another width.
    pub(in crate::diagnosis) position_factor: Option<f64>,
    /// Whether the mistake is another rate of the recorder, not another unit of time.
    pub(in crate::diagnosis) is_other_rate: bool,
    /// Whether the mistake must be present in all logs, because it concerns the robot or its mounting.
    pub(in crate::diagnosis) is_of_all_logs: bool,
    /// Channels that are reported first, because logs seldom distinguish the same mistake in other channels.
    pub(in crate::diagnosis) likelier_channels: Option<Channels>,
    pub(in crate::diagnosis) proof: Proof,
    /// Free number of the mistake; `None` for a fixed unit or a mistake without a number.
    pub(in crate::diagnosis) number: Option<Number>,
    /// Numbers of the mistake that a search could find for another robot.
    pub(in crate::diagnosis) other_numbers: Vec<f64>,
}

impl Facts {
    /// Properties of a common mistake of all joints without a number.
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

    /// The mistake with a standard number, for the comparison of kinds; `None` for a kind without a number.
    fn subject(&self) -> Option<Mistake> {
        self.with_number(1.0)
    }

    fn nearest_unit(&self) -> Option<Mistake> {
        None
    }

    /// The mistake in other channels (position or torque), if possible.
    fn with_channels(&self, _channels: Channels) -> Option<Mistake> {
        None
    }

    fn with_best_number(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let of_number = |number| self.with_number(number).map_or(f64::INFINITY, |mistake| value(&mistake));
        self.with_number(self.facts().number?.minimum(of_number))
    }
}

/// The robot with another model; nominal values are kept if there are any.
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
