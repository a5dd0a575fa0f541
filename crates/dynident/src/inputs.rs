//! No output takes the place of an input.

use crate::error::Error;
use crate::study::{Folders, Study};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// That none of `outputs` (files or folders, which need not exist yet) is one of `inputs` or holds one, also under
/// another path or through a link.
///
/// # Errors
/// [`Error::Overwrite`] with the first pair.
pub fn refuse_overwriting(outputs: &[PathBuf], inputs: &[PathBuf]) -> Result<(), Error> {
    let inputs: Vec<(&PathBuf, PathBuf)> =
        inputs.iter().filter_map(|input| Some((input, input.canonicalize().ok()?))).collect();
    for output in outputs {
        // What is not there yet is no input.
        let Ok(place) = output.canonicalize() else { continue };
        if let Some((input, _)) = inputs.iter().find(|(_, input)| input.starts_with(&place)) {
            return Err(Error::Overwrite { output: output.clone(), input: (*input).clone() });
        }
    }
    Ok(())
}

/// The study file, and every file that the study names in `sections` (`robot`, `log`, ..), as far as they exist. What
/// names a file is found by looking: every text of these sections that is a file in one of the study's folders, or
/// beside one that is (as the `file` keys of a log's channels are), so that no key can be forgotten.
pub fn study_inputs(study: &Study, study_path: &Path, data: Option<&Path>, sections: &[&str]) -> Vec<PathBuf> {
    let folders = Folders::new(study, study_path, data);
    let mut texts = Vec::new();
    if let Ok(Value::Object(all)) = serde_json::to_value(study) {
        for section in sections {
            gather(all.get(*section).unwrap_or(&Value::Null), &mut texts);
        }
    }
    let mut files: Vec<PathBuf> = texts.iter().filter_map(|text| folders.find(Path::new(text), None).ok()).collect();
    let beside: Vec<PathBuf> = files
        .iter()
        .filter_map(|file| file.parent())
        .flat_map(|folder| texts.iter().map(move |text| folder.join(text)))
        .filter(|path| path.is_file())
        .collect();
    files.extend(beside);
    files.push(study_path.to_owned());
    files.sort();
    files.dedup();
    files
}

/// All texts in `value` that could name a file.
fn gather(value: &Value, texts: &mut Vec<String>) {
    match value {
        Value::String(text) if !text.is_empty() => texts.push(text.clone()),
        Value::Array(values) => values.iter().for_each(|value| gather(value, texts)),
        Value::Object(entries) => entries.values().for_each(|value| gather(value, texts)),
        Value::String(_) | Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}
