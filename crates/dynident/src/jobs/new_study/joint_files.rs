//! Recordings with one file for each joint, all with the same columns: `joint1.csv` to `joint7.csv`.

use crate::jobs::columns::{JointKey, Quantity, column_list, meaning};
use crate::result::{LogChannel, LogContents};
use dynident_text::quoted;
use std::path::Path;

/// Recordings with one file for each joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct JointFiles {
    columns: Vec<JointColumn>,
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
    /// Joins the files of each folder to one recording, whose columns are named by file and column. `None` if the files
    /// do not have the same columns and number of rows, or more than one position each.
    pub(super) fn join<'a>(logs: &[(&'a Path, LogContents)]) -> Option<(Self, Vec<(&'a Path, LogContents)>)> {
        let mut folders: Vec<Vec<&(&'a Path, LogContents)>> = Vec::new();
        for log in logs {
            match folders.iter_mut().find(|folder| folder[0].0.parent() == log.0.parent()) {
                Some(folder) => folder.push(log),
                None => folders.push(vec![log]),
            }
        }
        let mut columns = Vec::new();
        let joined: Option<Vec<_>> = folders.iter().map(|files| of_folder(files, &mut columns)).collect();
        Some((Self { columns }, joined?))
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

/// One recording of the files of a folder.
fn of_folder<'a>(
    files: &[&(&'a Path, LogContents)],
    columns: &mut Vec<JointColumn>,
) -> Option<(&'a Path, LogContents)> {
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
        let stem = path.file_stem()?.to_str()?;
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
        JointFiles { columns: list.iter().map(column).collect() }
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
