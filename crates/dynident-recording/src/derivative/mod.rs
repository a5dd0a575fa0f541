//! Differentiators, which compute velocity dq and acceleration ddq from positions q.
//!
//! [`Differentiator`] is the interface, which callers can also implement; [`DifferentiatorSettings`] lists the
//! differentiators in this crate:
//!
//! * filters and local fits, which process a long log in pieces: [`ButterworthZeroPhase`] (the default), [`LowPass`],
//!   [`CentralDifferences`], [`SmoothedDifferences`], [`SavitzkyGolay`], [`FivePointCubic`];
//! * fits to a whole piece: [`FourierFit`], [`VelocitySeries`], [`FrequencyDomain`];
//! * differentiators that use the commanded motion: [`PositionMap`], [`TimeWarp`], [`Deviation`].
//!
//! To add a differentiator, add a file here and a variant of [`DifferentiatorSettings`].

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
