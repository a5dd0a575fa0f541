//! Writes the tables of errors in `docs/src/messages.md` from the sources of all crates; the text above them is kept:
//!
//! ```sh
//! cargo run -p dynident-cli --example messages
//! ```

use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The tables follow this line.
const MARK: &str = "<!-- The tables below are generated: cargo run -p dynident-cli --example messages -->\n";

/// Error types with the heading of their section and the page that helps, in the order of the page.
pub(crate) const SECTIONS: &[(&str, &str, &str)] = &[
    ("Error", "Files and jobs", "commands.md"),
    ("StudyFileError", "Studies and the files that they name", "study.md"),
    ("StudyError", "Study file", "study.md"),
    ("ResultFileError", "Result files", "schemas.md"),
    ("NewStudyError", "Writing a study", "your-robot.md"),
    ("FormatError", "Log format in a study", "log-formats.md"),
    ("RecordingError", "Reading logs", "logs.md"),
    ("FileError", "Files of logs", "logs.md"),
    ("LogError", "Rows of logs", "logs.md"),
    ("FilterError", "Filters and differentiators", "filters.md"),
    ("ParallelFilterError", "Filter of torque and regressor", "filters.md"),
    ("ReadError", "Robot files", "robots.md"),
    ("UrdfFault", "URDF", "robots.md"),
    ("MjcfFault", "MJCF", "robot-formats.md"),
    ("MjcfLoss", "Parts of an MJCF that are ignored", "robot-formats.md"),
    ("SdfFault", "SDF", "robot-formats.md"),
    ("SdfLoss", "Parts of an SDF that are ignored", "robot-formats.md"),
    ("DhFault", "Denavit-Hartenberg tables", "robot-formats.md"),
    ("XacroError", "Macros in robot files", "robots.md"),
    ("Located", "Places in robot files", "robots.md"),
    ("ModelError", "Robot models", "robots.md"),
    ("LoopError", "Closed chains", "robots.md"),
    ("MeshError", "Mesh files", "design-details.md"),
    ("MeshFault", "Contents of mesh files", "design-details.md"),
    ("MeshInertiaFault", "Masses of meshes in an MJCF", "robot-formats.md"),
    ("UrdfWriteError", "Writing a URDF", "robots.md"),
    ("MjcfWriteError", "Writing an MJCF", "robots.md"),
    ("SdfWriteError", "Writing an SDF", "robots.md"),
    ("DhWriteError", "Writing a Denavit-Hartenberg table", "robots.md"),
    ("ExpressionError", "Expressions", "friction.md"),
    ("ExpressionProblem", "Mistakes in expressions", "friction.md"),
    ("TorqueTableError", "Torque tables", "friction.md"),
    ("ParametricModelError", "Robot with its torque terms", "base-parameters.md"),
    ("IdentificationError", "Identification", "troubleshooting.md"),
    ("EstimationError", "Least squares", "estimation.md"),
    ("EstimatorError", "Estimators", "estimation.md"),
    ("NoStartError", "Start values of estimators", "estimation.md"),
    ("PeriodError", "Periodic motion", "estimation.md"),
    ("PhysicalError", "Physically consistent fit", "consistent-fit.md"),
    ("ConsistencyError", "Physically consistent model", "consistent-fit.md"),
    ("PayloadError", "Payloads", "payload.md"),
    ("NoBodyError", "Body of a payload", "payload.md"),
    ("ThresholdError", "Thresholds", "study.md"),
    ("EventSettingsError", "Search for events", "events.md"),
    ("InvalidLimit", "Limits of `check`", "check-methods.md"),
    ("ReduceError", "Reduction to factors", "fleets.md"),
    ("FactorsError", "Factor files", "fleets.md"),
    ("FamilyError", "Trajectory families", "design.md"),
    ("LimitError", "Limits of a motion", "design.md"),
    ("OptimiserError", "Search for a motion", "design-details.md"),
    ("StepWiseError", "Windowed design", "design-details.md"),
    ("ExportError", "Export", "export.md"),
    ("TrajectoryExportError", "Export of a motion", "design.md"),
    ("ReportError", "Report page", "commands.md"),
    ("FigureError", "Figures", "plot.md"),
    ("ServoError", "Fits to commands", "servo.md"),
    ("RunFault", "Logs of commands", "servo.md"),
    ("SimulationError", "Simulation", "simulation.md"),
    ("PlantFault", "The simulated robot", "simulation.md"),
    ("IterationError", "Iteration", "iterate.md"),
    ("HomeError", "Approach to the start", "bench.md"),
    ("RehearsalFailure", "Rehearsal", "bench.md"),
    ("RobotFault", "Runs on a robot", "robot-protocol.md"),
    ("LineError", "Lines of a robot's program", "robot-protocol.md"),
    ("LogTableError", "Logs of a robot's runs", "robot-protocol.md"),
    ("Rejection", "Rejected runs", "iterate.md"),
    ("UnmetCondition", "Conditions of convergence", "iterate.md"),
    ("TorqueCause", "Commanded and logged torque", "torque-check.md"),
    ("NotRedesigned", "New motions of an iteration", "iteration-methods.md"),
    ("ProgramRefused", "Permission for programs", "safety.md"),
    ("RunError", "Programs", "safety.md"),
    ("OnlineError", "Online monitoring", "online.md"),
    ("BenchmarkError", "The benchmark", "estimators-compared.md"),
];

/// One message of an error type.
struct Message {
    kind: String,
    /// `None` for a struct.
    variant: Option<String>,
    /// Documentation of the variant, or of the struct.
    reason: String,
    text: String,
}

fn main() -> Result<(), Box<dyn Error>> {
    std::fs::write(page_path(), page()?)?;
    Ok(())
}

pub(crate) fn page_path() -> PathBuf {
    repository().join("docs/src/messages.md")
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The page: the stored text up to the mark, and the tables of all error types.
pub(crate) fn page() -> Result<String, Box<dyn Error>> {
    let stored = std::fs::read_to_string(page_path())?;
    let (own, _) = stored.split_once(MARK).ok_or("docs/src/messages.md has no line before the generated tables")?;
    let mut files = Vec::new();
    sources(&repository().join("crates"), &mut files)?;
    files.sort();
    let mut messages = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file)?;
        let found = messages_of(&text).map_err(|error| format!("{}: {error}", file.display()))?;
        messages.extend(found.into_iter().map(|message| Message { kind: of_crate(&message.kind, &file), ..message }));
    }
    if let Some(one) = messages.iter().find(|one| !one.is_forwarded() && SECTIONS.iter().all(|row| row.0 != one.kind)) {
        return Err(format!("{}: add a row of SECTIONS in examples/messages.rs", one.kind).into());
    }
    let mut page = format!("{own}{MARK}");
    for (kind, heading, help) in SECTIONS {
        let rows: Vec<&Message> = messages.iter().filter(|one| one.kind == *kind && !one.is_forwarded()).collect();
        if rows.is_empty() {
            return Err(format!("{kind}: no message in the sources: remove its row of SECTIONS").into());
        }
        write!(page, "\n## {heading}\n\nMore on this subject: [{}]({help}).\n\n", title(help)?)?;
        page += "| code | message | cause and fix |\n| --- | --- | --- |\n";
        for one in rows {
            let code = dynident::error_code(kind, one.variant.as_deref());
            writeln!(page, "| `{code}` | {} | {} |", code_span(&one.text), one.reason.replace('|', "\\|"))?;
        }
    }
    Ok(page)
}

/// Name of a type; two types with the same name get different ones.
fn of_crate(kind: &str, file: &Path) -> String {
    let is_in = |name: &str| file.components().any(|part| part.as_os_str() == name);
    match kind {
        "ExportError" if is_in("dynident-excitation") => "TrajectoryExportError".to_owned(),
        _ => kind.to_owned(),
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default();
        if path.is_dir() {
            if !["tests", "examples", "benches", "book"].iter().any(|skipped| name == *skipped) {
                sources(&path, found)?;
            }
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            found.push(path);
        }
    }
    Ok(())
}

/// Heading of a page.
fn title(file: &str) -> Result<String, Box<dyn Error>> {
    let text = std::fs::read_to_string(repository().join("docs/src").join(file))?;
    let heading = text.lines().find_map(|line| line.strip_prefix("# "));
    Ok(heading.ok_or_else(|| format!("{file}: no heading"))?.to_owned())
}

fn code_span(text: &str) -> String {
    let text = text.replace('|', "\\|");
    if text.contains('`') { format!("`` {text} ``") } else { format!("`{text}`") }
}

impl Message {
    /// Whether the message is that of another error.
    fn is_forwarded(&self) -> bool {
        self.text == "{cause}"
    }
}

/// The messages in the attributes `#[error(..)]` of a source.
fn messages_of(text: &str) -> Result<Vec<Message>, String> {
    let mut found = Vec::new();
    let (mut kind, mut documentation, mut attribute) = (String::new(), Vec::new(), None::<String>);
    let mut lines = text.lines().take_while(|line| !line.starts_with("mod tests {"));
    while let Some(line) = lines.next() {
        let line = line.trim();
        if let Some(words) = line.strip_prefix("///") {
            documentation.push(words.trim().to_owned());
        } else if let Some(begin) = line.strip_prefix("#[error(") {
            let mut whole = begin.to_owned();
            while !whole.ends_with(")]") {
                whole = whole + "\n" + lines.next().ok_or("an attribute `error` has no end")?.trim_end();
            }
            attribute = Some(whole[..whole.len() - 2].trim().to_owned());
        } else if line.starts_with("#[") || line.is_empty() {
        } else {
            let item = ["pub ", "pub(crate) ", "pub(super) "].iter().find_map(|start| line.strip_prefix(start));
            let item = item.unwrap_or(line);
            let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric()).collect::<String>();
            let (is_struct, is_enum) = (item.strip_prefix("struct "), item.strip_prefix("enum "));
            if let Some(rest) = is_struct.or(is_enum) {
                kind = name(rest);
            }
            if let Some(attribute) = attribute.take() {
                let variant = is_struct.is_none().then(|| name(item));
                let has_cause = ["#[from]", "#[source]", "Error)", "Error>"].iter().any(|word| line.contains(word));
                let text = template(&attribute, has_cause)?;
                found.push(Message { kind: kind.clone(), variant, reason: plain(&documentation), text });
            }
            documentation.clear();
        }
    }
    Ok(found)
}

/// The first paragraph of a documentation without links to items.
fn plain(documentation: &[String]) -> String {
    let first: Vec<&str> = documentation.iter().map(String::as_str).take_while(|line| !line.is_empty()).collect();
    let text = first.join(" ");
    let mut parts = text.split("](crate::");
    let begin = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once(')').map_or(part, |(_, behind)| behind));
    rest.fold(begin, |text, part| text + part).replace("[`", "`").replace("`]", "`")
}

/// The format string of an attribute `error`, with names for all placeholders.
fn template(attribute: &str, has_cause: bool) -> Result<String, String> {
    let literal = attribute.strip_prefix('"').ok_or_else(|| format!("no string literal: {attribute}"))?;
    let (mut text, mut letters) = (String::new(), literal.char_indices());
    let rest = loop {
        match letters.next().ok_or_else(|| format!("no end of the literal: {attribute}"))? {
            (at, '"') => break &literal[at + 1..],
            (_, '\\') => match letters.next().map(|(_, letter)| letter) {
                // A line that continues.
                Some('\n') => {
                    let blanks = letters.as_str().len() - letters.as_str().trim_start().len();
                    letters.by_ref().take(blanks).for_each(drop);
                }
                Some('n') => text.push(' '),
                Some(letter) => text.push(letter),
                None => {}
            },
            (_, letter) => text.push(letter),
        }
    };
    let mut arguments = arguments(rest).into_iter();
    let mut shown = String::new();
    let mut rest = &text[..];
    while let Some(at) = rest.find(['{', '}']) {
        shown += &rest[..at];
        let doubled = rest[at..].starts_with("{{") || rest[at..].starts_with("}}");
        if doubled {
            shown.push_str(&rest[at..=at]);
            rest = &rest[at + 2..];
            continue;
        }
        let end = at + rest[at..].find('}').ok_or_else(|| format!("a placeholder has no end: {text}"))?;
        let name = rest[at + 1..end].split(':').next().unwrap_or_default();
        let name = match name {
            "" => arguments.next().unwrap_or_default(),
            "0" | "source" | "fault" | "problem" if has_cause => "cause".to_owned(),
            "0" => "value".to_owned(),
            name => name.to_owned(),
        };
        write!(shown, "{{{name}}}").map_err(|error| error.to_string())?;
        rest = &rest[end + 1..];
    }
    Ok((shown + rest).split_whitespace().collect::<Vec<_>>().join(" "))
}

/// A name for each argument after the format string: the last field before the first call, `path` of `path.display()`.
fn arguments(text: &str) -> Vec<String> {
    let (mut parts, mut depth, mut is_quoted) = (vec![String::new()], 0, false);
    for letter in text.trim_start_matches(',').chars() {
        match letter {
            '"' => is_quoted = !is_quoted,
            '(' | '[' | '{' if !is_quoted => depth += 1,
            ')' | ']' | '}' if !is_quoted => depth -= 1,
            ',' if !is_quoted && depth == 0 => parts.push(String::new()),
            _ => {}
        }
        if let Some(last) = parts.last_mut()
            && (letter != ',' || depth > 0 || is_quoted)
        {
            last.push(letter);
        }
    }
    parts.iter().map(|part| argument_name(part)).collect()
}

fn argument_name(part: &str) -> String {
    let mut rest = part;
    let mut name = "";
    while let Some(start) = rest.find(|c: char| c.is_alphabetic() || c == '_') {
        if !name.is_empty() && &rest[..start] != "." {
            break;
        }
        let after = &rest[start..];
        let end = after.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(after.len());
        let is_call = after[end..].starts_with('(') || after[end..].starts_with('!');
        if is_call && !name.is_empty() {
            break;
        }
        if !is_call && !["if", "match", "self"].contains(&&after[..end]) {
            name = &after[..end];
        }
        rest = &after[end..];
    }
    if name.is_empty() { "list".to_owned() } else { name.to_lowercase() }
}
