//! Training rows in a validation log are rejected, in any file format.

use super::{Row, read};
use crate::common::repository;
use dynident::result::ResultFile;
use dynident::{Error, RunOptions, Silent, Study, StudyError, StudyFileError, check, identify, validate};
use std::fmt::Write;
use std::path::Path;

fn options() -> RunOptions<'static> {
    RunOptions { data: None, threads: 2, progress: &Silent }
}

fn write_rows(path: &Path, header: &str, rows: &[Row], digits: usize) {
    let mut text = header.to_owned() + "\n";
    for row in rows {
        let fields: Vec<String> = row.iter().map(|value| format!("{value:.digits$}")).collect();
        writeln!(text, "{}", fields.join(",")).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn study_with(folder: &Path, held_out: &[Row], digits: usize) -> std::path::PathBuf {
    let (header, rows) = read("train.csv");
    write_rows(&folder.join("train.csv"), &header, &rows, 9);
    write_rows(&folder.join("test.csv"), &header, held_out, digits);
    let text = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let text = text
        .replace("../robots/ur10.urdf", &repository("robots/ur10.urdf").display().to_string())
        .replace("ur10_simulated/", "");
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn training_rows_saved_again_are_no_test() {
    let (_, rows) = read("train.csv");
    let mut piece = rows[800..1600].to_vec();
    let start_s = piece[0][0];
    for row in &mut piece {
        row[0] -= start_s;
    }
    let thinned: Vec<Row> = rows.iter().step_by(2).copied().collect();
    for (name, held_out, digits) in
        [("fewer digits", rows.clone(), 4), ("a piece from zero on", piece, 9), ("every second row", thinned, 6)]
    {
        let folder = tempfile::tempdir().unwrap();
        let path = study_with(folder.path(), &held_out, digits);
        let study = Study::load(&path).unwrap();
        for refused in [check(&study, &path, &options()).map(|_| ()), identify(&study, &path, &options()).map(|_| ())] {
            let Err(Error::Study(StudyFileError::Study { source, .. })) = refused else {
                panic!("{name}: {refused:?}")
            };
            assert!(matches!(*source, StudyError::SameSamples { .. }), "{name}: {source}");
        }
    }
    // A separate run is accepted.
    let folder = tempfile::tempdir().unwrap();
    let path = study_with(folder.path(), &read("test.csv").1, 4);
    check(&Study::load(&path).unwrap(), &path, &options()).unwrap();
}

#[test]
fn a_model_is_not_confirmed_by_what_it_was_fitted_to() {
    let folder = tempfile::tempdir().unwrap();
    let path = study_with(folder.path(), &read("test.csv").1, 9);
    let study = Study::load(&path).unwrap();
    let found = identify(&study, &path, &options()).unwrap();
    let result: ResultFile = found.result;
    let result_path = folder.path().join("result.json");
    std::fs::write(&result_path, serde_json::to_vec(&result).unwrap()).unwrap();
    let honest = validate(&result_path, &study, &path, &options()).unwrap();
    assert!(honest.problems.is_empty(), "{:?}", honest.problems);
    // The training log under another name.
    let other = folder.path().join("again.csv");
    std::fs::copy(folder.path().join("train.csv"), other).unwrap();
    let mut again = study.clone();
    again.log.retain(|log| log.file.ends_with("test.csv"));
    again.log[0].file = "again.csv".into();
    let doubted = validate(&result_path, &again, &path, &options()).unwrap();
    assert!(doubted.problems.iter().any(|problem| problem.contains("is the training log")), "{:?}", doubted.problems);
}

#[test]
fn training_rows_are_given_once() {
    let (header, rows) = read("train.csv");
    let others = [("the same rows", rows.clone(), 9), ("overlapping rows", rows[600..].to_vec(), 5)];
    for (name, second, digits) in others {
        let folder = tempfile::tempdir().unwrap();
        let path = study_with(folder.path(), &read("test.csv").1, 9);
        write_rows(&folder.path().join("second.csv"), &header, &second, digits);
        let text = std::fs::read_to_string(&path).unwrap() + "\n[[log]]\nfile = \"second.csv\"\n";
        std::fs::write(&path, text).unwrap();
        let study = Study::load(&path).unwrap();
        for refused in [check(&study, &path, &options()).map(|_| ()), identify(&study, &path, &options()).map(|_| ())] {
            let Err(Error::Study(StudyFileError::Study { source, .. })) = refused else {
                panic!("{name}: {refused:?}")
            };
            assert!(matches!(*source, StudyError::RepeatedRows { .. }), "{name}: {source}");
        }
    }
}

#[test]
fn logs_at_rest_are_a_problem() {
    let (header, rows) = read("train.csv");
    let folder = tempfile::tempdir().unwrap();
    let path = study_with(folder.path(), &read("test.csv").1, 9);
    // The posture of the first row, with an encoder that changes by one step.
    let noise = |row: usize, column: usize| ((row * 13 + column) as f64 * 12.9898).sin();
    let rest: Vec<Row> = rows
        .iter()
        .enumerate()
        .map(|(number, row)| {
            core::array::from_fn(|column| match column {
                0 => row[0],
                1..=6 => rows[0][column] + if noise(number, column) > 0.5 { 5e-5 } else { 0.0 },
                _ => rows[0][column] + 0.1 * noise(number, column),
            })
        })
        .collect();
    write_rows(&folder.path().join("train.csv"), &header, &rest, 9);
    let study = Study::load(&path).unwrap();
    let problems = match identify(&study, &path, &options()) {
        Ok(found) => found.result.problems,
        Err(error) => vec![error.to_string()],
    };
    let named = problems.iter().any(|problem| problem.contains("at rest") && problem.contains("dynident design"));
    assert!(named, "{problems:?}");
}
