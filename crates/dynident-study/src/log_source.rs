//! Source of a log's samples: a file or memory.

use dynident_recording::{Log, LogFormat, LogSource, MemoryLog};
use fnv::FnvHasher;
use std::hash::Hasher;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Source of a log's samples.
#[derive(Clone, Debug)]
pub enum StudyLogSource {
    /// An existing file.
    File(PathBuf),
    /// Samples in memory.
    Memory(MemoryLog),
}

impl StudyLogSource {
    /// Opens the samples as a log of `joints`.
    pub fn log(&self, format: LogFormat, joints: &[String]) -> Log {
        match self {
            Self::File(path) => Log::file(path, format, joints),
            Self::Memory(samples) => Log::new(samples.clone(), format, joints),
        }
    }

    /// Name in messages.
    pub fn path(&self) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Memory(samples) => PathBuf::from(samples.label()),
        }
    }

    /// Whether both sources contain the same samples: the same file or files of equal content, the same table in
    /// memory or tables of equal numbers. A file and a table are never treated as equal. False if a file cannot be
    /// read; the error is reported when the log is read.
    pub(crate) fn has_content_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::File(a), Self::File(b)) => same_file_content(a, b),
            (Self::Memory(a), Self::Memory(b)) => {
                a.is_same_table(b) || a.numbers().map(f64::to_bits).eq(b.numbers().map(f64::to_bits))
            }
            _ => false,
        }
    }
}

/// Whether two files have equal contents: they have the same path, or equal length and hash.
fn same_file_content(a: &Path, b: &Path) -> bool {
    if let (Ok(a), Ok(b)) = (a.canonicalize(), b.canonicalize())
        && a == b
    {
        return true;
    }
    let length = |path: &Path| path.metadata().map(|metadata| metadata.len()).ok();
    length(a).is_some() && length(a) == length(b) && hash(a).is_some_and(|one| Some(one) == hash(b))
}

/// FNV-1a hash of a file's bytes, 64 bits; `None` if the file cannot be read.
fn hash(path: &Path) -> Option<u64> {
    let mut file = BufReader::with_capacity(1 << 16, dynident_files::open(path).ok()?);
    let mut hasher = FnvHasher::default();
    loop {
        let block = file.fill_buf().ok()?;
        if block.is_empty() {
            return Some(hasher.finish());
        }
        hasher.write(block);
        let read = block.len();
        file.consume(read);
    }
}
