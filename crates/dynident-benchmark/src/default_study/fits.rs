//! The compared fits: with default settings, with the true friction laws and lag, with plain least squares, and with
//! each estimator by name.

use super::cases::DefaultCase;
use super::simulated::{CaseRobot, Simulated};
use crate::friction_truths::usual_searches;
use crate::simulated_logs::PERIOD_S;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{EstimateStatus, SplineMotionSettings};
use dynident_identification::estimators::{Estimator, InstrumentSettings, NoiseLevels, PeriodSettings};
use dynident_identification::{
    DiagnosisChoice, Execution, Identification, IdentificationError, IdentificationSettings, IdentificationTask,
    Recording, RegressorModel, identify,
};
use dynident_recording::log::OneOrMany;

/// Cut-offs for the fits with the true friction laws and lag, relative to that from the position spectra.
pub(super) const CUTOFF_MULTIPLES: [f64; 9] = [0.5, 0.707, 1.0, 1.414, 2.0, 2.828, 4.0, 5.657, 8.0];
/// Maximum cut-off relative to the sampling rate.
const MAX_CUTOFF_OVER_RATE: f64 = 0.45;
/// Maximum number of samples of all joints for estimators that also estimate the motion.
const MAX_SAMPLES_FOR_MOTION: f64 = 75_000.0;

/// Settings of `identify` for a study of this robot that only names its files and columns.
pub fn default_settings(robot: &ParametricModel) -> IdentificationSettings {
    let mut settings = with_friction_stated();
    settings.friction = usual_searches(robot.model()).into();
    settings.drive_inertia = robot.joint_names();
    settings
}

/// Like [`default_settings`], but with friction and drives given in the study.
fn with_friction_stated() -> IdentificationSettings {
    let mut settings = IdentificationSettings::default();
    settings.estimation.estimator = Estimator::Auto(InstrumentSettings::default());
    settings
}

impl Simulated {
    /// Fit with default settings. The check of the set-up, which does not change the model, is disabled.
    pub(super) fn by_default(&self, robot: &CaseRobot) -> Result<Identification, IdentificationError> {
        let settings = default_settings(&robot.described);
        self.fit(&robot.described, settings)
    }

    /// Fit with default settings, but with the true friction laws and their constants.
    pub(super) fn with_laws_stated(&self, robot: &CaseRobot) -> Result<Identification, IdentificationError> {
        self.fit(&robot.with_true_laws, with_friction_stated())
    }

    /// Fit with the true friction laws, their constants, the true lag and a given cut-off; `None` for an impossible
    /// filter.
    pub(super) fn with_truth(
        &self,
        case: &DefaultCase,
        robot: &CaseRobot,
        multiple: f64,
        consistent: bool,
    ) -> Option<Identification> {
        let cutoff_hz = Some(multiple * self.asked_hz).filter(|hz| *hz < MAX_CUTOFF_OVER_RATE * case.motion.rate_hz)?;
        let mut settings = IdentificationSettings::default();
        settings.motion.differentiator = settings.motion.differentiator.with_cutoff(cutoff_hz);
        settings.motion.torque_lag_s = Some(OneOrMany::One(case.lag_s));
        if !consistent {
            settings.consistency = None;
        }
        self.fit(&robot.with_true_laws, settings).ok()
    }

    /// Plain least squares: viscous and smoothed Coulomb friction, the default cut-off of these laws, and the torque
    /// as logged. With `Estimator::Ordinary` all joints have the same weight.
    pub(super) fn plain(&self, robot: &CaseRobot, estimator: Estimator) -> Option<Identification> {
        let mut settings = IdentificationSettings::default();
        settings.motion.torque_lag_s = Some(OneOrMany::One(0.0));
        settings.estimation.estimator = estimator;
        settings.consistency = None;
        self.fit(&robot.described, settings).ok()
    }

    /// Error of another estimator with the filter, the friction and the lag of the fit with default settings; `None`
    /// if it fails, does not converge, or is not applicable.
    pub(super) fn by_name(&self, robot: &CaseRobot, found: &Identification, estimator: Estimator) -> Option<f64> {
        let robot = robot.described.with_terms(found.model().terms().to_vec()).ok()?;
        let mut settings = IdentificationSettings::default();
        settings.motion = found.motion.clone();
        settings.estimation.estimator = estimator;
        settings.consistency = None;
        let lag_s = &found.torque_lag.lag_s;
        let lag_s = if lag_s.is_empty() { OneOrMany::One(0.0) } else { OneOrMany::Many(lag_s.clone()) };
        settings.motion.torque_lag_s = Some(lag_s);
        let found = self.fit(&robot, settings).ok()?;
        let settled = found.estimate().status != EstimateStatus::IterationLimit;
        settled.then(|| self.free_error(&found)).filter(|error| error.is_finite())
    }

    fn fit(
        &self,
        robot: &ParametricModel,
        settings: IdentificationSettings,
    ) -> Result<Identification, IdentificationError> {
        let mut task = IdentificationTask::new(robot.clone(), vec![Recording::training("run", self.log.clone())]);
        task.settings = settings;
        task.settings.diagnosis = DiagnosisChoice::Never;
        identify(&task, Execution::default())
    }

    pub(super) fn free_error(&self, found: &Identification) -> f64 {
        self.error(found.model(), found.base_values())
    }

    /// Error of the model that `identify` writes: the physically consistent one if available.
    pub(super) fn written_error(&self, found: &Identification) -> f64 {
        let theta = found.consistent_base_values().unwrap_or_else(|| found.base_values());
        let model: &RegressorModel = found.model();
        self.error(model, theta)
    }
}

/// Estimators that are compared by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedEstimator {
    /// Ordinary least squares.
    Ordinary,
    /// Weighted least squares.
    Weighted,
    /// Generalised least squares.
    Generalized,
    /// Least squares with Huber's weights.
    Huber,
    /// Least squares with Tukey's weights.
    Tukey,
    /// Least squares with weights from the local noise.
    NoiseWeighted,
    /// Instrumental variables from the motion of the logs.
    Instrumental,
    /// Motion and parameters estimated together, with splines as motion.
    Simultaneous,
    /// Motion and parameters estimated together, with a Fourier series of known period as motion.
    SimultaneousSeries,
}

impl NamedEstimator {
    /// All estimators, in the order of the table.
    pub const ALL: [Self; 9] = [
        Self::Ordinary,
        Self::Weighted,
        Self::Generalized,
        Self::Huber,
        Self::Tukey,
        Self::NoiseWeighted,
        Self::Instrumental,
        Self::Simultaneous,
        Self::SimultaneousSeries,
    ];

    /// Name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ordinary => "ordinary",
            Self::Weighted => "weighted",
            Self::Generalized => "generalized",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
            Self::NoiseWeighted => "noise-weighted",
            Self::Instrumental => "instrumental",
            Self::Simultaneous => "simultaneous",
            Self::SimultaneousSeries => "simultaneous-series",
        }
    }

    /// The estimator for a case; `None` if it would take minutes.
    pub(super) fn of(self, case: &DefaultCase, dof: usize) -> Option<Estimator> {
        let samples = case.motion.duration_s * case.motion.rate_hz * dof as f64;
        let periods = PeriodSettings { period_s: Some(PERIOD_S), ..PeriodSettings::default() };
        Some(match self {
            Self::Ordinary => Estimator::Ordinary,
            Self::Weighted => Estimator::Weighted,
            Self::Generalized => Estimator::Generalized,
            Self::Huber => Estimator::Huber,
            Self::Tukey => Estimator::Tukey,
            Self::NoiseWeighted => Estimator::NoiseWeighted(NoiseLevels::default()),
            Self::Instrumental => Estimator::Instrumental(InstrumentSettings::default()),
            Self::Simultaneous | Self::SimultaneousSeries if samples > MAX_SAMPLES_FOR_MOTION => return None,
            Self::Simultaneous => Estimator::SplineMotion(SplineMotionSettings::default()),
            Self::SimultaneousSeries => {
                Estimator::Simultaneous(PeriodSettings { harmonics: Some(case.motion.harmonics), ..periods })
            }
        })
    }
}
