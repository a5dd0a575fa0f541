//! Figures and tables for papers.

use crate::common::{CommandOutcome, broken, repository, run_in};
use crate::contract::json;
use roxmltree::Document;
use std::path::Path;

const STUDY: &str = "[robot]\nfile = \"arm.urdf\"\n[format]\ntime = { column = \"t\" }\nposition = { columns = \"q{1..2}\" }\n\
    torque = { columns = \"tau{1..2}\" }\n[drive]\nfriction = \"stated\"\n[[log]]\nfile = \"log.csv\"\n";

/// A folder with a study and its result.
fn identified() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.urdf", "log.csv"] {
        std::fs::copy(broken().join(name), folder.path().join(name)).unwrap();
    }
    std::fs::write(folder.path().join("s.toml"), STUDY).unwrap();
    let found = run_in(folder.path(), &["identify", "s.toml", "--out", "r"]);
    assert!(found.status < 2, "{}", found.stderr);
    folder
}

fn plot(at: &Path, arguments: &[&str]) -> CommandOutcome {
    run_in(at, &[&["plot"], arguments].concat())
}

fn written(at: &Path, result: &str, figure: &str, more: &[&str]) -> [String; 4] {
    let names = ["f.svg", "f.csv", "f.tex", "f.md"];
    let files: Vec<&str> = names.iter().flat_map(|name| ["--out", name]).collect();
    let ran = plot(at, &[&[result, "--figure", figure], &files[..], more].concat());
    assert_eq!(ran.status, 0, "{figure}: {}", ran.stderr);
    names.map(|name| std::fs::read_to_string(at.join(name)).unwrap())
}

/// Rows of a CSV without its header.
fn rows(csv: &str) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
}

/// Size of a picture: width in mm and px, and its plots.
fn size(svg: &str) -> (f64, f64, usize) {
    let document = Document::parse(svg).unwrap();
    let root = document.root_element();
    let width = root.attribute("width").unwrap().trim_end_matches("mm").parse().unwrap();
    let view: Vec<f64> = root.attribute("viewBox").unwrap().split(' ').map(|x| x.parse().unwrap()).collect();
    (width, view[2], document.descendants().filter(|node| node.has_tag_name("svg")).count() - 1)
}

#[test]
fn a_result_has_figures_data_and_tables() {
    let folder = identified();
    let at = folder.path();
    let result = json(&std::fs::read_to_string(at.join("r/result.json")).unwrap());
    let base = result["base_parameters"].as_array().unwrap();
    let [svg, csv, tex, markdown] = written(at, "r", "parameters", &[]);
    assert_eq!(size(&svg).0, 88.0);
    let values: Vec<f64> = rows(&csv).iter().filter_map(|row| row[3].parse().ok()).collect();
    let expected: Vec<f64> =
        base.iter().filter(|own| own["excited"] == true).map(|own| own["value"].as_f64().unwrap()).collect();
    assert_eq!(values, expected);
    assert_eq!(tex.lines().filter(|line| line.ends_with("\\\\")).count(), base.len() + 1, "{tex}");
    assert_eq!(markdown.lines().filter(|line| line.starts_with("| ")).count(), base.len() + 2, "{markdown}");

    // Friction is odd in velocity up to the offset, and its data are drawn for both joints.
    let [svg, csv, tex, _] = written(at, "r/result.json", "friction", &["--width-mm", "180", "--font-pt", "9"]);
    let (width, px, plots) = size(&svg);
    // 12 px are 9 pt of 25.4/72 mm.
    assert!(
        width == 180.0 && (px - 180.0 / (9.0 * 25.4 / 72.0 / 12.0)).abs() < 0.1 && plots == 2,
        "{width} {px} {plots}"
    );
    let data = rows(&csv);
    assert_eq!(data.len(), 2 * 300);
    assert!(data.iter().all(|row| row[1].parse::<f64>().unwrap() != 0.0 && row[2].parse::<f64>().is_ok()));
    assert!(tex.contains("\\begin{tabular}"));

    // The residuals are those of the validation in the band of the fit: the same root mean square at every joint.
    let [svg, csv, _, markdown] = written(at, "r", "residuals", &["--study", "s.toml"]);
    assert_eq!(size(&svg).2, 2);
    let validated = run_in(at, &["validate", "r", "--study", "s.toml", "--json"]);
    let report = &json(&validated.stdout)["validation"][0]["in_fit_band"];
    for joint in report["joints"].as_array().unwrap() {
        let own = rows(&csv).into_iter().filter(|row| row[1] == joint["name"].as_str().unwrap());
        let squares: Vec<f64> = own.map(|row| row[5].parse::<f64>().unwrap().powi(2)).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let expected = joint["rmse_nm"].as_f64().unwrap();
        // The report has the free fit, the figure the consistent set; they agree if, as here, the fit is consistent.
        assert!((rms - expected).abs() < 1e-6 * expected, "{rms} {expected}");
    }
    assert!(markdown.contains("Torque error by joint"));
}

#[test]
fn pdf_and_png_have_the_size_of_the_svg() {
    let folder = identified();
    let at = folder.path();
    let files = ["--out", "f.pdf", "--out", "f.png", "--out", "f.svg", "--dpi", "200", "--width-mm", "120"];
    let ran = plot(at, &[&["r", "--figure", "friction"], &files[..]].concat());
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    let root = Document::parse(&svg).unwrap().root_element().attribute("height").unwrap().to_owned();
    let sides_mm = [120.0, root.trim_end_matches("mm").parse::<f64>().unwrap()];
    // The header of a PNG: eight bytes of signature, eight of the chunk, width and height.
    let png = std::fs::read(at.join("f.png")).unwrap();
    let pixels = [16, 20].map(|place| f64::from(u32::from_be_bytes(png[place..place + 4].try_into().unwrap())));
    let pdf = String::from_utf8_lossy(&std::fs::read(at.join("f.pdf")).unwrap()).into_owned();
    let page = pdf.split_once("/MediaBox [").unwrap().1.split(']').next().unwrap();
    let points: Vec<f64> = page.split(' ').map(|side| side.parse().unwrap()).collect();
    for (axis, side_mm) in sides_mm.into_iter().enumerate() {
        // The SVG rounds its height to 0.1 mm.
        assert!((pixels[axis] - side_mm / 25.4 * 200.0).abs() <= 1.0, "{pixels:?} {sides_mm:?}");
        assert!((points[2 + axis] - side_mm / 25.4 * 72.0).abs() < 0.2, "{points:?} {sides_mm:?}");
    }
    assert!(pdf.contains("/ToUnicode") && pdf.contains("DejaVuSansCondensed"), "{pdf}");
}

#[test]
fn an_iteration_has_a_convergence_figure() {
    let folder = tempfile::tempdir().unwrap();
    let study = repository("examples/iterate_paper_2r.toml").display().to_string();
    assert_eq!(run_in(folder.path(), &["iterate", &study, "--out", "i"]).status, 0);
    let [svg, csv, tex, markdown] = written(folder.path(), "i", "convergence", &[]);
    let file = json(&std::fs::read_to_string(folder.path().join("i/iterations.json")).unwrap());
    let runs = file["runs"].as_array().unwrap();
    // Tracking, error bars and, for a simulated robot, errors.
    assert_eq!(size(&svg).2, 3);
    let tracking: Vec<f64> = rows(&csv)
        .iter()
        .filter(|row| row[2] == "largest tracking error" && row[0] == "1")
        .map(|row| row[5].parse().unwrap())
        .collect();
    let expected: Vec<f64> =
        runs[0]["max_tracking_error_rad"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
    assert_eq!(tracking, expected);
    assert_eq!(tex.lines().filter(|line| line.ends_with("\\\\")).count(), runs.len() + 1, "{tex}");
    assert!(markdown.contains("| accepted |"));
}

#[test]
fn what_cannot_be_plotted_is_refused_with_the_fix() {
    let folder = identified();
    let at = folder.path();
    for (arguments, reason) in [
        (&["r", "--figure", "parameters", "--out", "f.bmp"][..], ".svg, .pdf, .png, .csv, .tex or .md"),
        (&["r", "--figure", "parameters", "--dpi", "5", "--out", "f.png"], "30 to 2400 dpi"),
        (&["r", "--figure", "residuals", "--out", "f.svg"], "--study STUDY.toml"),
        (&["r", "--figure", "friction", "--study", "s.toml", "--out", "f.svg"], "omit it"),
        (&["r", "--figure", "convergence", "--out", "f.svg"], "iterations.json"),
        (&["r", "--figure", "parameters", "--width-mm", "5", "--out", "f.svg"], "5 mm"),
        (&["r", "--figure", "parameters", "--font-pt", "nan", "--out", "f.svg"], "pt"),
        (&["r", "--figure", "parameters", "--out", "r/result.json"], ".svg, .pdf"),
        (&["r", "--figure", "residuals", "--study", "s.toml", "--out", "log.csv"], "input"),
    ] {
        let ran = plot(at, arguments);
        assert!(ran.status == 2 && ran.stderr.contains(reason), "{arguments:?}: {}", ran.stderr);
    }
    assert!(!at.join("f.svg").exists());
    let ran = plot(at, &["r", "--figure", "parameters", "--out", "f.svg", "--json"]);
    assert_eq!(json(&ran.stdout)["schema"], "dynident/plot/1");
}
