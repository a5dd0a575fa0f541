//! `dynident schema NAME`: a JSON schema.

use super::Context;
use crate::{Verdict, packed, terminal};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Name of the file kind: `study` for study files, `result` for result.json, and others. Without it, all names are
    /// listed.
    name: Option<String>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let schemas = packed::schemas()?;
    let names: Vec<&str> = schemas.iter().map(|schema| &*schema.name).collect();
    let Some(name) = &options.name else {
        if context.json {
            return Err("a list of names is not a JSON schema: give a name, such as `study`, or omit --json".to_owned());
        }
        terminal::print(&names.join("\n"))?;
        return Ok(Verdict::Good);
    };
    let found = schemas.iter().find(|schema| schema.name == name.trim_end_matches(".json"));
    let found = found.ok_or_else(|| format!("no schema `{name}`; the schemas are: {}", names.join(", ")))?;
    terminal::print_document(found.text.trim_end())?;
    Ok(Verdict::Good)
}
