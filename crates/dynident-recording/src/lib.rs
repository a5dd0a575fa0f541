//! **From a log to a motion**: sources of rows, mapping of columns, units, clock and gaps, filters, differentiators,
//! and the parallel filter that decimates regressor and torque. All values are in SI units.
//!
//! # Tour
//!
//! | task | use |
//! | --- | --- |
//! | q, dq, ddq and torque of a log file | [`MotionStream::open`] with a [`LogFormat`] |
//! | the same for arrays in memory | [`JointSamples`], or [`MemoryLog`] for a table with a format |
//! | the same for any other source of rows | a type that implements [`LogSource`], converted to a [`Log`] |
//! | the samples as logged, without a filter | [`LogReader`] |
//! | commanded and measured positions as logged | [`Log::commanded_motion`], [`check_commands`] |
//! | another differentiator | [`DifferentiatorSettings`] (list: [`derivative`]); a new one: [`Differentiator`] |
//! | differentiators that use the commanded motion | [`Reference`], [`MotionStream::following`] |
//! | gaps, dead channels, lags and other findings | [`MotionStream::report`], [`report`] |
//! | a cut-off from the data | [`cutoff()`] |
//! | the same filter and decimation for regressor and torque | [`Decimator`] |
//!
//! Data flow: [`LogSource`] → [`LogReader`] (units, signs, gears, ranges, missing values) → [`RawBlock`]s → outliers
//! and held samples marked ([`RejectedSamples`]) → pieces on a uniform clock ([`clock`]) → [`Differentiator`] →
//! [`MotionBlock`]s. Memory does not grow with the log. Joints are identified by name only.
//!
//! # A file
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
//!
//! # Arrays
//!
//! ```
//! use dynident_recording::{DifferentiatorSettings, JointSamples, MotionBlock, MotionSettings, MotionStream};
//!
//! let q: Vec<f64> = (0..500).map(|i| (f64::from(i) * 0.01).sin()).collect();
//! let tau = vec![2.0; 500];
//! let log = JointSamples::at_rate(500.0, vec![q], vec![tau]).into_log("bench run", &["elbow".to_owned()])?;
//! let differentiator = DifferentiatorSettings::SavitzkyGolay { window: 21, degree: 4 };
//! let settings = MotionSettings { differentiator, ..MotionSettings::default() };
//! let mut stream = MotionStream::new(&log, &settings)?;
//! let mut block = MotionBlock::default();
//! assert!(stream.next_block(&mut block)?);
//! assert!((block.dq[0] - 5.0).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod cleaning;
pub mod clock;
pub mod command_check;
mod commanded;
pub mod derivative;
mod error;
pub mod filter;
pub mod log;
mod motion;
mod place;
mod quantisation;
pub mod reference;
pub mod report;

pub use cleaning::{CleaningSettings, Reason, RejectedSamples};
pub use command_check::{CommandCheckSettings, CommandFinding, check_commands};
pub use commanded::CommandedMotion;
pub use derivative::{Derivatives, Differentiator, DifferentiatorSettings, Place, SampleRanges};
pub use dynident_formats::{FileError, FileFormat};
pub use error::{FilterError, FormatError, RecordingError};
pub use filter::{DecimationSettings, Decimator, cutoff, position_noise};
pub use log::{
    FileLog, IgnoredTorque, JointSamples, Log, LogFormat, LogReader, LogSource, LogTable, MemoryLog, RawBlock,
};
pub use motion::{ImportLimits, MotionBlock, MotionSettings, MotionStream, unsettled_samples};
pub use place::LogPlace;
pub use reference::{LogisticPath, Reference, ReferenceSettings};
pub use report::{Finding, ImportReport, Level, best_lag};
