//! Parts of a recording that are compressed as whole files: `bag_0.db3.zstd`.

use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, ReadLimits};
use crate::{packed, recognition};
use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::Path;

const BLOCK_BYTES: usize = 1 << 18;

/// Opens a part. A compressed part is decompressed into a temporary file without a name, because SQLite files are not
/// read in sequence.
pub(super) fn open(path: &Path) -> Result<File, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let file = dynident_files::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    let mut reader = BufReader::with_capacity(BLOCK_BYTES, file);
    let head = recognition::head(&mut reader).map_err(io)?;
    let format = recognition::recognised(path, &head)?;
    if !matches!(format, FileFormat::GzipText | FileFormat::ZstdText) {
        let mut file = reader.into_inner();
        file.rewind().map_err(io)?;
        return Ok(file);
    }
    let broken = |problem: String| {
        FileError::broken(path, format, "its contents", problem, "copy it again, or unpack it (`zstd -d`)")
    };
    let mut unpacked = packed::unpacked(path, format, reader)?;
    let mut file = tempfile::tempfile().map_err(io)?;
    // The same limit as for numbers in memory: a small file must not fill the disk.
    let mut budget = Budget::new(&ReadLimits { memory_bytes: u64::MAX, ..ReadLimits::default() }, bytes);
    let mut block = vec![0; BLOCK_BYTES];
    loop {
        let read = unpacked.read(&mut block).map_err(|error| broken(format!("they cannot be unpacked ({error})")))?;
        if read == 0 {
            break;
        }
        let limit = |_| broken("they are more than a hundred times as long as the file".to_owned());
        budget.take(Some(read as u64)).map_err(limit)?;
        file.write_all(&block[..read]).map_err(io)?;
    }
    file.rewind().map_err(io)?;
    Ok(file)
}

/// Format of the decompressed content of a compressed file with these first bytes; for other files the format of the
/// file itself.
pub(crate) fn inner_format(path: &Path) -> Result<FileFormat, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let mut reader = BufReader::with_capacity(BLOCK_BYTES, dynident_files::open(path).map_err(io)?);
    let head = recognition::head(&mut reader).map_err(io)?;
    match recognition::recognised(path, &head)? {
        format @ (FileFormat::GzipText | FileFormat::ZstdText) => {
            let mut inner = BufReader::with_capacity(BLOCK_BYTES, packed::unpacked(path, format, reader)?);
            recognition::recognised(path, &recognition::head(&mut inner).map_err(io)?)
        }
        format => Ok(format),
    }
}
