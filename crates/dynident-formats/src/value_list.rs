//! Text with one value on each line and the shape of the array in its header: `np.savetxt` with a comment `shape: (40,
//! 5)`, two numbers on the first line, or the array format of Matrix Market
//! (<https://math.nist.gov/MatrixMarket/formats.html>).

use crate::arrays::{Array, ArrayTable};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, SPLIT_FIX};
use crate::table::Table;
use crate::text_number::{comments, number, plain_lines};
use std::io::{BufRead, Read};
use std::path::Path;

const MATRIX_MARKET: &[u8] = b"%%MatrixMarket matrix array ";
/// Maximum length of a line, bytes.
const MAX_LINE_BYTES: u64 = 1 << 16;
const COPY: &str = "write or copy the file again";

#[derive(Clone, Debug, PartialEq, Eq)]
struct Shape {
    sides: Vec<usize>,
    /// Whether values are stored column by column, otherwise row by row.
    by_columns: bool,
    /// Whether the first line that is not a comment contains the shape.
    on_first_line: bool,
}

/// The shape in the first bytes of a file; `None` for other files.
fn shape(head: &[u8]) -> Option<Shape> {
    let mut lines = plain_lines(head);
    let first = lines.next()?;
    let (words, next) = (words(first), lines.next().map(words).unwrap_or_default());
    let is_single = |words: &[&[u8]]| matches!(words, [word] if number(word, b' ').is_some());
    let sides = |words: &[&[u8]]| -> Option<Vec<usize>> {
        words.iter().map(|word| core::str::from_utf8(word).ok()?.parse().ok()).collect()
    };
    if head.starts_with(MATRIX_MARKET) {
        return Some(Shape { sides: sides(&words)?, by_columns: true, on_first_line: true });
    }
    for comment in comments(head) {
        let comment = String::from_utf8_lossy(comment).to_ascii_lowercase();
        let Some((before, after)) = comment.split_once("shape") else { continue };
        let end = after.find(|c: char| !(c.is_ascii_digit() || " ,;:=()[]x".contains(c))).unwrap_or(after.len());
        let numbers = after[..end].split(|c: char| !c.is_ascii_digit()).filter(|word| !word.is_empty());
        let sides: Option<Vec<usize>> = numbers.map(|word| word.parse().ok()).collect();
        let sides = sides.filter(|sides| sides.len() >= 2)?;
        let rest = format!("{before} {}", &after[end..]);
        let by_columns =
            ["fortran", "column", "order: f", "order=f", "order='f'"].iter().any(|word| rest.contains(word));
        return is_single(&words).then_some(Shape { sides, by_columns, on_first_line: false });
    }
    // Two whole numbers on the first line and then one number on each line: this cannot be a table.
    let sides = sides(&words).filter(|sides| sides.len() == 2 && sides.iter().all(|side| *side > 0))?;
    is_single(&next).then_some(Shape { sides, by_columns: false, on_first_line: true })
}

/// Whether these are the first bytes of a file of this format.
pub(crate) fn begins(head: &[u8]) -> bool {
    shape(head).is_some()
}

pub(crate) fn open(
    path: &Path,
    head: &[u8],
    mut reader: impl BufRead,
    mut budget: Budget,
) -> Result<Box<dyn Table>, FileError> {
    let fault = |place: String, problem: String, fix: &'static str| {
        FileError::broken(path, FileFormat::ValueList, place, problem, fix)
    };
    let header = || "its header".to_owned();
    let Some(Shape { sides, by_columns, on_first_line }) = shape(head) else {
        return Err(fault(header(), "it has no shape".to_owned(), COPY));
    };
    let is_real = !head.starts_with(MATRIX_MARKET)
        || plain_kind(head).is_some_and(|kind| kind == "real general" || kind == "integer general");
    if !is_real {
        return Err(fault(header(), "it is complex or symmetric".to_owned(), "write a real general matrix"));
    }
    let stated = sides.iter().try_fold(1_usize, |all, side| all.checked_mul(*side));
    let (Some(two), Some(count)) = (Array::two_sides(&sides), stated) else {
        return Err(fault(header(), format!("the shape {sides:?} is not that of a matrix"), COPY));
    };
    budget.take((count as u64).checked_mul(8)).map_err(|problem| fault(header(), problem, SPLIT_FIX))?;
    // Grow with the numbers in the file.
    let (mut values, mut line, mut bytes, mut skip) = (Vec::new(), 0, Vec::new(), on_first_line);
    loop {
        bytes.clear();
        let read = reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut bytes);
        let read = read.map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        if read == 0 {
            break;
        }
        line += 1;
        let place = || format!("line {line}");
        if read as u64 == MAX_LINE_BYTES {
            return Err(fault(place(), "it is longer than 64 KiB".to_owned(), COPY));
        }
        let Some(text) = plain_lines(&bytes).next() else { continue };
        if core::mem::take(&mut skip) {
            continue;
        }
        for word in words(text) {
            let value = number(word, b' ').ok_or_else(|| {
                let word: String = String::from_utf8_lossy(word).chars().take(40).collect();
                fault(place(), format!("`{word}` is not a number"), COPY)
            })?;
            if values.len() == count {
                return Err(fault(place(), format!("more values than the {count} of the shape {sides:?}"), COPY));
            }
            values.push(value);
        }
    }
    if values.len() < count {
        let problem = format!("{} values, but the shape {sides:?} has {count}", values.len());
        return Err(fault(format!("line {line}"), problem, COPY));
    }
    let make = if by_columns { Array::column_major } else { Array::row_major };
    let table = ArrayTable::new(vec![make(String::new(), two, values)])
        .ok_or_else(|| FileError::no_columns(path, FileFormat::ValueList, "no values", COPY))?;
    Ok(Box::new(table.nameless()))
}

/// The type of numbers and the symmetry in the header of Matrix Market.
fn plain_kind(head: &[u8]) -> Option<String> {
    let line = head.strip_prefix(MATRIX_MARKET)?.split(|byte| *byte == b'\n').next()?;
    let kind = String::from_utf8_lossy(line).to_ascii_lowercase();
    Some(kind.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn words(line: &[u8]) -> Vec<&[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::ReadLimits;

    fn read(text: &str) -> Result<Vec<Vec<f64>>, String> {
        let budget = Budget::new(&ReadLimits::default(), text.len() as u64);
        let mut table =
            open(Path::new("log.txt"), text.as_bytes(), text.as_bytes(), budget).map_err(|error| error.to_string())?;
        let mut rows = Vec::new();
        table.all_rows(&mut |_, row| rows.push(row.to_vec())).unwrap();
        Ok(rows)
    }

    #[test]
    fn values_have_the_order_of_their_header() {
        let rows = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
        for text in [
            "# shape: (3, 2)\n1\n2\n3\n4\n5\n6\n",
            "# recorded on Monday\n# Shape = 3 x 2\n1\n2\n3\n4\n5\n6\n",
            "% shape [3,2], order: F\n1\n3\n5\n2\n4\n6",
            "3 2\n1\n2\n3\n4\n5\n6\n",
            "%%MatrixMarket matrix array real general\n% note\n3 2\n1\n3\n5\n2\n4\n6\n",
            // Samples along the second side.
            "# shape: (2, 3)\n1\n3\n5\n2\n4\n6\n",
            "# shape: (3, 1, 2)\n1\n2\n3\n4\n5\n6\n",
        ] {
            assert!(begins(text.as_bytes()), "{text}");
            assert_eq!(read(text).unwrap(), rows, "{text}");
        }
    }

    #[test]
    fn tables_are_no_lists_of_values() {
        for text in ["3 2\n1 2\n", "# shape of the robot: 3 2\n1,2\n3,4\n", "3,2\n1\n", "1\n2\n", "", "# shape 3\n1\n"]
        {
            assert!(!begins(text.as_bytes()), "{text}");
        }
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        for (text, words) in [
            ("# shape: (3, 2)\n1\n2\n", "2 values, but the shape [3, 2] has 6"),
            ("# shape: (1, 2)\n1\n2\n3\n", "line 4: more values"),
            ("# shape: (4000000000, 4000000000)\n1\n", "memory"),
            ("# shape: (400000000, 9)\n1\n", "128 MiB of memory"),
            ("# shape: (2, 2, 2)\n1\n", "not that of a matrix"),
            ("# shape: (2, 2)\n1\nx\n", "`x` is not a number"),
            ("%%MatrixMarket matrix array complex general\n1 1\n1 0\n", "complex"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(words), "{text}: {message}");
        }
    }
}
