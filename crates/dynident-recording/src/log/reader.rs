//! Logs as a stream of blocks: paired files, ranges, mapping to joints. Memory does not grow with the log.

use super::columns::ColumnSelection;
use super::format::{LogFormat, Missing};
use super::found_rules::FoundRules;
use super::mapping::Mapping;
use super::source::LogSource;
use super::units::Quantity;
use super::{FileLog, Log};
use crate::error::RecordingError;
use std::path::Path;

/// Maximum position or torque: its squares and its second differences per second squared are finite.
const MAX_VALUE: f64 = 1e60;

const MAX_BLOCK_ROWS: usize = 4096;

/// Successive rows of a log in joint values (SI), as logged: no filter, no resampling.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawBlock {
    /// 0-based data row in the file of each sample; not contiguous where rows were left out.
    pub row: Vec<u64>,
    /// Seconds after the first data row of the file.
    pub time_s: Vec<f64>,
    /// Positions, one vector for each joint (rad, m).
    pub q: Vec<Vec<f64>>,
    /// Logged velocities; empty without a `velocity` group.
    pub dq: Vec<Vec<f64>>,
    /// Logged accelerations; empty without an `acceleration` group.
    pub ddq: Vec<Vec<f64>>,
    /// Torques (N m, N).
    pub tau: Vec<Vec<f64>>,
    /// Temperatures (°C); empty without a `temperature` group.
    pub temperature_c: Vec<Vec<f64>>,
}

impl RawBlock {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.row.len()
    }
}

/// Rows that the reader left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LinesDropped {
    /// Rows with an empty, NaN or infinite field, under `missing = "drop"`.
    pub missing: u64,
    /// Rows left out by `drop_rows`, `drop_time_s`, `drop_where` and `keep_where`.
    #[serde(default)]
    pub by_rule: u64,
    /// File and line of a truncated last row.
    pub truncated: Option<String>,
}

#[derive(Debug)]
struct Group {
    quantity: Quantity,
    table: usize,
    slots: Vec<usize>,
    mapping: Mapping,
    columns: Vec<Vec<f64>>,
}

/// One pass over a log: converts raw columns to joint values in SI and applies ranges and rules for missing values.
#[derive(Debug)]
pub struct LogReader {
    label: String,
    joints: Vec<String>,
    tables: Vec<ColumnSelection>,
    groups: Vec<Group>,
    /// Slot of the time column in the main table, and its factor to seconds.
    time: Option<(usize, f64)>,
    period_s: f64,
    first_stamp_s: Option<f64>,
    rows: [u64; 2],
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
        let time = match &format.time {
            Some(time) => Some((tables[0].request("time.column", &time.column)?, time.unit.seconds() * time.scale)),
            None => None,
        };
        let rules = FoundRules::new(format, |key, column| tables[0].request(key, column))?;
        let groups = channel_groups(log, &mut tables)?;
        tables.iter_mut().for_each(ColumnSelection::finish_selection);
        let rows = match (format.rows, format.fraction) {
            (Some(rows), _) => rows,
            (None, Some([from, to])) => {
                let count = tables[0].count_rows(main, &log.row_count)? as f64;
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
            period_s: format.rate_hz.map_or(0.0, f64::recip),
            first_stamp_s: None,
            rows,
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

    /// Rows and lines left out so far.
    pub fn dropped(&self) -> &LinesDropped {
        &self.dropped
    }

    /// Name of the log in messages.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Name or index of the time column, for messages.
    pub fn time_label(&self) -> String {
        self.time.map_or_else(|| "none".to_owned(), |(slot, _)| self.tables[0].label_of_slot(slot))
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
        // Always read the first row, because times are relative to it.
        if self.next_row > 0 && self.next_row < self.rows[0] {
            return self.skip_row();
        }
        let (mut ended, mut missing) = (None, None);
        for (index, table) in self.tables.iter_mut().enumerate() {
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
            Some((slot, seconds)) => {
                let stamp = self.tables[0].values[slot];
                // Subtract stamps before scaling: nanoseconds since 1970 lose precision in the multiplication.
                (stamp - *self.first_stamp_s.get_or_insert(stamp)) * seconds
            }
            None => row as f64 * self.period_s,
        };
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
            let values = &self.tables[group.table].values;
            for (column, slot) in group.columns.iter_mut().zip(&group.slots) {
                column.push(values[*slot]);
            }
        }
        Ok(())
    }

    /// Skips a row before the first requested one.
    fn skip_row(&mut self) -> Result<(), RecordingError> {
        let mut ended = None;
        for (index, table) in self.tables.iter_mut().enumerate() {
            if !table.skip_row()? {
                ended = Some(index);
            }
        }
        self.finished = ended.is_some();
        self.next_row += u64::from(!self.finished);
        ended.map_or(Ok(()), |index| self.check_ends(index))
    }

    /// Leaves out a row with a missing value in table `index`, if a rule or the settings allow it.
    fn leave_out_missing(&mut self, row: u64, index: usize) -> Result<(), RecordingError> {
        let values = &self.tables[0].values;
        let since = |stamp: f64| (stamp - self.first_stamp_s.unwrap_or(stamp)) * self.time.map_or(0.0, |time| time.1);
        let time_s = self.time.map_or(row as f64 * self.period_s, |(slot, _)| since(values[slot]));
        // Rows that a rule leaves out may contain invalid values.
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

    /// Checks that the files of one log end together; one truncated last row is tolerated.
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

/// The channel groups of a log. Opens each separate file of a group once.
fn channel_groups(log: &Log, tables: &mut Vec<ColumnSelection>) -> Result<Vec<Group>, RecordingError> {
    let (format, main) = (&log.format, log.source());
    let mut paths = vec![main.path().map(Path::to_owned)];
    let mut groups = Vec::new();
    for (quantity, group) in format.groups() {
        let key = quantity.key();
        let path = match &group.file {
            None => main.path().map(Path::to_owned),
            Some(name) => {
                let beside = main.path().ok_or_else(|| RecordingError::NoFolder { log: main.label(), key })?;
                Some(beside.parent().unwrap_or(Path::new("")).join(name))
            }
        };
        let table = paths.iter().position(|known| *known == path).unwrap_or(paths.len());
        if let (Some(path), true) = (&path, table == paths.len()) {
            let source = FileLog::new(path, format);
            tables.push(ColumnSelection::new(source.label(), source.open()?));
            paths.push(Some(path.clone()));
        }
        let list = group.column_list(key)?;
        let slots = list.iter().map(|column| tables[table].request(&format!("{key}.columns"), column));
        let slots = slots.collect::<Result<Vec<_>, _>>()?;
        let mapping = Mapping::new(group, quantity, log.joints.len())?;
        groups.push(Group { quantity, table, columns: vec![Vec::new(); slots.len()], slots, mapping });
    }
    Ok(groups)
}

fn describe_selection(format: &LogFormat) -> String {
    let mut selection = Vec::new();
    match (format.rows, format.fraction) {
        (Some(rows), _) => selection.push(format!("rows = {rows:?}")),
        (None, Some([from, to])) => selection.push(format!("fraction = [{from}, {to}]")),
        (None, None) => {}
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
