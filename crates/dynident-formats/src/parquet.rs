//! Parquet: flat columns by their name, lists by name and 0-based index.

use crate::error::FileError;
use crate::table::Table;
use std::path::Path;

#[cfg(not(feature = "parquet"))]
pub(crate) fn open(path: &Path) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "a Parquet table", feature: "parquet" })
}

#[cfg(feature = "parquet")]
pub(crate) use reading::open;

#[cfg(feature = "parquet")]
mod reading {
    use super::{FileError, Path, Table};
    use crate::arrays::{MAX_COLUMNS, MAX_LIST_COLUMNS};
    use crate::kind::FileFormat;
    use crate::parquet_pages::CheckedPages;
    use crate::table::slots;
    use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
    use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
    use parquet::data_type::DataType;
    use parquet::errors::ParquetError;
    use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
    use std::fs::File;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::path::PathBuf;

    const BLOCK_ROWS: usize = 4096;

    /// One column of the file; a list is several columns of the table.
    #[derive(Debug)]
    struct Leaf {
        index: usize,
        /// First column of the table, and the number of columns.
        begin: usize,
        count: usize,
        list: bool,
        definition: i16,
        /// Units per second of a time stamp; values are relative to the first one.
        ticks_per_s: Option<f64>,
        origin: Option<i64>,
    }

    struct ParquetTable {
        path: PathBuf,
        file: SerializedFileReader<File>,
        leaves: Vec<Leaf>,
        names: Vec<String>,
        notes: Vec<String>,
        /// Index of each column among the selected ones.
        slot_of: Vec<Option<usize>>,
        wanted: usize,
        group: usize,
        readers: Vec<(usize, ColumnReader)>,
        left_in_group: usize,
        /// Rows of a block, row by row, with the selected columns only.
        block: Vec<f64>,
        rows_in_block: usize,
        next: usize,
    }

    impl core::fmt::Debug for ParquetTable {
        fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            f.debug_struct("ParquetTable").field("path", &self.path).field("group", &self.group).finish_non_exhaustive()
        }
    }

    fn broken(path: &Path, place: impl Into<String>, error: &ParquetError) -> FileError {
        FileError::broken(path, FileFormat::Parquet, place, error.to_string(), "write or copy it again")
    }

    /// Converts panics of the decoder to errors: it assumes valid lengths, which can only be checked by
    /// decompression.
    fn guarded<T>(decode: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
        catch_unwind(AssertUnwindSafe(decode))
            .unwrap_or_else(|_| Err(ParquetError::EOF("its bytes do not match their description".into())))
    }

    pub(crate) fn open(path: &Path) -> Result<Box<dyn Table>, FileError> {
        let file = dynident_files::open(path).map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        let file = guarded(|| SerializedFileReader::new(file)).map_err(|error| broken(path, "its footer", &error))?;
        let mut table = ParquetTable {
            path: path.to_owned(),
            file,
            leaves: Vec::new(),
            names: Vec::new(),
            notes: Vec::new(),
            slot_of: Vec::new(),
            wanted: 0,
            group: 0,
            readers: Vec::new(),
            left_in_group: 0,
            block: Vec::new(),
            rows_in_block: 0,
            next: 0,
        };
        table.check_places()?;
        table.find_columns()?;
        if table.names.is_empty() {
            let fix = "write columns of numbers, or lists of them";
            return Err(FileError::no_columns(path, FileFormat::Parquet, table.notes.join("; "), fix));
        }
        table.slot_of = (0..table.names.len()).map(Some).collect();
        table.wanted = table.names.len();
        Ok(Box::new(table))
    }

    impl ParquetTable {
        /// Rejects negative offsets and lengths, on which the reader panics.
        fn check_places(&self) -> Result<(), FileError> {
            for (group, rows) in self.file.metadata().row_groups().iter().enumerate() {
                for (index, column) in rows.columns().iter().enumerate() {
                    let places = [
                        column.data_page_offset(),
                        column.compressed_size(),
                        column.uncompressed_size(),
                        column.num_values(),
                        column.dictionary_page_offset().unwrap_or(0),
                        rows.num_rows(),
                    ];
                    if places.iter().any(|place| *place < 0) {
                        let place = format!("row group {group}, column {index}");
                        let problem = "its offset or its length is negative";
                        let fix = "write or copy it again";
                        return Err(FileError::broken(&self.path, FileFormat::Parquet, place, problem, fix));
                    }
                }
            }
            Ok(())
        }

        fn find_columns(&mut self) -> Result<(), FileError> {
            let schema = self.file.metadata().file_metadata().schema_descr_ptr();
            for index in 0..schema.num_columns() {
                let column = schema.column(index);
                // In `observation.state.list.element`, the last two parts are defined by the format.
                let parts = column.path().parts();
                let list = column.max_rep_level() > 0;
                let own = if list && parts.len() > 2 { &parts[..parts.len() - 2] } else { parts };
                let name = own.join(".");
                let number = matches!(
                    column.physical_type(),
                    Physical::BOOLEAN | Physical::INT32 | Physical::INT64 | Physical::FLOAT | Physical::DOUBLE
                );
                let decimal = column.converted_type() == ConvertedType::DECIMAL;
                if !number || decimal || column.max_rep_level() > 1 {
                    self.notes.push(format!("column {name}: not numeric, or lists of lists"));
                    continue;
                }
                let ticks_per_s = match (column.logical_type_ref(), column.converted_type()) {
                    (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
                        TimeUnit::MILLIS => 1e3,
                        TimeUnit::MICROS => 1e6,
                        TimeUnit::NANOS => 1e9,
                    }),
                    (_, ConvertedType::TIMESTAMP_MILLIS) => Some(1e3),
                    (_, ConvertedType::TIMESTAMP_MICROS) => Some(1e6),
                    _ => None,
                };
                let mut leaf = Leaf {
                    index,
                    begin: self.names.len(),
                    count: 1,
                    list,
                    definition: column.max_def_level(),
                    ticks_per_s,
                    origin: None,
                };
                if list || ticks_per_s.is_some() {
                    self.look_at_first(&mut leaf)?;
                }
                if self.names.len() + leaf.count > MAX_COLUMNS {
                    self.notes.push(format!("column {name}: more than {MAX_COLUMNS} columns"));
                    continue;
                }
                if list {
                    self.names.extend((0..leaf.count).map(|k| format!("{name}[{k}]")));
                } else {
                    self.names.push(name);
                }
                self.leaves.push(leaf);
            }
            Ok(())
        }

        /// Reads the length of a list and the first time stamp from the first row.
        fn look_at_first(&self, leaf: &mut Leaf) -> Result<(), FileError> {
            leaf.count = usize::from(!leaf.list);
            if self.file.num_row_groups() == 0 {
                return Ok(());
            }
            let error = |error| broken(&self.path, format!("column {}", leaf.index), &error);
            let group = self.file.get_row_group(0).map_err(error)?;
            let mut reader = checked_reader(&*group, leaf.index).map_err(error)?;
            let read = guarded(|| read_block(&mut reader, 1)).map_err(error)?;
            if leaf.list {
                leaf.count = read.levels.len().min(MAX_LIST_COLUMNS);
            }
            leaf.origin = read.integers.first().copied();
            Ok(())
        }

        fn next_group(&mut self) -> Result<bool, FileError> {
            if self.group >= self.file.num_row_groups() {
                return Ok(false);
            }
            let place = format!("row group {}", self.group);
            let error = |error| broken(&self.path, place.clone(), &error);
            let group = self.file.get_row_group(self.group).map_err(error)?;
            self.left_in_group = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            self.readers.clear();
            for (index, leaf) in self.leaves.iter().enumerate() {
                if (leaf.begin..leaf.begin + leaf.count).any(|column| self.slot_of[column].is_some()) {
                    self.readers.push((index, checked_reader(&*group, leaf.index).map_err(error)?));
                }
            }
            self.group += 1;
            Ok(true)
        }

        fn next_block(&mut self) -> Result<bool, FileError> {
            while self.left_in_group == 0 {
                if !self.next_group()? {
                    return Ok(false);
                }
            }
            let rows = self.left_in_group.min(BLOCK_ROWS);
            let width = self.wanted;
            self.block.clear();
            self.block.resize(rows * width, f64::NAN);
            let mut readers = core::mem::take(&mut self.readers);
            for (index, reader) in &mut readers {
                let leaf = &self.leaves[*index];
                let place = || format!("row group {}, column {}", self.group - 1, self.names[leaf.begin]);
                let read = guarded(|| read_block(reader, rows));
                let read = read.map_err(|error| broken(&self.path, place(), &error))?;
                if read.rows != rows {
                    let problem = format!("it ends after {} of {rows} rows", read.rows);
                    let fix = "write or copy it again";
                    return Err(FileError::broken(&self.path, FileFormat::Parquet, place(), problem, fix));
                }
                let mut values = read.values(leaf);
                let (mut row, mut entry) = (0, 0);
                for (at, (definition, repetition)) in read.levels.iter().enumerate() {
                    if leaf.list {
                        (row, entry) = if *repetition > 0 { (row, entry + 1) } else { (row + usize::from(at > 0), 0) };
                    } else {
                        row = at;
                    }
                    let value = if *definition == leaf.definition { values.next() } else { None };
                    if entry < leaf.count
                        && let (Some(value), Some(slot)) = (value, self.slot_of[leaf.begin + entry])
                        && let Some(place) = self.block.get_mut(row * width + slot)
                    {
                        *place = value;
                    }
                }
            }
            self.readers = readers;
            self.left_in_group -= rows;
            self.rows_in_block = rows;
            self.next = 0;
            Ok(true)
        }

        fn advance(&mut self) -> Result<Option<usize>, FileError> {
            if self.next >= self.rows_in_block && !self.next_block()? {
                return Ok(None);
            }
            self.next += 1;
            Ok(Some(self.next - 1))
        }
    }

    /// A column of a row group, with checks of its pages before they are decoded.
    fn checked_reader(group: &dyn RowGroupReader, index: usize) -> Result<ColumnReader, ParquetError> {
        guarded(|| {
            let column = group.metadata().schema_descr().column(index);
            let pages = Box::new(CheckedPages::new(group.get_column_page_reader(index)?, &column));
            Ok(get_column_reader(column, pages))
        })
    }

    #[derive(Default)]
    struct Read {
        rows: usize,
        /// Definition and repetition level of each entry.
        levels: Vec<(i16, i16)>,
        floats: Vec<f64>,
        integers: Vec<i64>,
    }

    impl Read {
        fn values<'a>(&'a self, leaf: &'a Leaf) -> Box<dyn Iterator<Item = f64> + 'a> {
            match leaf.ticks_per_s {
                Some(ticks) => {
                    let origin = i128::from(leaf.origin.unwrap_or(0));
                    Box::new(self.integers.iter().map(move |value| (i128::from(*value) - origin) as f64 / ticks))
                }
                None if self.floats.is_empty() => Box::new(self.integers.iter().map(|value| *value as f64)),
                None => Box::new(self.floats.iter().copied()),
            }
        }
    }

    fn read_block(reader: &mut ColumnReader, rows: usize) -> Result<Read, ParquetError> {
        let mut read = Read::default();
        match reader {
            ColumnReader::BoolColumnReader(reader) => {
                let values = typed(reader, rows, &mut read)?;
                read.integers = values.into_iter().map(i64::from).collect();
            }
            ColumnReader::Int32ColumnReader(reader) => {
                let values = typed(reader, rows, &mut read)?;
                read.integers = values.into_iter().map(i64::from).collect();
            }
            ColumnReader::Int64ColumnReader(reader) => read.integers = typed(reader, rows, &mut read)?,
            ColumnReader::FloatColumnReader(reader) => {
                let values = typed(reader, rows, &mut read)?;
                read.floats = values.into_iter().map(f64::from).collect();
            }
            ColumnReader::DoubleColumnReader(reader) => read.floats = typed(reader, rows, &mut read)?,
            _ => {}
        }
        Ok(read)
    }

    fn typed<T: DataType>(
        reader: &mut ColumnReaderImpl<T>,
        rows: usize,
        read: &mut Read,
    ) -> Result<Vec<T::T>, ParquetError> {
        let (mut definitions, mut repetitions, mut values) = (Vec::new(), Vec::new(), Vec::new());
        while read.rows < rows {
            let (records, _, levels) =
                reader.read_records(rows - read.rows, Some(&mut definitions), Some(&mut repetitions), &mut values)?;
            if records == 0 && levels == 0 {
                break;
            }
            read.rows += records;
        }
        let count = definitions.len().max(repetitions.len());
        // A column without definition and repetition levels has a value in every row.
        let count = if count == 0 { values.len() } else { count };
        let level = |levels: &[i16], at: usize| levels.get(at).copied().unwrap_or(0);
        read.levels = (0..count).map(|at| (level(&definitions, at), level(&repetitions, at))).collect();
        Ok(values)
    }

    impl Table for ParquetTable {
        fn width(&self) -> usize {
            self.names.len()
        }

        fn names(&self) -> Option<&[String]> {
            Some(&self.names)
        }

        fn select(&mut self, columns: &[usize]) {
            self.slot_of = slots(self.names.len(), columns);
            self.wanted = columns.len();
        }

        fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
            let Some(row) = self.advance()? else { return Ok(false) };
            values.copy_from_slice(&self.block[row * self.wanted..][..self.wanted]);
            Ok(true)
        }

        fn skip_row(&mut self) -> Result<bool, FileError> {
            Ok(self.advance()?.is_some())
        }

        fn notes(&self) -> Vec<String> {
            self.notes.clone()
        }

        fn estimated_rows(&self) -> Option<u64> {
            u64::try_from(self.file.metadata().file_metadata().num_rows()).ok()
        }
    }
}
