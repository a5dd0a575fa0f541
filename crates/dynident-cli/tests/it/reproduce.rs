//! The command `reproduce`: every table and figure of the paper, its goals, and a self-contained page.
use crate::common::run_in;
use serde_json::Value;

/// The visible text of a page: its body without scripts and figures.
fn read(page: &str) -> String {
    let body = page.split_once("</style>").unwrap().1;
    let without = |text: &str, begin: &str, end: &str| -> String {
        let mut parts = text.split(begin);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |read, part| read + part.split_once(end).map_or("", |(_, rest)| rest))
    };
    without(&without(body, "<script", "</script>"), "<svg", "</svg>")
}

#[test]
fn the_paper_comes_out() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run_in(folder.path(), &["reproduce", "--out", "out", "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let file: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(file["schema"], "dynident/paper/1");
    for number in ["1", "2", "3", "4", "5", "6"] {
        let table = &file["tables"][number];
        let width = table["columns"].as_array().unwrap().len();
        assert!(table["rows"].as_array().unwrap().iter().all(|row| row.as_array().unwrap().len() == width), "{number}");
    }
    let figures = file["figures"].as_array().unwrap();
    assert!(figures.iter().map(|figure| figure["number"].as_u64().unwrap()).eq(1..=17));
    for figure in figures {
        let picture =
            std::fs::read_to_string(folder.path().join("out").join(figure["file"].as_str().unwrap())).unwrap();
        assert!(picture.starts_with("<svg") && picture.contains("<p"), "{figure}");
    }
    assert!(file["reached"].as_array().unwrap().iter().all(|goal| goal["met"] == true), "{}", file["reached"]);
    // Fig. 12, read from the paper: 0.6, 0.15, 0; the axis has a resolution of a tenth of a radian.
    let of = |number: u64| figures.iter().find(|figure| figure["number"] == number).unwrap();
    for (run, paper) in [(1, 0.6), (2, 0.15), (3, 0.0)] {
        let error = of(12)["values"][format!("largest_error_of_run_{run}_rad")].as_f64().unwrap();
        assert!((error - paper).abs() < 0.1, "run {run}: {error}");
    }
    // The literal column: within 0.01 of the truth after three runs, as in the paper.
    for number in ["4", "5"] {
        for row in file["tables"][number]["rows"].as_array().unwrap().iter().filter(|row| row[1] == "3") {
            assert!(row[5].as_f64().unwrap() < 0.01, "{row}");
        }
    }
    // No goal repeats the number of another.
    let reached: Vec<f64> =
        file["reached"].as_array().unwrap().iter().map(|goal| goal["value"].as_f64().unwrap()).collect();
    assert!((0..reached.len()).all(|k| !reached[..k].contains(&reached[k])), "{reached:?}");
    the_page_says_it(&std::fs::read_to_string(folder.path().join("out/report.html")).unwrap(), &file);
    both_methods_are_compared(&file["comparison"]);
    // Its studies can be run separately.
    let again =
        run_in(&folder.path().join("out/study"), &["design", "design_fourier.toml", "--out", "again", "--json"]);
    assert_eq!(again.status, 0, "{}", again.stderr);
}

/// Captions are sentences with units, every table and figure is referenced, and deviations and differences are stated.
fn the_page_says_it(page: &str, file: &Value) {
    assert!(!page.contains("src=\"http"));
    let text = read(page);
    for number in 1..=17 {
        assert!(text.contains(&format!("<h3>Fig. {number}: ")), "Fig. {number}");
    }
    for number in 1..=6 {
        assert!(text.contains(&format!("<h3>Table {number}: ")), "Table {number}");
    }
    // No JSON keys, no nanometres, no code marks.
    for wrong in ["largest_", "largest error of run 1 in the paper rad", " nm", "`", "section 5"] {
        assert!(
            !text.contains(wrong),
            "{wrong}: {}",
            text.split(wrong).next().unwrap().chars().rev().take(200).collect::<String>()
        );
    }
    let index =
        text.split_once("Index of tables, figures and equations</h3>").unwrap().1.split_once("</table>").unwrap().0;
    let places =
        [(1..=17).map(|k| format!("Fig. {k}<")).collect::<Vec<_>>(), (1..=6).map(|k| format!("Table {k}<")).collect()];
    for place in places.concat() {
        assert!(index.contains(&place), "{place}");
    }
    for link in text.split("href=\"#").skip(1) {
        let id = link.split_once('"').unwrap().0;
        assert!(text.contains(&format!("id=\"{id}\"")), "{id}");
    }
    for number in 7..=20 {
        assert!(text.contains(&format!("[{number}]")), "[{number}]");
    }
    let figures = file["figures"].as_array().unwrap();
    let caption = |number: usize| figures[number - 1]["caption"].as_str().unwrap();
    for number in 9..=14 {
        assert!(caption(number).contains("columns \"as in the paper\""), "{}", caption(number));
    }
    assert!(caption(12).contains("were chosen for it"), "{}", caption(12));
    assert!(caption(16).contains("Nm") && caption(17).contains("seeds"));
    let deviations = file["deviations"].to_string();
    for what in ["mean of the values before and after", "blended into a line", "Figs. 16, 17", "modified D-H"] {
        assert!(deviations.contains(what), "{what}");
    }
    // Statements of the paper that do not hold here.
    let statements = file["statements"].as_array().unwrap();
    for place in ["Table 4", "Table 5", "section 3, Figs. 9, 10"] {
        let statement = statements.iter().find(|statement| statement["place"] == place).unwrap();
        assert_eq!(statement["holds"], false, "{statement}");
    }
    assert!(text.contains("one run is enough for the parameters"));
}

/// Logistic strokes compared with a Fourier series under equal conditions.
fn both_methods_are_compared(comparison: &Value) {
    let cases = comparison["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        for method in ["logistic", "fourier"] {
            for key in ["parameter_error", "parameter_error_with_noise", "tracking_error_rad"] {
                assert_eq!(case[method][key].as_array().unwrap().len(), 3, "{method} {key}");
            }
        }
    }
    // Another program computed 1.46 for the ratio of the Cramér-Rao bounds of two such motions, 100 seeds of
    // `examples/logistic_against_fourier.rs` 1.30 for that of the errors; two designs differ by a tenth.
    let bound = comparison["bound"].as_f64().unwrap();
    assert!((1.2..1.6).contains(&bound), "{bound}");
    // Four standard deviations for this number of seeds, on either side of the bound.
    let (quotient, std) = (cases[0]["quotient"].as_f64().unwrap(), cases[0]["quotient_std"].as_f64().unwrap());
    assert!((quotient - bound).abs() < 4.0 * std, "{quotient} {std} {bound}");
    assert!(comparison["statement"].as_str().unwrap().contains("does not hold"), "{comparison}");
    // A differentiator that uses the actual motion needs no second run: without noise and after one run it is already
    // within the paper's accuracy after three, 0.009.
    for way in 0..2 {
        for method in ["logistic", "fourier"] {
            let error = cases[way][method]["parameter_error"][0].as_f64().unwrap();
            assert!(error < 0.009, "{way} {method}: {error}");
        }
    }
}
