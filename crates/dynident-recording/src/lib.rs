//! **What was measured?** Log readers, units, clocks, filters, and every way from q to dq and ddq.
#![forbid(unsafe_code)]

mod butterworth;
mod central_differences;
mod column_pattern;
mod decimation;
mod differentiator;
mod error;
mod format;
mod lines;
mod mapping;
mod reader;
mod savitzky_golay;
mod sections;
mod table;
mod units;

pub use butterworth::ButterworthZeroPhase;
pub use central_differences::CentralDifferences;
pub use decimation::{DecimationSettings, Decimator};
pub use differentiator::{Derivatives, Differentiator, DifferentiatorSettings};
pub use error::{FilterError, FormatError, RecordingError};
pub use format::{
    ChannelGroup, ClockRule, ColumnRef, Columns, Header, LogFormat, Missing, OneOrMany, TimeColumn, TimeUnit,
};
pub use lines::MAX_LINE_BYTES;
pub use reader::{BLOCK_ROWS, LinesDropped, LogReader, RawBlock};
pub use savitzky_golay::SavitzkyGolay;
pub use sections::{Section, butterworth_low_pass};
pub use units::{Quantity, si_factor, unit_names};
