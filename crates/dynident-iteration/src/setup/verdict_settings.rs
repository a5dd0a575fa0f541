use dynident_simulation::{SimulationError, require};

/// Thresholds of the verdict on a run and on its estimate. They are not part of study files.
#[derive(Clone, Debug, PartialEq)]
pub struct VerdictSettings {
    /// Largest share of a joint's samples at the drive's limit, 0 to 1. Default 0.002: a limit that is touched briefly
    /// at a reversal has no effect.
    pub max_clipped_share: f64,
    /// Smallest share of the torque inside the 95 % band of a prediction, 0 to 1. Default 0.85: residuals that are
    /// correlated over seconds let the share vary by some percent; a prediction that is off by its noise throughout has
    /// 0.83.
    pub min_inside_share: f64,
    /// Ratio of the lag difference of two runs to its 95 % interval above which the lags differ. Default 1.5: with six
    /// joints and some runs, ratios above 1 occur by chance.
    pub min_lag_change_ratio: f64,
    /// Largest ratio of a good run's error bars to those of an earlier estimate for which the new estimate is used.
    /// Default 3.
    pub max_width_ratio_of_good_run: f64,
    /// Largest ratio of a rejected run's error bars to those of a good run for which its estimate is used. Default 0.5.
    pub max_width_ratio_of_rejected_run: f64,
    /// Share of a joint's samples at the drive's limit above which a run that left its trajectory proves that no
    /// controller can follow it, 0 to 1. Default 0.05.
    pub min_saturated_share: f64,
    /// Bounds of the largest tracking error with which a joint follows its trajectory, rad (m): half of the joint's
    /// range of motion, within these bounds. Default 0.1 and 1: beyond them other effects may occur than along the
    /// motion (end stops, other contacts, friction at other speeds).
    pub following_error_bounds: [f64; 2],
    /// Detection of a link length that differs from the robot description.
    pub lengths: LengthSettings,
}

impl Default for VerdictSettings {
    fn default() -> Self {
        Self {
            max_clipped_share: 2e-3,
            min_inside_share: 0.85,
            min_lag_change_ratio: 1.5,
            max_width_ratio_of_good_run: 3.0,
            max_width_ratio_of_rejected_run: 0.5,
            min_saturated_share: 0.05,
            following_error_bounds: [0.1, 1.0],
            lengths: LengthSettings::default(),
        }
    }
}

impl VerdictSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Shares outside of 0 to 1, ratios that are not positive, bounds in the wrong order.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let shares = [
            ("verdict.max_clipped_share", self.max_clipped_share),
            ("verdict.min_inside_share", self.min_inside_share),
            ("verdict.min_saturated_share", self.min_saturated_share),
        ];
        for (name, share) in shares {
            require((0.0..=1.0).contains(&share), name, share, "give a share, 0 to 1")?;
        }
        let ratios = [
            ("verdict.min_lag_change_ratio", self.min_lag_change_ratio),
            ("verdict.max_width_ratio_of_good_run", self.max_width_ratio_of_good_run),
            ("verdict.max_width_ratio_of_rejected_run", self.max_width_ratio_of_rejected_run),
        ];
        for (name, ratio) in ratios {
            require(ratio > 0.0 && ratio.is_finite(), name, ratio, "give a positive ratio")?;
        }
        let [low, high] = self.following_error_bounds;
        let fix = "give two distances in ascending order, rad (m)";
        require(0.0 < low && low <= high && high.is_finite(), "verdict.following_error_bounds", low, fix)?;
        self.lengths.validate()
    }
}

/// Thresholds of the detection of a link length that differs from the robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct LengthSettings {
    /// Smallest relative change that is reported. Default 0.01: bearings and dimension tables are not more accurate.
    pub min_change: f64,
    /// Largest ratio of a joint's residual with the other length to that with the described length. Default 0.8:
    /// unmodelled friction is not mistaken for a length, because residuals vary by some tenths of a percent per fitted
    /// parameter by chance.
    pub max_residual_ratio: f64,
    /// Smallest share of the squared residuals of all joints that another length explains, 0 to 1. Default 0.12: a
    /// length affects several joints, whereas unmodelled friction in one light joint is explained by a length in that
    /// joint only. A correct arm of the test campaign reaches 0.06.
    pub min_explained_share: f64,
}

impl Default for LengthSettings {
    fn default() -> Self {
        Self { min_change: 0.01, max_residual_ratio: 0.8, min_explained_share: 0.12 }
    }
}

impl LengthSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Numbers outside of 0 to 1.
    pub fn validate(&self) -> Result<(), SimulationError> {
        for (name, value) in [
            ("verdict.lengths.min_change", self.min_change),
            ("verdict.lengths.max_residual_ratio", self.max_residual_ratio),
            ("verdict.lengths.min_explained_share", self.min_explained_share),
        ] {
            require((0.0..=1.0).contains(&value), name, value, "give 0 to 1")?;
        }
        Ok(())
    }
}
