//! Truncated, altered or malicious files cause an error with the file, the place and the fix, and never a panic, an
//! endless loop or memory that the file cannot fill.

use super::golden::folder;
use dynident_formats::{Contents, FileError, open};
use std::io::{Read, Write};
use std::path::Path;

fn drain(path: &Path) -> Result<usize, FileError> {
    let mut rows = 0;
    match open(path)?.contents {
        Contents::Text(mut text) => {
            let mut all = Vec::new();
            let read = text.by_ref().take(1 << 26).read_to_end(&mut all);
            read.map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        }
        Contents::Table(mut table) => {
            let width = table.groups()[0].columns.len();
            table.select(&(0..width).collect::<Vec<_>>());
            let mut row = vec![0.0; width];
            while table.next_row(&mut row)? {
                rows += 1;
            }
        }
    }
    Ok(rows)
}

fn files() -> Vec<std::path::PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file() && path.extension().is_none_or(|extension| extension != "json"))
        .collect();
    files.sort();
    files
}

fn check_message(error: &FileError, file: &str) {
    let message = error.to_string();
    assert!(message.contains(file), "{message}");
    assert!(message.contains(';') || message.contains('('), "no fix: {message}");
    assert!(message.chars().all(|c| !c.is_control()) && message.len() < 2000, "{message:?}");
}

#[test]
fn files_that_are_cut_off_anywhere_are_read_so_far_or_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("cut.log");
    for file in files() {
        let whole = std::fs::read(&file).unwrap();
        let steps = 60.min(whole.len());
        for k in 0..steps {
            std::fs::write(&path, &whole[..whole.len() * k / steps]).unwrap();
            if let Err(error) = drain(&path) {
                check_message(&error, "cut.log");
            }
        }
    }
}

#[test]
fn files_with_altered_bytes_are_read_or_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("altered.log");
    let mut state = 20261123_u64;
    let mut draw = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize
    };
    for file in files() {
        let whole = std::fs::read(&file).unwrap();
        for _ in 0..60 {
            let mut bytes = whole.clone();
            // Mostly the start of the file, because it contains lengths.
            let within = if draw() % 2 == 0 { bytes.len().min(600) } else { bytes.len() };
            for _ in 0..=draw() % 4 {
                bytes[draw() % within] = [0, 0xFF, 0x7F, 0x80, draw() as u8][draw() % 5];
            }
            std::fs::write(&path, &bytes).unwrap();
            if let Err(error) = drain(&path) {
                check_message(&error, "altered.log");
            }
        }
    }
}

#[test]
fn truncated_recordings_are_read_up_to_the_end() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("crash.log");
    for file in ["zstd.mcap", "plain.bag", "flight.ulg"] {
        let whole = std::fs::read(folder().join(file)).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let Contents::Table(mut table) = open(&path).unwrap().contents else { panic!() };
        let mut rows = 0;
        let mut row = vec![0.0; table.width()];
        while table.next_row(&mut row).unwrap() {
            rows += 1;
        }
        assert!(rows > 5 && rows < 40 && table.truncated(), "{file}: {rows}");
    }
    let path = scratch.path().join("crash.jsonl");
    std::fs::write(&path, "{\"t\": 1}\n{\"t\": 2}\n{\"t\": 3").unwrap();
    let Contents::Table(mut table) = open(&path).unwrap().contents else { panic!() };
    let mut row = [0.0];
    while table.next_row(&mut row).unwrap() {}
    assert!(row == [2.0] && table.truncated());
    // An Arrow stream has no footer before it is closed; an Arrow file without a footer is incomplete.
    let path = scratch.path().join("crash.arrow");
    let whole = std::fs::read(folder().join("stream.arrows")).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 9 / 10]).unwrap();
    let Contents::Table(mut table) = open(&path).unwrap().contents else { panic!() };
    let mut row = vec![0.0; table.width()];
    let mut rows = 0;
    while table.next_row(&mut row).unwrap() {
        rows += 1;
    }
    assert!(rows == 30 && table.truncated(), "{rows}");
    let whole = std::fs::read(folder().join("plain.arrow")).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 9 / 10]).unwrap();
    let message = drain(&path).unwrap_err().to_string();
    assert!(
        message.ends_with("its end: it is truncated, or its writer was not closed; write or copy it again"),
        "{message}"
    );
}

#[test]
fn claims_that_the_file_cannot_fill_take_no_memory() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("claims.npy");
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (200000000, 1), }\n";
    let mut file = std::fs::File::create(&path).unwrap();
    file.write_all(b"\x93NUMPY\x01\x00").unwrap();
    file.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    file.write_all(header.as_bytes()).unwrap();
    file.write_all(&[0; 80]).unwrap();
    drop(file);
    let message = drain(&path).unwrap_err().to_string();
    assert!(message.contains("only 80 of 1600000000 bytes are present"), "{message}");
    for (shape, words) in
        [("(9999999999999, 9999999999)", "more than 2048 MiB of memory"), ("(-1,)", "its header is invalid")]
    {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
        bytes.extend_from_slice(header.as_bytes());
        std::fs::write(&path, bytes).unwrap();
        let message = drain(&path).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

/// A short subscription must not cause a long definition each.
#[test]
fn subscriptions_of_a_ulog_are_limited() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("many.ulg");
    let mut bytes = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    let mut add = |kind: u8, body: &[u8]| {
        bytes.extend_from_slice(&(body.len() as u16).to_le_bytes());
        bytes.push(kind);
        bytes.extend_from_slice(body);
    };
    add(b'F', format!("a:uint64_t timestamp;{}", "double x;".repeat(6000)).as_bytes());
    for id in 0..3000_u16 {
        add(b'A', &[&[0], &id.to_le_bytes()[..], b"a"].concat());
    }
    std::fs::write(&path, bytes).unwrap();
    let message = drain(&path).unwrap_err().to_string();
    assert!(message.contains("more than 2000 subscriptions"), "{message}");
}

#[test]
fn unsupported_formats_are_named() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("log.csv");
    for (bytes, words) in [
        (&b"#ROSBAG V2.0\n"[..], "without a column of numbers"),
        (b"#ROSBAG V1.2\n", "`rosbag fix`"),
        (b"FEA1\0\0", "pandas.read_feather"),
        (
            b"TDSm\x0E\0\0\0",
            "a TDMS file of LabVIEW, which Dynident does not read; convert it in Python: `nptdms.TdmsFile",
        ),
        (b"MDF     4.10    ", "asammdf.MDF"),
        (b"UnFinMF 4.10    ", "asammdf.MDF"),
        (b"\x0E\x03\x13\x01", "h4toh5"),
        (b"\x80\x04\x95\x20\0\0\0", "a pickle can run any program, so it is never loaded"),
        (b"\x80\x02}q\0", "pandas.read_pickle"),
        (b"\x78\x9C\xED\x9D", "joblib.load"),
        (b"PK\x03\x04\x14\0\0\0\x08\0....[Content_Types].xml....PK\x03\x04..xl/workbook.xml", "pandas.read_excel"),
        (b"PK\x03\x04....mimetypeapplication/vnd.oasis.opendocument.spreadsheet", "a workbook (ods)"),
        (b"PK\x03\x04....simulink/blockdiagram.xml", "a Simulink model (slx)"),
        (b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1", "an old workbook (xls)"),
        (b"ARROW1\0\0", "its end: it is truncated"),
        (b"BZh91AY&SY", "unpack it first"),
        (b"PK\x03\x04nothing", "the list of members is missing"),
        (b"\x1F\x8B\x08\0garbage beyond", "cannot be read"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let message = drain(&path).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    let message = open(scratch.path()).unwrap_err().to_string();
    assert!(message.contains("cannot be read"), "{message}");
    std::fs::write(scratch.path().join("metadata.yaml"), "relative_file_paths:\n  - gone.mcap\n").unwrap();
    let message = open(scratch.path()).unwrap_err().to_string();
    assert!(
        message.contains("`gone.mcap` is not in the folder; recreate the metadata by `ros2 bag reindex`"),
        "{message}"
    );
}

#[test]
fn an_incomplete_data_set_names_the_missing_files() {
    let scratch = tempfile::tempdir().unwrap();
    let set = scratch.path().join("set");
    std::fs::create_dir_all(set.join("meta")).unwrap();
    let golden = folder().join("lerobot_v2");
    let refused = |words: &str| {
        let error = drain(&set).expect_err(words);
        check_message(&error, "set");
        assert!(error.to_string().contains(words), "{error}");
    };
    std::fs::write(set.join("meta/info.json"), "{").unwrap();
    refused("meta/info.json: it is not JSON");
    std::fs::write(set.join("meta/info.json"), "{}").unwrap();
    refused("meta/info.json: it has no `features`");
    std::fs::copy(golden.join("meta/info.json"), set.join("meta/info.json")).unwrap();
    assert!(drain(&set).is_err());
    let chunk = set.join("data/chunk-000");
    std::fs::create_dir_all(&chunk).unwrap();
    refused("it contains no Parquet file; download the complete data set");
    let episodes = golden.join("data/chunk-000");
    std::fs::copy(episodes.join("episode_000000.parquet"), chunk.join("episode_000000.parquet")).unwrap();
    let Contents::Table(table) = open(&set).unwrap().contents else { panic!() };
    assert!(table.notes().contains(&"the files of 2 of 3 episodes are missing".to_owned()), "{:?}", table.notes());
    assert_eq!(drain(&set).unwrap(), 15);
    // The pointer of Git LFS to a missing file; a table with other columns.
    let second = chunk.join("episode_000001.parquet");
    std::fs::write(&second, "version https://git-lfs.github.com/spec/v1\n").unwrap();
    refused("episode_000001.parquet: cannot be read (it is a Git LFS pointer");
    std::fs::copy(folder().join("snappy.parquet"), &second).unwrap();
    refused("episode_000001.parquet: its columns, or the lengths of its lists, differ from those of the first file");
}

#[test]
fn an_incomplete_trace_names_the_missing_files() {
    let scratch = tempfile::tempdir().unwrap();
    let golden = |name: &str| std::fs::read(folder().join("trace").join(name)).unwrap();
    let refused = |header: &[u8], words: &str| {
        let path = scratch.path().join("run_NextGenDrive#1.dat");
        std::fs::write(&path, header).unwrap();
        let error = drain(&path).expect_err(words);
        check_message(&error, "run_NextGenDrive#");
        assert!(error.to_string().contains(words), "{error}");
    };
    let header = golden("run_NextGenDrive#1.dat");
    let changed = |from: &str, to: &str| {
        let text: String = header.iter().map(|byte| char::from(*byte)).collect();
        assert!(text.contains(from));
        text.replacen(from, to, 1).chars().map(|letter| letter as u8).collect::<Vec<_>>()
    };
    refused(&header, "channel `Istposition`: file `renamed_NextGenDrive#1.r64` is missing; copy the whole trace again");
    let data = golden("run_NextGenDrive#1.r64");
    let beside = scratch.path().join("run_NextGenDrive#1.r64");
    std::fs::write(&beside, &data[..data.len() - 8]).unwrap();
    refused(&header, "`run_NextGenDrive#1.r64` ends before 40 values");
    std::fs::write(&beside, &data).unwrap();
    refused(b"DIAEXTENDED\r\n#BEGINCHANNELHEADER\r\n200,Zeit\r\n", "it contains no complete channel");
    refused(&changed("221,1\r\n", "221,1\r\n222,3\r\n"), "222 is 3, but 2 channels are interleaved");
    refused(&changed("214,REAL64", "214,REAL32"), "interleaved channels have different types");
    refused(&changed("220,40", "220,-40"), "its length (220) is missing");
    std::fs::write(scratch.path().join("run_NextGenDrive#2.dat"), changed("241,0.004", "241,0.002")).unwrap();
    refused(&header, "its time differs from that of the first drive");
}

#[test]
fn inputs_found_by_fuzzing_are_rejected() {
    // An attachment longer than its chunk; a column with a negative offset; a page shorter than its packed levels; a
    // page with a missing dictionary; byte stream split data shorter than its values.
    let corpus = ["bags/wrong_length.mcap", "parquet/negative_place.parquet", "parquet/short_page.parquet"];
    let seeds = corpus.map(|file| format!("../../fuzz/corpus/{file}"));
    let refused = ["tests/refused/no_dictionary.parquet", "tests/refused/short_split.parquet"];
    for file in seeds.iter().map(String::as_str).chain(refused) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        check_message(&drain(&path).expect_err(file), file.rsplit('/').next().unwrap());
    }
}
