//! Filters that do not depend on joints, and their components.
//!
//! [`Decimator`] is the parallel filter: the same linear-phase low-pass and decimation for all columns of the regressor
//! and for the torque. [`cutoff()`] selects a cut-off from the spectrum of the positions, and [`position_noise()`]
//! estimates the noise that remains below it. Internal modules: second-order sections of the Butterworth low-pass,
//! orthonormal polynomials, and the smooth transition between the ends of a piece for a Fourier transform.

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
