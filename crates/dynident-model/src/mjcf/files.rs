//! The files that a document includes.

use super::expanded::MAX_BYTES;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads the files that an MJCF in `folder` includes: for [`read_mjcf_with`](super::read_mjcf_with). No pipes or
/// devices, for their names come from a document and not from the user; at most 16 MiB.
pub fn included_from(folder: &Path) -> impl FnMut(&str) -> Result<String, String> + use<> {
    let folder = folder.to_owned();
    move |file| {
        let path = folder.join(file);
        let metadata = std::fs::metadata(&path).map_err(|error| error.to_string())?;
        if !metadata.is_file() {
            return Err("it is no file".to_owned());
        }
        let mut bytes = Vec::new();
        // Bounded reading: the length that the system reports may be wrong.
        let read = File::open(&path).and_then(|file| file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes));
        read.map_err(|error| error.to_string())?;
        if bytes.len() > MAX_BYTES {
            return Err(format!("it is larger than {} MiB", MAX_BYTES >> 20));
        }
        String::from_utf8(bytes).map_err(|_| "it is not UTF-8 text".to_owned())
    }
}
