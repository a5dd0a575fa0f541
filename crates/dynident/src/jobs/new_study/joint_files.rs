//! Recordings with one file for each joint, all with the same columns: `joint1.csv` to `joint7.csv`. Each folder, or
//! each group of files that differ in the joint only, is one recording: `run_a_elbow.csv` and `run_a_wrist.csv`.

use super::draft::RenamedFiles;
use crate::jobs::columns::{JointKey, Quantity, column_list, meaning};
use crate::result::{LogChannel, LogContents};
use dynident_text::quoted;
use std::path::Path;

/// Recordings with one file for each joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct JointFiles {
    columns: Vec<JointColumn>,
    /// For each recording, the text before and after the joint in the names of its files; empty texts if it has all
    /// files of its folder.
    runs: Vec<[String; 2]>,
}

/// A column of a file of one joint.
#[derive(Clone, Debug, PartialEq, Eq)]
struct JointColumn {
    /// Its name in the recording of all joints.
    joined: String,
    file: String,
    column: String,
}

/// The file key and the columns of a channel group in the notation of a study.
pub(super) struct GroupColumns {
    pub(super) file: Option<String>,
    pub(super) columns: String,
}

impl JointFiles {
    /// Joins the files of each recording, whose columns are named by file and column; `joints` are the names of the
    /// robot's joints. `None` if the files of a recording do not have the same columns and number of rows, or more than
    /// one position each.
    pub(super) fn join<'a>(
        logs: &[(&'a Path, LogContents)],
        joints: &[String],
    ) -> Option<(Self, Vec<(&'a Path, LogContents)>)> {
        let mut folders: Vec<Vec<&(&'a Path, LogContents)>> = Vec::new();
        for log in logs {
            match folders.iter_mut().find(|folder| folder[0].0.parent() == log.0.parent()) {
                Some(folder) => folder.push(log),
                None => folders.push(vec![log]),
            }
        }
        let runs: Vec<Run<'_, 'a>> = folders.iter().flat_map(|files| runs_of_folder(files, joints)).collect();
        let mut columns = Vec::new();
        let joined: Option<Vec<_>> = runs.iter().map(|run| of_run(run, &mut columns)).collect();
        Some((Self { columns, runs: runs.into_iter().map(|run| run.around).collect() }, joined?))
    }

    /// The names of the files of recording number `run`, if they differ from those of the first one.
    pub(super) fn renamed(&self, run: usize) -> Option<RenamedFiles> {
        let (first, own) = (self.runs.first()?, self.runs.get(run)?);
        (first != own).then(|| RenamedFiles { first: first.clone(), own: own.clone() })
    }

    /// The file key and the column of `joined` columns of one quantity; `joints` are their joints. `None` if one text
    /// cannot name their files.
    pub(super) fn group(&self, joined: &[String], joints: &[&str]) -> Option<GroupColumns> {
        let parts: Option<Vec<&JointColumn>> =
            joined.iter().map(|name| self.columns.iter().find(|column| column.joined == *name)).collect();
        let parts = parts?;
        let column = &parts.first()?.column;
        let files: Vec<String> = parts.iter().map(|part| part.file.clone()).collect();
        let of_joint = |(file, joint): (&String, &&str)| {
            file.match_indices(*joint)
                .last()
                .map(|(at, _)| format!("{}{{joint}}{}", &file[..at], &file[at + joint.len()..]))
        };
        let by_name: Option<Vec<String>> = files.iter().zip(joints).map(of_joint).collect();
        let by_name = by_name.filter(|names| names.windows(2).all(|pair| pair[0] == pair[1]));
        let by_number = || Some(column_list(&files)).filter(|list| list.starts_with('"'));
        let file = by_number().or_else(|| by_name.map(|names| quoted(&names[0])))?;
        parts
            .iter()
            .all(|part| part.column == *column)
            .then(|| GroupColumns { file: Some(file), columns: quoted(column) })
    }
}

/// The files of one recording.
struct Run<'l, 'a> {
    /// Text before and after the joint in the names of the files; empty texts for all files of a folder.
    around: [String; 2],
    files: Vec<&'l (&'a Path, LogContents)>,
}

/// The recordings in a folder. The files of a recording differ in the name of the joint, or otherwise in the last
/// number of their names. All files are one recording, if a group would be a single file.
fn runs_of_folder<'l, 'a>(files: &[&'l (&'a Path, LogContents)], joints: &[String]) -> Vec<Run<'l, 'a>> {
    let stem = |path: &Path| path.file_stem()?.to_str().map(str::to_owned);
    let parts_by = |split: &dyn Fn(&str) -> Option<[String; 2]>| -> Option<Vec<[String; 2]>> {
        files.iter().map(|(path, _)| split(&stem(path)?)).collect()
    };
    let around = parts_by(&|stem| around_joint(stem, joints)).or_else(|| parts_by(&around_number));
    let mut runs: Vec<Run<'l, 'a>> = Vec::new();
    for (around, file) in around.into_iter().flatten().zip(files.iter().copied()) {
        match runs.iter_mut().find(|run| run.around == around) {
            Some(run) => run.files.push(file),
            None => runs.push(Run { around, files: vec![file] }),
        }
    }
    if runs.len() > 1 && runs.iter().all(|run| run.files.len() > 1) {
        return runs;
    }
    vec![Run { around: [String::new(), String::new()], files: files.to_vec() }]
}

/// The text before and after the longest joint name in `stem` that is a separate word.
fn around_joint(stem: &str, joints: &[String]) -> Option<[String; 2]> {
    let is_part = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
    let split = |joint: &String| {
        let is_word = |(at, _): &(usize, &str)| {
            !is_part(stem[..*at].chars().next_back()) && !is_part(stem[*at + joint.len()..].chars().next())
        };
        let (at, _) = stem.match_indices(joint.as_str()).filter(is_word).last()?;
        Some((joint.len(), [stem[..at].to_owned(), stem[at + joint.len()..].to_owned()]))
    };
    let found = joints.iter().filter(|joint| !joint.is_empty()).filter_map(split);
    found.max_by_key(|(length, _)| *length).map(|(_, around)| around)
}

/// The text before and after the last number in `stem`.
fn around_number(stem: &str) -> Option<[String; 2]> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].trim_end_matches(|c: char| c.is_ascii_digit()).len();
    Some([stem[..begin].to_owned(), stem[end..].to_owned()])
}

/// The recording of the files of a run.
fn of_run<'a>(Run { around, files }: &Run<'_, 'a>, columns: &mut Vec<JointColumn>) -> Option<(&'a Path, LogContents)> {
    let (path, first) = (files[0].0, &files[0].1);
    let names = |log: &LogContents| log.channels.iter().map(|channel| channel.name.clone()).collect::<Vec<_>>();
    let is_like = |(_, log): &&&(&Path, LogContents)| {
        log.groups.len() == 1 && log.groups[0].rows == first.groups[0].rows && names(log) == names(first)
    };
    let count = |quantity: Quantity| {
        let is_own = |name: &&String| {
            let found = meaning(name, &[]);
            found.quantity == Some(quantity) && found.joint == JointKey::Alone
        };
        names(first).iter().filter(is_own).count()
    };
    let has_one_joint = count(Quantity::Position) == 1 && count(Quantity::Torque) + count(Quantity::Current) >= 1;
    if files.len() < 2 || !has_one_joint || !files.iter().all(|file| is_like(&file)) {
        return None;
    }
    let time = first.groups[0].time.as_deref();
    let mut channels: Vec<LogChannel> =
        first.channels.iter().filter(|channel| Some(channel.name.as_str()) == time).cloned().collect();
    for (path, log) in files {
        let file = path.file_name()?.to_str()?;
        // The part that is the same for all runs.
        let stem = path.file_stem()?.to_str()?.strip_prefix(around[0].as_str())?.strip_suffix(around[1].as_str())?;
        for channel in log.channels.iter().filter(|channel| Some(channel.name.as_str()) != time) {
            let joined = format!("{stem}/{}", channel.name);
            channels.push(LogChannel { name: joined.clone(), ..channel.clone() });
            columns.push(JointColumn { joined, file: file.to_owned(), column: channel.name.clone() });
        }
    }
    Some((path, LogContents { channels, ..first.clone() }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[[&str; 3]]) -> JointFiles {
        let column = |[joined, file, column]: &[&str; 3]| JointColumn {
            joined: (*joined).to_owned(),
            file: (*file).to_owned(),
            column: (*column).to_owned(),
        };
        JointFiles { columns: list.iter().map(column).collect(), runs: Vec::new() }
    }

    #[test]
    fn the_joint_in_a_file_name_is_found() {
        let joints = ["joint", "elbow_joint"].map(str::to_owned);
        let around = |before: &str, after: &str| Some([before.to_owned(), after.to_owned()]);
        assert_eq!(around_joint("a_elbow_joint_raw", &joints), around("a_", "_raw"));
        assert_eq!(around_joint("joint_a", &joints), around("", "_a"));
        assert_eq!(around_joint("joint2_a", &joints), None);
        assert_eq!(around_number("run2_axis12_x"), around("run2_axis", "_x"));
        assert_eq!(around_number("axis"), None);
    }

    #[test]
    fn one_text_names_all_files_or_none() {
        let group = |files: &JointFiles, joints: &[&str]| {
            let joined: Vec<String> = files.columns.iter().map(|column| column.joined.clone()).collect();
            files.group(&joined, joints).map(|group| (group.file.unwrap(), group.columns))
        };
        let numbered = files(&[["a1/q", "a1.csv", "q"], ["a2/q", "a2.csv", "q"]]);
        assert_eq!(group(&numbered, &["x", "y"]).unwrap(), ("\"a{1..2}.csv\"".to_owned(), "\"q\"".to_owned()));
        let named = files(&[["run_x/q", "run_x.csv", "q"], ["run_y/q", "run_y.csv", "q"]]);
        assert_eq!(group(&named, &["x", "y"]).unwrap().0, "\"run_{joint}.csv\"");
        assert_eq!(group(&named, &["x", "z"]), None);
        assert_eq!(group(&files(&[["a2/q", "a2.csv", "q"], ["a1/q", "a1.csv", "q"]]), &["x", "y"]), None);
    }
}
