//! Recordings of messages: MCAP, rosbag2, ROS 1 bags and ULog. Every topic is a group of columns with a separate clock.

use crate::error::FileError;
use crate::kind::FileFormat;
use std::path::{Path, PathBuf};

#[cfg(feature = "bags")]
mod database;
#[cfg(feature = "bags")]
mod joined;
#[cfg(feature = "bags")]
mod mcap_file;
#[cfg(feature = "bags")]
mod messages;
#[cfg(feature = "bags")]
mod part;
#[cfg(feature = "bags")]
mod ros1_bag;
#[cfg(feature = "bags")]
mod sqlite;
#[cfg(feature = "bags")]
mod table;
#[cfg(feature = "bags")]
mod topic;

#[cfg(feature = "bags")]
mod ulog;
#[cfg(feature = "bags")]
mod unpacked;

#[cfg(feature = "bags")]
pub(crate) use table::{open_file, open_folder};

pub(crate) const METADATA: &str = "metadata.yaml";
const MAX_METADATA_BYTES: u64 = 1 << 24;

pub(crate) fn parts(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    use std::io::Read;
    let path = folder.join(METADATA);
    let mut text = String::new();
    dynident_files::open(&path)
        .and_then(|file| file.take(MAX_METADATA_BYTES).read_to_string(&mut text))
        .map_err(|source| FileError::Io { file: path.clone(), source })?;
    let broken = |problem: String| {
        let fix = "recreate the metadata by `ros2 bag reindex`, or specify the part";
        FileError::broken(&path, FileFormat::Rosbag2, "relative_file_paths", problem, fix)
    };
    let mut lines = text.lines().skip_while(|line| !line.trim_start().starts_with("relative_file_paths:")).skip(1);
    let mut parts = Vec::new();
    while let Some(name) = lines.next().and_then(|line| line.trim_start().strip_prefix("- ")) {
        // Old bags contain the folder in the names of their parts.
        let name = name.trim().trim_matches(['"', '\'']);
        let name = Path::new(name).file_name().ok_or_else(|| broken(format!("`{name}` is not a file name")))?;
        let part = folder.join(name);
        if !part.is_file() {
            return Err(broken(format!("`{}` is not in the folder", name.to_string_lossy())));
        }
        parts.push(part);
    }
    if parts.is_empty() { Err(broken("the list of parts is empty".to_owned())) } else { Ok(parts) }
}

#[cfg(not(feature = "bags"))]
mod left_out {
    use crate::{Contents, FileError, FileFormat};
    use std::path::Path;

    pub(crate) fn not_built(path: &Path) -> Result<Contents, FileError> {
        Err(FileError::NotBuilt { file: path.to_owned(), format: "a recording of messages", feature: "bags" })
    }

    pub(crate) use not_built as open_folder;

    pub(crate) fn open_file(path: &Path, _: FileFormat) -> Result<Contents, FileError> {
        not_built(path)
    }
}
#[cfg(not(feature = "bags"))]
pub(crate) use left_out::{open_file, open_folder};
