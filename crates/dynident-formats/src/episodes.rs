//! Several recordings (episodes) in one file: groups of arrays with the same names and different lengths.

use crate::arrays::{Array, ArrayTable};
use crate::error::FileError;
use crate::table::{ColumnGroup, Table};
use std::collections::BTreeMap;

/// Maximum depth of the groups that are compared.
const MAX_DEPTH: usize = 8;

/// The episodes of a file, each a group of columns.
#[derive(Debug)]
pub(crate) struct EpisodeTable {
    names: Vec<String>,
    groups: Vec<ColumnGroup>,
    episodes: Vec<ArrayTable>,
    /// Index of the current episode, and the place of its selected columns in a row.
    selected: usize,
    places: Vec<usize>,
    own: Vec<f64>,
    notes: Vec<String>,
}

/// The first `depth` parts of a name, and the rest.
fn split(name: &str, depth: usize) -> Option<(&str, &str)> {
    let (at, _) = name.match_indices('.').nth(depth.checked_sub(1)?)?;
    Some((&name[..at], &name[at + 1..]))
}

/// Names of the episodes in `arrays`: sibling groups that have an array of the same name with different lengths. Empty
/// for a single recording.
fn episodes(arrays: &[Array]) -> Vec<String> {
    for depth in 1..=MAX_DEPTH {
        // Lengths of each group's array, by the parent group and the name of the array in the group.
        let mut siblings: BTreeMap<(&str, &str), BTreeMap<&str, usize>> = BTreeMap::new();
        for array in arrays {
            let Some((group, own)) = split(&array.name, depth) else { continue };
            let above = group.rsplit_once('.').map_or("", |(above, _)| above);
            siblings.entry((above, own)).or_default().insert(group, array.shape[0]);
        }
        let differ = |lengths: &&BTreeMap<&str, usize>| {
            let first = lengths.values().next();
            lengths.len() > 1 && lengths.values().any(|length| Some(length) != first)
        };
        if let Some(found) = siblings.values().filter(differ).max_by_key(|lengths| lengths.len()) {
            return in_order(found.keys().copied());
        }
    }
    Vec::new()
}

/// Sorts names by the numbers in them: `demo_2` before `demo_10`.
fn in_order<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let number = |name: &str| {
        let begin = name.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
        name.get(begin..).and_then(|digits| digits.parse::<u64>().ok())
    };
    let mut names: Vec<String> = names.map(str::to_owned).collect();
    names.sort_by_key(|name| number(name));
    names
}

impl EpisodeTable {
    /// The episodes in `arrays`; the arrays themselves if they are one recording.
    ///
    /// # Errors
    /// Returns `arrays` if they are one recording.
    pub(crate) fn new(arrays: Vec<Array>, notes: Vec<String>) -> Result<Self, (Vec<Array>, Vec<String>)> {
        let parts = episodes(&arrays);
        if parts.is_empty() {
            return Err((arrays, notes));
        }
        let mut found = Self {
            names: Vec::new(),
            groups: Vec::new(),
            episodes: Vec::new(),
            selected: 0,
            places: Vec::new(),
            own: Vec::new(),
            notes,
        };
        let mut rest = arrays;
        for part in parts {
            let is_own = |array: &Array| array.name.strip_prefix(&part).is_some_and(|own| own.starts_with('.'));
            let own = rest.extract_if(.., |array| is_own(array)).collect();
            let Some(table) = ArrayTable::new(own) else { continue };
            let begin = found.names.len();
            found.names.extend_from_slice(table.names().unwrap_or_default());
            let columns = begin..found.names.len();
            found.groups.push(ColumnGroup { name: Some(part), columns, time: None });
            found.notes.extend(table.notes());
            found.episodes.push(table);
        }
        found.notes.extend(rest.iter().map(|array| format!("{}: not in an episode", array.name)));
        if let Some(first) = found.groups.first() {
            found.select(&first.columns.clone().collect::<Vec<_>>());
        }
        Ok(found)
    }
}

impl Table for EpisodeTable {
    fn width(&self) -> usize {
        self.names.len()
    }

    fn names(&self) -> Option<&[String]> {
        Some(&self.names)
    }

    fn groups(&self) -> Vec<ColumnGroup> {
        self.groups.clone()
    }

    /// Episodes have no common time, so selected columns of other episodes than that of the first column are missing
    /// values.
    fn select(&mut self, columns: &[usize]) {
        let of = |column: usize| self.groups.iter().position(|group| group.columns.contains(&column));
        self.selected = columns.first().and_then(|column| of(*column)).unwrap_or(0);
        let mut own = Vec::new();
        self.places = columns
            .iter()
            .map(|column| {
                let group = &self.groups[self.selected].columns;
                if !group.contains(column) {
                    return usize::MAX;
                }
                own.push(column - group.start);
                own.len() - 1
            })
            .collect();
        self.own = vec![f64::NAN; own.len()];
        if let Some(episode) = self.episodes.get_mut(self.selected) {
            episode.select(&own);
        }
    }

    fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
        let Some(episode) = self.episodes.get_mut(self.selected) else { return Ok(false) };
        let found = episode.next_row(&mut self.own)?;
        for (value, place) in values.iter_mut().zip(&self.places) {
            *value = self.own.get(*place).copied().unwrap_or(f64::NAN);
        }
        Ok(found)
    }

    fn skip_row(&mut self) -> Result<bool, FileError> {
        self.episodes.get_mut(self.selected).map_or(Ok(false), ArrayTable::skip_row)
    }

    fn all_rows(&mut self, each: &mut dyn FnMut(usize, &[f64])) -> Result<(), FileError> {
        for (index, episode) in self.episodes.iter_mut().enumerate() {
            episode.all_rows(&mut |_, row| each(index, row))?;
        }
        Ok(())
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn estimated_rows(&self) -> Option<u64> {
        self.episodes.get(self.selected)?.estimated_rows()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(name: &str, rows: usize) -> Array {
        Array::row_major(name.to_owned(), [rows, 2], (0..2 * rows).map(|k| k as f64).collect())
    }

    #[test]
    fn groups_of_different_length_are_episodes() {
        let mut arrays: Vec<Array> = [0, 1, 2, 10].map(|k| array(&format!("data.demo_{k}.obs.q"), 3 + k)).to_vec();
        arrays.push(array("data.mask", 9));
        let mut table = EpisodeTable::new(arrays, Vec::new()).unwrap();
        let names: Vec<String> = table.groups().into_iter().filter_map(|group| group.name).collect();
        assert_eq!(names, ["data.demo_0", "data.demo_1", "data.demo_2", "data.demo_10"]);
        assert_eq!(table.notes(), ["data.mask: not in an episode"]);
        let column = table.names().unwrap().iter().position(|name| name == "data.demo_2.obs.q[1]").unwrap();
        table.select(&[column, 0]);
        let (mut row, mut rows) = ([0.0; 2], Vec::new());
        while table.next_row(&mut row).unwrap() {
            assert!(row[1].is_nan());
            rows.push(row[0]);
        }
        assert_eq!(rows, [1.0, 3.0, 5.0, 7.0, 9.0]);
    }

    #[test]
    fn groups_of_one_length_are_one_recording() {
        let arrays = vec![array("left.q", 5), array("right.q", 5), array("left.tau", 5)];
        assert_eq!(EpisodeTable::new(arrays, Vec::new()).unwrap_err().0.len(), 3);
        // Different quantities of one recording.
        let arrays = vec![array("arm.q", 5), array("arm.dq", 4), array("t", 5)];
        assert!(EpisodeTable::new(arrays, Vec::new()).is_err());
    }
}
