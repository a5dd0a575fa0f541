//! Reads a robot from a URDF, MJCF, SDF or D-H table, distinguished by file name or content.

use crate::dh::{DhError, read_dh};
use crate::mjcf::{MjcfError, MjcfLoss, MjcfNotice, is_mjcf, read_mjcf_in};
use crate::place::line_and_column;
use crate::sdf::{SdfError, SdfNotice, is_sdf, read_sdf};
use crate::tree::Model;
use crate::urdf::{UnreadElement, UrdfError, UrdfIrregularity, read_urdf};
use crate::xacro::has_macros;
use std::io::Read;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Size limit of a robot description, bytes. The largest known humanoids are below one megabyte.
pub const MAX_DESCRIPTION_BYTES: u64 = 16 << 20;

/// Format of a robot description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptionFormat {
    /// URDF.
    Urdf,
    /// MJCF, MuJoCo's format.
    Mjcf,
    /// SDF, Gazebo's format.
    Sdf,
    /// D-H table in TOML.
    Dh,
}

/// A robot and its source.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// The robot.
    pub model: Model,
    /// Format of the file.
    pub format: DescriptionFormat,
    /// Path of the file.
    pub path: PathBuf,
    /// Text of the file, for [`rewrite_urdf`](crate::rewrite_urdf); for a file with xacro macros, the expanded text.
    pub text: String,
    /// Elements of a URDF that were ignored.
    pub unread: Vec<UnreadElement>,
    /// Violations of the URDF rules that do not make the robot ambiguous.
    pub irregularities: Vec<UrdfIrregularity>,
    /// Contents of an MJCF that the model cannot represent.
    pub notices: Vec<MjcfNotice>,
    /// Contents of an SDF that the model cannot represent.
    pub sdf_notices: Vec<SdfNotice>,
}

impl Robot {
    /// Notices about a base that can move, although the model has it fixed. They restrict the logs that are valid.
    pub fn losses_of_base(&self) -> impl Iterator<Item = &MjcfLoss> {
        self.notices.iter().map(|notice| &notice.loss).filter(|loss| matches!(loss, MjcfLoss::FloatingBase { .. }))
    }
}

/// Why a file could not be read as a robot. Every message begins with the file, and with line and column if known.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum ReadError {
    /// The robot file does not exist, or you have no permission to read it. Correct the path, for example `file` under
    /// `[robot]`, or the permissions.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File { path: PathBuf, source: std::io::Error },
    /// Robot descriptions are far smaller, so the path names another file, such as a mesh or a log. Give the URDF,
    /// MJCF, SDF or D-H file.
    #[error("{}: larger than {} MiB, too large for a robot description: name the URDF, MJCF, SDF or D-H file", path.display(), MAX_DESCRIPTION_BYTES >> 20)]
    TooLarge { path: PathBuf },
    /// The file contains only blanks. Often an export or a xacro expansion failed before. Write the file again.
    #[error("{}:1:1: the file is empty: name a URDF, an MJCF, an SDF or a D-H table", path.display())]
    Empty { path: PathBuf },
    /// The file is binary or saved in another encoding, such as UTF-16 or Latin-1. Save it as UTF-8.
    #[error("{}:{line}:{column}: not UTF-8 text{hint}: save the description as UTF-8", path.display())]
    Encoding { path: PathBuf, line: u32, column: u32, hint: &'static str },
    /// The content is that of another kind of file, such as a mesh, an archive or a web page. The message names the
    /// file to give instead.
    #[error("{}:1:1: {what}, not a robot description: {fix}", path.display())]
    NoDescription { path: PathBuf, what: &'static str, fix: &'static str },
    /// Only the program `xacro` can expand macros. Expand the file and use the result, or permit the program with
    /// `--allow-command`.
    #[error("{}: the file contains xacro macros: expand it first (`xacro robot.urdf.xacro > robot.urdf`)", path.display())]
    Macros { path: PathBuf },
    /// The URDF has the error that follows the path. See the tables *URDF* and *Robot models* below.
    #[error("{}:{source}", path.display())]
    Urdf { path: PathBuf, source: Box<UrdfError> },
    /// The MJCF has the error that follows the path. See the tables *MJCF* and *Robot models* below.
    #[error("{}:{source}", path.display())]
    Mjcf { path: PathBuf, source: Box<MjcfError> },
    /// The SDF has the error that follows the path. See the tables *SDF* and *Robot models* below.
    #[error("{}:{source}", path.display())]
    Sdf { path: PathBuf, source: Box<SdfError> },
    /// The D-H table has the error that follows the path. See the tables *Denavit-Hartenberg tables* and *Robot models*
    /// below.
    #[error("{}:{source}", path.display())]
    Dh { path: PathBuf, source: Box<DhError> },
}

/// Reads a robot description. `.toml` is a D-H table; `.urdf`, `.xml` and any other text that begins with `<` is an
/// MJCF, SDF or URDF, depending on its root element. Files included by an MJCF are searched relative to its folder. No
/// program is run: a file with xacro macros is rejected.
///
/// # Errors
/// File not readable, too large, empty, not UTF-8, with invalid content or with xacro macros; every message names the
/// file.
#[doc(alias("urdf", "mjcf", "mujoco", "denavit-hartenberg"))]
pub fn load_robot(path: impl AsRef<Path>) -> Result<Robot, ReadError> {
    load_robot_with(path.as_ref(), |path| Err(ReadError::Macros { path: path.to_owned() }))
}

/// Like [`load_robot`], but `expand` returns the expanded text of a file with xacro macros; it is called only for
/// such files.
///
/// # Errors
/// Same as for [`load_robot`], and those of `expand`.
pub fn load_robot_with<E: From<ReadError>>(
    path: &Path,
    expand: impl FnOnce(&Path) -> Result<String, E>,
) -> Result<Robot, E> {
    let text = description_text(path)?;
    let text = if has_macros(&text) { expand(path)? } else { text };
    Ok(read_robot(text, path)?)
}

/// Whether a robot file contains xacro macros, which only the program `xacro` can expand.
///
/// # Errors
/// File not readable, too large, not UTF-8, or not a robot description.
pub fn has_xacro_macros(path: &Path) -> Result<bool, ReadError> {
    Ok(has_macros(&description_text(path)?))
}

fn description_text(path: &Path) -> Result<String, ReadError> {
    let named = || path.to_owned();
    let bytes = bounded(path)?;
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    if let Some((what, fix)) = other_kind(&bytes, extension.as_deref()) {
        return Err(ReadError::NoDescription { path: named(), what, fix });
    }
    decode(bytes, path)
}

/// Reads a robot from the text of its description. The format is determined as in [`load_robot`], from the extension of
/// `path` and the content. `path` appears in messages, and files included by an MJCF are searched relative to its
/// folder; it need not exist.
///
/// # Errors
/// Empty or invalid text, or xacro macros; every message names `path`.
pub fn read_robot(text: String, path: &Path) -> Result<Robot, ReadError> {
    let named = || path.to_owned();
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(ReadError::Empty { path: named() });
    }
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    let is_xml = match extension.as_deref() {
        Some("urdf" | "xml" | "xacro" | "mjcf" | "sdf" | "world") => true,
        Some("toml") => false,
        _ => text.trim_start_matches('\u{feff}').trim_start().starts_with('<'),
    };
    let format = match is_xml {
        true if is_mjcf(&text) => DescriptionFormat::Mjcf,
        true if is_sdf(&text) => DescriptionFormat::Sdf,
        true => DescriptionFormat::Urdf,
        false => DescriptionFormat::Dh,
    };
    let (mut unread, mut irregularities) = (Vec::new(), Vec::new());
    let (mut notices, mut sdf_notices) = (Vec::new(), Vec::new());
    let model = match format {
        DescriptionFormat::Urdf => {
            let robot = read_urdf(&text).map_err(|error| ReadError::Urdf { path: named(), source: Box::new(error) })?;
            (unread, irregularities) = (robot.unread, robot.irregularities);
            robot.model
        }
        DescriptionFormat::Mjcf => {
            let folder = path.parent().unwrap_or(Path::new(""));
            let robot = read_mjcf_in(&text, folder)
                .map_err(|error| ReadError::Mjcf { path: named(), source: Box::new(error) })?;
            notices = robot.notices;
            robot.model
        }
        DescriptionFormat::Sdf => {
            let robot = read_sdf(&text).map_err(|error| ReadError::Sdf { path: named(), source: Box::new(error) })?;
            sdf_notices = robot.notices;
            robot.model
        }
        DescriptionFormat::Dh => {
            read_dh(&text).map_err(|error| ReadError::Dh { path: named(), source: Box::new(error) })?
        }
    };
    Ok(Robot { model, format, path: named(), text, unread, irregularities, notices, sdf_notices })
}

fn bounded(path: &Path) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    // The size reported by the system may be wrong (kernel files), so the read itself is bounded.
    dynident_files::open(path)
        .and_then(|file| file.take(MAX_DESCRIPTION_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| ReadError::File { path: path.to_owned(), source })?;
    if bytes.len() as u64 > MAX_DESCRIPTION_BYTES {
        return Err(ReadError::TooLarge { path: path.to_owned() });
    }
    Ok(bytes)
}

const RECORDINGS: [&str; 16] = [
    "csv", "tsv", "dat", "log", "mcap", "bag", "db3", "h5", "hdf5", "mat", "npy", "npz", "parquet", "feather", "xlsx",
    "ods",
];

/// Kind of a file that is obviously not a robot description, and the fix.
fn other_kind(bytes: &[u8], extension: Option<&str>) -> Option<(&'static str, &'static str)> {
    const LOG: &str = "name the log in a study, as `file` of a [[log]], and give the URDF or the D-H table here";
    if extension.is_some_and(|extension| RECORDINGS.contains(&extension)) {
        return Some(("a recording or a table of numbers", LOG));
    }
    let text = str::from_utf8(bytes).ok()?;
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    if extension == Some("toml") {
        // Section names that only a study has.
        let section = |line: &str| matches!(line, "[robot]" | "[[log]]" | "[format]" | "[design]" | "[iteration]");
        return lines.any(section).then_some((
            "a study",
            "give the file that its [robot] names; the study itself is for `identify`, `design` and `iterate`",
        ));
    }
    let first = lines.next()?;
    if first.starts_with('{') && extension == Some("json") {
        return Some(("a JSON file", "give the URDF or the D-H table"));
    }
    // A row of names or numbers without syntax of TOML or XML.
    let plain = |c: char| !matches!(c, '=' | '[' | ']' | '<' | '>' | '{' | '}' | '"');
    let table =
        [',', ';', '\t'].iter().any(|delimiter| first.matches(*delimiter).count() >= 2) && first.chars().all(plain);
    table.then_some(("a table", LOG))
}

fn decode(bytes: Vec<u8>, path: &Path) -> Result<String, ReadError> {
    String::from_utf8(bytes).map_err(|error| {
        let bytes = error.as_bytes();
        let good = error.utf8_error().valid_up_to();
        let before = String::from_utf8_lossy(&bytes[..good]);
        let (line, column) = line_and_column(&before, before.len());
        let hint = match bytes {
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => " (it looks like UTF-16)",
            _ if bytes.contains(&0) => " (it looks like a binary file)",
            _ => "",
        };
        ReadError::Encoding { path: path.to_owned(), line, column, hint }
    })
}
