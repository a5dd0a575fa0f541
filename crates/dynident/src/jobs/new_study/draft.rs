//! Draft of a study: tables and keys, each with its reason.

use crate::jobs::check::REPEATED_VALUES;
use crate::result::{CheckFinding, StudyChange, StudyCheck, Unsure};
use core::fmt::Write;
use dynident_recording::Level;
use dynident_text::{comment, toml_document};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    key: String,
    value: String,
    reason: String,
    is_sure: bool,
}

/// A table, or one entry of an array of tables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Table {
    /// Heading in brackets: `[robot]`, `[[log]]`; empty for the top level.
    heading: String,
    reason: String,
    lines: Vec<Line>,
    /// Names of the files of this recording, in its own `format`.
    renamed: Option<RenamedFiles>,
}

/// Names of the files of one recording among several in one folder: `run_b_{joint}.csv` in place of
/// `run_a_{joint}.csv`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RenamedFiles {
    /// Text before and after the joint in the file names of the first recording.
    pub(super) first: [String; 2],
    /// The same for this recording.
    pub(super) own: [String; 2],
}

impl RenamedFiles {
    /// The value of a key `file`, a text in quotes.
    fn renamed(&self, file: &str) -> String {
        let [before, after] = &self.first;
        let inside = file.strip_prefix(&format!("\"{before}")).and_then(|rest| {
            let (stem, extension) = rest.rsplit_once('.')?;
            Some((stem.strip_suffix(after.as_str())?, extension))
        });
        let name = |(joint, extension): (&str, &str)| format!("\"{}{joint}{}.{extension}", self.own[0], self.own[1]);
        inside.map_or_else(|| file.to_owned(), name)
    }
}

impl Table {
    pub(super) fn new(heading: &str, reason: impl Into<String>) -> Self {
        Self { heading: heading.to_owned(), reason: reason.into(), lines: Vec::new(), renamed: None }
    }

    /// The table of a recording whose files have other names than those in `[format]`.
    #[must_use]
    pub(super) fn with_own_format(self, renamed: RenamedFiles) -> Self {
        Self { renamed: Some(renamed), ..self }
    }

    #[must_use]
    pub(super) fn with(self, key: &str, value: impl Into<String>, reason: impl Into<String>) -> Self {
        self.with_line(key, value, reason, true)
    }

    #[must_use]
    pub(super) fn with_unsure(self, key: &str, value: impl Into<String>, reason: impl Into<String>) -> Self {
        self.with_line(key, value, reason, false)
    }

    #[must_use]
    pub(super) fn with_line(
        mut self,
        key: &str,
        value: impl Into<String>,
        reason: impl Into<String>,
        is_sure: bool,
    ) -> Self {
        self.lines.push(Line { key: key.to_owned(), value: value.into(), reason: reason.into(), is_sure });
        self
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Draft {
    pub(super) tables: Vec<Table>,
}

impl Draft {
    #[must_use]
    pub(super) fn with(&self, table: Table) -> Self {
        let mut tables = self.tables.clone();
        tables.push(table);
        Self { tables }
    }

    /// Adds a reason to a line of a table.
    pub(super) fn explain(&mut self, heading: &str, key: &str, reason: &str) {
        let tables = self.tables.iter_mut().filter(|table| table.heading == heading);
        for line in tables.flat_map(|table| &mut table.lines).filter(|line| line.key == key) {
            let separator = if line.reason.is_empty() { "" } else { "; " };
            line.reason = format!("{}{separator}{reason}", line.reason);
        }
    }

    /// The format of the study with the names of the files of one recording, as an inline table.
    fn own_format(&self, renamed: &RenamedFiles) -> String {
        let value = |line: &Line| {
            let value = if line.key == "file" { renamed.renamed(&line.value) } else { line.value.clone() };
            format!("{} = {value}", line.key)
        };
        let list = |table: &Table| table.lines.iter().map(value).collect::<Vec<_>>().join(", ");
        let of_table = |table: &Table| match table.heading.trim_matches(['[', ']']).split_once('.') {
            None if table.heading == "[format]" => Some(list(table)).filter(|list| !list.is_empty()),
            Some(("format", group)) => Some(format!("{group} = {{ {} }}", list(table))),
            _ => None,
        };
        format!("{{ {} }}", self.tables.iter().filter_map(of_table).collect::<Vec<_>>().join(", "))
    }

    /// Applies a proposed change; returns false if the change is not a key or its table is missing.
    pub(super) fn apply(&mut self, change: &StudyChange, reason: &str) -> bool {
        let Some((key, value)) = change.line.split_once('=') else { return false };
        let (key, value) = (key.trim(), value.trim());
        if key.starts_with('#') {
            return false;
        }
        let heading = format!("[{}]", change.table);
        let Some(table) = self.tables.iter_mut().find(|table| table.heading == heading) else { return false };
        let line = Line { key: key.to_owned(), value: value.to_owned(), reason: reason.to_owned(), is_sure: true };
        match table.lines.iter_mut().find(|old| old.key == key) {
            Some(old) if old.value == line.value => return false,
            Some(old) => *old = line,
            None => table.lines.push(line),
        }
        true
    }

    /// Applies the unambiguous corrections of an examination; returns whether anything changed. Signs, orders,
    /// mountings and units have few possible values, and the number of rows that a recorder repeats can be counted. A
    /// zero position or a factor can have any value and may compensate for another mistake, so a person has to
    /// decide.
    pub(super) fn apply_corrections(&mut self, found: &StudyCheck) -> bool {
        let is_discrete = |finding: &&CheckFinding| match finding.kind.as_str() {
            "sign" | "order" | "mounting" => true,
            "unit" => finding.write.iter().all(|change| change.line.starts_with("unit")),
            _ => false,
        };
        let problems = found.findings.iter().filter(|finding| finding.level == Level::Problem && finding.or.is_empty());
        let repeated = found.findings.iter().filter(|finding| finding.code == REPEATED_VALUES);
        let corrections = repeated.chain(problems.filter(is_discrete));
        let mut changed = false;
        let mut is_reordered = false;
        for finding in corrections {
            for change in &finding.write {
                let reason = format!("From `dynident check`: {}: {}", finding.what, finding.evidence);
                let is_applied = self.apply(change, &reason);
                is_reordered |= is_applied && finding.kind == "order";
                changed |= is_applied;
            }
        }
        if is_reordered {
            self.explain("[robot]", "joints", "then `dynident check` found another order of the columns (below)");
        }
        changed
    }

    pub(super) fn unsure(&self) -> Vec<Unsure> {
        let of_table = |table: &Table| {
            let unsure = |line: &Line| Unsure {
                line: Some(StudyChange {
                    table: table.heading.trim_matches(['[', ']']).to_owned(),
                    line: format!("{} = {}", line.key, line.value),
                }),
                proposed: Vec::new(),
                reason: line.reason.clone(),
            };
            table.lines.iter().filter(|line| !line.is_sure).map(unsure).collect::<Vec<_>>()
        };
        self.tables.iter().flat_map(of_table).collect()
    }

    pub(super) fn text(&self) -> String {
        let mut text =
            "# Written by `dynident new`: each line with its reason. Check the lines marked UNSURE.\n".to_owned();
        let is_empty = |table: &&Table| table.heading.is_empty() && table.reason.is_empty();
        for table in self.tables.iter().filter(|table| !is_empty(table)) {
            text.push('\n');
            if !table.reason.is_empty() {
                let _ = writeln!(text, "# {}", comment(&table.reason.replace('\n', " ")));
            }
            if !table.heading.is_empty() {
                let _ = writeln!(text, "{}", table.heading);
            }
            for Line { key, value, reason, is_sure } in &table.lines {
                if !reason.is_empty() {
                    let _ = writeln!(
                        text,
                        "# {}{}",
                        if *is_sure { "" } else { "UNSURE: " },
                        comment(&reason.replace('\n', " "))
                    );
                }
                let _ = writeln!(text, "{key} = {value}");
            }
            if let Some(renamed) = &table.renamed {
                let _ = writeln!(
                    text,
                    "# The files of this recording have other names: otherwise as under [format]\nformat = {}",
                    self.own_format(renamed)
                );
            }
        }
        // The values come from several sources, all of which write TOML.
        toml_document(&text).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_go_into_their_table_once() {
        let torque = Table::new("[format.torque]", "").with("columns", "\"tau{1..2}\"", "by name");
        let mut draft = Draft { tables: vec![torque] };
        let change = StudyChange { table: "format.torque".to_owned(), line: "sign = -1".to_owned() };
        assert!(draft.apply(&change, "negative masses\notherwise"));
        assert!(!draft.apply(&change, "again"));
        let elsewhere = StudyChange { table: "robot".to_owned(), line: "gravity_m_s2 = [0.0, 0.0, 9.81]".to_owned() };
        let advice = StudyChange { table: "format.torque".to_owned(), line: "# matrix: the negative = 2".to_owned() };
        assert!(!draft.apply(&elsewhere, "") && !draft.apply(&advice, ""));
        let text = draft.text();
        assert!(text.contains("# negative masses otherwise\nsign = -1\n"), "{text}");
        assert!(text.parse::<toml::Table>().is_ok() && draft.unsure().is_empty(), "{text}");
    }

    #[test]
    fn a_recording_with_other_file_names_has_the_corrected_format() {
        let file =
            Table::new("[format.position]", "").with("file", "\"a_{joint}.csv\"", "").with("columns", "\"q\"", "");
        let names = |run: &str| [format!("{run}_"), String::new()];
        let second = RenamedFiles { first: names("a"), own: names("b") };
        let log = Table::new("[[log]]", "").with("file", "\"b_pan.csv\"", "").with_own_format(second);
        let time = Table::new("[format]", "").with("time", "{ column = \"t\" }", "");
        let mut draft = Draft { tables: vec![time, file, log] };
        let change = StudyChange { table: "format.position".to_owned(), line: "sign = [1, -1]".to_owned() };
        assert!(draft.apply(&change, ""));
        let text: toml::Table = draft.text().parse().unwrap();
        let own = &text["log"][0]["format"];
        assert_eq!(own["position"]["file"].as_str(), Some("b_{joint}.csv"));
        assert_eq!(own["position"]["sign"], text["format"]["position"]["sign"]);
        assert_eq!(own["time"], text["format"]["time"]);
    }
}
