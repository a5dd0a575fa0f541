//! The log that a person provides: a table `t_s, q1.., tau1..`.

use dynident_files::quoted;
use dynident_simulation::Record;
use thiserror::Error;

const MAX_LOG_BYTES: u64 = 1 << 30;

/// An error in a log.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LogTableError {
    /// The log file of the run cannot be opened, or is not CSV text. Write it again.
    #[error("{reason}")]
    Unreadable {
        /// Error of the operating system.
        reason: String,
    },
    /// The first line of the log must name all columns. Correct it as the message states.
    #[error("column {column} is missing in line 1 (`{found}`): write {}, separated by commas", expected.join(","))]
    NoColumn {
        /// Name of the missing column.
        column: String,
        /// Names of all required columns.
        expected: Vec<String>,
        /// The header line.
        found: String,
    },
    /// The line has fewer or more fields than the first line of the file. Write the row again, completely.
    #[error("line {line}: {found} fields where the header has {expected}")]
    Fields {
        /// Line number, from 1.
        line: usize,
        /// Number of columns in the header.
        expected: usize,
        /// Number of fields in the row.
        found: usize,
    },
    /// The field is empty, text, NaN or infinite. Write a number.
    #[error("line {line}, column {column}: `{field}` is not a finite number")]
    NotANumber {
        /// Line number, from 1.
        line: usize,
        /// The column.
        column: String,
        /// The field.
        field: String,
    },
    /// Each row must have a later time than the one before. Write each sample once, in order of time.
    #[error("line {line}: time {time_s} s does not come after the line before")]
    Time {
        /// Line number, from 1.
        line: usize,
        /// Time in that line, s.
        time_s: f64,
    },
    /// The program is still writing the log, so the run is not used yet. Write the file under another name and rename
    /// it when it is complete.
    #[error("the log is not complete: {reason}")]
    Incomplete {
        /// The missing part.
        reason: String,
    },
}

/// Reads a log of the joints: columns `t_s`, `q1..`, `tau1..` in any order; other columns are ignored. Units:
/// seconds, rad (m), Nm (N).
///
/// # Errors
/// [`LogTableError`] with the line; [`LogTableError::Incomplete`] if the last line is unfinished.
pub fn read_log_table(path: &std::path::Path, joints: &[String], rate_hz: f64) -> Result<Record, LogTableError> {
    read_log_with_currents(path, joints, rate_hz, None)
}

/// Reads a log like [`read_log_table`]. With torque constants, Nm/A (N/A), the log can have currents `i1..`, A,
/// instead of `tau1..`.
pub(super) fn read_log_with_currents(
    path: &std::path::Path,
    joints: &[String],
    rate_hz: f64,
    constants: Option<&[f64]>,
) -> Result<Record, LogTableError> {
    let unreadable = |error: std::io::Error| LogTableError::Unreadable { reason: error.to_string() };
    parse(&dynident_files::read_text(path, MAX_LOG_BYTES).map_err(unreadable)?, joints, rate_hz, constants)
}

fn parse(text: &str, joints: &[String], rate_hz: f64, constants: Option<&[f64]>) -> Result<Record, LogTableError> {
    let incomplete = |reason: &str| LogTableError::Incomplete { reason: reason.to_owned() };
    if !text.ends_with('\n') {
        return Err(incomplete("its last line is unfinished"));
    }
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, first_line) = lines.next().ok_or_else(|| incomplete("it is empty"))?;
    let header: Vec<&str> = first_line.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
    let numbered = |prefix: &'static str| (1..=joints.len()).map(move |joint| format!("{prefix}{joint}"));
    let constants = constants.filter(|_| !header.contains(&"tau1") && header.contains(&"i1"));
    let torque = if constants.is_some() { "i" } else { "tau" };
    let expected: Vec<String> =
        core::iter::once("t_s".to_owned()).chain(numbered("q")).chain(numbered(torque)).collect();
    let places: Vec<usize> = expected
        .iter()
        .map(|column| {
            header.iter().position(|name| name == column).ok_or_else(|| LogTableError::NoColumn {
                column: column.clone(),
                expected: expected.clone(),
                found: quoted(first_line),
            })
        })
        .collect::<Result<_, _>>()?;
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); expected.len()];
    for (line, text) in lines {
        let line = line + 1;
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        if fields.len() != header.len() {
            return Err(LogTableError::Fields { line, expected: header.len(), found: fields.len() });
        }
        for (column, &place) in places.iter().enumerate() {
            let value: Option<f64> = fields[place].parse().ok().filter(|x: &f64| x.is_finite());
            let value = value.ok_or_else(|| LogTableError::NotANumber {
                line,
                column: expected[column].clone(),
                field: quoted(fields[place]),
            })?;
            if column == 0 && columns[0].last().is_some_and(|&before| value <= before) {
                return Err(LogTableError::Time { line, time_s: value });
            }
            columns[column].push(value);
        }
    }
    let samples = columns[0].len();
    if samples == 0 {
        return Err(incomplete("it has no rows"));
    }
    let mut columns = columns.into_iter();
    let times_s = columns.next().unwrap_or_default();
    let q = columns.by_ref().take(joints.len()).flatten().collect();
    let mut tau: Vec<f64> = columns.flatten().collect();
    for (own, constant) in tau.chunks_exact_mut(samples).zip(constants.unwrap_or_default()) {
        for value in own {
            *value *= constant;
        }
    }
    Ok(Record { joints: joints.to_vec(), rate_hz, samples, times_s, q, tau })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_read_by_name_and_refused_by_line() {
        let joints = ["a".to_owned(), "b".to_owned()];
        let read = |text: &str| parse(text, &joints, 100.0, None);
        let good = "tau2,t_s,q1,q2,tau1,spare\n4,0,1,2,3,x\n8,0.01,5,6,7,x\n";
        let record = read(good).unwrap();
        assert_eq!((record.samples, &record.q, &record.tau), (2, &vec![1.0, 5.0, 2.0, 6.0], &vec![3.0, 7.0, 4.0, 8.0]));
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message(good.trim_end()).contains("unfinished"));
        assert!(message("").contains("unfinished") && message("\n").contains("empty"));
        assert!(message("t_s,q1,q2,tau1\n").contains("tau2"));
        assert!(message(&good.replace("0.01", "0")).contains("line 3"));
        assert!(message(&good.replace(",7,", ",nan,")).contains("column tau1"));
        assert!(message(&good.replace(",7,", ",")).contains("line 3: 5 fields"));
        assert!(message("t_s,q1,q2,tau1,tau2\n").contains("no rows"));
        assert!(message("t_s;q1;q2;tau1;tau2\n0;1;2;3;4\n").contains("(`t_s;q1;q2;tau1;tau2`)"));
        let currents = "t_s,q1,q2,i1,i2\n0,1,2,3,4\n";
        assert!(message(currents).contains("column tau1 is missing"));
        assert_eq!(parse(currents, &joints, 100.0, Some(&[10.0, -2.0])).unwrap().tau, [30.0, -8.0]);
    }
}
