//! `[design]`: family, criterion, optimiser and limits of an excitation trajectory.

mod joined;
pub(crate) mod name_or_table;
mod optimiser;
mod prior;
mod start_posture;
mod windows;

pub use joined::JoinedChoice;
pub use optimiser::OptimiserChoice;
pub use prior::PriorSection;
pub use start_posture::StartPosture;
pub use windows::{GivenStroke, WindowedCondition, WindowedProblem};

use super::FunctionChoice;
use crate::error::{Expected, StudyError};
use dynident_excitation::criteria::{AOptimal, ConditionNumber, Criterion, DOptimal, EOptimal};
use dynident_excitation::families::{
    BSpline, BSplineSettings, FamilyError, Fourier, FourierSettings, FrictionLadder, FrictionLadderSettings,
    LogisticStrokes, LogisticStrokesSettings, Multisine, MultisineSettings, Quintic, QuinticSettings, SplicedLogistic,
    SplicedLogisticSettings, StaticPostures, StaticPosturesSettings,
};
use dynident_excitation::limits::{AssumedLimits, Limits};
use dynident_excitation::{DesignSettings, Family};
use dynident_model::Model;
use name_or_table::name_or_table;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Longest motion of an arm of 1.2 m, s; the limit exists because the final check evaluates the whole motion at 10
/// kHz.
const MAX_DURATION_S: f64 = 3600.0;
const MAX_DURATION_OF_ANY_ROBOT_S: f64 = 1e7;

/// Maximum number of samples of the search grid, and of the planned log.
const MAX_SAMPLES: f64 = 1e6;

const MAX_STOP_MARGIN_PERCENT: f64 = 90.0;

const MAX_CONTINUOUS_TURNS: f64 = 1e4;

/// Maximum number of starts, of rounds, and of evaluations per start.
const MAX_COUNT: usize = 1_000_000;

/// Section `[design]`; every key is optional.
///
/// ```
/// let section: dynident_study::DesignSection = toml::from_str(
///     r#"
///     family = { kind = "fourier", harmonics = 7 }
///     duration_s = 20.0
///     criterion = "d-optimal"
///     torque_std_nm = [1.0, 1.0, 0.5]
///     search = { seed = 3, starts = 12 }
///     limits = { joints = [{ joint = "elbow", acceleration = 10.0 }] }
///     "#,
/// )?;
/// assert!(section.validate().is_ok());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DesignSection {
    /// The trajectory family and its settings; five Fourier harmonics with rest at both ends by default.
    pub family: FamilyChoice,
    /// Duration of the motion, s; 10 by default.
    pub duration_s: f64,
    /// Optimality criterion; `"d-optimal"` by default. A name, or a table with a `kind` and its settings.
    #[serde(deserialize_with = "name_or_table")]
    #[cfg_attr(feature = "schema", schemars(transform = name_or_table::schema))]
    pub criterion: CriterionChoice,
    /// Optimiser; `"gradient"` by default. A name, or a table with a `kind` and its settings.
    #[serde(deserialize_with = "name_or_table")]
    #[cfg_attr(feature = "schema", schemars(transform = name_or_table::schema))]
    pub optimiser: OptimiserChoice,
    /// Logistic moves (strokes) of a step-wise design, one per joint, that are evaluated without a search. Empty by
    /// default.
    pub parameters: Vec<GivenStroke>,
    /// Posture at the start, and at the end for a family that returns to its start; free by default.
    pub start_posture: Option<StartPosture>,
    /// Name of a known `[[payload]]` that the arm carries during the motion; torque limits include it. No payload by
    /// default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub payload: Option<String>,
    /// Prior knowledge of the parameters; no prior by default.
    pub prior: PriorSection,
    /// Standard deviation of each joint's torque, Nm (N): one number, or one per joint in the order of the model. By
    /// default 1 % of the joint's effort limit, or 1 without an effort limit.
    pub torque_std_nm: Option<TorqueNoise>,
    /// Effort and resolution of the search; also the sampling rate of the log and the seed.
    pub search: DesignSettings,
    /// Limits; they replace those of the robot description.
    pub limits: Limits,
    /// Selection of the limits that are assumed where neither `limits` nor the robot description defines a limit.
    pub defaults: AssumedLimits,
}

impl Default for DesignSection {
    fn default() -> Self {
        Self {
            family: FamilyChoice::Fourier(FourierSettings::default()),
            duration_s: 10.0,
            criterion: CriterionChoice::default(),
            optimiser: OptimiserChoice::default(),
            parameters: Vec::new(),
            start_posture: None,
            payload: None,
            prior: PriorSection::default(),
            torque_std_nm: None,
            search: DesignSettings::default(),
            limits: Limits::default(),
            defaults: AssumedLimits::default(),
        }
    }
}

/// A family by its `kind`, with the settings of that family in the same table.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum FamilyChoice {
    /// Finite Fourier series.
    Fourier(FourierSettings),
    /// Splines of degree 5.
    BSpline(BSplineSettings),
    /// Quintic polynomials through waypoints.
    Quintic(QuinticSettings),
    /// Sines with Schroeder phases.
    Multisine(MultisineSettings),
    /// Several logistic functions (smooth moves) per joint.
    LogisticStrokes(LogisticStrokesSettings),
    /// Logistic functions back and forth, as in *Iterative Identification of Robot Dynamic Parameters Based on
    /// Logistic Function*.
    SplicedLogistic(SplicedLogisticSettings),
    /// Sweeps at constant velocity, for friction.
    FrictionLadder(FrictionLadderSettings),
    /// Postures held one after another, for gravity.
    StaticPostures(StaticPosturesSettings),
    /// A motion function in code of the calling program.
    Function(FunctionChoice),
    /// Several families in sequence.
    Joined(JoinedChoice),
}

impl FamilyChoice {
    /// Value of `kind` in study files and results.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fourier(_) => "fourier",
            Self::BSpline(_) => "b-spline",
            Self::Quintic(_) => "quintic",
            Self::Multisine(_) => "multisine",
            Self::LogisticStrokes(_) => "logistic-strokes",
            Self::SplicedLogistic(_) => "spliced-logistic",
            Self::FrictionLadder(_) => "friction-ladder",
            Self::StaticPostures(_) => "static-postures",
            Self::Function(_) => "function",
            Self::Joined(_) => "joined",
        }
    }

    /// Names of the calling program's functions that the family or its parts use.
    pub fn functions(&self) -> Vec<String> {
        match self {
            Self::Function(own) => vec![own.function.clone()],
            Self::Joined(joined) => joined.parts.iter().flat_map(Self::functions).collect(),
            Self::Fourier(_)
            | Self::BSpline(_)
            | Self::Quintic(_)
            | Self::Multisine(_)
            | Self::LogisticStrokes(_)
            | Self::SplicedLogistic(_)
            | Self::FrictionLadder(_)
            | Self::StaticPostures(_) => Vec::new(),
        }
    }

    /// Builds the family for `joints` joints and a duration of `duration_s`.
    ///
    /// # Errors
    /// If a setting is invalid.
    pub fn family(&self, joints: usize, duration_s: f64) -> Result<Box<dyn Family>, FamilyError> {
        Ok(match self {
            Self::Fourier(settings) => Box::new(Fourier::new(joints, duration_s, settings)?),
            Self::BSpline(settings) => Box::new(BSpline::new(joints, duration_s, settings)?),
            Self::Quintic(settings) => Box::new(Quintic::new(joints, duration_s, settings)?),
            Self::Multisine(settings) => Box::new(Multisine::new(joints, duration_s, settings)?),
            Self::LogisticStrokes(settings) => Box::new(LogisticStrokes::new(joints, duration_s, settings)?),
            Self::SplicedLogistic(settings) => Box::new(SplicedLogistic::new(joints, duration_s, settings)?),
            Self::FrictionLadder(settings) => Box::new(FrictionLadder::new(joints, duration_s, settings)?),
            Self::StaticPostures(settings) => Box::new(StaticPostures::new(joints, duration_s, settings)?),
            Self::Function(settings) => Box::new(settings.family(joints, duration_s)?),
            Self::Joined(settings) => Box::new(settings.family(joints, duration_s)?),
        })
    }
}

/// Optimality criterion.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CriterionChoice {
    /// D-optimality, the volume of the confidence ellipsoid: `-log det D` with the information matrix D.
    #[default]
    DOptimal,
    /// A-optimality, the sum of the variances: `tr D⁻¹` with the information matrix D.
    AOptimal,
    /// E-optimality, the largest variance of any direction: `1 / λ_min(D)` with the information matrix D.
    EOptimal,
    /// The condition number of the stacked base regressor, in SI units, all torques with equal weight.
    ConditionNumber,
    /// Condition number of the same matrix after division of each column by its norm.
    ConditionNumberScaled,
    /// V-optimality: the mean square error of the torque that the identified model will predict along a given motion
    /// (the task).
    Prediction {
        /// The motion along which torque will be predicted: a table with `t_s`, `q1..` and, if available, `dq1..` and
        /// `ddq1..` (rad, m, s), or positions under the joint names. The path is resolved in the same way as those of
        /// the logs.
        trajectory: PathBuf,
    },
    /// Sum of the joints' condition numbers, each over time windows around the mid-points of its logistic moves
    /// (*Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, equation 19).
    WindowedCondition(WindowedCondition),
}

impl CriterionChoice {
    /// The criterion in the versions that a search uses one after another: smooth first, then sharp. `None` for a
    /// prediction criterion, whose trajectory file has to be read first.
    pub fn criteria(&self) -> Option<Vec<Box<dyn Criterion>>> {
        let condition = |scaled| -> Vec<Box<dyn Criterion>> {
            [40.0, 80.0].map(|order| -> Box<dyn Criterion> { Box::new(ConditionNumber { order, scaled }) }).into()
        };
        Some(match self {
            Self::DOptimal => vec![Box::new(DOptimal)],
            Self::AOptimal => vec![Box::new(AOptimal)],
            Self::EOptimal => vec![Box::new(EOptimal::default())],
            Self::ConditionNumber | Self::WindowedCondition(_) => condition(false),
            Self::ConditionNumberScaled => condition(true),
            Self::Prediction { .. } => return None,
        })
    }

    /// Whether the criterion depends only on the regressor and not on torque noise.
    pub fn ignores_torque_noise(&self) -> bool {
        matches!(self, Self::ConditionNumber | Self::ConditionNumberScaled | Self::WindowedCondition(_))
    }
}

/// Torque noise: one value for all joints, or one per joint.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "a standard deviation in Nm, or a list with one per joint")]
pub enum TorqueNoise {
    /// The same value for every joint.
    Same(f64),
    /// Values in the order of the model's joints.
    Each(Vec<f64>),
}

impl DesignSection {
    /// Longest motion of `model` that can be checked, s.
    pub fn longest_s(model: &Model) -> f64 {
        model.characteristic_scale().seconds(MAX_DURATION_S)
    }

    /// Start position of each joint that the family's settings define, rad (m); empty if they define none.
    pub fn start_of_family(&self) -> Vec<Option<f64>> {
        let own = match &self.family {
            FamilyChoice::SplicedLogistic(own) => own.offsets.as_ref(),
            FamilyChoice::Joined(own) => own.start.as_ref(),
            FamilyChoice::Fourier(_)
            | FamilyChoice::BSpline(_)
            | FamilyChoice::Quintic(_)
            | FamilyChoice::Multisine(_)
            | FamilyChoice::LogisticStrokes(_)
            | FamilyChoice::FrictionLadder(_)
            | FamilyChoice::StaticPostures(_)
            | FamilyChoice::Function(_) => None,
        };
        own.map_or_else(Vec::new, |start| start.iter().copied().map(Some).collect())
    }

    /// Checks all settings that do not depend on the robot.
    ///
    /// # Errors
    /// The first key with an invalid value, with its valid range.
    pub fn validate(&self) -> Result<(), StudyError> {
        let within = |key: &str, value: f64, least: f64, most: f64| Expected::Range(least, most).check(key, value);
        within("duration_s", self.duration_s, 1e-3, MAX_DURATION_OF_ANY_ROBOT_S)?;
        self.optimiser.validate()?;
        if !self.parameters.is_empty() && !matches!(self.criterion, CriterionChoice::WindowedCondition(_)) {
            let fix = "these are strokes of a windowed design: set criterion = { kind = \"windowed-condition\" }";
            return Err(StudyError::conflict("parameters", fix));
        }
        if self.start_posture.is_some() && matches!(self.criterion, CriterionChoice::WindowedCondition(_)) {
            let fix = "a windowed design starts at family.offsets; give the posture there";
            return Err(StudyError::conflict("start_posture", fix));
        }
        let search = &self.search;
        within("search.rate_hz", search.rate_hz, 1e-4, 1e7)?;
        within("duration_s times search.rate_hz", self.duration_s * search.rate_hz, 0.0, MAX_SAMPLES)?;
        for (key, value, least) in [
            ("search.starts", search.starts.unwrap_or(1), 1),
            ("search.rounds", search.rounds.unwrap_or(0), 0),
            ("search.evaluations_per_start", search.evaluations_per_start.unwrap_or(1), 1),
            ("search.polish_evaluations", search.polish_evaluations, 1),
        ] {
            within(key, value as f64, f64::from(least), MAX_COUNT as f64)?;
        }
        if let Some(samples) = search.search_samples {
            within("search.search_samples", samples as f64, 8.0, MAX_SAMPLES)?;
        }
        if let Some(limit) = search.time_limit_s {
            within("search.time_limit_s", limit, 1e-3, 1e7)?;
        }
        within("defaults.stop_margin_percent", self.defaults.stop_margin_percent, 0.0, MAX_STOP_MARGIN_PERCENT)?;
        within("defaults.continuous_turns", self.defaults.continuous_turns, 0.0, MAX_CONTINUOUS_TURNS)?;
        self.prior.validate()?;
        if !self.prior.is_empty() && self.criterion.ignores_torque_noise() {
            let fix = "a condition number does not use a prior: set the criterion to \"d-optimal\", \"a-optimal\", \"e-optimal\" or prediction";
            return Err(StudyError::conflict("prior", fix));
        }
        if let (Some(_), FamilyChoice::Joined(joined)) = (&self.start_posture, &self.family)
            && (joined.start.is_some() || joined.end.is_some())
        {
            return Err(StudyError::Exclusive { keys: vec!["start_posture", "start or end of the joined family"] });
        }
        let stds = match &self.torque_std_nm {
            None => &[][..],
            Some(TorqueNoise::Same(std)) => core::slice::from_ref(std),
            Some(TorqueNoise::Each(stds)) => stds,
        };
        stds.iter().try_for_each(|std| within("torque_std_nm", *std, 1e-9, 1e9))
    }
}
