//! Provenance on the page of a result.

use crate::result::ResultFile;
use dynident_report::{Report, Table, Text};

/// Adds version, identity, command and input files.
pub(super) fn origin(page: &mut Report, r: &ResultFile) {
    let Some(provenance) = &r.provenance else { return };
    let command = provenance.command.as_ref().map_or_else(String::new, |command| format!(" by `{command}`"));
    page.add(Text::new(format!(
        "Created by dynident {}{command} on {}. Identity {}: it is also in result.json and identified.urdf of this run, \
         and is the same for every run of this version with the same files.",
        provenance.version, r.timings_s.made_at, provenance.identity
    )));
    let rows = provenance.study.iter().chain(&provenance.inputs).map(|input| {
        [input.what.clone(), input.file.clone(), input.bytes.to_string(), input.sha256.clone()].map(Into::into).into()
    });
    page.add(
        Table::new("Files", ["what", "file", "bytes", "SHA-256"]).note("relative to the study's folder").rows(rows),
    );
}
