//! Filtered rows of regressor and torque from recordings.
//!
//! A [`Recording`] is a log or a motion in memory. [`Logs`] contains all recordings of a task with one cut-off. A
//! [`LogPass`] reads one of them and sends its rows to a [`RowConsumer`]. A recording that fits into memory is read and
//! differentiated once, for any number of passes. Estimators and examinations are in `dynident-identification`.

#![forbid(unsafe_code)]

mod excerpt;
mod execution;
mod logs;
mod progress;
mod recording;
mod regressor_model;
mod rows;

pub use excerpt::excerpts;
pub use execution::Execution;
pub use logs::{LogSpectrum, Logs, RowSettings, of_role};
pub use progress::{Progress, Silent};
pub use recording::{LogError, MotionRecord, Recording, Role, Samples, Whole};
pub use regressor_model::RegressorModel;
pub use rows::{
    JointFilters, JointRows, KeptLog, LogPass, LogStatistics, PANEL_SAMPLES, ParallelFilterError,
    ParallelFilterSettings, RawSamples, RowBlock, RowBuilder, RowConsumer, VelocityHistogram, divide_by_coverage,
    in_model_order, motion_band_hz, noise_factors, predicted_torque, set_aside,
};
