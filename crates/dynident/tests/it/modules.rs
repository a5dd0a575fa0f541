//! Module dependencies are acyclic: neither top-level modules nor files use each other, directly or indirectly.

use super::common::repository;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

type Uses = BTreeMap<String, BTreeSet<String>>;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn code(file: &Path) -> String {
    let text = std::fs::read_to_string(file).unwrap();
    let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
    code.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

fn module(src: &Path, file: &Path) -> String {
    let parts = file.strip_prefix(src).unwrap().with_extension("");
    let parts: Vec<&str> = parts.iter().map(|part| part.to_str().unwrap()).collect();
    let names =
        if ["mod", "lib", "main"].contains(&parts[parts.len() - 1]) { &parts[..parts.len() - 1] } else { &parts };
    names.join("::")
}

fn paths(own: &str, code: &str) -> Vec<String> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let starts = code.match_indices("crate::").chain(code.match_indices("super::"));
    for (at, start) in starts.filter(|(at, _)| !code[..*at].ends_with("super::") && !code[..*at].ends_with(is_name)) {
        let mut rest = &code[at..];
        let mut base: Vec<&str> = if start == "crate::" { Vec::new() } else { own.split("::").collect() };
        while let Some(after) = rest.strip_prefix("super::") {
            (rest, _) = (after, base.pop());
        }
        rest = rest.strip_prefix("crate::").unwrap_or(rest);
        let end = rest.find(|c: char| !is_name(c) && c != ':').unwrap_or(rest.len());
        let path = [base.as_slice(), &rest[..end].split("::").collect::<Vec<_>>()].concat().join("::");
        let group =
            rest[end..].strip_prefix('{').filter(|_| path.ends_with("::")).and_then(|group| group.split('}').next());
        for name in group.unwrap_or("").split(',') {
            found.push(format!("{path}{}", name.trim()));
        }
    }
    found
}

/// Files used by each file of the crate. Module roots are excluded, because they re-export.
fn uses_of_files(src: &Path) -> Uses {
    let mut files = Vec::new();
    sources(src, &mut files);
    files.retain(|file| !["mod", "lib", "main"].contains(&file.file_stem().unwrap().to_str().unwrap()));
    let modules: BTreeSet<String> = files.iter().map(|file| module(src, file)).collect();
    let resolved = |path: String| {
        let ends = [path.len()].into_iter().chain(path.rmatch_indices("::").map(|(at, _)| at));
        ends.map(|end| path[..end].to_owned()).find(|prefix| modules.contains(prefix))
    };
    let uses = |file: &PathBuf| {
        let own = module(src, file);
        let used = paths(&own, &code(file)).into_iter().filter_map(resolved).filter(|used| *used != own).collect();
        (own, used)
    };
    files.iter().map(uses).collect()
}

fn used(line: &str) -> impl Iterator<Item = &str> {
    line.split("crate::").skip(1).map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap())
}

/// Top-level modules used by each top-level module, without tests.
fn uses(src: &Path) -> Uses {
    let mut files = Vec::new();
    sources(src, &mut files);
    let top = |file: &Path| {
        let first = file.strip_prefix(src).unwrap().components().next().unwrap();
        Path::new(&first).file_stem().unwrap().to_str().unwrap().to_owned()
    };
    let mut uses: Uses = files.iter().map(|file| (top(file), BTreeSet::new())).collect();
    for root in ["lib", "main", "bin"] {
        uses.remove(root);
    }
    let modules: BTreeSet<String> = uses.keys().cloned().collect();
    for file in &files {
        let own = top(file);
        let Some(uses) = uses.get_mut(&own) else { continue };
        let code = code(file);
        let others = code.lines().flat_map(used).filter(|name| *name != own && modules.contains(*name));
        uses.extend(others.map(str::to_owned));
    }
    uses
}

fn cycle(uses: &Uses) -> Vec<&str> {
    let returns = |start: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
        while let Some(module) = open.pop() {
            open.extend(uses[module].iter().filter(|next| seen.insert(*next)));
        }
        seen.contains(start)
    };
    uses.keys().filter(|module| returns(module)).map(String::as_str).collect()
}

#[test]
fn no_module_is_above_and_below_another() {
    let mut crates: Vec<PathBuf> =
        std::fs::read_dir(repository("crates")).unwrap().map(|entry| entry.unwrap().path()).collect();
    crates.sort();
    assert!(crates.len() > 10);
    for folder in crates.iter().filter(|folder| folder.join("src").is_dir()) {
        let name = folder.file_name().unwrap().to_str().unwrap();
        for uses in [uses(&folder.join("src")), uses_of_files(&folder.join("src"))] {
            let cycle = cycle(&uses);
            assert!(cycle.is_empty(), "{name}: {cycle:?} use each other: {uses:#?}");
        }
    }
}

#[test]
fn rooms_of_the_facade_stand_in_their_order() {
    let uses = uses(&repository("crates/dynident/src"));
    let allowed = [("error", &[][..]), ("pages", &["error"]), ("inputs", &["error"])];
    for (room, below) in allowed {
        assert!(uses[room].iter().all(|used| below.contains(&used.as_str())), "{room} uses {:?}", uses[room]);
    }
}

#[test]
fn a_circle_is_found() {
    let uses = |pairs: &[(&str, &[&str])]| -> Uses {
        let one = |(name, used): &(&str, &[&str])| ((*name).to_owned(), used.iter().map(|u| (*u).to_owned()).collect());
        pairs.iter().map(one).collect()
    };
    assert_eq!(cycle(&uses(&[("a", &["b"]), ("b", &["c"]), ("c", &["b"])])), ["b", "c"]);
    assert!(cycle(&uses(&[("a", &["b", "c"]), ("b", &["c"]), ("c", &[])])).is_empty());
    assert_eq!(used("    crate::study::Study, crate::error").collect::<Vec<_>>(), ["study", "error"]);
    let code = "use super::super::b::{C, d::E};\nuse crate::f::G; let x = super::h::i();";
    assert_eq!(paths("a::own", code), ["f::G", "b::C", "b::d::E", "a::h::i"]);
}
