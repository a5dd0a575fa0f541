//! Settings of an iteration.

use crate::safety::SafetySettings;
use crate::torque_check_settings::TorqueCheckSettings;
use dynident_identification::EstimationSettings;
use dynident_identification::consistent::ConsistencySettings;
use dynident_identification::estimators::Estimator;
use dynident_identification::friction::{FrictionSearch, JointFriction};
use dynident_identification::payload::Payload;
use dynident_model::Model;
use dynident_recording::{DecimationSettings, DifferentiatorSettings};
use dynident_simulation::controllers::{ControllerSettings, FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};

/// Which parameters are looked for together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// All joints at once.
    #[default]
    AllJoints,
    /// Joint by joint from tip to base, as in the paper (Eqs. 9, 10): the rows of one joint alone, columns that are
    /// known already subtracted.
    StepByStep,
}

/// Whether runs that are fitted together share the constant torques of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunOffsets {
    /// One offset for each joint.
    Shared,
    /// One offset for each joint, unless one of some run clearly deviates from the mean and matters; then as
    /// [`PerRun`](Self::PerRun).
    #[default]
    WhereSeen,
    /// Each run has its own; base parameters hold their mean.
    PerRun,
}

/// How one run is identified: the motion as it follows from a record, then all that an identification can be
/// determined.
#[derive(Clone, Debug)]
pub struct RunIdentificationSettings {
    /// All joints at once (the default), or step by step.
    pub scheme: Scheme,
    /// From positions to velocities and accelerations. Default `deviation`: the commanded motion's own derivatives and
    /// those of the smoothed deviation from it.
    pub differentiator: DifferentiatorSettings,
    /// Whether each run chooses its differentiator among several, the paper's map among them: the one whose motion
    /// leaves the least of the run's torques ([`DifferentiatorChoice`](super::DifferentiatorChoice)). Default false.
    pub choose_differentiator: bool,
    /// Torque and every column pass the same low-pass and lose the same rows; default none.
    pub parallel_filter: Option<DecimationSettings>,
    /// Whether recorded torques are held from one sample to the next, as digital drives do: at a sample's instant the
    /// mean of the values before and after is in force. Default true.
    pub held_torque: bool,
    /// Whether rows near rest do not count where a joint's dry friction is not explained there
    /// ([`NearRest`](crate::NearRest)); default true. Rests themselves never count.
    pub set_aside_near_rest: bool,
    /// The estimator, what counts as excited, where error bars come from. Default weighted least squares. Step by step
    /// takes ordinary or weighted least squares.
    pub estimation: EstimationSettings,
    /// Joints whose friction the first run that is able to chooses, for itself and all runs after it. Default none.
    pub friction: Vec<FrictionSearch>,
    /// Friction that a run before chose, which the robot's terms hold: what is unknown of its constants stands in the
    /// bars. The iteration fills it in.
    pub friction_before: Vec<JointFriction>,
    /// What is known of the bodies of the consistent set that controllers get; `None` gives them the estimate as it is.
    pub consistency: Option<ConsistencySettings>,
    /// What legs carry. Default nothing.
    pub payloads: Vec<Payload>,
    /// Whether runs that are fitted together share the constant torques of the joints that have one; by default unless
    /// one run clearly has another.
    pub run_offsets: RunOffsets,
}

impl Default for RunIdentificationSettings {
    fn default() -> Self {
        Self {
            scheme: Scheme::default(),
            differentiator: DifferentiatorSettings::Deviation {
                reference: dynident_recording::ReferenceSettings::default(),
                smoother: Box::default(),
                max_lag_s: None,
            },
            choose_differentiator: false,
            parallel_filter: None,
            held_torque: true,
            set_aside_near_rest: true,
            estimation: EstimationSettings::default(),
            friction: Vec::new(),
            friction_before: Vec::new(),
            consistency: Some(ConsistencySettings::default()),
            payloads: Vec::new(),
            run_offsets: RunOffsets::default(),
        }
    }
}

impl RunIdentificationSettings {
    /// The same with this differentiator, stated.
    #[must_use]
    pub(crate) fn with_differentiator(&self, differentiator: &DifferentiatorSettings) -> Self {
        Self { differentiator: differentiator.clone(), choose_differentiator: false, ..self.clone() }
    }
}

/// What controls the first run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StartWith {
    /// A controller without a model.
    #[default]
    ModelFree,
    /// The controller with the prior of the robot.
    Prior,
}

/// When an iteration has converged: see [`Shortfall`](super::Shortfall) for what must be met, and by what it is judged.
/// Parameters stand still with `|θ_k - θ_{k-1}| ≤ parameter_sigmas · √(s_k² + s_{k-1}²) + parameter_tolerance ·
/// max|θ|` and `s ≤ most_uncertain · max|θ|`, where θ_k is what is known after run k. Sizes of different parameters are
/// compared by the torque that they make along the motion, as a share of each joint's: a mass and a moment of inertia
/// have no other common measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SettledSettings {
    /// Error bars within which a change counts as none. Default 3.
    pub parameter_sigmas: f64,
    /// Share of the largest parameter (by its torque) within which a change counts as none. Default 1e-6.
    pub parameter_tolerance: f64,
    /// Widest error bar (one standard deviation) as a share of the largest parameter, both by their torque: what is
    /// known worse than that cannot be said to stand still. Default 0.1.
    pub most_uncertain: f64,
    /// Tracking error that is good enough, rad (m): the largest distance of every joint from its trajectory. Default
    /// 1e-4.
    pub tracking_tolerance: f64,
    /// Tracking that falls by less than this factor from a run to the next no longer gets better: the iteration ends,
    /// converged or not. Default 1.5.
    pub tracking_ratio: f64,
    /// A tracking error beyond the tolerance is explained up to this many times the floor that noise, friction and
    /// delay make. Default 2.
    pub floor_ratio: f64,
    /// Torque of a joint that the model leaves unexplained beyond the log's own noise, as a percentage of the joint's
    /// torque (root mean squares). Default 5.
    pub most_unexplained_percent: f64,
    /// Longest lag between torque and motion that is taken off and still lets the iteration converge, seconds: with a
    /// longer one the robot is not where its log says, whatever the tracking is. By default 10 ms, and for an arm
    /// longer than 1.2 m a hundredth of its own second: a bus is no faster because the arm is short.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_lag_s: Option<f64>,
}

/// Longest lag that still lets an iteration converge, seconds of a usual arm and of a shorter one.
const MOST_LAG_S: f64 = 0.01;

impl SettledSettings {
    /// The longest lag that still lets an iteration with such a robot converge, seconds.
    pub(crate) fn most_lag_s(&self, model: &Model) -> f64 {
        self.most_lag_s.unwrap_or_else(|| model.own_scale().seconds(MOST_LAG_S).max(MOST_LAG_S))
    }
}

impl Default for SettledSettings {
    fn default() -> Self {
        Self {
            parameter_sigmas: 3.0,
            parameter_tolerance: 1e-6,
            most_uncertain: 0.1,
            tracking_tolerance: 1e-4,
            tracking_ratio: 1.5,
            floor_ratio: 2.0,
            most_unexplained_percent: 5.0,
            most_lag_s: None,
        }
    }
}

/// Settings of [`Iteration`](super::Iteration).
#[derive(Clone, Debug)]
pub struct IterationSettings {
    /// How a run is identified.
    pub identification: RunIdentificationSettings,
    /// What controls the first run; default a controller without a model.
    pub start: StartWith,
    /// The controller of the first run where that has the prior as its model: a poor model asks for less trust than a
    /// good one. Default [`controller`](Self::controller).
    pub first: Option<ControllerSettings>,
    /// The model of the first run's controller in place of the prior, all parameters; default the prior.
    pub first_model: Option<Vec<f64>>,
    /// The controller without a model: joint PD (16 and 8) by default. It is also what a bad model falls back to.
    pub model_free: ControllerSettings,
    /// The controller with the model so far: the paper's finite-time law with its gains of joint 2 (4 and 4) by
    /// default.
    pub controller: ControllerSettings,
    /// Whether a run that got worse is rejected and its step halved; true by default.
    pub reject: bool,
    /// Whether the model is fitted to all good runs together; true by default. Otherwise to the newest alone.
    pub pool: bool,
    /// A run is worse when its tracking error (mean over the joints of the largest) is above this many times that of
    /// the last good run, and above `settled.tracking_tolerance`. Default 1.5.
    pub worse_factor: f64,
    /// How often a step is halved before the controller without a model comes back. Default 3.
    pub most_halvings: usize,
    /// By how much the gains of the controller without a model grow each time it has to come back. Default 2.
    pub stiffen: f64,
    /// Model-free runs that may fail before the robot counts as one that cannot follow. Default 4.
    pub most_model_free: usize,
    /// Most runs. Default 8.
    pub max_runs: usize,
    /// When all has settled.
    pub settled: SettledSettings,
    /// When a difference between logged and commanded torque counts; `None` disables the check.
    pub torque_check: Option<TorqueCheckSettings>,
    /// What keeps runs safe.
    pub safety: SafetySettings,
}

impl Default for IterationSettings {
    fn default() -> Self {
        Self {
            identification: RunIdentificationSettings::default(),
            start: StartWith::default(),
            first: None,
            first_model: None,
            model_free: ControllerSettings::JointPd(JointPdSettings { kp: 16.0.into(), kd: 8.0.into() }),
            controller: ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(4.0, 4.0)),
            reject: true,
            pool: true,
            worse_factor: 1.5,
            most_halvings: 3,
            stiffen: 2.0,
            most_model_free: 4,
            max_runs: 8,
            settled: SettledSettings::default(),
            torque_check: Some(TorqueCheckSettings::default()),
            safety: SafetySettings::default(),
        }
    }
}

impl IterationSettings {
    /// The paper's scheme as it stands: velocities and accelerations by the map from position (Eqs. 15, 16) with the
    /// lag of at most `max_lag_s` estimated, step by step, every estimate straight into the controller, nothing
    /// rejected.
    pub fn literal(max_lag_s: f64) -> Self {
        Self {
            identification: RunIdentificationSettings {
                scheme: Scheme::StepByStep,
                differentiator: DifferentiatorSettings::PositionMap {
                    reference: dynident_recording::ReferenceSettings::default(),
                    max_lag_s,
                },
                estimation: EstimationSettings::of(Estimator::Ordinary),
                consistency: None,
                ..RunIdentificationSettings::default()
            },
            reject: false,
            pool: false,
            ..Self::default()
        }
    }

    /// Checks the numbers for so many joints.
    ///
    /// # Errors
    /// Numbers out of range, controllers whose gains do not fit, a controller for the first run that needs a model.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.safety.validate(joints)?;
        self.model_free.validate(joints)?;
        self.controller.validate(joints)?;
        self.torque_check.as_ref().map_or(Ok(()), TorqueCheckSettings::validate)?;
        self.first.as_ref().map_or(Ok(()), |first| first.validate(joints))?;
        if self.model_free.needs_model() {
            return Err(SimulationError::NoModel { controller: self.model_free.name() });
        }
        let within =
            |what: &str, value: f64, low: f64, high: f64, fix| require((low..=high).contains(&value), what, value, fix);
        within("worse_factor", self.worse_factor, 1.0, 1e6, "give 1 to 1e6")?;
        within("stiffen", self.stiffen, 1.0, 100.0, "give 1 to 100")?;
        within("most_halvings", self.most_halvings as f64, 0.0, 50.0, "give at most 50")?;
        within("most_model_free", self.most_model_free as f64, 1.0, 50.0, "give 1 to 50")?;
        within("max_runs", self.max_runs as f64, 1.0, 1000.0, "give 1 to 1000")?;
        let settled = &self.settled;
        within("settled.parameter_sigmas", settled.parameter_sigmas, 0.0, 1e3, "give 0 to 1000")?;
        within("settled.parameter_tolerance", settled.parameter_tolerance, 0.0, 1.0, "give 0 to 1")?;
        within("settled.most_uncertain", settled.most_uncertain, 0.0, 1e6, "give 0 or a positive share")?;
        within("settled.tracking_tolerance", settled.tracking_tolerance, 0.0, 1e3, "give 0 or a positive distance")?;
        within("settled.tracking_ratio", settled.tracking_ratio, 1.0, 1e6, "give 1 or more")?;
        within("settled.floor_ratio", settled.floor_ratio, 1.0, 1e6, "give 1 or more")?;
        let unexplained = settled.most_unexplained_percent;
        within("settled.most_lag_s", settled.most_lag_s.unwrap_or(0.0), 0.0, 1e4, "give seconds, 0 to 10000")?;
        within("settled.most_unexplained_percent", unexplained, 0.0, 1e6, "give 0 or a positive percentage")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::InertialParameters;
    use dynident_model::sample::planar_2r;

    /// What a bus takes does not shrink with the arm: a TX40 of 0.45 m had 6 ms, and its drives log 7 to 8 ms late.
    #[test]
    fn a_short_arm_may_be_as_late_as_a_usual_one() {
        let rod = |length_m: f64| {
            let (m, first, second) = (1.0, 0.5 * length_m, length_m * length_m / 3.0);
            InertialParameters([m, first, 0.0, 0.0, 0.01 * second, 0.0, 0.0, second, 0.0, second])
        };
        let allowed =
            |length_m: f64| SettledSettings::default().most_lag_s(&planar_2r(length_m, rod(length_m), rod(length_m)));
        assert_eq!(allowed(0.2), MOST_LAG_S);
        assert!(allowed(5.0) > 1.5 * MOST_LAG_S, "{}", allowed(5.0));
        let stated = SettledSettings { most_lag_s: Some(2e-3), ..SettledSettings::default() };
        assert_eq!(stated.most_lag_s(&planar_2r(5.0, rod(5.0), rod(5.0))), 2e-3);
    }
}
