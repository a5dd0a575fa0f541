//! Files written by other programs (`golden/formats.py`) give their original numbers, bit by bit.

use dynident_formats::{Contents, FileFormat, Table, files, open};
use serde_json::Value;
use std::io::Read;
use std::path::{Path, PathBuf};

pub(crate) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../golden/formats")
}

/// Parses a hexadecimal float of Python: `-0x1.8p+3`.
fn hexadecimal(text: &str) -> f64 {
    if text == "nan" {
        return f64::NAN;
    }
    let (sign, rest) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (mantissa, exponent) = rest.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap();
    let exponent: i32 = exponent.parse().unwrap();
    // In two steps, because 2^-1074 times an integer is exact, but 2^-1080 is zero.
    let exponent = exponent - 4 * i32::try_from(fraction.len()).unwrap();
    sign * digits as f64 * 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2)
}

pub(crate) fn columns(table: &mut dyn Table, names: &[&str]) -> Vec<Vec<f64>> {
    let place = |name: &&str| match table.names() {
        Some(names) => names.iter().position(|known| known == name).unwrap_or_else(|| panic!("no {name}: {names:?}")),
        None => name.parse().unwrap(),
    };
    let fields: Vec<usize> = names.iter().map(place).collect();
    table.select(&fields);
    let mut found = vec![Vec::new(); names.len()];
    let mut row = vec![0.0; names.len()];
    while table.next_row(&mut row).unwrap() {
        found.iter_mut().zip(&row).for_each(|(column, value)| column.push(*value));
    }
    found
}

fn same(name: &str, found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{name}");
    for (row, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!(
            a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan() || *a == 0.0 && *b == 0.0,
            "{name}, row {row}: {a:e} for {b:e}"
        );
    }
}

#[test]
fn every_file_gives_its_original_numbers() {
    let golden: Value = serde_json::from_slice(&std::fs::read(folder().join("values.json")).unwrap()).unwrap();
    let series: Vec<Vec<f64>> = golden["series"]
        .as_array()
        .unwrap()
        .iter()
        .map(|values| values.as_array().unwrap().iter().map(|text| hexadecimal(text.as_str().unwrap())).collect())
        .collect();
    let files = golden["files"].as_object().unwrap();
    assert!(files.len() > 20);
    for (file, expected) in files {
        let path = folder().join(file);
        let expected = expected.as_object().unwrap();
        let joined = expected.contains_key("joined");
        let expected: Vec<(&str, &Vec<f64>)> = expected
            .iter()
            .filter(|(name, _)| *name != "joined")
            .map(|(name, index)| (name.as_str(), &series[usize::try_from(index.as_u64().unwrap()).unwrap()]))
            .collect();
        match open(&path).unwrap_or_else(|error| panic!("{file}: {error}")).contents {
            Contents::Text(mut text) => {
                let mut found = String::new();
                text.read_to_string(&mut found).unwrap();
                let mut lines = found.lines();
                let names: Vec<&str> = lines.next().unwrap().split(',').collect();
                let rows: Vec<Vec<f64>> =
                    lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
                for (name, values) in expected {
                    let at = names.iter().position(|known| *known == name).unwrap();
                    same(name, &rows.iter().map(|row| row[at]).collect::<Vec<_>>(), values);
                }
            }
            Contents::Table(mut table) => {
                let names: Vec<&str> = expected.iter().map(|(name, _)| *name).collect();
                if joined {
                    let found = columns(table.as_mut(), &names);
                    for ((name, values), found) in expected.iter().zip(&found) {
                        same(&format!("{file}: {name}"), found, values);
                    }
                    continue;
                }
                // One group at a time, because each has a separate clock.
                for group in table.groups() {
                    let of_group = |name: &str| match table.names() {
                        Some(known) => known[group.columns.clone()].iter().any(|one| one == name),
                        None => true,
                    };
                    let chosen: Vec<&(&str, &Vec<f64>)> = expected.iter().filter(|one| of_group(one.0)).collect();
                    let Contents::Table(mut fresh) = open(&path).unwrap().contents else { unreachable!() };
                    let names: Vec<&str> = chosen.iter().map(|one| one.0).collect();
                    let found = columns(fresh.as_mut(), &names);
                    for ((name, values), found) in chosen.iter().zip(&found) {
                        same(&format!("{file}: {name}"), found, values);
                    }
                }
                if let Some(known) = table.names() {
                    assert!(names.iter().all(|name| known.iter().any(|one| one == name)), "{file}: {known:?}");
                    let bag = known.iter().any(|name| name.ends_with("log_time"));
                    assert!(bag || known.len() == names.len(), "{file}: {known:?} for {names:?}");
                }
            }
        }
    }
}

#[test]
fn formats_are_detected_from_the_content() {
    let scratch = tempfile::tempdir().unwrap();
    for (file, format) in [
        ("table.csv.gz", FileFormat::GzipText),
        ("table.csv.zst", FileFormat::ZstdText),
        ("sideways.csv", FileFormat::SidewaysText),
        ("value_list.txt", FileFormat::ValueList),
        ("matrix_market.mtx", FileFormat::ValueList),
        ("rows.jsonl", FileFormat::JsonLines),
        ("matrix.npy", FileFormat::Npy),
        ("packed.npz", FileFormat::Npz),
        ("zstd.mcap", FileFormat::Mcap),
        ("protobuf.mcap", FileFormat::Mcap),
        ("jazzy.db3", FileFormat::Rosbag2),
        ("zstd.parquet", FileFormat::Parquet),
        ("lerobot_v2/data/chunk-000/episode_000001.parquet", FileFormat::Parquet),
        ("lz4.feather", FileFormat::Arrow),
        ("stream.arrows", FileFormat::Arrow),
        ("packed.mat", FileFormat::Mat5),
        ("v73.mat", FileFormat::Hdf5),
        ("groups.h5", FileFormat::Hdf5),
    ] {
        let renamed = scratch.path().join("log.csv");
        std::fs::copy(folder().join(file), &renamed).unwrap();
        assert_eq!(open(&renamed).unwrap().format, format, "{file}");
    }
    let trace = folder().join("trace/run_NextGenDrive#2.dat");
    assert_eq!((open(&trace).unwrap().format, files(&trace).unwrap().len()), (FileFormat::Diadem, 4));
    for name in ["lerobot_v3", "lerobot_v3/meta/info.json"] {
        let path = folder().join(name);
        assert_eq!(open(&path).unwrap().format, FileFormat::LeRobot, "{name}");
        let files = files(&path).unwrap();
        assert!(files.len() == 3 && files[0].ends_with("meta/info.json"), "{files:?}");
    }
}

/// Names of joints that are Python objects are reported with the fix.
#[test]
fn names_in_an_archive_name_its_columns() {
    let notes = |file: &str| {
        let Contents::Table(table) = open(&folder().join(file)).unwrap().contents else { panic!() };
        table.notes()
    };
    assert!(notes("named.npz").is_empty() && notes("named_bytes.npz").is_empty());
    let [note] = &notes("named_objects.npz")[..] else { panic!() };
    assert!(note.starts_with("joint_names: Python objects") && note.contains("dtype=str"), "{note}");
}

/// Messages with time stamps in Protobuf have their clock, as those of ROS with a header.
#[test]
fn the_time_stamp_of_protobuf_is_the_clock() {
    let Contents::Table(table) = open(&folder().join("protobuf.mcap")).unwrap().contents else { panic!() };
    let [group] = &table.groups()[..] else { panic!() };
    assert_eq!(table.names().unwrap()[group.time.unwrap()], "/arm.timestamp");
    assert!(table.notes().is_empty(), "{:?}", table.notes());
}

#[test]
fn topics_are_groups_and_rows_are_those_of_the_first_column() {
    let Contents::Table(mut table) = open(&folder().join("two_clocks.mcap")).unwrap().contents else { panic!() };
    let groups = table.groups();
    let names: Vec<String> = groups.iter().map(|group| group.name.clone().unwrap()).collect();
    assert_eq!(names, ["/joint_states", "/tau"]);
    let time = |index: usize| table.names().unwrap()[groups[index].time.unwrap()].clone();
    assert_eq!([time(0), time(1)], ["/joint_states.header.stamp", "/tau.log_time"]);
    // On the clock of the torques: thirteen rows.
    let found = columns(table.as_mut(), &["/tau.log_time", "/joint_states.position[elbow]"]);
    assert_eq!(found[0].len(), 13);
    assert!(found[0].windows(2).all(|pair| (pair[1] - pair[0] - 0.025).abs() < 1e-12));
    // The elbow moves as 0.7 cos 5t; linear interpolation between samples 10 ms apart has the error 0.7 · 25 · 0.01² /
    // 8.
    for (k, q) in found[1].iter().enumerate() {
        let t = 0.012_345_678 + 0.025 * k as f64;
        assert!((q - 0.7 * (5.0 * t).cos()).abs() < 2.2e-4 + 0.7 * 5.0 * 6e-5, "{k}: {q}");
    }
}
