//! Writes the JSON schemas of all files into a folder, `docs/schemas` by default:
//!
//! ```sh
//! cargo run -p dynident-cli --features schema --example schemas
//! ```

use dynident::export::{MODEL_SCHEMA, ModelFile, SIMULATOR_SCHEMA, SimulatorFile};
use dynident::iteration::{RUN_SCHEMA, RunFile};
use dynident::result::{
    CHECK_SCHEMA, COMPARISON_SCHEMA, CheckFile, ComparisonFile, DESIGN_SCHEMA, DesignFile, EVALUATION_SCHEMA,
    EXPORT_SCHEMA, EXPORT_VALIDATION_SCHEMA, EvaluationFile, ExportFile, ExportValidationFile, FACTORS_SCHEMA,
    FactorsFile, INSPECTION_SCHEMA, ITERATIONS_SCHEMA, Inspection, IterationsFile, LOG_SCHEMA, LogContents,
    NEW_STUDY_SCHEMA, NewStudyFile, RESULT_SCHEMA, ResultFile, SERVO_DESIGN_SCHEMA, SERVO_SCHEMA, SIMULATION_SCHEMA,
    ServoDesignFile, ServoFile, SimulationFile, TEST_SAMPLES_SCHEMA, TestSamplesFile, VALIDATION_SCHEMA,
    ValidationFile,
};
use dynident_benchmark::accuracy::{BENCHMARK_SCHEMA, BenchmarkFile};
use dynident_cli::{DOCS_SCHEMA, DocsFile, INIT_SCHEMA, InitFile};
use dynident_paper::{PAPER_SCHEMA, PaperFile};
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema};
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
    write_all(&std::env::args_os().nth(1).map_or_else(default, PathBuf::from))
}

pub(crate) fn write_all(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let files = [
        (BENCHMARK_SCHEMA, written::<BenchmarkFile>()),
        (CHECK_SCHEMA, written::<CheckFile>()),
        (COMPARISON_SCHEMA, written::<ComparisonFile>()),
        (DOCS_SCHEMA, written::<DocsFile>()),
        (INIT_SCHEMA, written::<InitFile>()),
        (DESIGN_SCHEMA, written::<DesignFile>()),
        (EVALUATION_SCHEMA, written::<EvaluationFile>()),
        (EXPORT_SCHEMA, written::<ExportFile>()),
        (EXPORT_VALIDATION_SCHEMA, written::<ExportValidationFile>()),
        (FACTORS_SCHEMA, written::<FactorsFile>()),
        (INSPECTION_SCHEMA, written::<Inspection>()),
        (ITERATIONS_SCHEMA, written::<IterationsFile>()),
        (LOG_SCHEMA, written::<LogContents>()),
        (MODEL_SCHEMA, written::<ModelFile>()),
        (SIMULATOR_SCHEMA, written::<SimulatorFile>()),
        (NEW_STUDY_SCHEMA, written::<NewStudyFile>()),
        (PAPER_SCHEMA, written::<PaperFile>()),
        (RESULT_SCHEMA, written::<ResultFile>()),
        (RUN_SCHEMA, written::<RunFile>()),
        (SERVO_SCHEMA, written::<ServoFile>()),
        (SERVO_DESIGN_SCHEMA, written::<ServoDesignFile>()),
        (SIMULATION_SCHEMA, written::<SimulationFile>()),
        (TEST_SAMPLES_SCHEMA, written::<TestSamplesFile>()),
        (VALIDATION_SCHEMA, written::<ValidationFile>()),
    ];
    for (name, mut schema) in files {
        schema.insert("title".to_owned(), name.into());
        // The key `schema` of a file contains the name of its schema.
        schema
            .pointer_mut("/properties/schema")
            .and_then(serde_json::Value::as_object_mut)
            .ok_or_else(|| format!("{name}: no key `schema`"))?
            .insert("const".to_owned(), name.into());
        let file = name.split('/').nth(1).ok_or_else(|| format!("{name} is not dynident/NAME/VERSION"))?;
        write(folder, file, &schema)?;
    }
    write(folder, "study", &settings().into_generator().into_root_schema_for::<dynident::Study>())
}

/// Editors of TOML read draft 7.
fn settings() -> SchemaSettings {
    SchemaSettings::draft07().with_transform(RecursiveTransform(plain_description))
}

/// The schema of written files: optional keys are present, with null.
fn written<T: JsonSchema>() -> Schema {
    settings().for_serialize().into_generator().into_root_schema_for::<T>()
}

/// Documentation of Rust as plain text: without examples, links and line breaks.
fn plain_description(schema: &mut Schema) {
    let Some(text) = schema.get("description").and_then(serde_json::Value::as_str) else { return };
    let text = text.split("```").next().unwrap_or_default().trim();
    let paragraphs: Vec<String> =
        text.split("\n\n").map(|paragraph| without_links(&paragraph.replace('\n', " "))).collect();
    schema.insert("description".to_owned(), paragraphs.join("\n\n").into());
}

/// `[a](b)` becomes `a`, and so does an item name in brackets.
fn without_links(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('[') {
        plain += before;
        rest = after;
        let Some((inner, behind)) = after.split_once(']') else {
            plain.push('[');
            continue;
        };
        match behind.strip_prefix('(').and_then(|target| target.split_once(')')) {
            Some((_, behind)) => {
                plain += inner;
                rest = behind.strip_prefix(')').unwrap_or(behind);
            }
            None if inner.starts_with('`') => {
                plain += inner;
                rest = behind;
            }
            None => plain.push('['),
        }
    }
    plain + rest
}

fn write(folder: &Path, name: &str, schema: &Schema) -> Result<(), Box<dyn Error>> {
    let text = serde_json::to_string_pretty(schema)? + "\n";
    std::fs::write(folder.join(format!("{name}.json")), text)?;
    Ok(())
}
