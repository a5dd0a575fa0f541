//! Text files that are part of the program; the build script compresses them.

use flate2::read::DeflateDecoder;
use std::io::Read;

/// A text file that is part of the program.
pub(crate) struct PackedFile {
    pub(crate) name: String,
    pub(crate) text: String,
}

/// JSON schemas by name.
pub(crate) fn schemas() -> Result<Vec<PackedFile>, String> {
    files(include_bytes!(concat!(env!("OUT_DIR"), "/schemas.deflate")))
}

/// The robot and the logs of the example of `init`.
pub(crate) fn example() -> Result<Vec<PackedFile>, String> {
    files(include_bytes!(concat!(env!("OUT_DIR"), "/example.deflate")))
}

pub(crate) fn files(packed: &[u8]) -> Result<Vec<PackedFile>, String> {
    let mut text = String::new();
    DeflateDecoder::new(packed)
        .read_to_string(&mut text)
        .map_err(|error| format!("the files in this program are corrupt: {error}; install it again"))?;
    let files = text.split_terminator('\u{c}').filter_map(|file| file.split_once('\n'));
    Ok(files.map(|(name, text)| PackedFile { name: name.to_owned(), text: text.to_owned() }).collect())
}
