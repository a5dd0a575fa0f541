//! Logs as a stream of blocks: several files, ranges of rows, mapping to joints. The memory does not grow with the
//! length of the log.

use super::channels::ColumnRef;
use super::columns::ColumnSelection;
use super::format::{LogFormat, Missing};
use super::found_rules::FoundRules;
use super::mapping::Mapping;
use super::source::LogSource;
use super::stamps::ContinuedStamps;
use super::units::Quantity;
use super::{FileLog, Log};
use crate::error::RecordingError;
use std::path::{Path, PathBuf};

/// Maximum position or torque. Below it, squares and second differences per second squared are finite.
const MAX_VALUE: f64 = 1e60;

const MAX_BLOCK_ROWS: usize = 4096;

/// Successive rows of a log as joint values in SI units, as logged: without filter or interpolation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawBlock {
    /// Data row in the file of each sample, from 0. Where rows were omitted, the numbers are not contiguous.
    pub row: Vec<u64>,
    /// Time of each sample, s after the first data row of the file.
    pub time_s: Vec<f64>,
    /// Positions, one vector for each joint (rad, m).
    pub q: Vec<Vec<f64>>,
    /// Logged velocities; empty without a `velocity` group.
    pub dq: Vec<Vec<f64>>,
    /// Logged accelerations; empty without an `acceleration` group.
    pub ddq: Vec<Vec<f64>>,
    /// Torques (N m, N); empty without a `torque` group.
    pub tau: Vec<Vec<f64>>,
    /// Temperatures (°C); empty without a `temperature` group.
    pub temperature_c: Vec<Vec<f64>>,
    /// Commanded positions (rad, m); empty without a `command` group.
    pub command: Vec<Vec<f64>>,
}

impl RawBlock {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.row.len()
    }
}

/// Rows that the reader omitted.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LinesDropped {
    /// Number of rows with an empty, NaN or infinite field, with `missing = "drop"`.
    pub missing: u64,
    /// Number of rows that `drop_rows`, `drop_time_s`, `drop_where` and `keep_where` exclude.
    #[serde(default)]
    pub by_rule: u64,
    /// File and line of a truncated last row.
    pub truncated: Option<String>,
}

#[derive(Debug)]
struct Group {
    quantity: Quantity,
    /// For each column, the index of its table and the index of its value in a row of this table.
    slots: Vec<(usize, usize)>,
    mapping: Mapping,
    columns: Vec<Vec<f64>>,
}

/// One pass over a log: converts raw columns to joint values in SI units, and applies ranges of rows and rules for
/// missing values.
#[derive(Debug)]
pub struct LogReader {
    label: String,
    joints: Vec<String>,
    tables: Vec<ColumnSelection>,
    groups: Vec<Group>,
    /// Time column: index of its table, index of its value in a row, and factor to seconds.
    time: Option<(usize, usize, f64)>,
    /// Columns with the name of the time column in other files (table and index of the value); `max_difference_s` is
    /// the largest permitted difference from the time column, s.
    other_stamps: Vec<(usize, usize)>,
    max_difference_s: f64,
    period_s: f64,
    first_stamp_s: Option<f64>,
    stamps: ContinuedStamps,
    rows: [u64; 2],
    keep_every: u64,
    time_range_s: [f64; 2],
    rules: FoundRules,
    selection: String,
    missing: Missing,
    next_row: u64,
    delivered: u64,
    finished: bool,
    dropped: LinesDropped,
}

impl LogReader {
    /// Starts a pass over `log`.
    ///
    /// # Errors
    /// If the format is invalid, a file is missing or empty, or a column does not exist.
    pub fn open(log: &Log) -> Result<Self, RecordingError> {
        let format = &log.format;
        format.validate(&log.joints)?;
        let main = log.source();
        let mut tables = vec![ColumnSelection::new(main.label(), main.open()?)];
        let mut paths = vec![main.path().map(Path::to_owned)];
        let time = match &format.time {
            Some(time) => {
                let table = table_of(log, "time", time.file.as_deref(), &mut tables, &mut paths)?;
                let slot = tables[table].request("time.column", &time.column)?;
                Some((table, slot, time.unit.seconds() * time.scale))
            }
            None => None,
        };
        let rules = FoundRules::new(format, |key, column| tables[0].request(key, column))?;
        let groups = channel_groups(log, &mut tables, &mut paths)?;
        let other_stamps = other_stamps(format, time.map(|time| time.0), &mut tables);
        tables.iter_mut().for_each(ColumnSelection::finish_selection);
        let keep_every = format.keep_every.unwrap_or(1);
        let rows = match (format.rows, format.fraction) {
            (Some(rows), _) => rows,
            (None, Some([from, to])) => {
                let count = tables[0].count_rows(main, &log.row_count)?.div_ceil(keep_every) as f64;
                [(from * count).round() as u64, (to * count).round() as u64]
            }
            (None, None) => [0, u64::MAX],
        };
        Ok(Self {
            label: main.label(),
            joints: log.joints.clone(),
            tables,
            groups,
            time,
            other_stamps,
            max_difference_s: format.time.as_ref().map_or(f64::INFINITY, |time| time.max_difference_s),
            period_s: format.rate_hz.map_or(0.0, |rate_hz| keep_every as f64 / rate_hz),
            first_stamp_s: None,
            stamps: ContinuedStamps::new(time.map_or(1.0, |time| time.2)),
            rows,
            keep_every,
            time_range_s: format.time_range_s.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            rules,
            selection: describe_selection(format),
            missing: format.missing,
            next_row: 0,
            delivered: 0,
            finished: false,
            dropped: LinesDropped::default(),
        })
    }

    /// Rows and lines omitted so far.
    pub fn dropped(&self) -> &LinesDropped {
        &self.dropped
    }

    /// Name of the log in messages.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Name or index of the time column, for messages.
    pub fn time_label(&self) -> String {
        self.time.map_or_else(|| "none".to_owned(), |(table, slot, _)| self.tables[table].label_of_slot(slot))
    }

    /// Reads up to 4096 rows into `block`; false at the end of the log (with an empty `block`).
    ///
    /// # Errors
    /// If a row cannot be read, files of one log differ in length, or the selection contains no row.
    pub fn next_block(&mut self, block: &mut RawBlock) -> Result<bool, RecordingError> {
        block.row.clear();
        block.time_s.clear();
        for group in &mut self.groups {
            group.columns.iter_mut().for_each(Vec::clear);
        }
        while !self.finished && block.row.len() < MAX_BLOCK_ROWS {
            self.next_row_into(block)?;
        }
        for quantity in Quantity::ALL {
            let out = match quantity {
                Quantity::Position => &mut block.q,
                Quantity::Velocity => &mut block.dq,
                Quantity::Acceleration => &mut block.ddq,
                Quantity::Torque => &mut block.tau,
                Quantity::Temperature => &mut block.temperature_c,
                Quantity::Command => &mut block.command,
            };
            let Some(group) = self.groups.iter().find(|group| group.quantity == quantity) else {
                out.clear();
                continue;
            };
            out.resize(self.joints.len(), Vec::new());
            group.mapping.apply(&group.columns, out);
            for (joint, values) in out.iter().enumerate() {
                if let Some(at) = values.iter().position(|value| !(-MAX_VALUE..=MAX_VALUE).contains(value)) {
                    return Err(RecordingError::Overflow {
                        log: self.label.clone(),
                        row: block.row[at],
                        group: quantity.key(),
                        joint: self.joints[joint].clone(),
                    });
                }
            }
        }
        self.delivered += block.row.len() as u64;
        if block.row.is_empty() && self.delivered == 0 {
            return Err(if self.next_row == 0 && self.rows[1] > 0 {
                RecordingError::NoRows { place: self.tables[0].table.place() }
            } else {
                RecordingError::EmptySelection {
                    log: self.label.clone(),
                    selection: if self.selection.is_empty() {
                        "missing = \"drop\"".to_owned()
                    } else {
                        self.selection.clone()
                    },
                    rows: self.next_row,
                }
            });
        }
        Ok(!block.row.is_empty())
    }

    fn next_row_into(&mut self, block: &mut RawBlock) -> Result<(), RecordingError> {
        if self.next_row >= self.rows[1] {
            self.finished = true;
            return Ok(());
        }
        // The first row is always read, because times are relative to it.
        if self.next_row > 0 && self.next_row < self.rows[0] {
            return self.skip_row();
        }
        let (mut ended, mut missing) = (self.skip_thinned()?, None);
        let read = if ended.is_some() { &mut [][..] } else { &mut self.tables[..] };
        for (index, table) in read.iter_mut().enumerate() {
            if !table.next_row()? {
                ended = Some(index);
            } else if table.missing() {
                missing = Some(index);
            }
        }
        if let Some(index) = ended {
            self.finished = true;
            return self.check_ends(index);
        }
        let row = self.next_row;
        self.next_row += 1;
        if let Some(index) = missing {
            return self.leave_out_missing(row, index);
        }
        let time_s = match self.time {
            Some((table, slot, seconds)) => {
                let stamp = self.stamps.next(self.tables[table].values[slot]);
                // The difference of stamps is computed before scaling, because nanoseconds since 1970 would lose
                // precision in a multiplication.
                (stamp - *self.first_stamp_s.get_or_insert(stamp)) * seconds
            }
            None => row as f64 * self.period_s,
        };
        self.check_stamps(row)?;
        if row < self.rows[0] || time_s < self.time_range_s[0] || time_s >= self.time_range_s[1] {
            return Ok(());
        }
        if self.rules.drops(row, time_s, &self.tables[0].values) {
            self.dropped.by_rule += 1;
            return Ok(());
        }
        block.row.push(row);
        block.time_s.push(time_s);
        for group in &mut self.groups {
            for (column, (table, slot)) in group.columns.iter_mut().zip(&group.slots) {
                column.push(self.tables[*table].values[*slot]);
            }
        }
        Ok(())
    }

    /// Checks that all files of a log have the same time in a row.
    fn check_stamps(&self, row: u64) -> Result<(), RecordingError> {
        let Some((table, slot, seconds)) = self.time else { return Ok(()) };
        let stamp = self.tables[table].values[slot];
        for &(other, own) in &self.other_stamps {
            let difference_s = (self.tables[other].values[own] - stamp) * seconds;
            if difference_s.abs() > self.max_difference_s {
                return Err(RecordingError::ForeignFile {
                    log: self.tables[table].label.clone(),
                    other: self.tables[other].label.clone(),
                    column: self.time_label(),
                    row,
                    difference_s,
                });
            }
        }
        Ok(())
    }

    /// Skips the rows of the tables between two rows that `keep_every` keeps. Returns the index of a table that ended.
    fn skip_thinned(&mut self) -> Result<Option<usize>, RecordingError> {
        let mut ended = None;
        for _ in 1..if self.next_row > 0 { self.keep_every } else { 1 } {
            for (index, table) in self.tables.iter_mut().enumerate() {
                if !table.skip_row()? {
                    ended = Some(index);
                }
            }
            if ended.is_some() {
                break;
            }
        }
        Ok(ended)
    }

    /// Skips a row before the first row to use.
    fn skip_row(&mut self) -> Result<(), RecordingError> {
        let mut ended = self.skip_thinned()?;
        let skipped = if ended.is_some() { &mut [][..] } else { &mut self.tables[..] };
        for (index, table) in skipped.iter_mut().enumerate() {
            if !table.skip_row()? {
                ended = Some(index);
            }
        }
        self.finished = ended.is_some();
        self.next_row += u64::from(!self.finished);
        ended.map_or(Ok(()), |index| self.check_ends(index))
    }

    /// Omits a row with a missing value in table `index`, if a rule or the settings permit this.
    fn leave_out_missing(&mut self, row: u64, index: usize) -> Result<(), RecordingError> {
        let values = &self.tables[0].values;
        let since = |stamp: f64| {
            (self.stamps.continued(stamp) - self.first_stamp_s.unwrap_or(stamp)) * self.time.map_or(0.0, |time| time.2)
        };
        let stamp = |(table, slot, _): (usize, usize, f64)| since(self.tables[table].values[slot]);
        let time_s = self.time.map_or(row as f64 * self.period_s, stamp);
        // Rows that a rule excludes may contain invalid values.
        if self.rules.drops(row, time_s, values) {
            self.dropped.by_rule += u64::from(row >= self.rows[0]);
            return Ok(());
        }
        if self.missing == Missing::Error {
            return Err(self.tables[index].missing_error());
        }
        self.dropped.missing += u64::from(row >= self.rows[0]);
        Ok(())
    }

    /// Checks that all files of a log end at the same row; one truncated last row is tolerated.
    fn check_ends(&mut self, ended: usize) -> Result<(), RecordingError> {
        for table in &self.tables {
            if let Some(place) = table.table.truncated() {
                self.dropped.truncated = Some(place.to_string());
            }
        }
        let (rows, log) = (self.tables[ended].rows, self.tables[ended].label.clone());
        let tolerated = u64::from(self.dropped.truncated.is_some());
        for table in &mut self.tables {
            let longer = table.rows > rows;
            if longer && (table.rows > rows + tolerated || table.skip_row()?) {
                return Err(RecordingError::UnequalFiles { log, rows, other: table.label.clone() });
            }
        }
        Ok(())
    }
}

/// Columns in other files that have the name of the time column: index of the table, and index of the value in a row.
fn other_stamps(format: &LogFormat, own: Option<usize>, tables: &mut [ColumnSelection]) -> Vec<(usize, usize)> {
    let (Some(time), Some(own)) = (&format.time, own) else { return Vec::new() };
    let ColumnRef::Name(name) = &time.column else { return Vec::new() };
    let others = tables.iter_mut().enumerate().filter(|(table, other)| {
        let names = other.table.names().unwrap_or_default();
        *table != own && names.iter().filter(|known| *known == name).count() == 1
    });
    others.filter_map(|(table, other)| Some((table, other.request("time.column", &time.column).ok()?))).collect()
}

/// The channel groups of a log. Opens each separate file of a group once.
fn channel_groups(
    log: &Log,
    tables: &mut Vec<ColumnSelection>,
    paths: &mut Vec<Option<PathBuf>>,
) -> Result<Vec<Group>, RecordingError> {
    let mut groups = Vec::new();
    for (quantity, group) in log.format.groups() {
        let key = quantity.key();
        let files = group.files(key, &log.joints)?;
        let mut slots = Vec::new();
        for (at, column) in group.columns_of(key, &log.joints)?.iter().enumerate() {
            let file = files.get(at).or(files.first()).map(PathBuf::as_path);
            let table = table_of(log, key, file, tables, paths)?;
            slots.push((table, tables[table].request(&format!("{key}.columns"), column)?));
        }
        let mapping = Mapping::new(group, quantity, &log.joints)?;
        groups.push(Group { quantity, columns: vec![Vec::new(); slots.len()], slots, mapping });
    }
    Ok(groups)
}

/// Index of the table of `file`, relative to the folder of the main file; opens it if it is new.
fn table_of(
    log: &Log,
    key: &'static str,
    file: Option<&Path>,
    tables: &mut Vec<ColumnSelection>,
    paths: &mut Vec<Option<PathBuf>>,
) -> Result<usize, RecordingError> {
    let main = log.source();
    let Some(name) = file else { return Ok(0) };
    let beside = main.path().ok_or_else(|| RecordingError::NoFolder { log: main.label(), key })?;
    let path = Some(beside.parent().unwrap_or(Path::new("")).join(name));
    let table = paths.iter().position(|known| *known == path).unwrap_or(paths.len());
    if let (Some(path), true) = (&path, table == paths.len()) {
        let source = FileLog::new(path, &log.format);
        tables.push(ColumnSelection::new(source.label(), source.open()?));
        paths.push(Some(path.clone()));
    }
    Ok(table)
}

fn describe_selection(format: &LogFormat) -> String {
    let mut selection = Vec::new();
    match (format.rows, format.fraction) {
        (Some(rows), _) => selection.push(format!("rows = {rows:?}")),
        (None, Some([from, to])) => selection.push(format!("fraction = [{from}, {to}]")),
        (None, None) => {}
    }
    if let Some(every) = format.keep_every.filter(|every| *every > 1) {
        selection.push(format!("keep_every = {every}"));
    }
    let rules_in_force = [
        (!format.drop_rows.is_empty()).then_some("drop_rows"),
        (!format.drop_time_s.is_empty()).then_some("drop_time_s"),
        (!format.drop_where.is_empty()).then_some("drop_where"),
        (!format.keep_where.is_empty()).then_some("keep_where"),
    ];
    selection.extend(rules_in_force.into_iter().flatten().map(str::to_owned));
    if let Some(range) = format.time_range_s {
        selection.push(format!("time_range_s = {range:?}"));
    }
    selection.join(", ")
}
