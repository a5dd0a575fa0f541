//! The command `reproduce`: every table and figure of the paper, its goals reached, a page that stands alone.
use crate::common::run_in;
use serde_json::Value;

/// Figures that the paper draws from computations (8 is a flow chart).
const FIGURES: [u64; 15] = [2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17];

#[test]
fn the_paper_comes_out() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run_in(folder.path(), &["reproduce", "--out", "out", "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let file: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(file["schema"], "dynident/paper/1");
    for number in ["2", "3", "4", "5", "6"] {
        let table = &file["tables"][number];
        let width = table["columns"].as_array().unwrap().len();
        assert!(table["rows"].as_array().unwrap().iter().all(|row| row.as_array().unwrap().len() == width), "{number}");
    }
    let figures = file["figures"].as_array().unwrap();
    assert_eq!(figures.iter().map(|figure| figure["number"].as_u64().unwrap()).collect::<Vec<_>>(), FIGURES);
    for figure in figures {
        let picture =
            std::fs::read_to_string(folder.path().join("out").join(figure["file"].as_str().unwrap())).unwrap();
        assert!(picture.starts_with("<svg") && picture.contains("<p"), "{figure}");
    }
    assert!(file["reached"].as_array().unwrap().iter().all(|goal| goal["met"] == true), "{}", file["reached"]);
    // Fig. 12, as the paper reads off it: 0.6, 0.15, 0; a tenth of a radian is what its axis lets one read.
    let of = |number: u64| figures.iter().find(|figure| figure["number"] == number).unwrap();
    for (run, paper) in [(1, 0.6), (2, 0.15), (3, 0.0)] {
        let error = of(12)["values"][format!("largest_error_of_run_{run}_rad")].as_f64().unwrap();
        assert!((error - paper).abs() < 0.1, "run {run}: {error}");
    }
    // The literal column: within 0.01 of the truth after three runs, as the paper has it.
    for number in ["4", "5"] {
        for row in file["tables"][number]["rows"].as_array().unwrap().iter().filter(|row| row[1] == "3") {
            assert!(row[5].as_f64().unwrap() < 0.01, "{row}");
        }
    }
    assert!(!file["deviations"].as_array().unwrap().is_empty());
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains("src=\"http") && page.contains("Fig. 17"));
    // Its studies run by themselves.
    let again =
        run_in(&folder.path().join("out/study"), &["design", "design_fourier.toml", "--out", "again", "--json"]);
    assert_eq!(again.status, 0, "{}", again.stderr);
}
