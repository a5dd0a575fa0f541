//! Beginning of a text table: a preamble before it, names in a comment, and rows with text that have no header.

use super::field::number;
use super::text_columns::{are_units, guessed_delimiter, split, text_of};

/// Number of bytes in which the beginning is searched.
pub(super) const HEAD_BYTES: usize = 1 << 18;
/// Number of rows after a preamble that must have the same number of fields.
const MIN_ROWS: usize = 3;
/// Last name of a table of LabVIEW, whose rows have no such field.
const COMMENT_COLUMN: &[u8] = b"Comment";

/// Beginning of a text table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct TableStart {
    /// Number of lines before the names.
    pub(super) preamble_lines: u64,
    /// Line number of the first row after a preamble; 0 without a preamble.
    pub(super) first_row: u64,
    /// Whether the first line is a row although it contains text.
    pub(super) is_row: bool,
    /// Names of the columns of a table without a header.
    pub(super) names: Option<Vec<String>>,
}

/// A line.
struct Line<'a> {
    number: u64,
    fields: Vec<&'a [u8]>,
}

impl<'a> Line<'a> {
    fn new(number: u64, text: &'a [u8], delimiter: u8) -> Self {
        let mut ranges = Vec::new();
        split(text, delimiter, &mut ranges);
        Self { number, fields: ranges.into_iter().map(|(from, to)| &text[from..to]).collect() }
    }

    fn begins_with_number(&self, delimiter: u8) -> bool {
        self.fields.first().is_some_and(|field| number(field, delimiter != b',').is_some())
    }

    fn is_mostly_numbers(&self, delimiter: u8) -> bool {
        let numbers = self.fields.iter().filter(|field| number(field, delimiter != b',').is_some()).count();
        2 * numbers > self.fields.len()
    }

    /// Number of different texts, if it can name `count` columns.
    fn different_names(&self, count: usize) -> Option<usize> {
        let has_comments = self.fields.len() == count + 1 && self.fields[count] == COMMENT_COLUMN;
        if self.fields.len() != count && !has_comments {
            return None;
        }
        let is_name = |field: &&&[u8]| !field.is_empty() && number(field, true).is_none();
        let mut names: Vec<&&[u8]> = self.fields.iter().filter(is_name).collect();
        names.sort_unstable();
        names.dedup();
        Some(names.len())
    }
}

impl TableStart {
    /// The beginning of the table in the first bytes of a text.
    pub(super) fn find(head: &[u8], delimiter: Option<u8>) -> Self {
        let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
        // The last line may be cut off.
        let complete = head.iter().rposition(|byte| *byte == b'\n').map_or(&[][..], |at| &head[..at]);
        let lines = (1..).zip(complete.split(|byte| *byte == b'\n'));
        let lines = lines.map(|(number, line)| (number, line.strip_suffix(b"\r").unwrap_or(line)));
        let lines = lines.filter(|(_, line)| !line.trim_ascii().is_empty());
        let (comments, lines): (Vec<_>, Vec<_>) = lines.partition(|(_, line)| line.trim_ascii_start()[0] == b'#');
        let Some((first_number, first)) = lines.first().copied() else { return Self::default() };
        let delimiter_of = |line: &[u8]| delimiter.unwrap_or_else(|| guessed_delimiter(line));
        if let Some(start) = after_preamble(&lines, delimiter_of) {
            return start;
        }
        let delimiter = delimiter_of(first);
        let first = Line::new(first_number, first, delimiter);
        let second = lines.get(1).map(|(number, line)| Line::new(*number, line, delimiter));
        let is_row = second.is_some_and(|second| has_equal_texts(&first, &second, delimiter));
        let of_comment = || {
            let before = comments.iter().rev().filter(|(number, _)| *number < first_number);
            before.into_iter().find_map(|(_, comment)| names_in_comment(comment, delimiter, first.fields.len()))
        };
        let names = if is_row { joint_state_names(&first.fields) } else { of_comment() };
        Self { is_row, names, ..Self::default() }
    }
}

/// The beginning of a table after lines that are not part of it. The first field of a row is a number, that of a line
/// before it is not, and the line of the names has as many fields as the rows.
fn after_preamble(lines: &[(u64, &[u8])], delimiter_of: impl Fn(&[u8]) -> u8) -> Option<TableStart> {
    let begins = |(_, line): &(u64, &[u8])| {
        let delimiter = delimiter_of(line);
        Line::new(0, line, delimiter).begins_with_number(delimiter)
    };
    let at = lines.iter().position(begins)?;
    let delimiter = delimiter_of(lines[at].1);
    let line = |(number, text): &(u64, &'_ [u8])| Line::new(*number, text, delimiter).fields.len();
    let count = line(&lines[at]);
    let rows = &lines[at..lines.len().min(at + MIN_ROWS)];
    if count < 2 || rows.len() < MIN_ROWS || rows.iter().any(|row| line(row) != count || !begins(row)) {
        return None;
    }
    let above = lines[..at].iter().rev().map_while(|(number, text)| {
        let line = Line::new(*number, text, delimiter);
        let different = line.different_names(count)?;
        let mut ranges = Vec::new();
        split(text, delimiter, &mut ranges);
        let different = if are_units(text, &ranges) { 0 } else { different };
        Some((different, line))
    });
    let above: Vec<(usize, Line)> = above.collect();
    // A row that begins with a text.
    if above.iter().any(|(_, line)| line.is_mostly_numbers(delimiter)) {
        return None;
    }
    let (_, header) = above.iter().max_by_key(|(different, line)| (*different, line.number))?;
    // The names in the first line, and units or further names in the second, are a usual header.
    let is_usual = above.len() == at && at <= 2 && header.fields.len() == count;
    (!is_usual).then(|| TableStart {
        preamble_lines: header.number - 1,
        first_row: lines[at].0,
        ..TableStart::default()
    })
}

/// Whether both lines are rows of the same table that contain equal texts, such as the names of joints.
fn has_equal_texts(first: &Line, second: &Line, delimiter: u8) -> bool {
    let comma = delimiter != b',';
    let is_number = |field: &[u8]| number(field, comma).is_some();
    let mut pairs = first.fields.iter().zip(&second.fields);
    first.fields.len() == second.fields.len()
        && first.fields.iter().any(|field| is_number(field))
        && !first.fields.iter().all(|field| is_number(field))
        && pairs.all(|(first, second)| first == second && !is_number(first) || is_number(first) && is_number(second))
}

/// The names of `count` columns in a comment.
fn names_in_comment(comment: &[u8], delimiter: u8, count: usize) -> Option<Vec<String>> {
    let text = comment.trim_ascii_start();
    let line = Line::new(0, text.strip_prefix(b"#").unwrap_or(text), delimiter);
    (line.fields.len() == count && line.different_names(count) == Some(count))
        .then(|| line.fields.iter().map(|field| text_of(field)).collect())
}

/// The names of the columns of `ros2 topic echo --csv` for `sensor_msgs/JointState`: stamp, frame, names of joints, and
/// their positions, velocities and efforts.
fn joint_state_names(fields: &[&[u8]]) -> Option<Vec<String>> {
    const QUANTITIES: [&str; 3] = ["position", "velocity", "effort"];
    let is_number = |field: &&&[u8]| number(field, false).is_some();
    let (stamp, rest) = fields.split_at_checked(3)?;
    let joints = rest.iter().take_while(|field| !is_number(field)).count();
    let is_message = stamp.iter().filter(is_number).count() == 2
        && !is_number(&&stamp[2])
        && joints > 0
        && rest.len() == joints * (1 + QUANTITIES.len())
        && rest[joints..].iter().all(|field| is_number(&field));
    let numbered = |name: &'static str| (0..joints).map(move |joint| format!("{name}{joint}"));
    let of_stamp = ["sec", "nanosec", "frame_id"].map(str::to_owned);
    is_message.then(|| of_stamp.into_iter().chain(["name"].into_iter().chain(QUANTITIES).flat_map(numbered)).collect())
}

/// Numbers the repeated names of a table with a column of time stamps before each channel, as TwinCAT Scope writes it:
/// `Time, q1, Time, q2` becomes `Time, q1, Time[1], q2`.
pub(super) fn number_repeated_stamps(mut names: Vec<String>) -> Vec<String> {
    let is_paired = names.len() >= 4
        && names.len().is_multiple_of(2)
        && names.iter().step_by(2).all(|name| *name == names[0])
        && names.iter().skip(1).step_by(2).all(|name| *name != names[0] && !name.is_empty());
    if is_paired {
        for (pair, name) in names.iter_mut().step_by(2).enumerate().skip(1) {
            *name = format!("{name}[{pair}]");
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(text: &str) -> TableStart {
        TableStart::find(text.as_bytes(), None)
    }

    #[test]
    fn preambles_end_at_the_names() {
        let rows = "0\t1,5\t2\n8\t1\t2\n16\t1\t2\n";
        for preamble in [
            "Name\tScope\nFile\tC:\\a.svdx\n\n",
            "Operator\tlab\nChannels\t2\t\nSamples\t3\t3\t3\n***End***\t\n",
            "a line of text\n# a comment\n",
        ] {
            let lines = preamble.matches('\n').count() as u64;
            for (names, expected) in
                [("t\tq1\tq2\n", 2), ("t\tq1\tq2\nType\tREAL\tREAL\n\n", 4), ("t\tq1\tq2\tComment\n", 2)]
            {
                let start = find(&format!("{preamble}{names}{rows}"));
                assert_eq!((start.preamble_lines, start.first_row), (lines, lines + expected), "{preamble}{names}");
            }
        }
    }

    #[test]
    fn units_are_not_names() {
        let start = find("a run\nt,q1,tau1\ns,rad,Nm\n0,1,2\n1,1,2\n2,1,2\n");
        assert_eq!((start.preamble_lines, start.first_row), (1, 4));
    }

    #[test]
    fn tables_without_a_preamble_are_left_alone() {
        for text in [
            "t,q1\n0,1\n1,2\n2,3\n",
            "t,q1\ns,rad\n0,1\n1,2\n2,3\n",
            "t,q,q,tau\ns,a,b,c\n0,1,2,3\n1,1,2,3\n2,1,2,3\n",
            "mode,q1,q2\nINIT,0,1\nINIT,0,1\n1,0,1\n1,0,1\n1,0,1\n",
            // A missing name, and a row that is too short, are errors.
            "t,q1\n0,1,2\n1,2,3\n2,3,4\n",
            "t,q1,q2\n0,1\n1,2,3\n2,3,4\n",
            "0,1\n1,2\n2,3\n",
            "",
        ] {
            assert_eq!(find(text), TableStart::default(), "{text}");
        }
    }

    #[test]
    fn names_are_found_in_the_comment_above_the_rows() {
        let start = find("# run of iiwa\n# t q_0 tau_0\n0 1 2\n1 1 2\n");
        assert_eq!(start.names.unwrap(), ["t", "q_0", "tau_0"]);
        assert_eq!(find("# rate 500 Hz\n0 1\n# t q\n").names, None);
    }

    #[test]
    fn rows_with_equal_texts_are_no_header() {
        let row = |second: &str| format!("171,8000000{second},base,elbow,wrist,0.1,0.2,0,0,-1,-2\n");
        let start = find(&(row("0") + &row("1")));
        assert!(start.is_row);
        let names = start.names.unwrap();
        assert_eq!([&names[1], &names[4], &names[5], &names[10]], ["nanosec", "name1", "position0", "effort1"]);
        assert!(!find("t,mode\n0,A\n").is_row && find("A,1,2\nA,3,4\n").is_row);
        assert_eq!(find("A,1,2\nA,3,4\n").names, None);
    }

    #[test]
    fn stamps_of_each_channel_are_numbered() {
        let names = |list: &[&str]| number_repeated_stamps(list.iter().map(|name| (*name).to_owned()).collect());
        assert_eq!(names(&["Name", "q1", "Name", "q2"]), ["Name", "q1", "Name[1]", "q2"]);
        assert_eq!(names(&["t", "q1", "q1", "q2"]), ["t", "q1", "q1", "q2"]);
    }
}
