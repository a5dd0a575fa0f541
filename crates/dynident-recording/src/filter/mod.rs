//! Filters that know nothing of joints, and what they are built of.
//!
//! [`Decimator`] is the parallel filter: the same linear-phase low-pass and decimation for every column of the
//! regressor and the torque. [`cutoff()`] chooses a cut-off from the spectrum of the positions,
//! [`position_noise()`] reads off what noise is left below it, [`averaged_periods`] folds a periodic record.
//! Inside: second-order sections of the Butterworth low-pass, orthonormal polynomials, and the bridge over
//! the ends of a piece that a Fourier transform needs.

pub(crate) mod bridge;
pub(crate) mod cutoff;
mod decimation;
pub(crate) mod orthonormal;
mod periods;
mod position_noise;
pub(crate) mod sections;

pub use cutoff::{CutoffChoice, cutoff};
pub use decimation::{DecimationSettings, Decimator};
pub use periods::{AveragedPeriods, averaged_periods};
pub(crate) use position_noise::NoiseSpectra;
pub use position_noise::position_noise;
