//! Writes one episode of actions as a LeRobot data set of version 2.1, which `lerobot-replay` plays.
//!
//! Layout: `codebase_version` v2.1 of <https://github.com/huggingface/lerobot>: `meta/info.json`, `meta/tasks.jsonl`,
//! `meta/episodes.jsonl`, `meta/episodes_stats.jsonl`, and one Parquet file for the episode.

use super::ExportError;

/// Actions of one episode at a constant rate.
#[derive(Clone, Copy, Debug)]
pub struct LeRobotEpisode<'a> {
    /// Type of the robot, as LeRobot names it.
    pub robot_type: &'a str,
    /// Description of the task in words.
    pub task: &'a str,
    /// Frames per second; LeRobot needs a whole number.
    pub rate_hz: f64,
    /// Names of the actions, for example `shoulder_pan.pos`.
    pub names: &'a [String],
    /// Values of each action, in LeRobot's units.
    pub actions: &'a [Vec<f64>],
}

/// The files of a data set: path and content of each.
pub type EpisodeFiles = Vec<(&'static str, Vec<u8>)>;

/// Paths of the files. The folder `lerobot` is the data set.
pub const LEROBOT_FILES: [&str; 5] = [
    "lerobot/meta/info.json",
    "lerobot/meta/tasks.jsonl",
    "lerobot/meta/episodes.jsonl",
    "lerobot/meta/episodes_stats.jsonl",
    "lerobot/data/chunk-000/episode_000000.parquet",
];

#[cfg(not(feature = "parquet"))]
/// Files of the data set. Actions are stored as 32-bit numbers, as LeRobot does.
///
/// # Errors
/// This build has no Parquet.
pub fn lerobot_episode(_: &LeRobotEpisode<'_>) -> Result<EpisodeFiles, ExportError> {
    Err(ExportError::NotBuilt { format: "a LeRobot data set", feature: "parquet" })
}

#[cfg(feature = "parquet")]
pub use writing::lerobot_episode;

#[cfg(feature = "parquet")]
mod writing {
    use super::{EpisodeFiles, ExportError, LEROBOT_FILES, LeRobotEpisode};
    use core::fmt::Write;
    use parquet::basic::Compression;
    use parquet::column::writer::ColumnWriter;
    use parquet::errors::ParquetError;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use serde_json::{Map, Value, json};
    use std::sync::Arc;

    /// Columns in the order of the file; lists as `pyarrow` writes them.
    const SCHEMA: &str = "message schema {
        OPTIONAL group action (LIST) { REPEATED group list { OPTIONAL FLOAT element; } }
        OPTIONAL FLOAT timestamp;
        OPTIONAL INT64 frame_index;
        OPTIONAL INT64 episode_index;
        OPTIONAL INT64 index;
        OPTIONAL INT64 task_index;
    }";
    /// Definition level of a list entry: list, its group and the entry are present.
    const ENTRY: i16 = 3;

    /// Files of the data set. Actions are stored as 32-bit numbers, as LeRobot does.
    ///
    /// # Errors
    /// No frames, another number of names than of actions, lists of different lengths, values that are not finite, or a
    /// rate that is not a whole number.
    pub fn lerobot_episode(episode: &LeRobotEpisode<'_>) -> Result<EpisodeFiles, ExportError> {
        let frames = checked(episode)?;
        let fps = episode.rate_hz as u64;
        let actions: Vec<Vec<f32>> =
            episode.actions.iter().map(|values| values.iter().map(|value| *value as f32).collect()).collect();
        let stamps: Vec<f32> = (0..frames).map(|frame| (frame as f64 / episode.rate_hz) as f32).collect();
        let lines = [
            pretty(&info(episode, fps, frames)),
            line(&json!({ "task_index": 0, "task": episode.task })),
            line(&json!({ "episode_index": 0, "tasks": [episode.task], "length": frames })),
            line(&json!({ "episode_index": 0, "stats": stats(&actions, &stamps) })),
        ];
        let mut files: EpisodeFiles = LEROBOT_FILES.into_iter().zip(lines.map(String::into_bytes)).collect();
        let table = table(&actions, &stamps).map_err(|error| ExportError::Parquet { message: error.to_string() })?;
        files.push((LEROBOT_FILES[4], table));
        Ok(files)
    }

    /// Number of frames.
    fn checked(episode: &LeRobotEpisode<'_>) -> Result<usize, ExportError> {
        let LeRobotEpisode { names, actions, rate_hz, .. } = *episode;
        let frames = actions.first().map_or(0, Vec::len);
        let other = actions.iter().map(Vec::len).find(|length| *length != frames || frames == 0);
        let shape = |what, expected, found| Err(ExportError::Shape { what, expected, found });
        if names.len() != actions.len() {
            return shape("names of actions", actions.len(), names.len());
        }
        if let Some(found) = other {
            return shape("frames", frames.max(1), found);
        }
        if !(1.0..=1e6).contains(&rate_hz) || rate_hz.fract() != 0.0 {
            let needed = "a whole number of frames per second, as LeRobot needs";
            return Err(ExportError::Setting { setting: "rate_hz", value: rate_hz, needed });
        }
        for (name, values) in names.iter().zip(actions) {
            if let Some(frame) = values.iter().position(|value| !(*value as f32).is_finite()) {
                return Err(ExportError::NotFinite { joint: name.clone(), at_s: frame as f64 / rate_hz });
            }
        }
        Ok(frames)
    }

    fn pretty(value: &Value) -> String {
        ascii(&format!("{value:#}\n"))
    }

    fn line(value: &Value) -> String {
        ascii(&format!("{value}\n"))
    }

    /// JSON in ASCII: other characters, which are in strings only, as escapes.
    fn ascii(text: &str) -> String {
        let mut out = String::with_capacity(text.len());
        for c in text.chars() {
            if matches!(c, ' '..='~' | '\n') {
                out.push(c);
            } else {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    // Writing to a string cannot fail.
                    let _ = write!(out, "\\u{unit:04x}");
                }
            }
        }
        out
    }

    fn info(episode: &LeRobotEpisode<'_>, fps: u64, frames: usize) -> Value {
        let scalar = |kind: &str| json!({ "dtype": kind, "shape": [1], "names": null });
        json!({
            "codebase_version": "v2.1",
            "robot_type": episode.robot_type,
            "total_episodes": 1,
            "total_frames": frames,
            "total_tasks": 1,
            "total_videos": 0,
            "total_chunks": 1,
            "chunks_size": 1000,
            "fps": fps,
            "splits": { "train": "0:1" },
            "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "video_path": null,
            "features": {
                "action": { "dtype": "float32", "shape": [episode.names.len()], "names": episode.names },
                "timestamp": scalar("float32"),
                "frame_index": scalar("int64"),
                "episode_index": scalar("int64"),
                "index": scalar("int64"),
                "task_index": scalar("int64"),
            },
        })
    }

    /// Minimum, maximum, mean, standard deviation and number of frames of each feature.
    fn stats(actions: &[Vec<f32>], stamps: &[f32]) -> Value {
        let frames = stamps.len();
        let count: Vec<f64> = (0..frames).map(|frame| frame as f64).collect();
        let wide = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
        let zeros = vec![0.0; frames];
        let features = [
            ("action", actions.iter().map(|values| wide(values)).collect()),
            ("timestamp", vec![wide(stamps)]),
            ("frame_index", vec![count.clone()]),
            ("episode_index", vec![zeros.clone()]),
            ("index", vec![count]),
            ("task_index", vec![zeros]),
        ];
        let of = |columns: &[Vec<f64>]| {
            let each = |of: fn(&[f64]) -> f64| columns.iter().map(|values| of(values)).collect::<Vec<f64>>();
            json!({
                "min": each(|values| values.iter().copied().fold(f64::INFINITY, f64::min)),
                "max": each(|values| values.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
                "mean": each(mean),
                "std": each(|values| {
                    let mean = mean(values);
                    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
                }),
                "count": [frames],
            })
        };
        Value::Object(features.iter().map(|(name, columns)| ((*name).to_owned(), of(columns))).collect::<Map<_, _>>())
    }

    fn mean(values: &[f64]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    fn table(actions: &[Vec<f32>], stamps: &[f32]) -> Result<Vec<u8>, ParquetError> {
        let frames = stamps.len();
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let mut file = Vec::new();
        let schema = Arc::new(parse_message_type(SCHEMA)?);
        let mut writer = SerializedFileWriter::new(&mut file, schema, Arc::new(properties))?;
        let mut group = writer.next_row_group()?;
        let present = vec![1_i16; frames];
        let count: Vec<i64> = (0..frames).map(|frame| frame as i64).collect();
        let zeros = vec![0_i64; frames];
        for place in 0.. {
            let Some(mut column) = group.next_column()? else { break };
            match (column.untyped(), place) {
                (ColumnWriter::FloatColumnWriter(entries), 0) => {
                    let rows: Vec<f32> =
                        (0..frames).flat_map(|frame| actions.iter().map(move |values| values[frame])).collect();
                    // The first entry of a list begins a row.
                    let begins: Vec<i16> = (0..rows.len()).map(|entry| i16::from(entry % actions.len() != 0)).collect();
                    entries.write_batch(&rows, Some(&vec![ENTRY; rows.len()]), Some(&begins))?;
                }
                (ColumnWriter::FloatColumnWriter(values), _) => {
                    values.write_batch(stamps, Some(&present), None)?;
                }
                (ColumnWriter::Int64ColumnWriter(values), place) => {
                    let own = if place == 2 || place == 4 { &count } else { &zeros };
                    values.write_batch(own, Some(&present), None)?;
                }
                _ => return Err(ParquetError::General("a column of another type".to_owned())),
            }
            column.close()?;
        }
        group.close()?;
        writer.close()?;
        Ok(file)
    }
}

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use super::*;

    #[test]
    fn what_lerobot_cannot_hold_is_named() {
        let (names, actions) = (["a.pos".to_owned(), "b.pos".to_owned()], [vec![0.0, 1.0], vec![2.0, f64::NAN]]);
        let episode = LeRobotEpisode { robot_type: "arm", task: "t", rate_hz: 50.0, names: &names, actions: &actions };
        let refused = |episode: &LeRobotEpisode<'_>| lerobot_episode(episode).unwrap_err();
        assert_eq!(refused(&episode), ExportError::NotFinite { joint: "b.pos".to_owned(), at_s: 0.02 });
        let one = LeRobotEpisode { names: &names[..1], ..episode };
        assert_eq!(refused(&one), ExportError::Shape { what: "names of actions", expected: 2, found: 1 });
        let short = [vec![0.0, 1.0], vec![2.0]];
        let short = LeRobotEpisode { actions: &short, ..episode };
        assert_eq!(refused(&short), ExportError::Shape { what: "frames", expected: 2, found: 1 });
        let rate = LeRobotEpisode { rate_hz: 62.5, ..episode };
        assert!(refused(&rate).to_string().contains("rate_hz = 62.5: give a whole number"));
    }

    #[test]
    fn names_are_ascii_in_the_files_and_return_from_json() {
        let names = ["j\u{202e}\"\u{1f600}".to_owned()];
        let actions = [vec![0.5]];
        let episode = LeRobotEpisode { robot_type: "arm", task: "t\n", rate_hz: 1.0, names: &names, actions: &actions };
        let files = lerobot_episode(&episode).unwrap();
        assert_eq!(files.iter().map(|(path, _)| *path).collect::<Vec<_>>(), LEROBOT_FILES);
        for (path, contents) in &files[..4] {
            let text = core::str::from_utf8(contents).unwrap();
            assert!(text.is_ascii(), "{path}");
            for line in text.lines().filter(|_| path.ends_with("jsonl")) {
                serde_json::from_str::<serde_json::Value>(line).unwrap();
            }
        }
        let info: serde_json::Value = serde_json::from_slice(&files[0].1).unwrap();
        assert_eq!(info["features"]["action"]["names"][0].as_str(), Some(&names[0][..]));
    }
}
