//! `dynident init [FOLDER]`: a complete example.

use super::{Context, json, message_of};
use crate::{Verdict, packed, terminal};
use dynident::OutputSet;
use serde::Serialize;
use std::path::PathBuf;

/// Name and version of the schema of `init --json`.
pub const INIT_SCHEMA: &str = "dynident/init/1";

const STUDY: &str = "study.toml";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The new folder, or an empty one.
    #[arg(default_value = "dynident-example")]
    folder: PathBuf,
}

/// Output of `init --json`: the written example.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InitFile {
    /// Name and version of the schema: [`INIT_SCHEMA`].
    pub schema: String,
    /// Folder of the example.
    pub folder: String,
    /// Names of the files in the folder.
    pub files: Vec<String>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let mut files = packed::example()?;
    files.push(packed::PackedFile { name: STUDY.to_owned(), text: include_str!("init.toml").to_owned() });
    let folder = &options.folder;
    if let Some(file) = files.iter().map(|file| folder.join(&file.name)).find(|path| path.exists()) {
        return Err(format!("{}: exists already and is not overwritten: name another folder", file.display()));
    }
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    let set = files.into_iter().fold(OutputSet::new(folder), |set, file| set.file(&file.name, file.text));
    set.write().map_err(message_of)?;
    if context.json {
        let shown = InitFile { schema: INIT_SCHEMA.to_owned(), folder: folder.display().to_string(), files: names };
        terminal::print_document(&json(&shown)?)?;
    } else if !context.quiet {
        let folder = folder.display();
        terminal::print(&format!(
            "{folder}: the robot ur10.urdf, its logs train.csv and test.csv, and {STUDY}\n\nnext:\n  \
             dynident check {folder}/{STUDY}\n  dynident identify {folder}/{STUDY} --out {folder}/result"
        ))?;
    }
    Ok(Verdict::Good)
}
