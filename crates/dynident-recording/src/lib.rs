//! **What was measured?** Log readers, units, clocks, filters, and every way from q to dq and ddq.
#![forbid(unsafe_code)]

mod butterworth;
mod central_differences;
mod channel_checks;
pub mod clock;
mod column_pattern;
mod comparison;
pub mod cutoff;
mod decimation;
mod differentiator;
mod error;
mod format;
mod lag;
mod lines;
mod mapping;
mod reader;
mod report;
mod resampler;
mod savitzky_golay;
mod sections;
mod segments;
mod stream;
mod table;
mod time_checks;
mod units;

pub use butterworth::ButterworthZeroPhase;
pub use central_differences::CentralDifferences;
pub use channel_checks::ChannelReport;
pub use clock::Clock;
pub use comparison::DerivativeComparison;
pub use cutoff::{CutoffChoice, cutoff};
pub use decimation::{DecimationSettings, Decimator};
pub use differentiator::{Derivatives, Differentiator, DifferentiatorSettings};
pub use error::{FilterError, FormatError, RecordingError};
pub use format::{
    ChannelGroup, ClockRule, ColumnRef, Columns, Header, LogFormat, Missing, OneOrMany, TimeColumn, TimeUnit,
};
pub use lag::{Lag, best_lag};
pub use lines::MAX_LINE_BYTES;
pub use reader::{BLOCK_ROWS, LinesDropped, LogReader, RawBlock};
pub use report::{Finding, Gap, ImportReport, Level, Steps};
pub use savitzky_golay::SavitzkyGolay;
pub use sections::{Section, butterworth_low_pass};
pub use stream::{MotionBlock, MotionSettings, MotionStream};
pub use units::{Quantity, si_factor, unit_names};
