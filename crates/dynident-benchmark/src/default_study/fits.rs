//! The fits that are compared: by default, with the truth in hand, plain, and with each estimator by name.

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

/// Cut-offs that are tried with the truth in hand, in units of what the spectra ask for.
pub(super) const MULTIPLES: [f64; 9] = [0.5, 0.707, 1.0, 1.414, 2.0, 2.828, 4.0, 5.657, 8.0];
/// A filter is possible below this part of the sampling rate.
const HIGHEST: f64 = 0.45;
/// Samples of all joints up to which estimators that estimate the motion as well are asked.
const MOST_FOR_MOTION: f64 = 75_000.0;

/// Settings of `identify` for a study of this robot that has files and columns alone.
pub fn default_settings(robot: &ParametricModel) -> IdentificationSettings {
    let mut settings = with_friction_stated();
    settings.friction = usual_searches(robot.model());
    settings.drive_inertia = robot.joint_names();
    settings
}

/// The same where keys state the friction and the drives.
fn with_friction_stated() -> IdentificationSettings {
    let mut settings = IdentificationSettings::default();
    settings.estimation.estimator = Estimator::Auto(InstrumentSettings::default());
    settings
}

impl Simulated {
    /// As a study without keys does it. Other readings of the logs, which change nothing of the model, are not tried.
    pub(super) fn by_default(&self, robot: &CaseRobot) -> Result<Identification, IdentificationError> {
        let settings = default_settings(&robot.described);
        self.fit(&robot.described, settings)
    }

    /// As by default in all else, with the true laws and their constants stated.
    pub(super) fn with_laws_stated(&self, robot: &CaseRobot) -> Result<Identification, IdentificationError> {
        self.fit(&robot.with_true_laws, with_friction_stated())
    }

    /// With the true laws, their constants and the true lag stated, and a cut-off; none where it leaves nothing.
    pub(super) fn with_truth(
        &self,
        case: &DefaultCase,
        robot: &CaseRobot,
        multiple: f64,
        consistent: bool,
    ) -> Option<Identification> {
        let cutoff_hz = Some(multiple * self.asked_hz).filter(|hz| *hz < HIGHEST * case.motion.rate_hz)?;
        let mut settings = IdentificationSettings::default();
        settings.motion.differentiator = settings.motion.differentiator.with_cutoff(cutoff_hz);
        settings.motion.torque_lag_s = Some(OneOrMany::One(case.lag_s));
        if !consistent {
            settings.consistency = None;
        }
        self.fit(&robot.with_true_laws, settings).ok()
    }

    /// Plain least squares: viscous and smooth Coulomb friction, the cut-off that is chosen by default for that, torque
    /// as logged; with `Estimator::Ordinary` every joint's newton metre counts alike.
    pub(super) fn plain(&self, robot: &CaseRobot, estimator: Estimator) -> Option<Identification> {
        let mut settings = IdentificationSettings::default();
        settings.motion.torque_lag_s = Some(OneOrMany::One(0.0));
        settings.estimation.estimator = estimator;
        settings.consistency = None;
        self.fit(&robot.described, settings).ok()
    }

    /// With the filter, friction and lag of the default fit and another estimator: its error; none where it fails, does
    /// not settle, or is not asked.
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

    /// Error of the estimate itself.
    pub(super) fn free_error(&self, found: &Identification) -> f64 {
        self.error(found.model(), found.base_values())
    }

    /// Error of the model that is written: the consistent set's, where there is one.
    pub(super) fn written_error(&self, found: &Identification) -> f64 {
        let theta = found.consistent_base_values().unwrap_or_else(|| found.base_values());
        let model: &RegressorModel = found.model();
        self.error(model, theta)
    }
}

/// Estimators that are asked for by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedEstimator {
    /// Ordinary least squares.
    Ordinary,
    /// Weighted least squares.
    Weighted,
    /// Generalised least squares.
    Generalized,
    /// Huber's weights.
    Huber,
    /// Tukey's weights.
    Tukey,
    /// Weights by the noise around a row.
    NoiseWeighted,
    /// Instruments of the logs' own motion.
    Instrumental,
    /// Maximum likelihood of a motion that repeats.
    MaximumLikelihood,
    /// Motion and parameters at once, the motion a spline.
    Simultaneous,
    /// Motion and parameters at once, the motion a Fourier series whose period is stated.
    SimultaneousSeries,
}

impl NamedEstimator {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 10] = [
        Self::Ordinary,
        Self::Weighted,
        Self::Generalized,
        Self::Huber,
        Self::Tukey,
        Self::NoiseWeighted,
        Self::Instrumental,
        Self::MaximumLikelihood,
        Self::Simultaneous,
        Self::SimultaneousSeries,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ordinary => "ordinary",
            Self::Weighted => "weighted",
            Self::Generalized => "generalized",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
            Self::NoiseWeighted => "noise-weighted",
            Self::Instrumental => "instrumental",
            Self::MaximumLikelihood => "maximum-likelihood",
            Self::Simultaneous => "simultaneous",
            Self::SimultaneousSeries => "simultaneous-series",
        }
    }

    /// The estimator for a case; none where it cannot be asked (less than two periods) or would take minutes.
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
            Self::MaximumLikelihood if case.motion.duration_s < 2.0 * PERIOD_S => return None,
            Self::MaximumLikelihood => Estimator::MaximumLikelihood(periods),
            Self::Simultaneous | Self::SimultaneousSeries if samples > MOST_FOR_MOTION => return None,
            Self::Simultaneous => Estimator::SplineMotion(SplineMotionSettings::default()),
            Self::SimultaneousSeries => {
                Estimator::Simultaneous(PeriodSettings { harmonics: Some(case.motion.harmonics), ..periods })
            }
        })
    }
}
