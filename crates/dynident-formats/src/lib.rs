//! Reads log files of many formats. The format is detected from the content, not from the name; the result is text, or
//! a table of named columns of numbers.
//!
//! | format | columns | feature |
//! | --- | --- | --- |
//! | text, also in UTF-16, or compressed by gzip or Zstandard | parsed by the caller: [`Contents::Text`] | `gzip`, `zstd` |
//! | text with one line for each quantity; text with one value on each line and a shape | names of the lines; columns of the matrix | |
//! | NumPy `.npy`, `.npz` | fields of a structured array, columns of a matrix, arrays of one length | `.npz`: `gzip` |
//! | JSON, one object per line or one document | numbers by their path: `arm.q[0]` | `json` |
//! | MCAP, rosbag2, ROS 1 bag, ULog | numbers of messages by topic and path: `/joint_states.position[elbow]` | `bags` |
//! | Parquet | columns, lists with their indices | `parquet` |
//! | LeRobot data sets | as Parquet, entries by their names: `action[elbow]`; time over all episodes | `json`, `parquet` |
//! | SAGE recording: a folder with `control.csv` and `state_motor.csv` | parsed and joined by the caller | |
//! | Arrow: Feather, streams | as Parquet | `arrow` |
//! | DIAdem header and numbers (KUKA trace) | channels, of all drives: `Istmoment[A3]` | |
//! | MATLAB 4 and 5, Octave text, MATLAB 7.3 and HDF5 | variables of one length, matrices in either orientation | `gzip`, `hdf5` |
//!
//! Columns that were recorded with different clocks (topics of a bag) are interpolated at the times of the first
//! selected column: see [`Table::select`]. Indices in names are 0-based. Memory is limited by the length of the file
//! and by [`ReadLimits`]. Checksums in a file are verified. Only regular files are read.
//!
//! ```
//! use dynident_formats::{Contents, open};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("log");
//! std::fs::write(&path, "{\"t\": 0.5, \"q\": [1, 2]}\n{\"t\": 0.75, \"q\": [3, 4]}\n")?;
//! let opened = open(&path)?;
//! let Contents::Table(mut table) = opened.contents else { panic!("JSON lines are a table") };
//! assert_eq!(table.names().unwrap(), ["q[0]", "q[1]", "t"]);
//! table.select(&[1, 2]);
//! let mut row = [0.0; 2];
//! assert!(table.next_row(&mut row)? && row == [2.0, 0.5]);
//! assert!(table.next_row(&mut row)? && row == [4.0, 0.75]);
//! assert!(!table.next_row(&mut row)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(
    not(all(
        feature = "gzip",
        feature = "zstd",
        feature = "bags",
        feature = "parquet",
        feature = "arrow",
        feature = "hdf5"
    )),
    allow(
        dead_code,
        unused_variables,
        clippy::needless_pass_by_value,
        reason = "some shared code is unused without all formats"
    )
)]

mod arrays;
mod arrow;
mod bags;
mod bytes;
#[cfg(feature = "bags")]
mod cbor;
mod diadem;
#[cfg(feature = "hdf5")]
mod episodes;
mod error;
mod hdf5;
#[cfg(feature = "json")]
mod json_document;
mod json_lines;
#[cfg(feature = "json")]
mod json_numbers;
mod kind;
mod lerobot;
mod limits;
mod line_ends;
mod mat;
mod mat4;
mod npy;
mod octave;
mod packed;
mod parquet;
#[cfg(feature = "parquet")]
mod parquet_pages;
#[cfg(feature = "bags")]
mod protobuf;
mod recognition;
#[cfg(feature = "bags")]
mod ros;
mod sage;
mod sideways;
mod table;
mod text_number;
mod value_list;
mod zip;

pub use dynident_files::SeenFiles;
pub use error::FileError;
pub use kind::FileFormat;
pub use limits::ReadLimits;
pub use sage::{SAGE_FILES, sage_joints};
pub use table::{ColumnGroup, Table};

use limits::Budget;
use std::io::{BufReader, Read};
use std::path::Path;

/// An opened file.
#[derive(Debug)]
pub struct Opened {
    /// Its format.
    pub format: FileFormat,
    /// Its contents.
    pub contents: Contents,
}

/// Contents of a file.
pub enum Contents {
    /// Text, decompressed.
    Text(Box<dyn Read + Send>),
    /// Columns of numbers.
    Table(Box<dyn Table>),
}

impl core::fmt::Debug for Contents {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Text(_) => f.write_str("Text"),
            Self::Table(table) => f.debug_tuple("Table").field(table).finish(),
        }
    }
}

/// Opens the file at `path`, or the folder of a rosbag2 recording, a LeRobot data set or a SAGE recording, and
/// detects its format. For a SAGE recording, it opens the measurements.
///
/// # Errors
/// If it cannot be read, is not a regular file, has an unsupported format, is corrupt in the part that names its
/// columns, or needs more memory than the default of [`ReadLimits`].
pub fn open(path: &Path) -> Result<Opened, FileError> {
    open_within(path, &ReadLimits::default())
}

/// Like [`open`], with other memory limits.
///
/// # Errors
/// Same as for [`open`].
pub fn open_within(path: &Path, limits: &ReadLimits) -> Result<Opened, FileError> {
    let refused = |source| FileError::Io { file: path.to_owned(), source };
    let folder = std::fs::metadata(path).map_err(refused)?.is_dir();
    if let Some(folder) = lerobot::folder(path) {
        return Ok(Opened { format: FileFormat::LeRobot, contents: Contents::Table(lerobot::open(folder)?) });
    }
    if folder {
        if path.join(bags::METADATA).is_file() {
            return Ok(Opened { format: FileFormat::Rosbag2, contents: bags::open_folder(path)? });
        }
        if sage::is_recording(path) {
            let opened = open_within(&path.join(SAGE_FILES[1]), limits)?;
            return Ok(Opened { format: FileFormat::Sage, ..opened });
        }
        return Err(refused(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    let file = dynident_files::open(path).map_err(refused)?;
    let budget = Budget::new(limits, file.metadata().map_err(refused)?.len());
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let head = recognition::head(&mut reader).map_err(refused)?;
    let format = recognition::recognised(path, &head)?;
    let contents = match format {
        FileFormat::ValueList => Contents::Table(value_list::open(path, &head, reader, budget)?),
        FileFormat::Text | FileFormat::SidewaysText if sideways::may_begin(&head) => {
            let Some(table) = sideways::open(path, reader, budget, sideways::Layout::Recognised)? else {
                // A normal table whose rows begin with a text, not one line for each quantity.
                let mut reader = BufReader::with_capacity(1 << 18, dynident_files::open(path).map_err(refused)?);
                let head = recognition::head(&mut reader).map_err(refused)?;
                return Ok(Opened { format, contents: Contents::Text(line_ends::plain(reader, &head)) });
            };
            return Ok(Opened { format: FileFormat::SidewaysText, contents: Contents::Table(table) });
        }
        // The detection from file contents never returns the formats of folders or of text with one line for each
        // quantity.
        FileFormat::Text | FileFormat::SidewaysText | FileFormat::Sage => {
            Contents::Text(line_ends::plain(reader, &head))
        }
        FileFormat::GzipText | FileFormat::ZstdText => {
            return open_packed(path, format, packed::unpacked(path, format, reader)?);
        }
        FileFormat::JsonLines => Contents::Table(json_lines::open(path, Box::new(reader))?),
        FileFormat::Json => Contents::Table(json(path, reader)?),
        // The file is not compressed, so an array cannot be longer than the file.
        FileFormat::Npy => Contents::Table(npy::open(path, reader, Budget::new(limits, u64::MAX))?),
        FileFormat::Npz => Contents::Table(npy::open_archive(path, budget)?),
        FileFormat::Mcap | FileFormat::Rosbag2 | FileFormat::Ros1Bag | FileFormat::Ulog => {
            bags::open_file(path, format)?
        }
        FileFormat::Parquet => Contents::Table(parquet::open(path)?),
        FileFormat::LeRobot => Contents::Table(lerobot::open(path)?),
        FileFormat::Arrow => Contents::Table(arrow::open(path, budget)?),
        FileFormat::Diadem => Contents::Table(diadem::open(path, limits)?),
        FileFormat::Mat4 => Contents::Table(mat4::open(path, reader, budget)?),
        FileFormat::Octave => Contents::Table(octave::open(path, reader, budget)?),
        FileFormat::Mat5 => Contents::Table(mat::open(path, reader, budget)?),
        FileFormat::Hdf5 => Contents::Table(hdf5::open(path, budget)?),
    };
    Ok(Opened { format, contents })
}

/// Opens the content of a compressed file.
fn open_packed(path: &Path, format: FileFormat, unpacked: impl Read + Send + 'static) -> Result<Opened, FileError> {
    let refused = |source| FileError::Io { file: path.to_owned(), source };
    let mut reader = BufReader::with_capacity(1 << 18, unpacked);
    let head = recognition::head(&mut reader).map_err(refused)?;
    let contents = match recognition::recognised(path, &head)? {
        FileFormat::Text => Contents::Text(line_ends::plain(reader, &head)),
        recording @ (FileFormat::Mcap | FileFormat::Rosbag2 | FileFormat::Ros1Bag | FileFormat::Ulog) => {
            return Ok(Opened { format: recording, contents: bags::open_file(path, recording)? });
        }
        FileFormat::JsonLines => Contents::Table(json_lines::open(path, Box::new(reader))?),
        FileFormat::Json => Contents::Table(json(path, reader)?),
        other => {
            let problem = format!("it contains {}, which is supported only uncompressed", other.name());
            return Err(FileError::broken(path, format, "its beginning", problem, "unpack it first"));
        }
    };
    Ok(Opened { format, contents })
}

/// Opens a text table with one line for each quantity and one value for each sample. Lines need no names.
///
/// # Errors
/// Same as for [`open`], and lines of different length.
pub fn open_transposed(path: &Path, limits: &ReadLimits) -> Result<Opened, FileError> {
    let refused = |source| FileError::Io { file: path.to_owned(), source };
    let file = dynident_files::open(path).map_err(refused)?;
    let budget = Budget::new(limits, file.metadata().map_err(refused)?.len());
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let head = recognition::head(&mut reader).map_err(refused)?;
    let text = BufReader::new(line_ends::plain(reader, &head));
    let fix = "write one line for each quantity";
    let table = sideways::open(path, text, budget, sideways::Layout::Stated)?
        .ok_or_else(|| FileError::no_columns(path, FileFormat::SidewaysText, "no lines", fix))?;
    Ok(Opened { format: FileFormat::SidewaysText, contents: Contents::Table(table) })
}

#[cfg(feature = "json")]
fn json(path: &Path, reader: impl Read) -> Result<Box<dyn Table>, FileError> {
    json_document::open(path, reader)
}

#[cfg(not(feature = "json"))]
fn json(path: &Path, _: impl Read) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "JSON", feature: "json" })
}

/// The files of `path`: itself, or the parts of a rosbag2 recording, a LeRobot data set, a SAGE recording or a DIAdem
/// recording, starting with their metadata.
///
/// # Errors
/// If a folder's list of parts cannot be read.
pub fn files(path: &Path) -> Result<Vec<std::path::PathBuf>, FileError> {
    if let Some(folder) = lerobot::folder(path) {
        return lerobot::files(folder);
    }
    if !path.is_dir() {
        if path.is_file() && diadem::is_header(path) {
            return diadem::files(path);
        }
        return Ok(vec![path.to_owned()]);
    }
    if sage::is_recording(path) {
        return Ok(sage::files(path));
    }
    let mut files = vec![path.join(bags::METADATA)];
    files.extend(bags::parts(path)?);
    Ok(files)
}
