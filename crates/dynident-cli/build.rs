//! Packs the pages of the book for `dynident docs`, the JSON schemas for `dynident schema`, and an example for
//! `dynident init`, each into one compressed file. Without the feature `book` (the Python package has a size limit),
//! only the pages on messages and the schema of the study are packed.

use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pages of the smaller book.
const SMALL_BOOK: [&str; 2] = ["troubleshooting.md", "messages.md"];

/// Schemas of the smaller package.
const SMALL_SCHEMAS: [&str; 1] = ["study.json"];

type Files = Vec<(String, String)>;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-env-changed=DYNIDENT_COMMIT");
    let is_complete = std::env::var_os("CARGO_FEATURE_BOOK").is_some();
    pack("book", &book(is_complete)?)?;
    pack("schemas", &schemas(is_complete)?)?;
    pack("example", &example()?)
}

fn book(is_complete: bool) -> Result<Files, Box<dyn Error>> {
    let book = folder("book", "docs/src")?;
    let summary = std::fs::read_to_string(book.join("SUMMARY.md"))?;
    let files = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let packed = files.filter(|file| is_complete || SMALL_BOOK.contains(file));
    packed.map(|file| named(&book, file, file.trim_end_matches(".md"))).collect()
}

fn schemas(is_complete: bool) -> Result<Files, Box<dyn Error>> {
    let schemas = folder("schemas", "docs/schemas")?;
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(&schemas)? {
        names.extend(
            entry?
                .file_name()
                .into_string()
                .ok()
                .filter(|name| std::path::Path::new(name).extension().is_some_and(|kind| kind == "json")),
        );
    }
    names.sort();
    let packed = names.iter().filter(|name| is_complete || SMALL_SCHEMAS.contains(&&***name));
    packed.map(|name| named(&schemas, name, name.trim_end_matches(".json"))).collect()
}

/// The robot and the two logs of the simulated UR10; every second row of the logs, for size.
fn example() -> Result<Files, Box<dyn Error>> {
    let (logs, robots) = (folder("example", "examples/ur10_simulated")?, folder("robots", "robots")?);
    let mut files = vec![named(&robots, "ur10.urdf", "ur10.urdf")?];
    for name in ["train.csv", "test.csv"] {
        let (name, text) = named(&logs, name, name)?;
        let mut rows = text.split_inclusive('\n');
        let header = rows.next().ok_or("an empty log")?;
        files.push((name, header.to_owned() + &rows.step_by(2).collect::<String>()));
    }
    Ok(files)
}

fn named(folder: &Path, file: &str, name: &str) -> Result<(String, String), Box<dyn Error>> {
    let path = folder.join(file);
    println!("cargo::rerun-if-changed={}", path.display());
    Ok((name.to_owned(), std::fs::read_to_string(path)?))
}

/// A folder of the repository. A link in this crate brings it into the package; some checkouts on Windows have no
/// links.
fn folder(link: &str, of_repository: &str) -> Result<PathBuf, Box<dyn Error>> {
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?);
    let folders = [root.join(link), root.join("../..").join(of_repository)];
    let found = folders.into_iter().find(|folder| folder.is_dir());
    found.ok_or_else(|| format!("a folder of the repository is missing: {of_repository}").into())
}

/// Writes the files into `NAME.deflate`. Form feeds separate them; each begins with its name.
fn pack(name: &str, files: &Files) -> Result<(), Box<dyn Error>> {
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::best());
    for (file, text) in files {
        write!(packed, "{file}\n{text}\u{c}")?;
    }
    let out = Path::new(&std::env::var("OUT_DIR")?).join(format!("{name}.deflate"));
    Ok(std::fs::write(out, packed.finish()?)?)
}
