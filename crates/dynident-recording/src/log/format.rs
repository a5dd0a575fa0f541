//! Format of a log: the mapping of columns to quantities, read from the study file.

use super::channels::{ChannelGroup, ColumnRef};
use super::mapping::Mapping;
use super::row_rules::{RowRule, checked_ranges};
use super::units::Quantity;
use crate::error::FormatError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Whether the first row contains the column names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "WrittenHeader", into = "WrittenHeader")]
#[non_exhaustive]
pub enum Header {
    /// The first row contains the names, unless every field of it is a number.
    #[default]
    Auto,
    /// The first row contains the names.
    Present,
    /// The first row contains values; columns are addressed by their index from 0.
    Absent,
}

/// Serialised form of [`Header`]: `true`, `false` or `"auto"`.
#[derive(Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "header must be true, false or \"auto\"")]
enum WrittenHeader {
    Flag(bool),
    Word(HeaderWord),
}

#[derive(Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
enum HeaderWord {
    Auto,
}

impl From<WrittenHeader> for Header {
    fn from(written: WrittenHeader) -> Self {
        match written {
            WrittenHeader::Flag(true) => Self::Present,
            WrittenHeader::Flag(false) => Self::Absent,
            WrittenHeader::Word(HeaderWord::Auto) => Self::Auto,
        }
    }
}

impl From<Header> for WrittenHeader {
    fn from(header: Header) -> Self {
        match header {
            Header::Auto => Self::Word(HeaderWord::Auto),
            Header::Present => Self::Flag(true),
            Header::Absent => Self::Flag(false),
        }
    }
}

/// Unit of time stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    #[serde(rename = "s")]
    Seconds,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Milliseconds,
    /// Microseconds.
    #[serde(rename = "us")]
    Microseconds,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanoseconds,
}

impl TimeUnit {
    /// Length of the unit, s.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e-3,
            Self::Microseconds => 1e-6,
            Self::Nanoseconds => 1e-9,
        }
    }
}

/// The time column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Name or index (from 0) of the column, in the main file or in `file`.
    pub column: ColumnRef,
    /// Another file of the same log with the same rows, relative to the folder of the main file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Unit of the stamps; seconds by default.
    #[serde(default)]
    pub unit: TimeUnit,
    /// Additional factor on the time stamps, for example the length of a tick; 1 by default.
    #[serde(default = "one")]
    pub scale: f64,
    /// Largest difference between the time stamps in one row, s, if other files of the log also have a column of this
    /// name. A larger difference shows that the files do not belong together. Default 0.1, which is five samples of a
    /// servo bus; the files of published SAGE recordings have equal stamps.
    #[serde(default = "max_difference_s", skip_serializing_if = "is_default_difference")]
    pub max_difference_s: f64,
}

fn one() -> f64 {
    1.0
}

fn max_difference_s() -> f64 {
    0.1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
fn is_false(value: &bool) -> bool {
    !*value
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
fn is_default_difference(value: &f64) -> bool {
    *value == max_difference_s()
}

impl TimeColumn {
    /// Column with time stamps in seconds.
    pub fn seconds(column: ColumnRef) -> Self {
        Self { column, file: None, unit: TimeUnit::Seconds, scale: one(), max_difference_s: max_difference_s() }
    }
}

/// Treatment of a row with an empty, NaN or infinite field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Missing {
    /// Stop with an error.
    #[default]
    Error,
    /// Omit the row. A short hole is interpolated, a long one splits the log.
    Drop,
}

/// Interpretation of time stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ClockRule {
    /// Dynident decides from the data; see [`Clock`](crate::clock::Clock).
    #[default]
    Auto,
    /// Samples are evenly spaced; only the mean rate is taken from the stamps.
    Uniform,
    /// Samples were taken at the stamps; they are interpolated to a uniform grid.
    Stamps,
    /// The rate changes slowly and the stamps jitter; the stamps are smoothed.
    Smoothed,
}

/// Format of a log; part of the study file.
///
/// ```
/// let format: dynident_recording::LogFormat = toml::from_str(
///     r#"
///     time = { column = "t_s" }
///     position = { columns = "q{1..7}_rad" }
///     torque = { columns = "i{1..7}", unit = "A", scale = [13.6, 14.3, 11.4, 11.2, 11.8, 11.8, 11.8] }
///     fraction = [0.0, 0.65]
///     "#,
/// )
/// .unwrap();
/// let joints: Vec<String> = (1..=7).map(|i| format!("joint_{i}")).collect();
/// format.validate(&joints).unwrap();
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LogFormat {
    /// Whether the first row contains the names of the columns.
    #[serde(default)]
    pub header: Header,
    /// Separator: `","`, `";"`, `"\t"` or `" "` (any number of spaces); detected from the first line by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<char>,
    /// Whether a text file has one line for each quantity, with one value for each sample. The keys for columns then
    /// refer to lines. Files whose lines begin with names are recognised without this key. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub transposed: bool,
    /// The recording to use in a file with several recordings, for example an episode: `"data.demo_3"`. Names of
    /// columns are then relative to this name. The whole file by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Time column; without it, `rate_hz` is required.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeColumn>,
    /// Sampling rate of a log without a time column, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Joint or motor positions.
    pub position: ChannelGroup,
    /// Logged velocities, for comparison only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<ChannelGroup>,
    /// Logged accelerations, for comparison only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<ChannelGroup>,
    /// Joint torques or motor currents. A log without them needs `command`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque: Option<ChannelGroup>,
    /// Commanded positions, for robots with internal position controllers: the target that was sent to each servo, in
    /// rad (m) after unit, scale and offset. They can be given in addition to `torque` or instead of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<ChannelGroup>,
    /// Time by which the recorder stamps commands late, s: each command is used this much earlier. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_late_s: Option<f64>,
    /// Joint temperatures, °C, for temperature-dependent friction. Convert other units by `scale` and `offset`; several
    /// joints may use the same column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<ChannelGroup>,
    /// Range of data rows to use, `[first, end)`, counted from 0 without header and comments.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<[u64; 2]>,
    /// Share of the n data rows to use: `[0.0, 0.65]` is the first 65 %. For `[a, b]`, rows `[round(a n), round(b n))`
    /// are used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fraction: Option<[f64; 2]>,
    /// Time range to use, `[from, to)`, s after the first data row of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_range_s: Option<[f64; 2]>,
    /// Keeps one row in n, for a recorder that repeats values: `3` keeps rows 0, 3, 6 and so on. All other keys apply
    /// to the kept rows; `rate_hz` remains the rate of the file. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep_every: Option<u64>,
    /// Ranges of data rows `[first, end)`, counted from 0, that are omitted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_rows: Vec<[u64; 2]>,
    /// Time ranges `[from, to)`, s after the first data row of the file, that are omitted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_time_s: Vec<[f64; 2]>,
    /// Rows that satisfy one of these rules are omitted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_where: Vec<RowRule>,
    /// Rows that violate one of these rules are omitted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_where: Vec<RowRule>,
    /// Treatment of rows with an empty, NaN or infinite field.
    #[serde(default)]
    pub missing: Missing,
    /// Interpretation of time stamps.
    #[serde(default)]
    pub clock: ClockRule,
    /// Number of median steps above which a step between samples splits the log; 1.5 to 1000, 5 by default.
    #[serde(default = "default_max_gap_steps")]
    pub max_gap_steps: f64,
    /// Whether to fill a longer gap if it is short compared with the motion (at most a fifth of the period of the
    /// cut-off frequency). The filled samples are not used as rows of the fit. True by default.
    #[serde(default = "yes")]
    pub bridge_gaps: bool,
}

/// Largest time by which commands may be stamped late, s: recorders buffer less.
const MAX_COMMAND_LATE_S: f64 = 10.0;

fn yes() -> bool {
    true
}

fn default_max_gap_steps() -> f64 {
    5.0
}

impl LogFormat {
    /// Format of a log with a time column; all other keys have their defaults.
    pub fn with_time(time: TimeColumn, position: ChannelGroup, torque: ChannelGroup) -> Self {
        Self {
            header: Header::default(),
            delimiter: None,
            transposed: false,
            part: None,
            time: Some(time),
            rate_hz: None,
            position,
            velocity: None,
            acceleration: None,
            torque: Some(torque),
            command: None,
            command_late_s: None,
            temperature: None,
            rows: None,
            fraction: None,
            keep_every: None,
            time_range_s: None,
            drop_rows: Vec::new(),
            drop_time_s: Vec::new(),
            drop_where: Vec::new(),
            keep_where: Vec::new(),
            missing: Missing::default(),
            clock: ClockRule::default(),
            max_gap_steps: default_max_gap_steps(),
            bridge_gaps: yes(),
        }
    }

    /// Format of a log with an even sample rate and without stamps; all other keys have their defaults.
    pub fn at_rate(rate_hz: f64, position: ChannelGroup, torque: ChannelGroup) -> Self {
        let time = TimeColumn::seconds(ColumnRef::Index(0));
        Self { time: None, rate_hz: Some(rate_hz), ..Self::with_time(time, position, torque) }
    }

    /// Checks the keys of the clock.
    fn validate_clock(&self) -> Result<(), FormatError> {
        let wrong = |key: &str, problem: &str, fix: &str| Err(FormatError::new(key, problem, fix));
        match (&self.time, self.rate_hz) {
            (None, None) => {
                let fix = "write time = { column = \"t_s\" } or rate_hz = 1000.0";
                wrong("time", "neither time nor rate_hz is given", fix)
            }
            (Some(_), Some(_)) => wrong("rate_hz", "time and rate_hz are both given", "keep one of them"),
            (None, Some(rate)) if !(rate.is_finite() && rate > 0.0 && rate <= 1e7) => {
                let fix = "give samples per second, above 0 and at most 1e7";
                wrong("rate_hz", &format!("{rate} is not a valid rate"), fix)
            }
            (Some(time), None) if time.max_difference_s.is_nan() || time.max_difference_s <= 0.0 => {
                let problem = format!("{:?} is not positive", time.max_difference_s);
                wrong("time.max_difference_s", &problem, "give a number of seconds, such as 0.1")
            }
            (Some(time), None) if !(1e-15..=1e6).contains(&time.scale) => {
                let problem = format!("{:?} is no length of a tick", time.scale);
                wrong("time.scale", &problem, "give 1e-15 to 1e6 units per tick, or leave it out")
            }
            _ => Ok(()),
        }
    }

    /// Checks the format, including its agreement with the study's joints.
    ///
    /// # Errors
    /// A [`FormatError`] that names the key and the fix.
    pub fn validate(&self, joints: &[String]) -> Result<(), FormatError> {
        let wrong = |key: &str, problem: &str, fix: &str| Err(FormatError::new(key, problem, fix));
        if joints.is_empty() {
            return wrong("position", "the study contains no joints", "list at least one joint");
        }
        self.validate_clock()?;
        if let Some(delimiter) = self.delimiter
            && !matches!(delimiter, ',' | ';' | '\t' | ' ' | '|' | ':')
        {
            let fix = "use one of \",\" \";\" \"\\t\" \" \" \"|\" \":\"";
            return wrong("delimiter", &format!("{delimiter:?} is not supported"), fix);
        }
        if let Some([first, end]) = self.rows
            && first >= end
        {
            return wrong("rows", &format!("[{first}, {end}] is empty"), "write [first, end) with first < end");
        }
        if self.rows.is_some() && self.fraction.is_some() {
            return wrong("fraction", "rows and fraction are both given", "keep one of them");
        }
        if let Some([from, to]) = self.fraction
            && !(from >= 0.0 && from < to && to <= 1.0)
        {
            let fix = "write [from, to] with 0 <= from < to <= 1";
            return wrong("fraction", &format!("[{from}, {to}] is not a valid share of a log"), fix);
        }
        if let Some([from, to]) = self.time_range_s
            && !(from.is_finite() && from < to)
        {
            let fix = "write [from, to] in seconds with from < to";
            return wrong("time_range_s", &format!("[{from}, {to}] is empty"), fix);
        }
        if let Some(late) = self.command_late_s
            && !(0.0..=MAX_COMMAND_LATE_S).contains(&late)
        {
            let fix = "give the seconds by which commands are stamped late, 0 to 10";
            return wrong("command_late_s", &format!("{late} is out of range"), fix);
        }
        if self.keep_every == Some(0) {
            return wrong("keep_every", "0 keeps no row", "give 1 for all rows, 2 for every second row, ..");
        }
        checked_ranges(&self.drop_rows, &self.drop_time_s)?;
        self.keep_where.iter().try_for_each(|rule| rule.validate("keep_where"))?;
        self.drop_where.iter().try_for_each(|rule| rule.validate("drop_where"))?;
        if !(1.5..=1000.0).contains(&self.max_gap_steps) {
            let problem = format!("{} is out of range", self.max_gap_steps);
            return wrong("max_gap_steps", &problem, "give 1.5 to 1000 median steps");
        }
        if self.torque.is_none() && self.command.is_none() {
            let fix =
                "add torque = { columns = [...] }, or command = { columns = [...] } for a robot that reports no torque";
            return wrong("torque", "neither torque nor command is given", fix);
        }
        for (quantity, group) in self.groups() {
            group.validate(quantity, joints)?;
            Mapping::new(group, quantity, joints)?;
        }
        Ok(())
    }

    /// Checks that the format has torque columns.
    ///
    /// # Errors
    /// A [`FormatError`] that names the key and the fix.
    pub fn require_torque(&self) -> Result<(), FormatError> {
        if self.torque.is_some() {
            return Ok(());
        }
        let fix = match self.command {
            Some(_) => {
                "add torque = { columns = [...] }; for a robot that reports no torque, describe its servos in [drive.servo]"
            }
            None => "add torque = { columns = [...] }",
        };
        Err(FormatError::new("torque", "this method needs measured torques or currents", fix))
    }

    /// The channel groups that are present, in the order of [`Quantity::ALL`].
    pub(crate) fn groups(&self) -> Vec<(Quantity, &ChannelGroup)> {
        let group = |quantity| match quantity {
            Quantity::Position => Some(&self.position),
            Quantity::Velocity => self.velocity.as_ref(),
            Quantity::Acceleration => self.acceleration.as_ref(),
            Quantity::Torque => self.torque.as_ref(),
            Quantity::Temperature => self.temperature.as_ref(),
            Quantity::Command => self.command.as_ref(),
        };
        Quantity::ALL.into_iter().filter_map(|quantity| Some((quantity, group(quantity)?))).collect()
    }
}
