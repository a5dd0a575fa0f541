//! The description of a log: which column is what. Plain data, read from the study file.

use super::column_pattern::expanded;
use super::row_rules::{self, RowRule};
use super::units::{Quantity, si_factor, unit_names};
use crate::error::FormatError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Whether the first row names the columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "WrittenHeader", into = "WrittenHeader")]
#[non_exhaustive]
pub enum Header {
    /// Yes, unless every field of the first row is a number.
    #[default]
    Auto,
    /// Yes.
    Present,
    /// No: columns are addressed by 0-based index.
    Absent,
}

/// [`Header`] as it is written: `true`, `false` or `"auto"`.
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

/// One column: by name, or by 0-based index.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "a column is a name in quotes or a 0-based index")]
pub enum ColumnRef {
    /// 0-based index.
    Index(usize),
    /// Name in the header; a range such as `q{1..7}_rad` stands for several.
    Name(String),
}

/// Columns in joint order: a list, or one text with a range such as `"q{1..7}_rad"`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "columns must be a list of names or 0-based indices, or one pattern such as \"q{1..7}_rad\""
)]
pub enum Columns {
    /// One name or pattern.
    Pattern(String),
    /// A list of names, patterns and indices.
    List(Vec<ColumnRef>),
}

/// One value for all columns, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(rename = "OneOrMany_{T}"))]
#[serde(untagged, expecting = "give one value for all columns, or a list with one for each")]
pub enum OneOrMany<T> {
    /// The same for all.
    One(T),
    /// One for each.
    Many(Vec<T>),
}

impl<T: Clone> OneOrMany<T> {
    /// The value of number `index`; none where a list is shorter.
    pub fn at(&self, index: usize) -> Option<T> {
        match self {
            Self::One(value) => Some(value.clone()),
            Self::Many(values) => values.get(index).cloned(),
        }
    }

    fn fits(&self, count: usize) -> bool {
        matches!(self, Self::One(_)) || matches!(self, Self::Many(values) if values.len() == count)
    }

    pub(crate) fn values(&self) -> &[T] {
        match self {
            Self::One(value) => core::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

/// The columns of one quantity and how they become joint values in SI:
///
/// `joint = M · (scale · sign · unit · column) + offset`
///
/// where `M` is `matrix`, or the inverse of `inverse_matrix`, or the identity. `scale`, `sign` and `unit` are per
/// column; `offset` is per joint and in SI (rad, m, N m, N).
///
/// ```
/// let coupled_wrist: dynident_recording::log::ChannelGroup = toml::from_str(
///     r#"
///     file = "motor_angles.csv"
///     columns = "Joint_{1..2}"
///     unit = "deg"
///     inverse_matrix = [[45.0, 0.0], [32.0, 32.0]]
///     offset = [0.0, 1.5707963267948966]
///     "#,
/// )
/// .unwrap();
/// assert!(coupled_wrist.scale.is_none());
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ChannelGroup {
    /// Another file of the same log, relative to the main file's folder; its rows pair with the main file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// One column for each joint of the study, in the study's joint order (any number if a matrix follows).
    pub columns: Columns,
    /// Unit of the columns: `rad` `deg` `rev` `m` `mm`; `rad/s` `deg/s` `rpm` ..; `N m` `N` `A` `mA` ..
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<OneOrMany<String>>,
    /// Factor on top of the unit: current gain, gear ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<OneOrMany<f64>>,
    /// +1 or -1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sign: Option<OneOrMany<f64>>,
    /// Added last, per joint, in SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<OneOrMany<f64>>,
    /// `joint = matrix · columns`: one row for each joint, one entry for each column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Vec<Vec<f64>>>,
    /// `columns = inverse_matrix · joint`: the joint-to-motor matrix as makers give it; square.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inverse_matrix: Option<Vec<Vec<f64>>>,
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
    /// Seconds in one unit.
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
    /// Name or 0-based index, in the main file.
    pub column: ColumnRef,
    /// Unit of the stamps; seconds by default.
    #[serde(default)]
    pub unit: TimeUnit,
    /// Further factor on the stamps (a tick length); 1 by default.
    #[serde(default = "one")]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

impl TimeColumn {
    /// Stamps in seconds.
    pub fn seconds(column: ColumnRef) -> Self {
        Self { column, unit: TimeUnit::Seconds, scale: one() }
    }
}

/// What to do with a row that has an empty, NaN or infinite field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Missing {
    /// Stop with an error that names the place.
    #[default]
    Error,
    /// Leave the row out; the hole is interpolated, or splits the log if it is long.
    Drop,
}

/// How time stamps are understood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ClockRule {
    /// Decided from the data, see [`Clock`](crate::clock::Clock).
    #[default]
    Auto,
    /// Samples were taken at equal steps; the stamps only give the mean rate.
    Uniform,
    /// Samples were taken at the stamps; they are interpolated onto a uniform grid.
    Stamps,
    /// Samples were taken at a rate that changes slowly; single stamps jitter and are smoothed.
    Smoothed,
}

/// A log, described: part of the study file.
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
    /// Whether the first row names the columns.
    #[serde(default)]
    pub header: Header,
    /// `","`, `";"`, `"\t"` or `" "` (any run of blanks); found out from the first line by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<char>,
    /// The time column; without one, give `rate_hz`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeColumn>,
    /// Sampling rate of a log without a time column.
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
    /// Joint torques or motor currents.
    pub torque: ChannelGroup,
    /// Temperatures of the joints, °C, for friction that depends on them. Any other unit by `scale` and `offset`;
    /// several joints may name the same column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<ChannelGroup>,
    /// Data rows `[first, end)`, 0-based, header and comments not counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<[u64; 2]>,
    /// Part of the data rows, `[0.0, 0.65]` = the first 65 %: rows `[round(a n), round(b n))`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fraction: Option<[f64; 2]>,
    /// Seconds `[from, to)` after the first data row of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_range_s: Option<[f64; 2]>,
    /// Data rows `[first, end)`, 0-based, that are left out of what is used, one range or several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_rows: Vec<[u64; 2]>,
    /// Seconds `[from, to)` after the first data row of the file that are left out, one range or several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_time_s: Vec<[f64; 2]>,
    /// Rows are left out where one of these rules holds.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drop_where: Vec<RowRule>,
    /// Rows are left out where one of these rules does not hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_where: Vec<RowRule>,
    /// Rows with an empty, NaN or infinite field.
    #[serde(default)]
    pub missing: Missing,
    /// How time stamps are understood.
    #[serde(default)]
    pub clock: ClockRule,
    /// A step longer than this many median steps splits the log; 1.5 to 1000, 5 by default.
    #[serde(default = "default_max_gap_steps")]
    pub max_gap_steps: f64,
    /// Whether a longer gap is filled where it is short against the motion (a fifth of the cut-off's period); what
    /// stands in it counts as no row. True by default.
    #[serde(default = "yes")]
    pub bridge_gaps: bool,
}

fn yes() -> bool {
    true
}

fn default_max_gap_steps() -> f64 {
    5.0
}

impl LogFormat {
    /// A log with a time column, all else by default: no further channel, every row, a header if there seems to be one.
    pub fn with_time(time: TimeColumn, position: ChannelGroup, torque: ChannelGroup) -> Self {
        Self {
            header: Header::default(),
            delimiter: None,
            time: Some(time),
            rate_hz: None,
            position,
            velocity: None,
            acceleration: None,
            torque,
            temperature: None,
            rows: None,
            fraction: None,
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

    /// As [`with_time`](Self::with_time), for samples at an even rate and without stamps.
    pub fn at_rate(rate_hz: f64, position: ChannelGroup, torque: ChannelGroup) -> Self {
        let time = TimeColumn::seconds(ColumnRef::Index(0));
        Self { time: None, rate_hz: Some(rate_hz), ..Self::with_time(time, position, torque) }
    }

    /// Checks the description against itself and the study's joints.
    ///
    /// # Errors
    /// A [`FormatError`] that names the key and the fix.
    pub fn validate(&self, joints: &[String]) -> Result<(), FormatError> {
        let wrong = |key: &str, problem: &str, fix: &str| Err(FormatError::new(key, problem, fix));
        if joints.is_empty() {
            return wrong("position", "the study names no joints", "list at least one joint");
        }
        match (&self.time, self.rate_hz) {
            (None, None) => {
                let fix = "write time = { column = \"t_s\" } or rate_hz = 1000.0";
                return wrong("time", "neither time nor rate_hz is given", fix);
            }
            (Some(_), Some(_)) => return wrong("rate_hz", "time and rate_hz are both given", "keep one of them"),
            (None, Some(rate)) if !(rate.is_finite() && rate > 0.0 && rate <= 1e7) => {
                let fix = "give samples per second, above 0 and at most 1e7";
                return wrong("rate_hz", &format!("{rate} is not a rate"), fix);
            }
            (Some(time), None) if !(1e-15..=1e6).contains(&time.scale) => {
                let problem = format!("{:?} is no length of a tick", time.scale);
                return wrong("time.scale", &problem, "give 1e-15 to 1e6 units per tick, or leave it out");
            }
            _ => {}
        }
        if let Some(delimiter) = self.delimiter
            && !matches!(delimiter, ',' | ';' | '\t' | ' ' | '|' | ':')
        {
            let fix = "use one of \",\" \";\" \"\\t\" \" \" \"|\" \":\"";
            return wrong("delimiter", &format!("{delimiter:?} is not offered"), fix);
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
            return wrong("fraction", &format!("[{from}, {to}] is no part of a log"), fix);
        }
        if let Some([from, to]) = self.time_range_s
            && !(from.is_finite() && from < to)
        {
            let fix = "write [from, to] in seconds with from < to";
            return wrong("time_range_s", &format!("[{from}, {to}] is empty"), fix);
        }
        row_rules::validate(self)?;
        if !(1.5..=1000.0).contains(&self.max_gap_steps) {
            let problem = format!("{} is out of range", self.max_gap_steps);
            return wrong("max_gap_steps", &problem, "give 1.5 to 1000 median steps");
        }
        for (quantity, group) in self.groups() {
            group.validate(quantity, joints)?;
        }
        Ok(())
    }

    /// The channel groups that are present, in the order of [`Quantity::ALL`].
    pub(crate) fn groups(&self) -> Vec<(Quantity, &ChannelGroup)> {
        let group = |quantity| match quantity {
            Quantity::Position => Some(&self.position),
            Quantity::Velocity => self.velocity.as_ref(),
            Quantity::Acceleration => self.acceleration.as_ref(),
            Quantity::Torque => Some(&self.torque),
            Quantity::Temperature => self.temperature.as_ref(),
        };
        Quantity::ALL.into_iter().filter_map(|quantity| Some((quantity, group(quantity)?))).collect()
    }
}

impl ChannelGroup {
    /// Columns that are joint values in SI already, in the main file.
    pub fn new(columns: Columns) -> Self {
        Self {
            file: None,
            columns,
            unit: None,
            scale: None,
            sign: None,
            offset: None,
            matrix: None,
            inverse_matrix: None,
        }
    }

    /// The columns one by one, ranges expanded.
    ///
    /// # Errors
    /// If a range is malformed or absurdly long.
    pub fn column_list(&self, key: &str) -> Result<Vec<ColumnRef>, FormatError> {
        let key = format!("{key}.columns");
        let mut list = Vec::new();
        match &self.columns {
            Columns::Pattern(pattern) => list.extend(expanded(&key, pattern)?.into_iter().map(ColumnRef::Name)),
            Columns::List(columns) => {
                for column in columns {
                    match column {
                        ColumnRef::Index(index) => list.push(ColumnRef::Index(*index)),
                        ColumnRef::Name(name) => list.extend(expanded(&key, name)?.into_iter().map(ColumnRef::Name)),
                    }
                }
            }
        }
        Ok(list)
    }

    fn validate(&self, quantity: Quantity, joints: &[String]) -> Result<(), FormatError> {
        let key = quantity.key();
        let columns = self.column_list(key)?.len();
        let at = |name: &str| format!("{key}.{name}");
        let wrong = |name: &str, found: usize, expected: usize, what: &str| {
            FormatError::new(
                at(name),
                format!("{found} entries for {expected} {what}"),
                format!("give one value, or one for each of the {expected} {what}"),
            )
        };
        if self.matrix.is_some() && self.inverse_matrix.is_some() {
            return Err(FormatError::new(at("matrix"), "matrix and inverse_matrix are both given", "keep one of them"));
        }
        let count_matters = self.matrix.is_none();
        if columns == 0 || (count_matters && columns != joints.len()) {
            return Err(FormatError::new(
                at("columns"),
                format!("{columns} columns for {} joints", joints.len()),
                format!("give one column for each of: {}", joints.join(", ")),
            ));
        }
        if let Some(unit) = &self.unit {
            if !unit.fits(columns) {
                return Err(wrong("unit", unit.values().len(), columns, "columns"));
            }
            if let Some(unknown) = unit.values().iter().find(|unit| si_factor(unit, quantity).is_none()) {
                return Err(FormatError::new(
                    at("unit"),
                    format!("`{unknown}` is no unit of {key}"),
                    format!("use one of: {}", unit_names(quantity).join(", ")),
                ));
            }
        }
        for (name, values, expected, what) in [
            ("scale", &self.scale, columns, "columns"),
            ("sign", &self.sign, columns, "columns"),
            ("offset", &self.offset, joints.len(), "joints"),
        ] {
            let Some(values) = values else { continue };
            if !values.fits(expected) {
                return Err(wrong(name, values.values().len(), expected, what));
            }
            let bad = values.values().iter().find(|value| match name {
                "sign" => value.abs() != 1.0,
                "scale" => !(1e-15..=1e15).contains(&value.abs()),
                _ => value.is_nan() || value.abs() > 1e15,
            });
            if let Some(value) = bad {
                let fix = match name {
                    "sign" => "write 1 or -1",
                    "scale" => "give a factor of 1e-15 to 1e15 in size",
                    _ => "give a number of at most 1e15 in size",
                };
                return Err(FormatError::new(at(name), format!("{value:?} is not allowed"), fix));
            }
        }
        if let Some(matrix) = &self.matrix {
            check_matrix(&at("matrix"), matrix, joints.len(), columns)?;
        }
        if let Some(matrix) = &self.inverse_matrix {
            check_matrix(&at("inverse_matrix"), matrix, joints.len(), columns)?;
        }
        super::mapping::Mapping::new(self, quantity, joints.len()).map(|_| ())
    }
}

fn check_matrix(key: &str, matrix: &[Vec<f64>], rows: usize, columns: usize) -> Result<(), FormatError> {
    if matrix.len() != rows || matrix.iter().any(|row| row.len() != columns) {
        return Err(FormatError::new(
            key,
            format!("not a {rows} x {columns} matrix"),
            "give one row for each joint and one entry in it for each column",
        ));
    }
    if matrix.iter().flatten().any(|value| !value.is_finite()) {
        return Err(FormatError::new(key, "an entry is not finite", "give finite numbers"));
    }
    Ok(())
}
