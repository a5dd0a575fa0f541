//! Thresholds of decisions and tests.

use thiserror::Error;

/// Default maximum lag, in seconds for an arm of usual size; drives and buses stay below.
pub(crate) const LONGEST_DELAY_S: f64 = 0.1;

/// A threshold outside of its range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("thresholds.{name} = {value}: give a finite number of at least {minimum}")]
pub struct ThresholdError {
    /// Name of the threshold.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Smallest valid value.
    pub minimum: f64,
}

/// Checks that every value is finite and not below its minimum.
fn check(values: &[(&'static str, f64, f64)]) -> Result<(), ThresholdError> {
    match values.iter().find(|(_, value, minimum)| !(value.is_finite() && value >= minimum)) {
        Some(&(name, value, minimum)) => Err(ThresholdError { name, value, minimum }),
        None => Ok(()),
    }
}

/// Thresholds of the decisions before the last fit, and of the doubt about a study.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct DecisionThresholds {
    /// Test for drive inertia.
    pub drive_inertia: DriveInertiaThresholds,
    /// Selection of cut-offs.
    pub cutoff: CutoffThresholds,
    /// Significance of friction terms.
    pub friction: FrictionThresholds,
    /// Reasons to test alternative hypotheses.
    pub doubt: DoubtThresholds,
}

/// Threshold of the test for drive inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DriveInertiaThresholds {
    /// Standard deviations from which drive inertia is accepted. 3.0 by default: by chance once in 740 studies.
    /// Accepting a drive that is absent adds a column and widens the other error bars; missing one loses its torque. A
    /// stricter limit would exclude a single drive whose deviation has three degrees of freedom: thirty of its standard
    /// deviations are 3.7 normal ones.
    pub min_std: f64,
}

impl Default for DriveInertiaThresholds {
    fn default() -> Self {
        Self { min_std: 3.0 }
    }
}

/// Thresholds for the selection of cut-offs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CutoffThresholds {
    /// Ratio from which two cut-offs are different enough to select friction again. 1.2 by default; candidates are √2
    /// apart.
    pub min_friction_ratio: f64,
    /// Ratio of velocity noise (standard deviation) to step width above which noise smears the step. 0.05 by default;
    /// noise widens a smooth step by half the square of this ratio.
    pub max_step_noise_ratio: f64,
    /// Ratio of the regressor's cut-off to that of the instruments if both are automatic. 2.0 by default: positions are
    /// hardly smoothed inside the instruments' band.
    pub instruments_ratio: f64,
    /// Ratio of new to old cut-off above which the old one is kept after `auto` selected instruments. 0.8 by default.
    pub max_lowered_ratio: f64,
}

impl Default for CutoffThresholds {
    fn default() -> Self {
        Self { min_friction_ratio: 1.2, max_step_noise_ratio: 0.05, instruments_ratio: 2.0, max_lowered_ratio: 0.8 }
    }
}

/// Thresholds for friction terms.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FrictionThresholds {
    /// Critical values of Wald's test for a further term with 1, 2 and 3 degrees of freedom. By default χ² at 5 %:
    /// stricter tests drop terms that improve the prediction although they are not the true ones.
    pub term_chi_square: [f64; 3],
    /// The same for terms that only a second selection from the same motion adds. By default χ² at 1 %, because every
    /// term is then tested twice.
    pub second_selection_chi_square: [f64; 3],
    /// Minimum sum of squares of a Stribeck term's column, `Σ e^{-2|q̇/v_s|^δ}`, for supporting rows. 1.0 by default,
    /// the value of one row at rest.
    pub min_column_square_sum: f64,
    /// Minimum gain of a law with memory or with load-dependent friction: the decrease of the joint's root mean square
    /// error in cross-validation, as a share of the error with the best laws without memory and load. 0.02 by default:
    /// smaller gains disappear in the differences between logs, and not every controller and simulator can hold these
    /// laws.
    pub min_gain_ratio: f64,
}

impl Default for FrictionThresholds {
    fn default() -> Self {
        Self {
            term_chi_square: [3.84, 5.99, 7.81],
            second_selection_chi_square: [6.63, 9.21, 11.34],
            min_column_square_sum: 1.0,
            min_gain_ratio: 0.02,
        }
    }
}

/// Reasons to test alternative hypotheses about the logs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DoubtThresholds {
    /// Mean over joints of `ln(residual of a consistent robot / residual of separate joint parameters)`. 0.1 by
    /// default; simulated and well-described robots stay below 0.05.
    pub max_log_residual_ratio: f64,
    /// Minimum number of rows per parameter of a joint. 4/3 by default; with fewer rows the separate fit follows the
    /// noise.
    pub min_rows_per_parameter: f64,
    /// Ratio of held-out residual to noise of the fit. 1.7 by default; friction that changes with the motion causes
    /// less.
    pub max_held_out_ratio: f64,
}

impl Default for DoubtThresholds {
    fn default() -> Self {
        Self { max_log_residual_ratio: 0.1, min_rows_per_parameter: 4.0 / 3.0, max_held_out_ratio: 1.7 }
    }
}

impl DecisionThresholds {
    /// Checks the values.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), ThresholdError> {
        let Self { drive_inertia, cutoff, friction, doubt } = self;
        check(&[
            ("drive_inertia.min_std", drive_inertia.min_std, 0.0),
            ("cutoff.min_friction_ratio", cutoff.min_friction_ratio, 1.0),
            ("cutoff.max_step_noise_ratio", cutoff.max_step_noise_ratio, 0.0),
            ("cutoff.instruments_ratio", cutoff.instruments_ratio, 1.0),
            ("cutoff.max_lowered_ratio", cutoff.max_lowered_ratio, 0.0),
            ("friction.min_column_square_sum", friction.min_column_square_sum, 0.0),
            ("friction.min_gain_ratio", friction.min_gain_ratio, 0.0),
            ("doubt.max_log_residual_ratio", doubt.max_log_residual_ratio, 0.0),
            ("doubt.min_rows_per_parameter", doubt.min_rows_per_parameter, 1.0),
            ("doubt.max_held_out_ratio", doubt.max_held_out_ratio, 0.0),
        ])?;
        let term = friction.term_chi_square.map(|value| ("friction.term_chi_square", value, 1e-9));
        let second = friction.second_selection_chi_square;
        check(&term)?;
        check(&second.map(|value| ("friction.second_selection_chi_square", value, 1e-9)))
    }
}

/// Thresholds of the estimation.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EstimationThresholds {
    /// Selection of the lag.
    pub lag: LagThresholds,
    /// Test for noise in the regressor.
    pub noise: NoiseThresholds,
    /// Variation between logs.
    pub log_variation: LogVariationThresholds,
    /// Requirements on the motion of the simultaneous method.
    pub motion: MotionThresholds,
    /// Drive gains.
    pub gain: GainThresholds,
}

/// Thresholds for the lag between motion and torque.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LagThresholds {
    /// Minimum shift of a parameter, relative to its error bar, for a lag to be compensated. 0.3 by default.
    pub min_parameter_shift: f64,
    /// Standard deviations of χ² above which one common lag is rejected. 4.0 by default.
    pub max_scatter_std: f64,
    /// Minimum share of the squared residual that a joint's own lag explains for a separate lag. 0.5 by default;
    /// unmodelled friction looks like a lag but explains less.
    pub min_own_share: f64,
    /// Prior standard deviation of a lag of a drive or a bus, in seconds for an arm of usual size
    /// ([`CharacteristicScale`](dynident_model::CharacteristicScale)). 5 ms by default: drives and buses are as fast as
    /// their machine needs.
    pub prior_std_s: f64,
    /// Maximum lag in the search, in seconds for an arm of usual size. 0.1 s by default; drives and buses stay below.
    pub max_lag_s: f64,
}

impl Default for LagThresholds {
    fn default() -> Self {
        Self {
            min_parameter_shift: 0.3,
            max_scatter_std: 4.0,
            min_own_share: 0.5,
            prior_std_s: 5.0e-3,
            max_lag_s: LONGEST_DELAY_S,
        }
    }
}

/// Thresholds for noise in the regressor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NoiseThresholds {
    /// Coefficient of the torque on the fast motion below which the fast motion is mostly noise. 0.75 by default.
    pub max_followed: f64,
    /// Maximum difference of two equal estimates, in error bars of the better one, root mean square over the
    /// parameters. 1.5 by default; two independent estimates with the same error bars differ by 1.4.
    pub max_contrast_rms: f64,
    /// The same for the largest difference. 3.0 by default.
    pub max_contrast: f64,
    /// Share of the torque of the fast motion above which lower bands are always tried. 0.1 by default; the instruments
    /// of the first band may then contain much noise themselves.
    pub max_fast_torque_share: f64,
    /// Minimum shift of the parameters in error bars (root mean square) for noise to matter; the shift is at most
    /// `√(Σ_j ‖V_j θ‖² / σ_j² / p)`. 0.3 by default, because large noise also reduces θ and this bound.
    pub min_parameter_shift: f64,
}

impl Default for NoiseThresholds {
    fn default() -> Self {
        Self {
            max_followed: 0.75,
            max_contrast_rms: 1.5,
            max_contrast: 3.0,
            max_fast_torque_share: 0.1,
            min_parameter_shift: 0.3,
        }
    }
}

/// Thresholds for the variation of parameters between logs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LogVariationThresholds {
    /// Minimum number of parameter pairs to estimate the variation of a kind. 5 by default.
    pub min_pairs: usize,
    /// Minimum degrees of freedom of a single log's variance. 4.5 by default.
    pub min_degrees_of_freedom: f64,
    /// Upper limit of z² of one pair, relative to the typical value of its kind. 25.0 by default: one wrong log is not
    /// a variation of all logs.
    pub max_relative_square: f64,
}

impl Default for LogVariationThresholds {
    fn default() -> Self {
        Self { min_pairs: 5, min_degrees_of_freedom: 4.5, max_relative_square: 25.0 }
    }
}

/// Requirements on the motion of the simultaneous and maximum-likelihood methods.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MotionThresholds {
    /// Maximum residual of the positions from the Fourier series relative to their size. 0.1 by default.
    pub max_series_residual: f64,
    /// Minimum size of a motion, rad (m). 1e-4 by default.
    pub min_motion: f64,
    /// Maximum ratio of filtered residuals to those of weighted least squares for the spline fit. 1.25 by default.
    /// Above it the correlated part of the torque residuals is model error, and the whitening filter has removed a part
    /// of the motion as noise.
    pub max_spline_residual_ratio: f64,
}

impl Default for MotionThresholds {
    fn default() -> Self {
        Self { max_series_residual: 0.1, min_motion: 1e-4, max_spline_residual_ratio: 1.25 }
    }
}

/// Threshold for drive gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GainThresholds {
    /// Maximum relative half width of a gain's interval for a determined gain. 0.5 by default.
    pub max_half_width: f64,
}

impl Default for GainThresholds {
    fn default() -> Self {
        Self { max_half_width: 0.5 }
    }
}

impl EstimationThresholds {
    /// Checks the values.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), ThresholdError> {
        let Self { lag, noise, log_variation, motion, gain } = self;
        check(&[
            ("lag.min_parameter_shift", lag.min_parameter_shift, 0.0),
            ("lag.max_scatter_std", lag.max_scatter_std, 0.0),
            ("lag.min_own_share", lag.min_own_share, 0.0),
            ("lag.prior_std_s", lag.prior_std_s, 1e-9),
            ("lag.max_lag_s", lag.max_lag_s, 1e-9),
            ("noise.max_followed", noise.max_followed, 0.0),
            ("noise.max_contrast_rms", noise.max_contrast_rms, 0.0),
            ("noise.max_contrast", noise.max_contrast, 0.0),
            ("noise.max_fast_torque_share", noise.max_fast_torque_share, 0.0),
            ("noise.min_parameter_shift", noise.min_parameter_shift, 0.0),
            ("log_variation.min_pairs", log_variation.min_pairs as f64, 1.0),
            ("log_variation.min_degrees_of_freedom", log_variation.min_degrees_of_freedom, 2.0),
            ("log_variation.max_relative_square", log_variation.max_relative_square, 0.0),
            ("motion.max_series_residual", motion.max_series_residual, 0.0),
            ("motion.min_motion", motion.min_motion, 0.0),
            ("motion.max_spline_residual_ratio", motion.max_spline_residual_ratio, 0.0),
            ("gain.max_half_width", gain.max_half_width, 0.0),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_values_that_are_not_finite_are_rejected() {
        let (decision, estimation) = (DecisionThresholds::default(), EstimationThresholds::default());
        assert!(decision.validate().is_ok() && estimation.validate().is_ok());
        let lag = LagThresholds { max_lag_s: f64::NAN, ..LagThresholds::default() };
        assert_eq!(EstimationThresholds { lag, ..estimation }.validate().unwrap_err().name, "lag.max_lag_s");
        let friction = FrictionThresholds { term_chi_square: [3.84, 0.0, 7.81], ..FrictionThresholds::default() };
        assert!(DecisionThresholds { friction, ..decision }.validate().is_err());
    }
}
