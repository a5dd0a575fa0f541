//! Detects the format of a file from its first bytes.

use crate::arrow;
use crate::diadem;
use crate::error::FileError;
use crate::kind::FileFormat;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Number of bytes used for the detection; they should include the first line of JSON.
const HEAD_BYTES: usize = 1 << 16;

/// The first bytes of a stream, without consuming them; may be shorter than [`HEAD_BYTES`].
pub(crate) fn head<R: Read>(reader: &mut BufReader<R>) -> std::io::Result<Vec<u8>> {
    // A single fill of the buffer; a compressed stream may return fewer bytes, which suffice for the detection.
    let filled = reader.fill_buf()?;
    Ok(filled[..filled.len().min(HEAD_BYTES)].to_vec())
}

const SUPPORTED: &[(&[u8], FileFormat)] = &[
    (b"\x89MCAP0\r\n", FileFormat::Mcap),
    (b"SQLite format 3\0", FileFormat::Rosbag2),
    (b"\x89HDF\r\n\x1a\n", FileFormat::Hdf5),
    (b"\x93NUMPY", FileFormat::Npy),
    (b"PAR1", FileFormat::Parquet),
    (arrow::MAGIC, FileFormat::Arrow),
    (diadem::MAGIC, FileFormat::Diadem),
    (b"PK\x03\x04", FileFormat::Npz),
    (b"\x1F\x8B", FileFormat::GzipText),
    (b"\x28\xB5\x2F\xFD", FileFormat::ZstdText),
];

/// An unsupported format: first bytes, name, fix.
type Unsupported = (&'static [u8], &'static str, &'static str);

const EXPORT_FIX: &str = "export its table as CSV (pandas: `frame.to_csv(\"log.csv\", index=False)`)";
const UNPACK_FIX: &str = "unpack it first";
const UNSUPPORTED: &[Unsupported] = &[
    (b"#ROSBAG V", "a ROS 1 bag", "convert it to MCAP (`rosbags-convert`), or export the joint states as CSV"),
    (b"FEA1", "a Feather table of version 1", "write it as Parquet (pandas: `frame.to_parquet(\"log.parquet\")`)"),
    (b"BZh", "a bzip2 archive", UNPACK_FIX),
    (b"\xFD7zXZ\0", "an xz archive", UNPACK_FIX),
    (b"\x04\x22\x4D\x18", "an LZ4 archive", UNPACK_FIX),
    (b"\xFF\xFE", "text in UTF-16", "save it as UTF-8"),
    (b"\xFE\xFF", "text in UTF-16", "save it as UTF-8"),
    (b"<?xml", "an XML document", EXPORT_FIX),
    (b"\xD0\xCF\x11\xE0", "an old workbook", "save its sheet as CSV"),
];

/// The format of a file with these first bytes.
///
/// # Errors
/// If it is a known unsupported format.
pub(crate) fn recognised(path: &Path, head: &[u8]) -> Result<FileFormat, FileError> {
    if let Some((_, format)) = SUPPORTED.iter().find(|(begins, _)| head.starts_with(begins)) {
        return Ok(*format);
    }
    if arrow::begins_stream(head) {
        return Ok(FileFormat::Arrow);
    }
    if let Some((_, format, fix)) = UNSUPPORTED.iter().find(|(begins, _, _)| head.starts_with(begins)) {
        return Err(FileError::OtherFormat { file: path.to_owned(), format, fix });
    }
    // MATLAB: 116 bytes of text, then version and byte order; version 7.3 has the same text before an HDF5 file.
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
            "it is truncated",
            "record or copy it again",
        ));
    }
    if is_json_line(head) {
        return Ok(FileFormat::JsonLines);
    }
    if is_json_document(head) {
        return Ok(FileFormat::Json);
    }
    Ok(FileFormat::Text)
}

/// Whether the first line that is not blank is a JSON object: it starts with `{` and `"`, possibly with blanks between,
/// and ends with `}`.
fn is_json_line(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
    let line = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let begins = line.strip_prefix(b"{").is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""));
    // A line longer than the tested bytes has no end here.
    begins && (line.len() == head.len() && head.len() >= HEAD_BYTES / 2 || line.trim_ascii_end().ends_with(b"}"))
}

/// Whether these first bytes are those of a document over several lines, or of a list of objects.
fn is_json_document(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
    match head {
        [b'[', rest @ ..] => {
            rest.trim_ascii_start().strip_prefix(b"{").is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""))
        }
        [b'{', rest @ ..] => {
            let name = rest.trim_ascii_start();
            rest[..rest.len() - name.len()].contains(&b'\n') && name.starts_with(b"\"")
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_documents_are_recognised() {
        for (text, expected) in [
            ("[{\"t\": 0}]", true),
            (" [\n  { \"t\": 0}]", true),
            ("{\n \"t\": [0, 1]}", true),
            ("{\"t\": 0}\n", false),
            ("[0.1, 0.2]", false),
            ("t,q\n", false),
        ] {
            assert_eq!(is_json_document(text.as_bytes()), expected, "{text}");
        }
    }
}
