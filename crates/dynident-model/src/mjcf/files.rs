use super::expanded::MAX_BYTES;
use std::path::Path;

/// Reads the files that an MJCF in `folder` includes, for [`read_mjcf_with`](super::read_mjcf_with): regular files of
/// at most 16 MiB.
pub fn included_from(folder: &Path) -> impl FnMut(&str) -> Result<String, String> + use<> {
    let folder = folder.to_owned();
    move |file| {
        let path = folder.join(file);
        dynident_files::read_text(&path, MAX_BYTES as u64).map_err(|error| error.to_string())
    }
}
