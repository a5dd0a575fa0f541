//! Packs the pages of the book into one compressed file for `dynident docs`. Without the feature `book` (the Python
//! package has a size limit), only the pages on messages are packed.

use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pages of the smaller book.
const SMALL_BOOK: [&str; 2] = ["troubleshooting.md", "messages.md"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?);
    // `book` is a link, so that a package of this crate contains the pages. Some checkouts on Windows have no links.
    let folders = [root.join("book"), root.join("../../docs/src")];
    let book = folders.iter().find(|folder| folder.is_dir()).ok_or("the pages of the book are missing: docs/src")?;
    println!("cargo::rerun-if-changed={}", book.display());
    let is_complete = std::env::var_os("CARGO_FEATURE_BOOK").is_some();
    let summary = std::fs::read_to_string(book.join("SUMMARY.md"))?;
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::best());
    for file in summary.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        if is_complete || SMALL_BOOK.contains(&file) {
            let text = std::fs::read_to_string(book.join(file))?;
            // Form feeds separate the pages; each begins with its name.
            write!(packed, "{}\n{text}\u{c}", file.trim_end_matches(".md"))?;
        }
    }
    let out = Path::new(&std::env::var("OUT_DIR")?).join("book.deflate");
    Ok(std::fs::write(out, packed.finish()?)?)
}
