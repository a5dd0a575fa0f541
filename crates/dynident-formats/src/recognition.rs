//! What a file is, by its first bytes.

use crate::arrow;
use crate::diadem;
use crate::error::FileError;
use crate::kind::FileFormat;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Bytes that recognition looks at: a JSON object's whole first line should be among them.
const HEAD: usize = 1 << 16;

/// The beginning of a stream, which stays unread; shorter than [`HEAD`] only where the stream is.
pub(crate) fn head<R: Read>(reader: &mut BufReader<R>) -> std::io::Result<Vec<u8>> {
    // One filling of the buffer; a packed stream may give less at a time, which is enough to know a format by.
    let filled = reader.fill_buf()?;
    Ok(filled[..filled.len().min(HEAD)].to_vec())
}

/// Formats by what their files begin with.
const READ: &[(&[u8], FileFormat)] = &[
    (b"\x89MCAP0\r\n", FileFormat::Mcap),
    (b"SQLite format 3\0", FileFormat::Rosbag2),
    (b"\x89HDF\r\n\x1a\n", FileFormat::Hdf5),
    (b"\x93NUMPY", FileFormat::Npy),
    (b"PAR1", FileFormat::Parquet),
    (arrow::MAGIC, FileFormat::Arrow),
    (diadem::BEGIN, FileFormat::Diadem),
    (b"PK\x03\x04", FileFormat::Npz),
    (b"\x1F\x8B", FileFormat::GzipText),
    (b"\x28\xB5\x2F\xFD", FileFormat::ZstdText),
];

/// A format that is not read: what its files begin with, what it is, what to do.
type Foreign = (&'static [u8], &'static str, &'static str);

const EXPORT: &str = "export its table as CSV (pandas: `frame.to_csv(\"log.csv\", index=False)`)";
const UNPACK: &str = "unpack it first";
const FOREIGN: &[Foreign] = &[
    (b"#ROSBAG V", "a ROS 1 bag", "convert it to MCAP (`rosbags-convert`), or export the joint states as CSV"),
    (b"FEA1", "a Feather table of version 1", "write it as Parquet (pandas: `frame.to_parquet(\"log.parquet\")`)"),
    (b"BZh", "a bzip2 archive", UNPACK),
    (b"\xFD7zXZ\0", "an xz archive", UNPACK),
    (b"\x04\x22\x4D\x18", "an LZ4 archive", UNPACK),
    (b"\xFF\xFE", "text in UTF-16", "save it as UTF-8"),
    (b"\xFE\xFF", "text in UTF-16", "save it as UTF-8"),
    (b"<?xml", "an XML document", EXPORT),
    (b"\xD0\xCF\x11\xE0", "an old workbook", "save its sheet as CSV"),
];

/// What a file with this beginning is.
///
/// # Errors
/// If it is of a known format that is not read.
pub(crate) fn recognised(path: &Path, head: &[u8]) -> Result<FileFormat, FileError> {
    if let Some((_, format)) = READ.iter().find(|(begins, _)| head.starts_with(begins)) {
        return Ok(*format);
    }
    if arrow::begins_stream(head) {
        return Ok(FileFormat::Arrow);
    }
    if let Some((_, format, fix)) = FOREIGN.iter().find(|(begins, _, _)| head.starts_with(begins)) {
        return Err(FileError::OtherFormat { file: path.to_owned(), format, fix });
    }
    // MATLAB: 116 bytes of text, then its version and byte order; version 7.3 has the same text before an HDF5 file.
    if head.len() >= 128 && head.starts_with(b"MATLAB ") && matches!(&head[126..128], b"IM" | b"MI") {
        let little = &head[126..128] == b"IM";
        let version = if little { [head[125], head[124]] } else { [head[124], head[125]] };
        return match version {
            [1, _] => Ok(FileFormat::Mat5),
            _ => Ok(FileFormat::Hdf5),
        };
    }
    if head.starts_with(b"MATLAB ") {
        return Err(FileError::broken(
            path,
            FileFormat::Mat5,
            "its header",
            "it is cut off",
            "record or copy it again",
        ));
    }
    if is_json_line(head) {
        return Ok(FileFormat::JsonLines);
    }
    Ok(FileFormat::Text)
}

/// Whether the first line that is not blank is an object of JSON: `{"`, or `{` and blanks before `"`, and `}` at the
/// end of the line.
fn is_json_line(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
    let line = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let begins = line.strip_prefix(b"{").is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""));
    // A line longer than what was looked at has no end here.
    begins && (line.len() == head.len() && head.len() >= HEAD / 2 || line.trim_ascii_end().ends_with(b"}"))
}
