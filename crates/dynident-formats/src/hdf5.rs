//! HDF5, and MATLAB's `save -v7.3`: data sets of equal length.

use crate::error::FileError;
use crate::table::Table;
use std::path::Path;

#[cfg(not(feature = "hdf5"))]
pub(crate) fn open(path: &Path, _: crate::limits::Budget) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "an HDF5 file", feature: "hdf5" })
}

#[cfg(feature = "hdf5")]
pub(crate) use reading::open;

#[cfg(feature = "hdf5")]
mod reading {
    use super::{FileError, Path, Table};
    use crate::arrays::{Array, ArrayTable};
    use crate::episodes::EpisodeTable;
    use crate::error::visible;
    use crate::kind::FileFormat;
    use crate::limits::{Budget, SPLIT_FIX};
    use crate::mat::{OBJECT, OBJECT_FIX};
    use hdf5_pure::{AttrValue, DType, Dataset, File, Group};

    const MAX_NESTING: usize = 8;
    const MAX_DATA_SETS: usize = 10_000;

    pub(crate) fn open(path: &Path, budget: Budget) -> Result<Box<dyn Table>, FileError> {
        let error = |error: hdf5_pure::Error| {
            FileError::broken(path, FileFormat::Hdf5, "the file", error.to_string(), "write or copy it again")
        };
        dynident_files::open(path).map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        let file = File::open_streaming(path).map_err(error)?;
        let mut found = Found { path, arrays: Vec::new(), others: Vec::new(), sets: 0, budget, too_large: false };
        found.group(&file.root(), "", 0)?;
        // If the largest columns exceed the memory limit, the table is refused, because the rest could be mistaken
        // for the whole recording.
        if let (true, Some(problem)) = (found.too_large, found.others.last()) {
            return Err(FileError::broken(path, FileFormat::Hdf5, "its data sets", problem.as_str(), SPLIT_FIX));
        }
        let others = if found.others.is_empty() { "no data sets".to_owned() } else { found.others.join(", ") };
        let (arrays, notes) = match EpisodeTable::new(found.arrays, found.others) {
            Ok(episodes) => return Ok(Box::new(episodes)),
            Err(single) => single,
        };
        let table = ArrayTable::new(arrays).ok_or_else(|| {
            let fix = if others.contains(OBJECT) { OBJECT_FIX } else { "save vectors or matrices of real numbers" };
            FileError::no_columns(path, FileFormat::Hdf5, others, fix)
        })?;
        Ok(Box::new(table.with_notes(notes)))
    }

    struct Found<'a> {
        path: &'a Path,
        arrays: Vec<Array>,
        others: Vec<String>,
        sets: usize,
        budget: Budget,
        /// Whether a data set exceeds the memory limit; it is then the last of `others`.
        too_large: bool,
    }

    impl Found<'_> {
        fn broken(&self, place: &str, error: &hdf5_pure::Error) -> FileError {
            let fix = "write or copy it again";
            FileError::broken(self.path, FileFormat::Hdf5, format!("`{place}`"), error.to_string(), fix)
        }

        fn group(&mut self, group: &Group, at: &str, depth: usize) -> Result<(), FileError> {
            let name = |own: &str| if at.is_empty() { own.to_owned() } else { format!("{at}.{own}") };
            for own in group.datasets().map_err(|error| self.broken(at, &error))? {
                // MATLAB stores the data that references (for example of cells) point to in the group #refs#.
                if self.sets >= MAX_DATA_SETS || own.starts_with('#') {
                    continue;
                }
                self.sets += 1;
                let place = name(&own);
                // An unreadable data set does not prevent reading the others.
                let read = group.dataset(&own).map_err(|error| error.to_string());
                match read.and_then(|set| array(&set, &place, &mut self.budget)) {
                    Ok(array) => self.arrays.push(array),
                    Err(problem) => {
                        self.too_large = problem == self.budget.problem();
                        self.others.push(visible(&format!("{place}: {problem}")));
                        if self.too_large {
                            return Ok(());
                        }
                    }
                }
            }
            if depth < MAX_NESTING {
                for own in group.groups().map_err(|error| self.broken(at, &error))? {
                    if own.starts_with('#') {
                        continue;
                    }
                    let place = name(&own);
                    let inner = group.group(&own).map_err(|error| self.broken(&place, &error))?;
                    self.group(&inner, &place, depth + 1)?;
                    if self.too_large {
                        return Ok(());
                    }
                }
            }
            Ok(())
        }
    }

    fn array(set: &Dataset, place: &str, budget: &mut Budget) -> Result<Array, String> {
        let text = |error: hdf5_pure::Error| error.to_string();
        let kind = set.dtype().map_err(text)?;
        if !matches!(
            kind,
            DType::F32
                | DType::F64
                | DType::I8
                | DType::I16
                | DType::I32
                | DType::I64
                | DType::U8
                | DType::U16
                | DType::U32
                | DType::U64
        ) {
            return Err("not numeric".to_owned());
        }
        // MATLAB stores objects, texts and cells as numbers, too.
        let class = set.attrs().ok().and_then(|attributes| match attributes.get("MATLAB_class") {
            Some(AttrValue::String(class) | AttrValue::AsciiString(class)) => Some(class.clone()),
            _ => None,
        });
        match class.as_deref() {
            Some("table" | "timetable" | "timeseries" | "string" | "datetime" | "duration" | "categorical") => {
                return Err(OBJECT.to_owned());
            }
            Some("char" | "cell" | "function_handle") => return Err("not numeric".to_owned()),
            _ => {}
        }
        let shape = set.shape().map_err(text)?;
        let sides: Option<Vec<usize>> = shape.iter().map(|side| usize::try_from(*side).ok()).collect();
        let sides = sides.and_then(|sides| Array::two_sides(&sides)).ok_or("more than two dimensions")?;
        let numbers = shape.iter().try_fold(1_u64, |all, side| all.checked_mul(*side));
        budget.take(numbers.and_then(|numbers| numbers.checked_mul(8)))?;
        let values = set.read_f64().map_err(text)?;
        if values.len() != sides[0] * sides[1] {
            return Err("the number of values does not match the dimensions".to_owned());
        }
        Ok(Array::row_major(place.to_owned(), sides, values))
    }
}
