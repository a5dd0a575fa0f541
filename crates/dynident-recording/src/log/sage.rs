//! The folder of a SAGE recording as one table: measurements, combined with commands by their time stamps.

use super::format::Header;
use super::source::LogTable;
use super::text::TextTable;
use crate::error::RecordingError;
use crate::place::LogPlace;
use dynident_formats::{Contents, FileError, SAGE_FILES, sage_joints};
use std::path::Path;

/// Name of the column of time stamps in both files, µs.
const STAMP: &str = "timestamp";

/// The rows of `state_motor.csv`, each with the last command at or before its time stamp. Rows before the first and
/// after the last command are omitted.
///
/// Columns are `timestamp` and the entries of all lists: `control.positions[Elbow]`, `state_motor.positions[Elbow]`.
/// Entries have the names in `joint_list.txt` if this file contains a name for each entry; otherwise they have indices
/// from 0.
#[derive(Debug)]
pub(super) struct SageTable {
    names: Vec<String>,
    /// For each column, its table (0 for commands, 1 for measurements) and its column there.
    columns: Vec<(usize, usize)>,
    tables: [TextTable; 2],
    stamps: [usize; 2],
    label: String,
    /// For each selected column, its table and the index of its value in a row of this table.
    wanted: Vec<(usize, usize)>,
    state: Vec<f64>,
    command_width: usize,
    /// The command at or before the current time stamp, and the next command; each begins with its stamp.
    command: Option<Vec<f64>>,
    next_command: Option<Vec<f64>>,
    has_begun: bool,
}

impl SageTable {
    pub(super) fn open(folder: &Path) -> Result<Self, RecordingError> {
        let joints = sage_joints(folder)?;
        let [commands, states] = SAGE_FILES.map(|file| text_table(&folder.join(file)));
        let tables = [commands?, states?];
        let (mut names, mut columns) = (vec![STAMP.to_owned()], Vec::new());
        let mut stamps = [0; 2];
        for (index, (table, file)) in tables.iter().zip(SAGE_FILES).enumerate() {
            let of_table = table.names().unwrap_or_default();
            stamps[index] = of_table.iter().position(|name| name == STAMP).ok_or_else(|| unknown_stamp(table))?;
            let stem = file.trim_end_matches(".csv");
            for (column, name) in of_table.iter().enumerate() {
                let Some((list, entry)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) else {
                    continue;
                };
                let prefix = format!("{list}[");
                let count = of_table.iter().filter(|other| other.starts_with(&prefix)).count();
                let joint = entry.parse().ok().and_then(|entry: usize| joints.get(entry));
                let entry = joint.filter(|_| count == joints.len()).map_or(entry, String::as_str);
                names.push(format!("{stem}.{list}[{entry}]"));
                columns.push((index, column));
            }
        }
        columns.insert(0, (1, stamps[1]));
        let label = folder.display().to_string();
        let mut table = Self {
            names,
            columns,
            tables,
            stamps,
            label,
            wanted: Vec::new(),
            state: Vec::new(),
            command_width: 0,
            command: None,
            next_command: None,
            has_begun: false,
        };
        table.select(&[]);
        Ok(table)
    }

    /// Reads the next command after `next_command`.
    fn advance_command(&mut self) -> Result<(), RecordingError> {
        let before = self.next_command.take();
        let mut row = vec![0.0; self.command_width];
        loop {
            if !self.tables[0].next_row(&mut row)? {
                break;
            }
            // A command without a stamp cannot be joined.
            if row[0].is_finite() {
                let is_earlier = before.as_ref().is_some_and(|before| row[0] < before[0]);
                if is_earlier {
                    let file = SAGE_FILES[0];
                    return Err(RecordingError::Unordered {
                        log: format!("{}, {file}", self.label),
                        backward: 1,
                        rows: self.tables[0].rows_read(),
                    });
                }
                self.next_command = Some(row);
                break;
            }
        }
        self.command = before;
        Ok(())
    }

    /// Moves to the next measurement that has a command; returns false at the end.
    fn advance(&mut self) -> Result<bool, RecordingError> {
        if !core::mem::replace(&mut self.has_begun, true) {
            self.advance_command()?;
        }
        let mut state = core::mem::take(&mut self.state);
        let found = loop {
            if !self.tables[1].next_row(&mut state)? {
                break false;
            }
            let stamp = state[0];
            while self.next_command.as_ref().is_some_and(|next| next[0] <= stamp) {
                self.advance_command()?;
            }
            match (&self.command, &self.next_command) {
                // The commands end here, unless the last one has the time stamp of this measurement.
                (Some(last), None) if last[0] < stamp => break false,
                (None, None) => break false,
                (None, Some(_)) if stamp.is_finite() => {}
                _ => break true,
            }
        };
        self.state = state;
        Ok(found)
    }
}

impl LogTable for SageTable {
    fn width(&self) -> usize {
        self.names.len()
    }

    fn names(&self) -> Option<&[String]> {
        Some(&self.names)
    }

    fn unit(&self, column: usize) -> Option<&str> {
        (column == 0).then_some("us")
    }

    fn notes(&self) -> Vec<String> {
        vec![format!(
            "{} joined with {} by time stamps: each row has the last command at or before it",
            SAGE_FILES[1], SAGE_FILES[0]
        )]
    }

    fn select(&mut self, fields: &[usize]) {
        let mut own = self.stamps.map(|stamp| vec![stamp]);
        self.wanted.clear();
        for field in fields {
            let (table, column) = self.columns[*field];
            let place = own[table].iter().position(|known| *known == column);
            self.wanted.push((table, place.unwrap_or(own[table].len())));
            if place.is_none() {
                own[table].push(column);
            }
        }
        self.tables.iter_mut().zip(&own).for_each(|(table, fields)| table.select(fields));
        self.state = vec![0.0; own[1].len()];
        self.command_width = own[0].len();
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, RecordingError> {
        if !self.advance()? {
            return Ok(false);
        }
        for (value, (table, place)) in values.iter_mut().zip(&self.wanted) {
            let row = if *table == 0 { self.command.as_deref().unwrap_or_default() } else { &self.state[..] };
            *value = row.get(*place).copied().unwrap_or(f64::NAN);
        }
        Ok(true)
    }

    fn skip_row(&mut self) -> Result<bool, RecordingError> {
        self.advance()
    }

    fn place(&self) -> LogPlace {
        self.tables[1].place()
    }

    fn truncated(&self) -> Option<LogPlace> {
        self.tables.iter().find_map(LogTable::truncated)
    }
}

fn text_table(file: &Path) -> Result<TextTable, RecordingError> {
    match dynident_formats::open(file)?.contents {
        Contents::Text(text) => TextTable::open(file, text, Header::Present, Some(',')),
        Contents::Table(_) => Err(FileError::OtherFormat {
            file: file.to_owned(),
            format: "not a text table, as a SAGE recording has",
            fix: "write it as CSV with the columns type, timestamp and positions",
        }
        .into()),
    }
}

fn unknown_stamp(table: &TextTable) -> RecordingError {
    RecordingError::UnknownColumn {
        place: table.place(),
        key: "time.column".to_owned(),
        wanted: STAMP.to_owned(),
        hint: "both files of a SAGE recording have the columns type, timestamp and positions".to_owned(),
    }
}
