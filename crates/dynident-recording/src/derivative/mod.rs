//! From q to dq and ddq.
//!
//! [`Differentiator`] is the interface, also for differentiators that this crate does not know;
//! [`DifferentiatorSettings`] is the registry of those that it does. They come in three kinds:
//!
//! * filters and local fits, which work through a long log in pieces: [`ButterworthZeroPhase`] (the default),
//!   [`LowPass`], [`CentralDifferences`], [`SmoothedDifferences`], [`SavitzkyGolay`], [`FivePointCubic`];
//! * fits to a whole piece: [`FourierFit`], [`VelocitySeries`], [`FrequencyDomain`];
//! * differentiators that use the commanded motion: [`PositionMap`], [`TimeWarp`], [`Deviation`].
//!
//! A further differentiator is a file here and its variant of [`DifferentiatorSettings`]; the compiler asks for the
//! rest.

mod butterworth;
mod central_differences;
mod deviation;
pub(crate) mod differentiator;
mod five_point_cubic;
mod fourier_fit;
mod frequency_domain;
mod function;
mod harmonic_fit;
mod position_map;
mod reference_lag;
mod savitzky_golay;
mod settings;
mod smoothed_differences;
#[cfg(test)]
pub(crate) mod test_signals;
mod time_warp;
mod velocity_series;

pub use butterworth::{ButterworthZeroPhase, LowPass};
pub use central_differences::CentralDifferences;
pub use deviation::Deviation;
pub use differentiator::{Derivatives, Differentiator, Place, SampleRanges};
pub use five_point_cubic::FivePointCubic;
pub use fourier_fit::FourierFit;
pub use frequency_domain::{Ends, FrequencyDomain};
pub use function::DifferentiatorCode;
pub use position_map::PositionMap;
pub use savitzky_golay::SavitzkyGolay;
pub use settings::DifferentiatorSettings;
pub use smoothed_differences::SmoothedDifferences;
pub use time_warp::TimeWarp;
pub use velocity_series::VelocitySeries;
