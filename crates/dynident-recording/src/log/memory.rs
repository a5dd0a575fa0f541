//! Samples in memory as a log: joint values in SI units, or a table of numbers.

use super::Log;
use super::channels::{ChannelGroup, ColumnRef, Columns};
use super::format::{LogFormat, TimeColumn};
use super::source::{LogSource, LogTable};
use crate::error::RecordingError;
use crate::place::LogPlace;
use std::sync::Arc;

/// Samples of all joints in SI units, in the order of the joints: `q[j]` contains joint j.
///
/// ```
/// use dynident_recording::{JointSamples, MotionBlock, MotionSettings, MotionStream};
///
/// let time_s: Vec<f64> = (0..500).map(|i| f64::from(i) * 0.002).collect();
/// let q = time_s.iter().map(|t| (2.0 * t).sin()).collect();
/// let tau = time_s.iter().map(|t| -0.4 * (2.0 * t).sin()).collect();
/// let mut log = JointSamples::at_times(time_s, vec![q], vec![tau]).into_log("swing", &["elbow".to_owned()])?;
/// log.format.time_range_s = Some([0.1, 0.9]);
///
/// let mut stream = MotionStream::new(&log, &MotionSettings::default())?;
/// let mut block = MotionBlock::default();
/// assert!(stream.next_block(&mut block)?);
/// assert_eq!((block.rows, stream.rate_hz().round()), (400, 500.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointSamples {
    /// Rate or times of the samples.
    pub clock: SampleClock,
    /// Positions (rad, m).
    pub q: Vec<Vec<f64>>,
    /// Torques (N m, N); may be empty if there are commands.
    pub tau: Vec<Vec<f64>>,
    /// Measured velocities (rad/s, m/s), for comparison only; may be empty.
    pub dq: Vec<Vec<f64>>,
    /// Measured accelerations (rad/s², m/s²), for comparison only; may be empty.
    pub ddq: Vec<Vec<f64>>,
    /// Temperatures (°C); may be empty.
    pub temperature_c: Vec<Vec<f64>>,
    /// Commanded positions (rad, m); may be empty.
    pub command: Vec<Vec<f64>>,
}

/// Rate or times of samples in memory.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SampleClock {
    /// Sampling rate, Hz.
    RateHz(f64),
    /// Times, s; their jitter is treated as for a file ([`ClockRule`](super::ClockRule)).
    TimesS(Vec<f64>),
}

impl Default for SampleClock {
    fn default() -> Self {
        Self::TimesS(Vec::new())
    }
}

impl JointSamples {
    /// Positions and torques at `time_s` (s).
    pub fn at_times(time_s: Vec<f64>, q: Vec<Vec<f64>>, tau: Vec<Vec<f64>>) -> Self {
        Self { clock: SampleClock::TimesS(time_s), q, tau, ..Self::default() }
    }

    /// Positions and torques at an even rate.
    pub fn at_rate(rate_hz: f64, q: Vec<Vec<f64>>, tau: Vec<Vec<f64>>) -> Self {
        Self { clock: SampleClock::RateHz(rate_hz), q, tau, ..Self::default() }
    }

    /// Creates a log of these samples for `joints`, named `label` in messages. The samples are moved, not copied.
    /// Ranges, missing values and the clock rule can be set in the [`format`](Log::format) of the result.
    ///
    /// # Errors
    /// [`RecordingError::Samples`] if the arrays do not have one entry for each joint and one value for each sample.
    pub fn into_log(self, label: &str, joints: &[String]) -> Result<Log, RecordingError> {
        let (rate_hz, mut columns) = match self.clock {
            SampleClock::RateHz(rate_hz) => (Some(rate_hz), Vec::new()),
            SampleClock::TimesS(time_s) => (None, vec![time_s]),
        };
        let mut group = |name: &str, values: Vec<Vec<f64>>| {
            if values.len() != joints.len() {
                let problem = format!("{name} has {} arrays for {} joints", values.len(), joints.len());
                return Err(RecordingError::Samples { log: label.to_owned(), problem });
            }
            let list = (columns.len()..columns.len() + values.len()).map(ColumnRef::Index).collect();
            columns.extend(values);
            Ok(ChannelGroup::new(Columns::List(list)))
        };
        let position = group("q", self.q)?;
        let torque = if self.tau.is_empty() && !self.command.is_empty() { None } else { Some(group("tau", self.tau)?) };
        let mut optional = |name: &str, values: Vec<Vec<f64>>| {
            if values.is_empty() { Ok(None) } else { group(name, values).map(Some) }
        };
        let (velocity, acceleration) = (optional("dq", self.dq)?, optional("ddq", self.ddq)?);
        let temperature = optional("temperature_c", self.temperature_c)?;
        let command = optional("command", self.command)?;
        // It is replaced by the torque of the samples, if there is one.
        let format = match rate_hz {
            Some(rate_hz) => LogFormat::at_rate(rate_hz, position.clone(), position),
            None => LogFormat::with_time(TimeColumn::seconds(ColumnRef::Index(0)), position.clone(), position),
        };
        let format = LogFormat { velocity, acceleration, torque, command, temperature, ..format };
        Ok(Log::new(MemoryLog::columns(label, None, columns)?, format, joints))
    }
}

/// A table of numbers in memory with a [`LogFormat`] as for a file. Clones share the numbers.
///
/// ```
/// use dynident_recording::{Log, LogFormat, LogReader, MemoryLog, RawBlock};
///
/// // Three rows of time, angle in degrees and current.
/// let values = vec![0.0, 90.0, 1.0, 0.1, 91.0, 2.0, 0.2, 92.0, 3.0];
/// let names = ["t", "angle", "current"].map(str::to_owned).to_vec();
/// let source = MemoryLog::row_major("bench run 7", Some(names), 3, values)?;
/// let format: LogFormat = toml::from_str(
///     r#"
///     time = { column = "t" }
///     position = { columns = ["angle"], unit = "deg" }
///     torque = { columns = ["current"], unit = "A", scale = 11.4 }
///     "#,
/// )?;
/// let log = Log::new(source, format, &["elbow".to_owned()]);
/// let mut block = RawBlock::default();
/// assert!(LogReader::open(&log)?.next_block(&mut block)?);
/// assert_eq!((block.q[0][0], block.tau[0][2]), (core::f64::consts::FRAC_PI_2, 3.0 * 11.4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct MemoryLog {
    label: Arc<str>,
    names: Option<Arc<[String]>>,
    width: usize,
    rows: usize,
    values: Arc<Values>,
}

enum Values {
    /// Rows one after another: value `row * width + column`.
    RowMajor(Vec<f64>),
    Columns(Vec<Vec<f64>>),
}

impl MemoryLog {
    /// Creates a table with `values[i * width + k]` in row i and column k.
    ///
    /// # Errors
    /// [`RecordingError::Samples`] if the last row is incomplete, or the number of names is not `width`.
    pub fn row_major(
        label: &str,
        names: Option<Vec<String>>,
        width: usize,
        values: Vec<f64>,
    ) -> Result<Self, RecordingError> {
        if width == 0 || !values.len().is_multiple_of(width) {
            let problem = format!("{} numbers do not form rows of {width}", values.len());
            return Err(RecordingError::Samples { log: label.to_owned(), problem });
        }
        let rows = values.len() / width;
        Self::new(label, names, width, rows, Values::RowMajor(values))
    }

    /// Creates a table with the columns `columns[k]`.
    ///
    /// # Errors
    /// [`RecordingError::Samples`] if the columns differ in length, or the number of names differs from that of
    /// columns.
    pub fn columns(label: &str, names: Option<Vec<String>>, columns: Vec<Vec<f64>>) -> Result<Self, RecordingError> {
        let rows = columns.first().map_or(0, Vec::len);
        if let Some((column, other)) = columns.iter().enumerate().find(|(_, column)| column.len() != rows) {
            let problem = format!("column {column} (0-based) has {} values, but the first has {rows}", other.len());
            return Err(RecordingError::Samples { log: label.to_owned(), problem });
        }
        Self::new(label, names, columns.len(), rows, Values::Columns(columns))
    }

    fn new(
        label: &str,
        names: Option<Vec<String>>,
        width: usize,
        rows: usize,
        values: Values,
    ) -> Result<Self, RecordingError> {
        if let Some(names) = &names
            && names.len() != width
        {
            let problem = format!("{} names for {width} columns", names.len());
            return Err(RecordingError::Samples { log: label.to_owned(), problem });
        }
        Ok(Self { label: label.into(), names: names.map(Into::into), width, rows, values: Arc::new(values) })
    }

    /// Names of the columns, if any.
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    /// Whether both objects are clones of the same table.
    pub fn is_same_table(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.values, &other.values)
    }

    /// All numbers, row by row.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        (0..self.rows).flat_map(move |row| (0..self.width).map(move |column| self.number(row, column)))
    }

    fn number(&self, row: usize, column: usize) -> f64 {
        match &*self.values {
            Values::RowMajor(all) => all[row * self.width + column],
            Values::Columns(columns) => columns[column][row],
        }
    }
}

impl core::fmt::Debug for MemoryLog {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut shown = f.debug_struct("MemoryLog");
        shown.field("label", &self.label).field("names", &self.names);
        shown.field("width", &self.width).field("rows", &self.rows).finish_non_exhaustive()
    }
}

impl LogSource for MemoryLog {
    fn label(&self) -> String {
        self.label.as_ref().to_owned()
    }

    fn open(&self) -> Result<Box<dyn LogTable>, RecordingError> {
        Ok(Box::new(MemoryTable { log: self.clone(), fields: Vec::new(), next: 0 }))
    }

    fn estimated_rows(&self) -> Option<u64> {
        Some(self.rows as u64)
    }
}

#[derive(Debug)]
struct MemoryTable {
    log: MemoryLog,
    fields: Vec<usize>,
    next: usize,
}

impl LogTable for MemoryTable {
    fn width(&self) -> usize {
        self.log.width
    }

    fn names(&self) -> Option<&[String]> {
        self.log.names.as_deref()
    }

    fn select(&mut self, fields: &[usize]) {
        self.fields = fields.to_vec();
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        let row = self.next;
        if !self.skip_row()? {
            return Ok(false);
        }
        values.iter_mut().zip(&self.fields).for_each(|(value, &field)| *value = self.log.number(row, field));
        Ok(true)
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        let found = self.next < self.log.rows;
        self.next += usize::from(found);
        Ok(found)
    }

    fn place(&self) -> LogPlace {
        let log = self.log.label();
        match self.next.checked_sub(1) {
            Some(row) => LogPlace::Row { log, row: row as u64 },
            None => LogPlace::Whole { log },
        }
    }
}
