//! Detects the format of a file from its first bytes.

use crate::arrow;
use crate::diadem;
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::mat4;
use crate::octave;
use crate::value_list;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Number of bytes used for the detection; they should include the first line of JSON.
const HEAD_BYTES: usize = 1 << 16;

/// The first bytes of a stream, without consuming them; may be shorter than [`HEAD_BYTES`].
pub(crate) fn head<R: Read>(reader: &mut BufReader<R>) -> std::io::Result<Vec<u8>> {
    // The buffer is filled only once. A compressed stream may then return fewer bytes, which suffice for the
    // detection.
    let filled = reader.fill_buf()?;
    Ok(filled[..filled.len().min(HEAD_BYTES)].to_vec())
}

const SUPPORTED: &[(&[u8], FileFormat)] = &[
    (b"\x89MCAP0\r\n", FileFormat::Mcap),
    (b"SQLite format 3\0", FileFormat::Rosbag2),
    (b"#ROSBAG V2.0\n", FileFormat::Ros1Bag),
    (b"ULog\x01\x12\x35", FileFormat::Ulog),
    (b"\x89HDF\r\n\x1a\n", FileFormat::Hdf5),
    (b"\x93NUMPY", FileFormat::Npy),
    (b"PAR1", FileFormat::Parquet),
    (arrow::MAGIC, FileFormat::Arrow),
    (diadem::MAGIC, FileFormat::Diadem),
    (octave::BEGINNINGS[0], FileFormat::Octave),
    (octave::BEGINNINGS[1], FileFormat::Octave),
    (b"PK\x03\x04", FileFormat::Npz),
    (b"\x1F\x8B", FileFormat::GzipText),
    (b"\x28\xB5\x2F\xFD", FileFormat::ZstdText),
];

/// A format that is recognised, but that this crate does not read.
struct Unsupported {
    /// Bytes with which a file of the format starts.
    begins: &'static [u8],
    /// Bytes among the first bytes of the file; empty for no condition.
    contains: &'static [u8],
    name: &'static str,
    fix: &'static str,
}

const fn unsupported(begins: &'static [u8], name: &'static str, fix: &'static str) -> Unsupported {
    Unsupported { begins, contains: b"", name, fix }
}

const fn archive(contains: &'static [u8], name: &'static str, fix: &'static str) -> Unsupported {
    Unsupported { begins: b"PK\x03\x04", contains, name, fix }
}

const EXPORT_FIX: &str = "export its table as CSV (pandas: `frame.to_csv(\"log.csv\", index=False)`)";
const EXCEL_FIX: &str = "save its sheet as CSV, or convert it in Python: `pandas.read_excel(\"log.xlsx\").to_csv(\"log.csv\", index=False)`";
const PICKLE_FIX: &str = "a pickle can run any program, so it is never loaded; if you trust it, convert it in Python: `pandas.DataFrame(pandas.read_pickle(\"log.pkl\")).to_csv(\"log.csv\", index=False)`, or `numpy.savez` for arrays";
const JOBLIB_FIX: &str = "it may contain pickled objects, so it is never loaded; if you trust it, convert it in Python: `numpy.savez(\"log.npz\", **joblib.load(\"log.joblib\"))`";
const SIMULINK_FIX: &str = "it is a model without a recording; save the logged signals in MATLAB: `q = out.q.Data; tau = out.tau.Data; t = out.tout; save(\"log.mat\", \"t\", \"q\", \"tau\", \"-v7\")`";
const MDF_FIX: &str = "convert it in Python: `asammdf.MDF(\"log.mf4\").to_dataframe(raster=0.001).to_csv(\"log.csv\")` with the step of your recording in seconds";
const UNPACK_FIX: &str = "unpack it first";
const TAR: &str = "a tar archive";
const TAR_FIX: &str = "unpack it (`tar -xf FILE`) and give the files in it";
/// Place and value of the magic text of a tar archive.
const TAR_MAGIC: (usize, &[u8]) = (257, b"ustar");
const ECHO: &str = "the text of `ros2 topic echo`";
const ECHO_FIX: &str = "record a bag (`ros2 bag record /joint_states`, in ROS 1 `rosbag record /joint_states`), or write a table (`ros2 topic echo --csv /joint_states > log.csv`, in ROS 1 `rostopic echo -p`)";
const UNSUPPORTED: &[Unsupported] = &[
    unsupported(b"#ROSBAG V", "a ROS 1 bag of version 1", "convert it with `rosbag fix`"),
    unsupported(
        b"FEA1",
        "a Feather table of version 1",
        "convert it in Python: `pandas.read_feather(\"log.feather\").to_parquet(\"log.parquet\")`",
    ),
    unsupported(
        b"TDSm",
        "a TDMS file of LabVIEW",
        "convert it in Python: `nptdms.TdmsFile.read(\"log.tdms\").as_dataframe().to_csv(\"log.csv\", index=False)`",
    ),
    unsupported(b"MDF     ", "an MDF file (MF4)", MDF_FIX),
    unsupported(b"UnFinMF ", "an MDF file (MF4) that was not completed", MDF_FIX),
    unsupported(b"\x0E\x03\x13\x01", "an HDF4 file", "convert it to HDF5: `h4toh5 log.hdf log.h5`"),
    unsupported(b"\x80\x02c", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x02}", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x02]", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x03c", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x03}", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x03]", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x04\x95", "a pickle of Python", PICKLE_FIX),
    unsupported(b"\x80\x05\x95", "a pickle of Python", PICKLE_FIX),
    unsupported(b"ZF0x", "a file of joblib", JOBLIB_FIX),
    unsupported(b"\x78\x9C", "a compressed file of joblib", JOBLIB_FIX),
    archive(b"xl/", "a workbook (xlsx)", EXCEL_FIX),
    archive(b"opendocument.spreadsheet", "a workbook (ods)", EXCEL_FIX),
    archive(b"simulink/", "a Simulink model (slx)", SIMULINK_FIX),
    unsupported(b"Model {", "a Simulink model (mdl)", SIMULINK_FIX),
    unsupported(b"\xD0\xCF\x11\xE0", "an old workbook (xls)", EXCEL_FIX),
    unsupported(b"BZh", "a bzip2 archive", UNPACK_FIX),
    unsupported(b"\xFD7zXZ\0", "an xz archive", UNPACK_FIX),
    unsupported(b"\x04\x22\x4D\x18", "an LZ4 archive", UNPACK_FIX),
    unsupported(b"7z\xBC\xAF\x27\x1C", "a 7-Zip archive", UNPACK_FIX),
    unsupported(b"<?xml", "an XML document", EXPORT_FIX),
    unsupported(b"header:\n  stamp:", ECHO, ECHO_FIX),
    unsupported(b"header: \n  seq:", ECHO, ECHO_FIX),
];

fn contains(head: &[u8], wanted: &[u8]) -> bool {
    wanted.is_empty() || head.windows(wanted.len()).any(|window| window == wanted)
}

/// The format of a file with these first bytes.
///
/// # Errors
/// If it is a known unsupported format.
pub(crate) fn recognised(path: &Path, head: &[u8]) -> Result<FileFormat, FileError> {
    let is_like = |format: &&Unsupported| head.starts_with(format.begins) && contains(head, format.contains);
    // Archives of other formats are tested before NumPy's, because they have the same first bytes.
    let other = UNSUPPORTED.iter().find(is_like);
    if let Some((_, format)) = SUPPORTED.iter().find(|(begins, _)| head.starts_with(begins))
        && other.is_none_or(|other| other.contains.is_empty())
    {
        return Ok(*format);
    }
    if head.get(TAR_MAGIC.0..).is_some_and(|rest| rest.starts_with(TAR_MAGIC.1)) {
        return Err(FileError::OtherFormat { file: path.to_owned(), format: TAR, fix: TAR_FIX });
    }
    if arrow::begins_stream(head) {
        return Ok(FileFormat::Arrow);
    }
    if let Some(Unsupported { name, fix, .. }) = other {
        return Err(FileError::OtherFormat { file: path.to_owned(), format: name, fix });
    }
    if mat4::begins(head) {
        return Ok(FileFormat::Mat4);
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
    if value_list::begins(head) {
        return Ok(FileFormat::ValueList);
    }
    Ok(FileFormat::Text)
}

/// Whether the first line that is not blank is a JSON object: it starts with `{` and `"`, possibly with blanks between,
/// and ends with `}`.
fn is_json_line(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start();
    let line = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let begins = line.strip_prefix(b"{").is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""));
    // The end of a line that is longer than the tested bytes is unknown.
    begins && (line.len() == head.len() && head.len() >= HEAD_BYTES / 2 || line.trim_ascii_end().ends_with(b"}"))
}

/// Whether these first bytes are those of a JSON document over several lines, or of a list of objects.
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
    fn archives_and_printed_messages_name_their_fix() {
        let mut tar = vec![0; 512];
        tar[..7].copy_from_slice(b"run.csv");
        tar[257..263].copy_from_slice(b"ustar\0");
        let message = |head: &[u8]| recognised(Path::new("log"), head).unwrap_err().to_string();
        assert!(message(&tar).contains("tar -xf"), "{}", message(&tar));
        let ros2 = b"header:\n  stamp:\n    sec: 1718000000\n";
        let ros1 = b"header: \n  seq: 1\n  stamp: \n";
        for head in [&ros2[..], ros1] {
            assert!(message(head).contains("ros2 bag record"), "{}", message(head));
        }
        assert!(recognised(Path::new("log"), b"header,q\n1,2\n").is_ok());
    }

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
