//! **What was measured?** From log files to a motion: readers, column mapping, units, clock and gaps, filters, every way from q
//! to dq and ddq, and the parallel filter that decimates regressor and torque alike.
//!
//! [`LogFormat`] describes a log (it is part of the study file), [`MotionStream`] turns it into blocks of q, dq, ddq and torque on a uniform
//! clock with memory that does not grow with the log, and [`ImportReport`] tells what was found on the way. Joints are known
//! by name only; what moves them is other rooms' business. All values are SI.
//!
//! ```
//! use dynident_recording::{LogFormat, MotionBlock, MotionSettings, MotionStream};
//! # let folder = tempfile::tempdir()?;
//! # let file = folder.path().join("log.csv");
//! # let rows = (0..200).map(|i| format!("{},{},{}\n", i, (f64::from(i) * 0.02).sin() * 57.3, 1.5));
//! # std::fs::write(&file, "t_ms,elbow_deg,elbow_Nm\n".to_owned() + &rows.collect::<String>())?;
//! let format: LogFormat = toml::from_str(
//!     r#"
//!     time = { column = "t_ms", unit = "ms" }
//!     position = { columns = ["elbow_deg"], unit = "deg" }
//!     torque = { columns = ["elbow_Nm"], unit = "N m" }
//!     "#,
//! )?;
//! let mut stream = MotionStream::open(&format, &file, &["elbow".to_owned()], &MotionSettings::default())?;
//! let mut block = MotionBlock::default();
//! while stream.next_block(&mut block)? {
//!     for (dq, tau) in block.joint(&block.dq, 0).iter().zip(block.joint(&block.tau, 0)) {
//!         assert!(dq.is_finite() && (tau - 1.5).abs() < 1e-12);
//!     }
//! }
//! let report = stream.report();
//! assert_eq!((report.rows, report.rate_hz.round()), (200, 1000.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bridge;
mod butterworth;
mod central_differences;
mod channel_checks;
pub mod clock;
mod comparison;
pub mod cutoff;
mod decimation;
mod deviation;
mod differentiator;
mod error;
mod five_point_cubic;
mod fourier_fit;
mod frequency_domain;
mod harmonic_fit;
mod lag;
mod literal_map;
mod log;
mod logistic_path;
mod low_pass;
mod marks;
mod orthonormal;
mod periods;
mod position_map;
mod reference;
mod reference_lag;
mod reference_settings;
mod report;
mod resampler;
mod savitzky_golay;
mod sections;
mod segments;
mod smoothed_differences;
mod speed_series;
mod stream;
mod stroke;
#[cfg(test)]
mod test_signals;
mod time_checks;
mod time_warp;

pub use butterworth::ButterworthZeroPhase;
pub use central_differences::CentralDifferences;
pub use channel_checks::ChannelReport;
pub use clock::Clock;
pub use comparison::DerivativeComparison;
pub use cutoff::{CutoffChoice, cutoff};
pub use decimation::{DecimationSettings, Decimator};
pub use deviation::Deviation;
pub use differentiator::{Derivatives, Differentiator, DifferentiatorSettings, Place};
pub use error::{FilterError, FormatError, RecordingError};
pub use five_point_cubic::FivePointCubic;
pub use fourier_fit::FourierFit;
pub use frequency_domain::{Ends, FrequencyDomain};
pub use lag::{Lag, best_lag};
pub use literal_map::LiteralMap;
pub use log::{
    ChannelGroup, ClockRule, ColumnRef, Columns, Header, JointSamples, LinesDropped, Log, LogFormat, LogPlace,
    LogReader, LogSource, LogTable, MemoryLog, Missing, OneOrMany, Quantity, RawBlock, SampleClock, TextLog,
    TimeColumn, TimeUnit, si_factor, unit_names,
};
pub use logistic_path::LogisticPath;
pub use low_pass::LowPass;
pub use periods::{AveragedPeriods, averaged_periods};
pub use position_map::PositionMap;
pub use reference::Reference;
pub use reference_lag::{StrokeLag, stroke_lags};
pub use reference_settings::ReferenceSettings;
pub use report::{Finding, Gap, ImportReport, Level, Steps};
pub use savitzky_golay::SavitzkyGolay;
pub use sections::{Section, butterworth_low_pass};
pub use smoothed_differences::SmoothedDifferences;
pub use speed_series::SpeedSeries;
pub use stream::{MotionBlock, MotionSettings, MotionStream};
pub use stroke::Stroke;
pub use time_warp::TimeWarp;
