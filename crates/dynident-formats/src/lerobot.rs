//! LeRobot data sets: a folder with `meta/info.json` and Parquet files in `data`, one for each episode (version 2) or
//! for several episodes (version 3). Layout: <https://huggingface.co/docs/lerobot/lerobot-dataset-v3>.

use crate::error::FileError;
use crate::kind::FileFormat;
use std::path::{Path, PathBuf};

const INFO_FILE: &str = "meta/info.json";
const DOWNLOAD_FIX: &str = "download the complete data set (`hf download`, or `git lfs pull`)";

/// The folder of the data set: `path` itself, or the folder that contains the given `meta/info.json`.
pub(crate) fn folder(path: &Path) -> Option<&Path> {
    if path.ends_with(INFO_FILE) && path.is_file() {
        return path.parent()?.parent();
    }
    path.join(INFO_FILE).is_file().then_some(path)
}

pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let listed = |folder: &Path| -> Result<Vec<PathBuf>, FileError> {
        let io = |source| FileError::Io { file: folder.to_owned(), source };
        let names = dynident_system::names(folder).map_err(io)?;
        let mut found: Vec<PathBuf> = names.into_iter().map(|name| folder.join(name)).collect();
        // Numbers in file names have at least three or six digits, and more if needed, so shorter names come first.
        found.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
        Ok(found)
    };
    let mut files = vec![folder.join(INFO_FILE)];
    for chunk in listed(&folder.join("data"))?.iter().filter(|chunk| chunk.is_dir()) {
        let tables = listed(chunk)?.into_iter().filter(|path| path.extension().is_some_and(|kind| kind == "parquet"));
        files.extend(tables);
    }
    if files.len() > 1 {
        return Ok(files);
    }
    Err(FileError::broken(folder, FileFormat::LeRobot, "data", "it contains no Parquet file", DOWNLOAD_FIX))
}

#[cfg(not(all(feature = "json", feature = "parquet")))]
pub(crate) fn open(folder: &Path) -> Result<Box<dyn crate::table::Table>, FileError> {
    Err(FileError::NotBuilt { file: folder.to_owned(), format: "a LeRobot data set", feature: "parquet" })
}

#[cfg(all(feature = "json", feature = "parquet"))]
pub(crate) use reading::open;

#[cfg(all(feature = "json", feature = "parquet"))]
mod reading {
    use super::{DOWNLOAD_FIX, FileError, FileFormat, INFO_FILE, Path, PathBuf, files};
    use crate::parquet;
    use crate::recognition;
    use crate::table::{ColumnGroup, Table};
    use serde_json::Value;
    use std::io::{BufReader, Read};

    const MAX_INFO_BYTES: u64 = 1 << 24;
    /// Time between episodes, s: long enough to be treated as a gap, not as a late sample.
    const EPISODE_GAP_S: f64 = 10.0;
    const TIME: &str = "time";

    #[derive(Debug)]
    struct DataSet {
        folder: PathBuf,
        parts: Vec<PathBuf>,
        current: usize,
        part: Box<dyn Table>,
        /// Names of the columns in the parts, and in this table, which has the time in addition.
        own_names: Vec<String>,
        names: Vec<String>,
        notes: Vec<String>,
        wanted: Vec<usize>,
        clock: Option<Clock>,
        /// Columns that are read from each part, and one row of their values.
        read: Vec<usize>,
        row: Vec<f64>,
        total_rows: Option<u64>,
    }

    /// Time that continues from episode to episode.
    #[derive(Debug, Default)]
    struct Clock {
        stamp: usize,
        episode: usize,
        /// Added to the stamps of the current episode, s.
        offset_s: f64,
        last: Option<(f64, f64)>,
    }

    impl Clock {
        fn time(&mut self, stamp: f64, episode: f64) -> f64 {
            match self.last {
                Some((under_way, last)) if under_way != episode => self.offset_s = last + EPISODE_GAP_S - stamp,
                _ => {}
            }
            let time = stamp + self.offset_s;
            if time.is_finite() {
                self.last = Some((episode, time));
            }
            time
        }
    }

    pub(crate) fn open(folder: &Path) -> Result<Box<dyn Table>, FileError> {
        let info = read_info(folder)?;
        let parts: Vec<PathBuf> = files(folder)?.split_off(1);
        let part = open_part(folder, &parts[0])?;
        let own_names = part.names().unwrap_or_default().to_vec();
        let mut names = with_entries_named(&own_names, &info["features"]);
        let mut notes = part.notes();
        let place = |wanted: &str| own_names.iter().position(|name| name == wanted);
        let clock = match (place("timestamp"), place("episode_index"), place(TIME)) {
            (Some(stamp), Some(episode), None) => {
                names.push(TIME.to_owned());
                Some(Clock { stamp, episode, ..Clock::default() })
            }
            _ => None,
        };
        if let (Some(path), Some(episodes)) = (info["data_path"].as_str(), info["total_episodes"].as_u64())
            && path.contains("episode_index")
            && episodes > parts.len() as u64
        {
            notes.push(format!("the files of {} of {episodes} episodes are missing", episodes - parts.len() as u64));
        }
        let wanted = (0..names.len()).collect::<Vec<_>>();
        let mut table = DataSet {
            folder: folder.to_owned(),
            parts,
            current: 0,
            part,
            own_names,
            names,
            notes,
            wanted: Vec::new(),
            clock,
            read: Vec::new(),
            row: Vec::new(),
            total_rows: info["total_frames"].as_u64(),
        };
        table.select(&wanted);
        Ok(Box::new(table))
    }

    fn read_info(folder: &Path) -> Result<Value, FileError> {
        let path = folder.join(INFO_FILE);
        let mut text = Vec::new();
        dynident_files::open(&path)
            .and_then(|file| file.take(MAX_INFO_BYTES).read_to_end(&mut text))
            .map_err(|source| FileError::Io { file: path.clone(), source })?;
        let info: Result<Value, _> = serde_json::from_slice(&text);
        let problem = match info {
            Ok(info) if info["features"].is_object() => return Ok(info),
            Ok(_) => "it has no `features`".to_owned(),
            Err(error) => format!("it is not JSON ({error})"),
        };
        Err(FileError::broken(folder, FileFormat::LeRobot, INFO_FILE, problem, DOWNLOAD_FIX))
    }

    fn open_part(folder: &Path, path: &Path) -> Result<Box<dyn Table>, FileError> {
        let io = |source| FileError::Io { file: path.to_owned(), source };
        let head = recognition::head(&mut BufReader::new(dynident_files::open(path).map_err(io)?)).map_err(io)?;
        // In place of a file that was not downloaded, Git LFS leaves a short text that refers to it.
        if !head.starts_with(b"PAR1") {
            let place = path.strip_prefix(folder).unwrap_or(path).display().to_string();
            return Err(FileError::broken(
                folder,
                FileFormat::LeRobot,
                place,
                "it is not a Parquet file",
                DOWNLOAD_FIX,
            ));
        }
        parquet::open(path)
    }

    /// Columns whose list entries are named by `features`: `action[elbow]` for `action[1]`.
    fn with_entries_named(columns: &[String], features: &Value) -> Vec<String> {
        let named = |column: &String| {
            let (feature, entry) = column.strip_suffix(']')?.rsplit_once('[')?;
            let names = entry_names(&features[feature]["names"])?;
            let length = columns.iter().filter(|other| belongs(other, feature)).count();
            let mut sorted = names.clone();
            sorted.sort_unstable();
            sorted.dedup();
            let name = names.get(entry.parse::<usize>().ok()?)?;
            (names.len() == length && sorted.len() == length).then(|| format!("{feature}[{name}]"))
        };
        columns.iter().map(|column| named(column).unwrap_or_else(|| column.clone())).collect()
    }

    fn belongs(column: &str, feature: &str) -> bool {
        column.strip_prefix(feature).is_some_and(|rest| rest.starts_with('[') && !rest.contains('.'))
    }

    /// Names of list entries: a list, or the only list in a group such as `{"motors": [..]}`.
    fn entry_names(names: &Value) -> Option<Vec<&str>> {
        let list = match names {
            Value::Object(group) if group.len() == 1 => group.values().next()?,
            other => other,
        };
        list.as_array()?.iter().map(Value::as_str).collect()
    }

    impl DataSet {
        /// Reads the next row of the parts into `row`; false at the end.
        fn advance(&mut self) -> Result<bool, FileError> {
            while !self.part.next_row(&mut self.row)? {
                let Some(path) = self.parts.get(self.current + 1) else { return Ok(false) };
                let mut part = open_part(&self.folder, path)?;
                if part.names() != Some(&self.own_names) {
                    let place = path.strip_prefix(&self.folder).unwrap_or(path).display().to_string();
                    let problem = "its columns, or the lengths of its lists, differ from those of the first file";
                    let fix = "use the files with equal columns as separate logs";
                    return Err(FileError::broken(&self.folder, FileFormat::LeRobot, place, problem, fix));
                }
                part.select(&self.read);
                (self.part, self.current) = (part, self.current + 1);
            }
            Ok(true)
        }

        fn read_row(&mut self, values: Option<&mut [f64]>) -> Result<bool, FileError> {
            if !self.advance()? {
                return Ok(false);
            }
            let of = |column: usize| self.read.iter().position(|read| *read == column).map(|slot| self.row[slot]);
            let time = self.clock.as_mut().and_then(|clock| Some(clock.time(of(clock.stamp)?, of(clock.episode)?)));
            for (value, column) in values.into_iter().flatten().zip(&self.wanted) {
                *value = if *column < self.own_names.len() { of(*column) } else { time }.unwrap_or(f64::NAN);
            }
            Ok(true)
        }
    }

    impl Table for DataSet {
        fn width(&self) -> usize {
            self.names.len()
        }

        fn names(&self) -> Option<&[String]> {
            Some(&self.names)
        }

        fn groups(&self) -> Vec<ColumnGroup> {
            let time = self.clock.is_some().then(|| self.names.len() - 1);
            vec![ColumnGroup { name: None, columns: 0..self.names.len(), time }]
        }

        fn select(&mut self, columns: &[usize]) {
            self.wanted = columns.to_vec();
            let own = self.own_names.len();
            self.read = columns.iter().copied().filter(|column| *column < own).collect();
            if let Some(clock) = &self.clock
                && columns.contains(&own)
            {
                for column in [clock.stamp, clock.episode] {
                    if !self.read.contains(&column) {
                        self.read.push(column);
                    }
                }
            }
            self.row = vec![0.0; self.read.len()];
            self.part.select(&self.read);
        }

        fn next_row(&mut self, values: &mut [f64]) -> Result<bool, FileError> {
            self.read_row(Some(values))
        }

        fn skip_row(&mut self) -> Result<bool, FileError> {
            self.read_row(None)
        }

        fn notes(&self) -> Vec<String> {
            self.notes.clone()
        }

        fn estimated_rows(&self) -> Option<u64> {
            self.total_rows
        }
    }
}
