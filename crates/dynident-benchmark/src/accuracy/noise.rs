//! Noise levels of recordings: those of BIRDy's protocol, and others that are not white Gaussian.

use serde::Serialize;

/// Noise of a recording, the same for all joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NoiseLevel {
    /// Name on the command line.
    pub name: &'static str,
    /// Standard deviation of a position's white noise, degrees.
    pub position_std_deg: f64,
    /// Encoder counts per turn of the joint; `None` for an ideal encoder.
    pub encoder_steps: Option<u32>,
    /// Standard deviation of a torque's noise, Nm.
    pub torque_std_nm: f64,
    /// Correlation of a torque's noise at successive samples (1 kHz), a first-order autoregression; 0 for white
    /// noise.
    pub torque_correlation: f64,
    /// Share of torque samples with an outlier.
    pub outlier_share: f64,
    /// Size of an outlier, either sign, in standard deviations of the torque's noise.
    pub outlier_size: f64,
}

impl NoiseLevel {
    /// Standard deviation of an encoder position, rad: noise and rounding to encoder steps.
    pub(super) fn position_std_rad(&self) -> f64 {
        let step = self.encoder_steps.map_or(0.0, |steps| core::f64::consts::TAU / f64::from(steps));
        self.position_std_deg.to_radians().hypot(step / 12.0_f64.sqrt())
    }
}

const fn white(name: &'static str, position_std_deg: f64, torque_std_nm: f64) -> NoiseLevel {
    NoiseLevel {
        name,
        position_std_deg,
        encoder_steps: None,
        torque_std_nm,
        torque_correlation: 0.0,
        outlier_share: 0.0,
        outlier_size: 0.0,
    }
}

/// The registry: one line per level. The first five are BIRDy's (Leboutet et al., Applied Sciences 11 (2021) 4303).
pub const NOISE_LEVELS: &[NoiseLevel] = &[
    white("standard", 1e-3, 0.05),
    white("low-position", 1e-4, 0.05),
    white("high-position", 1e-2, 0.05),
    white("high-torque", 1e-3, 0.10),
    white("both-high", 1e-2, 0.10),
    NoiseLevel { torque_correlation: 0.9, ..white("coloured", 1e-3, 0.05) },
    NoiseLevel { torque_correlation: 0.99, ..white("long-coloured", 1e-3, 0.05) },
    NoiseLevel { encoder_steps: Some(1 << 17), ..white("quantised", 0.0, 0.05) },
    NoiseLevel { outlier_share: 0.05, outlier_size: 20.0, ..white("outliers", 1e-3, 0.05) },
];
