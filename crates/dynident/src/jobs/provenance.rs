//! Provenance of a result: its input files and its identity.

use crate::digest::hexadecimal;
use crate::error::Error;
use crate::factors::Factors;
use crate::result::{InputFile, Provenance};
use crate::study::{Study, StudyFile, StudyInput};
use dynident_recording::LogSource;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;

const IDENTITY_DIGITS: usize = 12;
const BLOCK_BYTES: usize = 1 << 16;

/// Provenance of a result of `study`. `read` contains the other inputs with their kinds; duplicates are allowed.
///
/// # Errors
/// [`Error::File`] for a file that cannot be read again.
pub(crate) fn provenance(study: StudyFile<'_>, read: &[(&'static str, StudyInput)]) -> Result<Provenance, Error> {
    let mut inputs = Vec::new();
    for (index, (what, source)) in read.iter().enumerate() {
        if read[..index].iter().any(|(_, earlier)| is_same(earlier, source)) {
            continue;
        }
        inputs.push(read_input(what, source, study)?);
    }
    // For a study built in memory the path is only a name.
    let own = if study.path.is_file() { Some(input("study", study.path, study)?) } else { None };
    Ok(identified_by(&study, own, inputs))
}

/// Provenance of a result that is made long after study and robot were read. Study and robot are taken from `begun`,
/// because the files may have changed; `read` contains the other files.
///
/// # Errors
/// [`Error::File`] for a file that cannot be read again.
pub(crate) fn later_provenance(
    study: StudyFile<'_>,
    begun: &Provenance,
    read: &[(&'static str, StudyInput)],
) -> Result<Provenance, Error> {
    let robot = begun.inputs.iter().filter(|input| input.what == "robot").cloned().map(Ok);
    let since = read.iter().map(|(what, source)| read_input(what, source, study));
    Ok(identified_by(&study, begun.study.clone(), robot.chain(since).collect::<Result<_, _>>()?))
}

pub(crate) fn factors_provenance(factors: &Factors) -> Provenance {
    let robot = factors.study.robot.description.iter();
    let robot =
        robot.map(|robot| input_in_memory("robot", &robot.path.display().to_string(), [&robot.text].into_iter()));
    let logs = factors.logs().iter().map(|log| InputFile {
        what: "log".to_owned(),
        file: log.log.name.clone(),
        bytes: log.numbers_bytes(),
        sha256: log.sha256.clone(),
    });
    identified_by(&factors.study, None, robot.chain(logs).collect())
}

fn identified_by(study: &Study, own: Option<InputFile>, inputs: Vec<InputFile>) -> Provenance {
    let version = env!("CARGO_PKG_VERSION");
    let mut identity = Sha256::new();
    identity.update(version);
    identity.update(format!("{study:?}"));
    for input in &inputs {
        identity.update(format!("\n{} {}", input.what, input.sha256));
    }
    let mut identity = hexadecimal(&identity.finalize());
    identity.truncate(IDENTITY_DIGITS);
    Provenance { identity, version: version.to_owned(), command: None, content_sha256: None, study: own, inputs }
}

/// Describes the input `source` of the kind `what`, with a path relative to the folder of `study`.
///
/// # Errors
/// [`Error::File`] for a file that cannot be read again.
pub(crate) fn read_input(what: &str, source: &StudyInput, study: StudyFile<'_>) -> Result<InputFile, Error> {
    Ok(match source {
        StudyInput::File(path) => input(what, path, study)?,
        StudyInput::Samples(samples) => {
            let numbers = samples.numbers().map(f64::to_le_bytes);
            input_in_memory(what, &samples.label(), numbers)
        }
        StudyInput::Description(robot) => {
            input_in_memory(what, &robot.path.display().to_string(), core::iter::once(&robot.text))
        }
    })
}

/// Computes the [`provenance()`] of a design, simulation or iteration, with further inputs.
///
/// # Errors
/// Same as for [`provenance()`].
pub(crate) fn motion_provenance(
    study: StudyFile<'_>,
    data: Option<&Path>,
    further: &[(&'static str, StudyInput)],
) -> Result<Provenance, Error> {
    let mut read = study.motion_inputs(&study.folders(data));
    read.extend_from_slice(further);
    provenance(study, &read)
}

fn is_same(a: &StudyInput, b: &StudyInput) -> bool {
    match (a, b) {
        (StudyInput::File(a), StudyInput::File(b)) => a == b,
        (StudyInput::Samples(a), StudyInput::Samples(b)) => a.is_same_table(b),
        _ => false,
    }
}

/// Computes the [`provenance()`] during a job, on a separate thread if more than one thread is permitted.
pub(crate) fn concurrently<R>(
    threads: usize,
    provenance: impl FnOnce() -> Result<Provenance, Error> + Send,
    job: impl FnOnce() -> R,
) -> (Result<Provenance, Error>, R) {
    if threads < 2 {
        let done = job();
        return (provenance(), done);
    }
    std::thread::scope(|scope| {
        let provenance = scope.spawn(provenance);
        let done = job();
        (provenance.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), done)
    })
}

fn input(what: &str, path: &Path, study: StudyFile<'_>) -> Result<InputFile, Error> {
    let cannot = |path: &Path, source| Error::File { path: path.to_owned(), source };
    let (mut hash, mut block, mut bytes) = (Sha256::new(), vec![0; BLOCK_BYTES], 0);
    // A recording that is a folder is hashed file by file.
    let parts = dynident_recording::log::files(path).map_err(|error| cannot(path, std::io::Error::other(error)))?;
    for part in parts {
        let mut file = dynident_files::open(&part).map_err(|error| cannot(&part, error))?;
        loop {
            let length = file.read(&mut block).map_err(|error| cannot(&part, error))?;
            if length == 0 {
                break;
            }
            hash.update(&block[..length]);
            bytes += length as u64;
        }
    }
    let sha256 = hexadecimal(&hash.finalize());
    Ok(InputFile { what: what.to_owned(), file: study.relative(path), bytes, sha256 })
}

/// Describes data in memory: numbers as 8-byte IEEE 754, little-endian, row by row; texts as UTF-8.
fn input_in_memory<B: AsRef<[u8]>>(what: &str, label: &str, parts: impl Iterator<Item = B>) -> InputFile {
    let (mut hash, mut block, mut bytes) = (Sha256::new(), Vec::with_capacity(2 * BLOCK_BYTES), 0);
    for part in parts {
        block.extend_from_slice(part.as_ref());
        if block.len() >= BLOCK_BYTES {
            hash.update(&block);
            bytes += block.len() as u64;
            block.clear();
        }
    }
    hash.update(&block);
    bytes += block.len() as u64;
    InputFile { what: what.to_owned(), file: label.to_owned(), bytes, sha256: hexadecimal(&hash.finalize()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_standard_and_paths_are_relative_to_the_study() {
        let folder = tempfile::tempdir().unwrap();
        let studies = folder.path().join("studies");
        std::fs::create_dir(&studies).unwrap();
        let study = Study::parse("[robot]\nfile = \"arm.urdf\"\n", Path::new("study.toml")).unwrap();
        let in_folder = |folder: &Path| folder.join("study.toml");
        let file = folder.path().join("abc.csv");
        std::fs::write(&file, "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        let found = input("log", &file, StudyFile::new(&study, &in_folder(&studies))).unwrap();
        assert_eq!(found.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!((found.bytes, found.file.as_str()), (3, "../abc.csv"));
        assert_eq!(StudyFile::new(&study, &in_folder(folder.path())).relative(&file), "abc.csv");
    }
}
