use dynident_simulation::{SimulationError, require};

/// Thresholds for accepting a run and its estimate. They are not part of study files.
#[derive(Clone, Debug, PartialEq)]
pub struct VerdictSettings {
    /// Largest share of a joint's samples at the drive's torque limit, 0 to 1. Default 0.002: a limit that is reached
    /// briefly at a reversal has no effect.
    pub max_clipped_share: f64,
    /// Smallest share of the torque inside the 95 % band of a prediction, 0 to 1. Default 0.85. Residuals that are
    /// correlated over seconds change the share by some percent; if the error of a prediction is everywhere as large
    /// as the noise, the share is 0.83.
    pub min_inside_share: f64,
    /// The lags of two runs differ if the ratio of their difference to its 95 % interval exceeds this. Default 1.5:
    /// with six joints and some runs, ratios above 1 occur by chance.
    pub min_lag_change_ratio: f64,
    /// Largest ratio of the error bars of a good run to those of an earlier estimate with which the new estimate is
    /// used. Default 3.
    pub max_width_ratio_of_good_run: f64,
    /// Largest ratio of the error bars of a rejected run to those of a good run with which its estimate is used.
    /// Default 0.5.
    pub max_width_ratio_of_rejected_run: f64,
    /// If a run left its trajectory and more than this share of a joint's samples is at the drive's torque limit, no
    /// controller can follow the trajectory; 0 to 1. Default 0.05.
    pub min_saturated_share: f64,
    /// Bounds of the tracking error up to which a joint follows its trajectory, rad (m): half of the joint's range of
    /// motion, within these bounds. Default 0.1 and 1. Farther from the trajectory other effects can occur (end
    /// stops, other contacts, friction at other velocities).
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
    /// Smallest relative change that is reported. Default 0.01: bearings and tables of dimensions are not more
    /// accurate.
    pub min_change: f64,
    /// Largest ratio of a joint's residual with the other length to the residual with the length in the description.
    /// Default 0.8, so that unmodelled friction is not mistaken for a length. By chance, residuals decrease by some
    /// tenths of a percent per fitted parameter.
    pub max_residual_ratio: f64,
    /// Smallest share of the squared residuals of all joints that another length must explain, 0 to 1. Default 0.12.
    /// A wrong length affects several joints, whereas a length that compensates unmodelled friction of one light
    /// joint improves only this joint. A correct arm in the tests reaches 0.06.
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
