use crate::setup::safety::SafetySettings;
use crate::setup::torque_check_settings::TorqueCheckSettings;
use crate::setup::verdict_settings::VerdictSettings;
use dynident_identification::consistent::ConsistencySettings;
use dynident_identification::estimators::Estimator;
use dynident_identification::friction::FrictionSource;
use dynident_identification::payload::Payload;
use dynident_identification::{DecisionThresholds, EstimationSettings};
use dynident_model::Model;
use dynident_recording::{DecimationSettings, DifferentiatorSettings};
use dynident_simulation::controllers::{ControllerSettings, FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};

/// Which parameters are estimated together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// All joints in one fit.
    #[default]
    AllJoints,
    /// One joint at a time, from tip to base (*Iterative Identification of Robot Dynamic Parameters Based on Logistic
    /// Function*, Eqs. 9, 10). Each fit uses the rows of one joint and subtracts the columns that are already known.
    StepByStep,
}

/// Whether runs that are fitted together share the constant torque offsets of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunOffsets {
    /// One offset per joint.
    Shared,
    /// One offset per joint, or one per joint and run if the offset of a run deviates significantly from the mean.
    #[default]
    WhereSeen,
    /// One offset per joint and run; the base parameters contain the mean.
    PerRun,
}

/// How one run is identified: from the recorded motion to the estimate.
#[derive(Clone, Debug)]
pub struct RunIdentificationSettings {
    /// All joints at once (default) or joint by joint.
    pub scheme: Scheme,
    /// Method that computes velocities and accelerations from positions. Default `deviation`: exact derivatives of
    /// the commanded motion, plus derivatives of the smoothed deviation from it.
    pub differentiator: DifferentiatorSettings,
    /// Whether each run selects, among several differentiators, the one with the smallest torque residual. One of
    /// them is the map from position to velocity and acceleration along logistic functions
    /// ([`DifferentiatorChoice`](crate::DifferentiatorChoice)). Default false.
    pub choose_differentiator: bool,
    /// Low-pass filter and decimation that are applied to the torque and to every regressor column. Default `None`.
    pub parallel_filter: Option<DecimationSettings>,
    /// Whether the recorded torque is held constant from one sample to the next, as in digital drives. The torque at
    /// a sample is then the mean of the values before and after it. Default true.
    pub held_torque: bool,
    /// Whether rows near rest (zero velocity) are excluded for joints whose dry friction model does not fit there
    /// ([`SamplesNearRest`](crate::SamplesNearRest)). Default true. Rows at rest are always excluded.
    pub set_aside_near_rest: bool,
    /// Estimator, excitation thresholds and sources of error bars. Default weighted least squares. If joints are
    /// identified one at a time, only ordinary and weighted least squares are supported.
    pub estimation: EstimationSettings,
    /// Source of the joints' friction laws; the terms of the robot by default. If friction is selected, the first run
    /// with sufficient data selects it, and later runs use the same terms.
    pub friction: FrictionSource,
    /// Prior knowledge of the bodies for the physically consistent model of the controllers; with `None` the
    /// controllers get the unconstrained estimate.
    pub consistency: Option<ConsistencySettings>,
    /// Payloads that the robot carries in the trajectories. Default empty.
    pub payloads: Vec<Payload>,
    /// Whether runs that are fitted together share the constant torque offsets of their joints.
    pub run_offsets: RunOffsets,
    /// Thresholds of the decisions before the last fit.
    pub thresholds: DecisionThresholds,
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
            friction: FrictionSource::default(),
            consistency: Some(ConsistencySettings::default()),
            payloads: Vec::new(),
            run_offsets: RunOffsets::default(),
            thresholds: DecisionThresholds::default(),
        }
    }
}

impl RunIdentificationSettings {
    #[must_use]
    pub(crate) fn with_differentiator(&self, differentiator: &DifferentiatorSettings) -> Self {
        Self { differentiator: differentiator.clone(), choose_differentiator: false, ..self.clone() }
    }
}

/// Controller of the first run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StartWith {
    /// A controller without a model.
    #[default]
    ModelFree,
    /// The controller with the nominal model.
    Prior,
}

/// Conditions for convergence; [`UnmetCondition`](crate::UnmetCondition) lists them all. Parameters have converged if
/// `|θ_k - θ_{k-1}| ≤ parameter_sigmas · √(s_k² + s_{k-1}²) + parameter_tolerance · max|θ|` and `s ≤ most_uncertain ·
/// max|θ|`, where θ_k is the estimate after run k and s its standard deviation. To compare parameters of different
/// units, each parameter is multiplied by its torque along the motion as a share of the joint torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ConvergenceSettings {
    /// Largest change of a parameter by the last run, in error bars of the parameter, with which an iteration has
    /// converged. Default 3.
    pub parameter_sigmas: f64,
    /// Additional accepted change of a parameter, as a share of the largest parameter, both measured by their torque.
    /// Default 1e-6.
    pub parameter_tolerance: f64,
    /// Largest error bar (one standard deviation) of a parameter with which an iteration has converged, as a share of
    /// the largest parameter, both measured by their torque. Default 0.1.
    pub most_uncertain: f64,
    /// Accepted tracking error, rad (m): the largest deviation of each joint from its trajectory. Default 1e-4.
    pub tracking_tolerance: f64,
    /// Smallest factor by which the tracking error must decrease between consecutive runs; below it the iteration
    /// ends, converged or not. Default 1.5.
    pub tracking_ratio: f64,
    /// Accepted ratio of the tracking error to the tracking floor, the error that noise, friction and delay explain.
    /// Default 2.
    pub floor_ratio: f64,
    /// Largest accepted unexplained torque of a joint beyond the noise of the log, in percent of the joint torque
    /// (root mean squares). Default 5.
    pub most_unexplained_percent: f64,
    /// Longest compensated lag between torque and motion with which an iteration has converged, seconds. With a
    /// longer lag the logged position differs from the true position of the robot. Default 10 ms; for an arm longer
    /// than 1.2 m multiplied by its characteristic time. For smaller arms it stays at 10 ms, because the delay of a
    /// bus does not depend on the arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_lag_s: Option<f64>,
    /// Thresholds for accepting a run. Not part of study files.
    #[serde(skip)]
    pub verdict: VerdictSettings,
}

/// Default of the longest accepted lag, seconds, for arms of up to 1.2 m.
const MOST_LAG_S: f64 = 0.01;

impl ConvergenceSettings {
    pub(crate) fn most_lag_s(&self, model: &Model) -> f64 {
        self.most_lag_s.unwrap_or_else(|| model.characteristic_scale().seconds(MOST_LAG_S).max(MOST_LAG_S))
    }
}

impl Default for ConvergenceSettings {
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
            verdict: VerdictSettings::default(),
        }
    }
}

/// Settings of [`Iteration`](crate::Iteration).
#[derive(Clone, Debug)]
pub struct IterationSettings {
    /// How a run is identified.
    pub identification: RunIdentificationSettings,
    /// Controller of the first run; default a controller without a model.
    pub start: StartWith,
    /// Controller of the first run if it uses the nominal model, which may need lower gains. Default
    /// [`controller`](Self::controller).
    pub first: Option<ControllerSettings>,
    /// Model of the first run's controller (all parameters). Default the nominal model.
    pub first_model: Option<Vec<f64>>,
    /// Controller without a model; also used as a fallback after a bad model. Default joint PD with the gains 16 and
    /// 8.
    pub model_free: ControllerSettings,
    /// Controller with the estimated model. Default the finite-time controller with the gains 4 and 4.
    pub controller: ControllerSettings,
    /// Whether a run that is worse than the previous one is rejected and the change of the parameters halved. Default
    /// true.
    pub reject: bool,
    /// Whether the model is fitted to all good runs together (default), or only to the newest run.
    pub pool: bool,
    /// A run is worse if its tracking error (mean of the joint maxima) exceeds `settled.tracking_tolerance` and this
    /// factor times the error of the last good run. Default 1.5.
    pub worse_factor: f64,
    /// Number of halvings of the parameter change before the iteration falls back to the controller without a model.
    /// Default 3.
    pub most_halvings: usize,
    /// Factor on the gains of the controller without a model each time the iteration falls back to it. Default 2.
    pub stiffen: f64,
    /// Number of failed runs without a model after which the iteration stops. Default 4.
    pub most_model_free: usize,
    /// Largest number of runs. Default 8.
    pub max_runs: usize,
    /// Conditions for convergence.
    pub settled: ConvergenceSettings,
    /// Thresholds for reporting a difference between logged and commanded torque; `None` disables the check.
    pub torque_check: Option<TorqueCheckSettings>,
    /// Safety of the runs.
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
            settled: ConvergenceSettings::default(),
            torque_check: Some(TorqueCheckSettings::default()),
            safety: SafetySettings::default(),
        }
    }
}

impl IterationSettings {
    /// The scheme of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*: velocities
    /// and accelerations follow from position by Eqs. 15 and 16, with an estimated lag of at most `max_lag_s`
    /// (seconds). Joints are identified one by one, each estimate is directly used by the controller, and no run is
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

    /// Checks the settings for `joints` joints.
    ///
    /// # Errors
    /// Numbers out of range, controllers with the wrong number of gains, or a `model_free` controller that needs a
    /// model.
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
        settled.verdict.validate()?;
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

    /// Bus delay does not scale with the arm: a TX40 of 0.45 m had 6 ms, and its drives log 7 to 8 ms late.
    #[test]
    fn a_short_arm_may_be_as_late_as_a_usual_one() {
        let rod = |length_m: f64| {
            let (m, first, second) = (1.0, 0.5 * length_m, length_m * length_m / 3.0);
            InertialParameters([m, first, 0.0, 0.0, 0.01 * second, 0.0, 0.0, second, 0.0, second])
        };
        let allowed = |length_m: f64| {
            ConvergenceSettings::default().most_lag_s(&planar_2r(length_m, rod(length_m), rod(length_m)))
        };
        assert_eq!(allowed(0.2), MOST_LAG_S);
        assert!(allowed(5.0) > 1.5 * MOST_LAG_S, "{}", allowed(5.0));
        let stated = ConvergenceSettings { most_lag_s: Some(2e-3), ..ConvergenceSettings::default() };
        assert_eq!(stated.most_lag_s(&planar_2r(5.0, rod(5.0), rod(5.0))), 2e-3);
    }
}
