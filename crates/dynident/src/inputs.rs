//! Input files of a job: they must not be overwritten, and must not change during the job.

use crate::error::Error;
use crate::study::{Study, StudyFile};
use dynident_files::SeenFiles;
use dynident_model::collision::find_mesh;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Largest robot description that is searched for the names of meshes and included files, bytes.
const MAX_ROBOT_BYTES: u64 = 64 << 20;

/// State of a study's files at the start of a job.
#[derive(Debug)]
pub(crate) struct InputFiles(SeenFiles);

impl InputFiles {
    /// Records the study file, all existing files that the study refers to, and the meshes and included files of its
    /// robot.
    pub(crate) fn of(study: StudyFile<'_>, data: Option<&Path>) -> Self {
        let mut files = named_files(study, data, |_| true);
        if let Ok(robot) = study.folders(data).find(&study.robot.file, None) {
            files.extend(files_of_robot(&robot));
        }
        let seen = SeenFiles::default();
        for file in files {
            // A recording can consist of several files. Its reader reports errors.
            for part in dynident_recording::log::files(&file).unwrap_or_default() {
                let _ = seen.is_unchanged(&part);
            }
        }
        Self(seen)
    }

    /// Checks that no file has changed since the start of the job.
    ///
    /// # Errors
    /// [`Error::Changed`] with the first changed file.
    pub(crate) fn unchanged(&self) -> Result<(), Error> {
        self.0.first_changed().map_or(Ok(()), |path| Err(Error::Changed { path }))
    }

    /// Runs a job that reads the files. A change of a file during the job is an error even if the job failed, because
    /// the numbers of the job and the hashes in its provenance may belong to different contents.
    ///
    /// # Errors
    /// [`Error::Changed`], and errors of the job.
    pub(crate) fn while_unchanged<R>(&self, job: impl FnOnce() -> Result<R, Error>) -> Result<R, Error> {
        let done = job();
        self.unchanged()?;
        done
    }
}

/// Meshes and included files in the attributes `file` and `filename` of a robot description.
fn files_of_robot(robot: &Path) -> Vec<PathBuf> {
    let folder = robot.parent().unwrap_or(Path::new(""));
    let Ok(text) = dynident_files::read_text(robot, MAX_ROBOT_BYTES) else { return Vec::new() };
    let named = |attribute: &'static str| {
        text.split(attribute).skip(1).filter_map(|rest| {
            let quote = rest.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
            rest[1..].split_once(quote).map(|(name, _)| name)
        })
    };
    let mut names: Vec<&str> = named("file=").chain(named("filename=")).collect();
    names.sort_unstable();
    names.dedup();
    names.into_iter().filter_map(|name| find_mesh(folder, name)).collect()
}

/// Checks that none of `outputs` (files or folders, which need not exist) is or contains one of `inputs`, also under
/// another path or through a link.
///
/// # Errors
/// [`Error::Overwrite`] with the first pair.
pub fn refuse_overwriting(outputs: &[PathBuf], inputs: &[PathBuf]) -> Result<(), Error> {
    let inputs: Vec<(&PathBuf, PathBuf)> =
        inputs.iter().filter_map(|input| Some((input, input.canonicalize().ok()?))).collect();
    for output in outputs {
        // A missing output cannot be an input.
        let Ok(place) = output.canonicalize() else { continue };
        if let Some((input, _)) = inputs.iter().find(|(_, input)| input.starts_with(&place)) {
            return Err(Error::Overwrite { output: output.clone(), input: (*input).clone() });
        }
    }
    Ok(())
}

/// The study file, and every existing file to which the study refers in `sections` (`robot`, `log`, ..). Every text
/// in these sections is treated as a possible file name, so that no key can be forgotten. Files are searched in the
/// study's folders, and next to the files found there (for the `file` keys of a log's channels).
pub fn study_inputs(study: &Study, study_path: &Path, data: Option<&Path>, sections: &[&str]) -> Vec<PathBuf> {
    let study = StudyFile::new(study, study_path);
    named_files(study, data, |section| sections.contains(&section))
}

fn named_files(study: StudyFile<'_>, data: Option<&Path>, chosen: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let folders = study.folders(data);
    let mut texts = Vec::new();
    if let Ok(Value::Object(all)) = study.to_json() {
        all.iter().filter(|(section, _)| chosen(section)).for_each(|(_, value)| collect_texts(value, &mut texts));
    }
    let mut files: Vec<PathBuf> = texts.iter().filter_map(|text| folders.find(Path::new(text), None).ok()).collect();
    let siblings: Vec<PathBuf> = files
        .iter()
        .filter_map(|file| file.parent())
        .flat_map(|folder| texts.iter().map(move |text| folder.join(text)))
        .filter(|path| path.is_file())
        .collect();
    files.extend(siblings);
    files.push(study.path.to_owned());
    files.sort();
    files.dedup();
    files
}

fn collect_texts(value: &Value, texts: &mut Vec<String>) {
    match value {
        Value::String(text) if !text.is_empty() => texts.push(text.clone()),
        Value::Array(values) => values.iter().for_each(|value| collect_texts(value, texts)),
        Value::Object(entries) => entries.values().for_each(|value| collect_texts(value, texts)),
        Value::String(_) | Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}
