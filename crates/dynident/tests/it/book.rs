//! Tests of the book: the kind of every code block is known, TOML blocks are parsed, pages and links exist, also those
//! of README, ARCHITECTURE and CONTRIBUTING. Rust blocks run as documentation tests (`src/book.rs`). The studies and
//! robots of `examples/` are parsed, too.

use dynident::Study;
use dynident::study::EstimatorSection;
use dynident_recording::{DecimationSettings, DifferentiatorSettings, LogFormat, MotionSettings};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

fn pages(folder: &Path) -> Vec<(String, String)> {
    let mut pages: Vec<(String, String)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read_to_string(&path).unwrap()))
        .collect();
    pages.sort();
    assert!(!pages.is_empty(), "{} holds no pages", folder.display());
    pages
}

struct Block {
    place: String,
    info: String,
    text: String,
}

fn blocks(page: &str, text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in text.lines().enumerate() {
        match (line.trim_start().strip_prefix("```"), open.take()) {
            (Some(_), Some(block)) => blocks.push(block),
            (Some(info), None) => {
                let place = format!("{page}:{}", number + 1);
                open = Some(Block { place, info: info.trim().to_owned(), text: String::new() });
            }
            (None, Some(mut block)) => {
                block.text.push_str(line);
                block.text.push('\n');
                open = Some(block);
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{page}: a code block is not closed");
    blocks
}

/// Parses a TOML block as the kind in its info string.
fn read(kind: &str, rest: &[&str], text: &str) -> Result<(), String> {
    let error = |error: &dyn std::fmt::Display| error.to_string();
    match kind {
        "study" => {
            let value = toml::from_str(text).map_err(|e| error(&e))?;
            let differences = dynident_testing::schema::differences("study", &value);
            Study::parse(text, Path::new("study.toml")).map_err(|e| error(&e))?;
            if differences.is_empty() { Ok(()) } else { Err(differences.join("; ")) }
        }
        "dh" => dynident_model::read_dh(text).map(|_| ()).map_err(|e| error(&e)),
        "log-format" => {
            let count = rest.iter().find_map(|word| word.strip_prefix("joints-")).and_then(|n| n.parse().ok());
            let count: usize = count.ok_or("say the number of joints, as in toml,log-format,joints-6")?;
            let joints: Vec<String> = (1..=count).map(|joint| format!("joint{joint}")).collect();
            let format: LogFormat = toml::from_str(text).map_err(|e| error(&e))?;
            format.validate(&joints).map_err(|e| error(&e))
        }
        "motion" => {
            let motion: MotionSettings = toml::from_str(text).map_err(|e| error(&e))?;
            motion.validate().map_err(|e| error(&e))
        }
        "differentiator" => {
            let settings: DifferentiatorSettings = toml::from_str(text).map_err(|e| error(&e))?;
            settings.validate().map_err(|e| error(&e))
        }
        "decimation" => {
            let settings: DecimationSettings = toml::from_str(text).map_err(|e| error(&e))?;
            settings.taps(1000.0).map(|_| ()).map_err(|e| error(&e))
        }
        "estimator" => {
            let section: EstimatorSection = toml::from_str(text).map_err(|e| error(&e))?;
            section.rank.validate().map_err(|e| error(&e))?;
            section.segments.validate().map_err(|e| error(&e))
        }
        _ => Err(format!("no reader for the kind `{kind}` (crates/dynident/tests/it/book.rs lists them)")),
    }
}

#[test]
fn every_code_block_is_of_a_kind_that_is_checked() {
    let mut read_blocks = 0;
    for (page, text) in pages(&docs().join("src")).iter().chain(&pages(&docs().join("decisions"))) {
        for block in blocks(page, text) {
            let words: Vec<&str> = block.info.split(',').map(str::trim).collect();
            match words[..] {
                ["toml", kind, ref rest @ ..] => {
                    read(kind, rest, &block.text).unwrap_or_else(|error| panic!("{}: {error}", block.place));
                    read_blocks += 1;
                }
                ["json"] => {
                    serde_json::from_str::<serde_json::Value>(&block.text)
                        .unwrap_or_else(|error| panic!("{}: {error}", block.place));
                }
                ["json", "lines"] => {
                    for line in block.text.lines() {
                        serde_json::from_str::<serde_json::Value>(line)
                            .unwrap_or_else(|error| panic!("{}: {error}", block.place));
                    }
                }
                ["python"] => assert!(
                    include_str!("../../../../.ci/python.sh").contains(&format!("docs/src/{page}")),
                    "{}: name the page in .ci/python.sh, so that its Python runs",
                    block.place
                ),
                ["text" | "sh"] => {}
                ["rust"] => assert!(
                    include_str!("../../src/book.rs").contains(&format!("\"{page}\"")),
                    "{}: name the page in crates/dynident/src/book.rs, so that its Rust is compiled",
                    block.place
                ),
                _ => panic!("{}: a block of kind `{}` that nothing checks", block.place, block.info),
            }
        }
    }
    assert!(read_blocks >= 10, "only {read_blocks} TOML blocks were found");
}

fn links(text: &str) -> Vec<&str> {
    let mut inside = false;
    let mut links = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            links.extend(line.split("](").skip(1).filter_map(|rest| rest.split(')').next()));
        }
    }
    links
}

#[test]
fn the_readmes_studies_are_read() {
    let readme = std::fs::read_to_string(docs().join("../README.md")).unwrap();
    for block in blocks("README.md", &readme).iter().filter(|block| block.info.starts_with("toml")) {
        // The block is indented under a list, which TOML permits.
        read("study", &[], &block.text).unwrap_or_else(|error| panic!("{}: {error}", block.place));
    }
}

#[test]
fn every_page_is_in_the_summary_and_every_link_leads_somewhere() {
    let source = docs().join("src");
    let pages = pages(&source);
    for (page, text) in &pages {
        for link in links(text) {
            // An empty link in the summary is a planned chapter.
            let outside =
                link.starts_with("https://") || link.starts_with('#') || (page == "SUMMARY.md" && link.is_empty());
            let file = link.split('#').next().unwrap_or(link);
            // docs/links.py leads links with `../../` to the repository. The built book holds no other files.
            let file_exists = source.join(file).is_file() && (!file.starts_with("../") || file.starts_with("../../"));
            assert!(outside || file_exists, "{page}: `{link}` leads nowhere");
        }
    }
    let summary = &pages.iter().find(|(page, _)| page == "SUMMARY.md").expect("the book has a summary").1;
    let linked: BTreeSet<&str> = links(summary).into_iter().collect();
    for (page, _) in pages.iter().filter(|(page, _)| page != "SUMMARY.md") {
        assert!(linked.contains(page.as_str()), "docs/src/SUMMARY.md does not link {page}");
    }
}

/// The Rust code in README must be part of a tested example.
#[test]
fn the_readmes_rust_is_an_example_of_the_crate() {
    let readme = std::fs::read_to_string(docs().join("../README.md")).unwrap();
    let source = std::fs::read_to_string(docs().join("../crates/dynident-identification/src/lib.rs")).unwrap();
    let example: Vec<&str> = source.lines().filter_map(|line| line.strip_prefix("//! ")).collect();
    let shown = blocks("README.md", &readme);
    let lines = shown.iter().filter(|block| block.info == "rust").flat_map(|block| block.text.lines());
    let missing: Vec<&str> = lines.filter(|line| !line.is_empty() && !example.contains(line)).collect();
    assert!(missing.is_empty(), "not in the example of dynident-identification: {missing:#?}");
}

#[test]
fn links_and_paths_of_the_guides_lead_somewhere() {
    let root = docs().join("..");
    for guide in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = std::fs::read_to_string(root.join(guide)).unwrap();
        let (links, paths) = (links(&text), text.split('`').filter(|word| word.starts_with("crates/")));
        for target in links.into_iter().chain(paths) {
            let file = target.split('#').next().unwrap_or(target);
            // The folder of a planned file must exist.
            let there = if file.contains("NAME") { Path::new(file).parent().unwrap() } else { Path::new(file) };
            assert!(target.starts_with("https://") || root.join(there).exists(), "{guide}: `{target}` leads nowhere");
        }
    }
}

#[test]
fn every_decision_is_in_the_book() {
    let index = std::fs::read_to_string(docs().join("src/decisions.md")).unwrap();
    let decisions = pages(&docs().join("decisions"));
    for (file, text) in &decisions {
        assert!(
            index.contains(&format!("{{{{#include ../decisions/{file}}}}}")),
            "decisions.md does not include {file}"
        );
        assert!(text.starts_with("## "), "{file}: begin with a heading of the second level");
    }
    assert_eq!(index.matches("{{#include").count(), decisions.len(), "decisions.md includes a file that is not there");
}

#[test]
fn every_example_study_and_robot_is_read() {
    let folder = docs().join("../examples");
    let tomls = |folder: &Path| -> Vec<PathBuf> {
        let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        paths.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect()
    };
    let (studies, robots) = (tomls(&folder), tomls(&folder.join("robots")));
    assert!(!studies.is_empty() && !robots.is_empty());
    for path in studies {
        Study::load(&path).unwrap_or_else(|error| panic!("{error}"));
    }
    for path in robots {
        dynident_model::load_robot(&path).unwrap_or_else(|error| panic!("{error}"));
    }
}
