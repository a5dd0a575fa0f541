//! Thresholds of `check`.

use crate::error::{Expected, StudyError};
use dynident_recording::CommandCheckSettings;

/// Thresholds of the findings of [`check_with`](crate::check_with).
#[derive(Clone, Debug, PartialEq)]
pub struct CheckSettings {
    /// Largest unexplained share of all torque, 0 to 1, at which a mistake is reported. Default 0.3; most real data
    /// sets have 0.1.
    pub max_unexplained_share: f64,
    /// For noisy logs: a mistake is also reported if its unexplained share is at most this multiple of the
    /// unexplained share of the study as written. Default 0.75.
    pub max_unexplained_ratio: f64,
    /// Unexplained share of all torque above which torque and motion are treated as unrelated. Default 0.92: a
    /// correct study with a noisy log of a slow pendulum has 0.81.
    pub min_unrelated_share: f64,
    /// Share of all torque that neither the best hypothesis nor noise explains, above which `check` warns. Default
    /// 0.6, like the limit of `identify`. The finding is a warning and not a PROBLEM, because a correct study with a
    /// noisy log of a slow pendulum has 0.80.
    pub max_unexplained_beyond_noise: f64,
    /// The same share of the torque of one joint above which most of it is unexplained. Default 0.75. More than half of
    /// the joints, and at least three, are a PROBLEM: noise and friction of honest logs spoil single weak joints.
    pub max_unexplained_of_joint: f64,
    /// Largest ratio between joint factors for one common unit or motor currents. Default 10: motor constants times
    /// gear ratios of one arm differ by at most 5.
    pub max_factor_ratio: f64,
    /// Number of equations per parameter below which the logs are too short. Default 2.
    pub too_few_equations: usize,
    /// Number of equations per parameter below which `check` warns of short logs. Default 3: ten seconds of slow
    /// motion have 2.7, and about half of the fits to such logs are usable.
    pub few_equations: usize,
    /// Thresholds of the findings about commanded positions.
    pub commands: CommandCheckSettings,
}

impl Default for CheckSettings {
    fn default() -> Self {
        Self {
            max_unexplained_share: 0.3,
            max_unexplained_ratio: 0.75,
            min_unrelated_share: 0.92,
            max_unexplained_beyond_noise: 0.6,
            max_unexplained_of_joint: 0.75,
            max_factor_ratio: 10.0,
            too_few_equations: 2,
            few_equations: 3,
            commands: CommandCheckSettings::default(),
        }
    }
}

impl CheckSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is out of range, with its value.
    pub fn validate(&self) -> Result<(), StudyError> {
        Expected::Range(0.0, 1.0).check("max_unexplained_share", self.max_unexplained_share)?;
        Expected::Range(0.0, 1.0).check("max_unexplained_ratio", self.max_unexplained_ratio)?;
        Expected::Range(0.0, 1.0).check("min_unrelated_share", self.min_unrelated_share)?;
        Expected::Range(0.0, 1.0).check("max_unexplained_beyond_noise", self.max_unexplained_beyond_noise)?;
        Expected::Range(0.0, 1.0).check("max_unexplained_of_joint", self.max_unexplained_of_joint)?;
        Expected::Range(1.0, 1e6).check("max_factor_ratio", self.max_factor_ratio)?;
        let few = self.few_equations as f64;
        Expected::Range(0.0, few).check("too_few_equations", self.too_few_equations as f64)?;
        Ok(self.commands.validate()?)
    }
}
