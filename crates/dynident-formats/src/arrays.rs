//! Arrays of one file as a table: the arrays that share the longest length are the columns.

use crate::error::FileError;
use crate::table::Table;

pub(crate) const MAX_COLUMNS: usize = 1 << 14;

/// Maximum number of entries of a list that become columns.
pub(crate) const MAX_LIST_COLUMNS: usize = 1024;

#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) name: String,
    /// Rows and columns; a vector has one column.
    pub(crate) shape: [usize; 2],
    /// Entry of row i and column k: `values[i * strides[0] + k * strides[1]]`.
    pub(crate) values: Vec<f64>,
    pub(crate) strides: [usize; 2],
}

impl Array {
    pub(crate) fn row_major(name: String, shape: [usize; 2], values: Vec<f64>) -> Self {
        Self { name, shape, values, strides: [shape[1], 1] }
    }

    pub(crate) fn column_major(name: String, shape: [usize; 2], values: Vec<f64>) -> Self {
        Self { name, shape, values, strides: [1, shape[0]] }
    }

    /// The lengths of an array along its dimensions, without those of length one; `None` if more than two remain.
    pub(crate) fn two_sides(sides: &[usize]) -> Option<[usize; 2]> {
        match sides.iter().copied().filter(|side| *side != 1).collect::<Vec<_>>()[..] {
            [] => Some([1, 1]),
            [one] => Some([one, 1]),
            [first, second] => Some([first, second]),
            _ => None,
        }
    }
}

/// Number of samples: the longest dimension that is shared by arrays with half of all numbers. It is the longer side of
/// at least one array, because 7 is not the number of samples of two arrays of 2000 × 7 and 1999 × 7.
fn length(arrays: &[Array]) -> usize {
    let numbers = |length: usize| -> usize {
        arrays.iter().filter(|array| array.shape.contains(&length)).map(|array| array.values.len()).sum()
    };
    let all: usize = arrays.iter().map(|array| array.values.len()).sum();
    let sides = || arrays.iter().map(|array| array.shape[0].max(array.shape[1]));
    let shared = sides().filter(|side| 2 * numbers(*side) >= all).max();
    shared.or_else(|| sides().max_by_key(|side| (numbers(*side), *side))).unwrap_or(0)
}

/// Names of the entries of all matrices of a file.
#[derive(Clone, Debug)]
pub(crate) struct EntryNames {
    /// The array of the names.
    pub(crate) array: String,
    pub(crate) names: Vec<String>,
}

/// Arrays as columns: a vector by its name, a matrix by name and 0-based index, such as `q[0]`. The samples may be
/// along either dimension of a matrix (along its rows, if both fit). Arrays of another length are omitted.
#[derive(Debug)]
pub(crate) struct ArrayTable {
    arrays: Vec<Array>,
    names: Option<Vec<String>>,
    /// Index of the array, and offset and stride in it, for each column.
    columns: Vec<[usize; 3]>,
    wanted: Vec<usize>,
    rows: usize,
    next: usize,
    notes: Vec<String>,
}

impl ArrayTable {
    /// The table of `arrays`; `None` if all are empty.
    pub(crate) fn new(arrays: Vec<Array>) -> Option<Self> {
        let rows = length(&arrays);
        let (mut names, mut columns) = (Vec::new(), Vec::new());
        for (index, array) in arrays.iter().enumerate() {
            let [down, across] = array.strides;
            let (count, step, along) = match array.shape {
                [first, second] if first == rows => (second, across, down),
                [first, second] if second == rows => (first, down, across),
                _ => continue,
            };
            if array.values.is_empty() || columns.len() + count > MAX_COLUMNS {
                continue;
            }
            for k in 0..count {
                names.push(if count == 1 { array.name.clone() } else { format!("{}[{k}]", array.name) });
                columns.push([index, k * step, along]);
            }
        }
        let wanted = (0..columns.len()).collect();
        let used: Vec<usize> = columns.iter().map(|column| column[0]).collect();
        let left_out = arrays.iter().enumerate().filter(|(index, _)| !used.contains(index));
        let notes = left_out
            .map(|(_, array)| format!("{}: {} x {}, not of {rows} rows", array.name, array.shape[0], array.shape[1]))
            .collect();
        (!columns.is_empty()).then_some(Self { arrays, names: Some(names), columns, wanted, rows, next: 0, notes })
    }

    /// Names the columns of each matrix with one column for each name, `q[elbow]` instead of `q[2]`. The names must be
    /// unique and not be numbers; otherwise a note is added.
    pub(crate) fn with_entry_names(mut self, entries: EntryNames) -> Self {
        let EntryNames { array, names } = entries;
        let is_name = |name: &String| name.parse::<u64>().is_err() && !name.trim().is_empty();
        let are_unique = names.iter().enumerate().all(|(at, name)| !names[..at].contains(name));
        let mut is_used = false;
        if let Some(columns) =
            self.names.as_mut().filter(|_| are_unique && names.len() > 1 && names.iter().all(is_name))
        {
            for (index, matrix) in self.arrays.iter().enumerate() {
                let own: Vec<usize> = (0..columns.len()).filter(|column| self.columns[*column][0] == index).collect();
                if own.len() == names.len() {
                    is_used = true;
                    own.iter()
                        .zip(&names)
                        .for_each(|(column, name)| columns[*column] = format!("{}[{name}]", matrix.name));
                }
            }
        }
        if !is_used {
            self.notes.push(format!("{array}: {} texts, which do not name the columns of a matrix", names.len()));
        }
        self
    }

    pub(crate) fn with_notes(mut self, notes: Vec<String>) -> Self {
        self.notes.extend(notes);
        self
    }

    pub(crate) fn nameless(mut self) -> Self {
        self.names = None;
        self
    }
}

impl Table for ArrayTable {
    fn width(&self) -> usize {
        self.columns.len()
    }

    fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    fn has_numbered_entries(&self) -> bool {
        true
    }

    fn select(&mut self, columns: &[usize]) {
        self.wanted = columns.to_vec();
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
        if self.next >= self.rows {
            return Ok(false);
        }
        for (value, column) in values.iter_mut().zip(&self.wanted) {
            let [array, offset, stride] = self.columns[*column];
            *value = self.arrays[array].values[offset + stride * self.next];
        }
        self.next += 1;
        Ok(true)
    }

    fn skip_row(&mut self) -> Result<bool, FileError> {
        self.next += 1;
        Ok(self.next <= self.rows)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn estimated_rows(&self) -> Option<u64> {
        Some(self.rows as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_one_length_are_columns_in_either_order() {
        let q = Array::row_major("q".to_owned(), [2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let tau = Array::column_major("tau".to_owned(), [3, 2], vec![-1.0, -2.0, -3.0, -4.0, -5.0, -6.0]);
        let other = Array::row_major("gain".to_owned(), [2, 1], vec![7.0, 8.0]);
        let mut table = ArrayTable::new(vec![other, q, tau]).unwrap();
        assert_eq!(table.names().unwrap(), ["q[0]", "q[1]", "tau[0]", "tau[1]"]);
        let mut rows = Vec::new();
        let mut row = [0.0; 4];
        while table.next_row(&mut row).unwrap() {
            rows.push(row);
        }
        assert_eq!(rows, [[1.0, 4.0, -1.0, -4.0], [2.0, 5.0, -2.0, -5.0], [3.0, 6.0, -3.0, -6.0]]);
        assert!(ArrayTable::new(Vec::new()).is_none());
    }

    #[test]
    fn arrays_of_different_length_do_not_become_rows_of_joints() {
        let array = |name: &str, rows: usize| Array::row_major(name.to_owned(), [rows, 3], vec![0.0; 3 * rows]);
        let table = ArrayTable::new(vec![array("ddq", 98), array("q", 100), array("dq", 99)]).unwrap();
        assert_eq!(table.estimated_rows(), Some(100));
        assert_eq!(table.names().unwrap(), ["q[0]", "q[1]", "q[2]"]);
        assert_eq!(table.notes(), ["ddq: 98 x 3, not of 100 rows", "dq: 99 x 3, not of 100 rows"]);
    }
}
