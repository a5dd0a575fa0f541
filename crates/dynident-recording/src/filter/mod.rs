//! Filters that are independent of joints, and their components.
//!
//! [`Decimator`] is the parallel filter: the same linear-phase low-pass and decimation for all columns of the regressor
//! and for the torque. [`cutoff()`] chooses a cut-off from the spectrum of the positions, [`position_noise()`]
//! estimates the remaining noise below it. Internal: second-order
//! sections of the Butterworth low-pass, orthonormal polynomials, and the bridge over the ends of a piece for a Fourier
//! transform.

pub(crate) mod bridge;
pub(crate) mod cutoff;
mod decimation;
pub(crate) mod orthonormal;
mod position_noise;
pub(crate) mod sections;

pub use cutoff::{CutoffChoice, CutoffSettings, cutoff, cutoff_within};
pub use decimation::{DecimationSettings, Decimator};
pub(crate) use position_noise::NoiseSpectra;
pub use position_noise::position_noise;
