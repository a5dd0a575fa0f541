//! Broken logs: each causes an error that names the file, the place and the fix, and never a panic.
use super::file_with;
use dynident_recording::{ImportReport, LogFormat, MotionBlock, MotionSettings, MotionStream, RecordingError};
use std::path::{Path, PathBuf};

/// File in `tests/broken`, and a part of its message.
const BROKEN: &[(&str, &str)] = &[
    ("empty.csv", "no data rows"),
    ("only_newlines.csv", "no data rows"),
    ("only_comments.csv", "no data rows"),
    ("only_bom.csv", "no data rows"),
    ("only_header.csv", "no data rows"),
    ("header_and_comments.csv", "no data rows"),
    ("binary_zeros.csv", "NUL byte"),
    ("elf.csv", "NUL byte"),
    ("recording.mcap", "MCAP"),
    ("random_bytes.csv", "no column `t`"),
    ("nul_in_a_field.csv", ":3, column `q2` (2)"),
    ("invalid_utf8_field.csv", ":3, column `q1` (1)"),
    ("invalid_utf8_header.csv", "no column `q1`"),
    ("nan.csv", ":3, column `q1` (1): `NaN`"),
    ("inf.csv", ":3, column `tau1` (3): `inf`"),
    ("minus_infinity.csv", ":3, column `q2` (2): `-Infinity`"),
    ("overflowing_exponent.csv", ":3, column `tau2` (4): `1e999`"),
    ("empty_field.csv", ":3, column `q1` (1): ``"),
    ("blank_field.csv", ":3, column `q1` (1): ``"),
    ("nan_time.csv", ":3, column `t` (0): `nan`"),
    ("word.csv", ":3, column `q1` (1): `zero` is not a number"),
    ("hexadecimal.csv", "`0x1F` is not a number"),
    ("unit_in_field.csv", "`1.5 rad` is not a number"),
    ("two_points.csv", "`1.5.2` is not a number"),
    ("thousands_separator.csv", "decimal points instead"),
    ("duplicate_names.csv", "duplicate column name `q1` (columns 1 and 2)"),
    ("duplicate_time.csv", "duplicate column name `t` (columns 0 and 1)"),
    ("missing_column.csv", "no column `q2`"),
    ("other_case.csv", "no column `t`"),
    ("misspelt.csv", "did you mean `tau_2`"),
    ("no_header.csv", "no header line"),
    ("ragged_short.csv", ":3: 3 fields where 5"),
    ("ragged_long.csv", ":3: 6 fields where 5"),
    ("first_row_short.csv", ":2: 2 fields where 5"),
    ("trailing_comma_in_rows.csv", ":2: 6 fields where 5"),
    ("unclosed_quote.csv", ":3: 2 fields where 5"),
    ("semicolons_after_header.csv", ":2: 1 fields where 5"),
    ("pipes.csv", "is `delimiter` right"),
    ("decimal_commas_and_commas.csv", "decimal commas?"),
    ("one_row.csv", "does not determine a sampling rate"),
    ("two_rows.csv", "filter needs 16"),
    ("standing_clock.csv", "does not determine a sampling rate"),
    ("backward_clock.csv", "does not determine a sampling rate"),
    ("clock_of_infinitesimal_steps.csv", "does not determine a sampling rate"),
    ("huge_positions.csv", "beyond 1e60 or not finite after scaling"),
    ("huge_time.csv", "does not determine a sampling rate"),
    ("gaps_everywhere.csv", "filter needs 16"),
    ("html.csv", "no column `t`"),
    ("json.csv", "no column"),
    ("zip.csv", "the list of members is missing"),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

fn joints() -> Vec<String> {
    vec!["shoulder".to_owned(), "elbow".to_owned()]
}

const FORMAT: &str = r#"
    time = { column = "t" }
    position = { columns = "q{1..2}", unit = "rev" }
    torque = { columns = "tau{1..2}" }
"#;

fn import(file: &Path, format: &str) -> Result<(usize, ImportReport), RecordingError> {
    let format: LogFormat = toml::from_str(format).unwrap();
    let mut stream = MotionStream::open(&format, file, &joints(), &MotionSettings::default())?;
    let (mut block, mut rows) = (MotionBlock::default(), 0);
    while stream.next_block(&mut block)? {
        assert!(block.q.iter().chain(&block.dq).chain(&block.ddq).chain(&block.tau).all(|x| x.is_finite()));
        rows += block.rows;
    }
    Ok((rows, stream.report()))
}

#[test]
fn every_broken_file_has_its_message() {
    for (name, words) in BROKEN {
        let message = import(&folder().join(name), FORMAT).expect_err(name).to_string();
        assert!(message.contains(words), "{name}: {message}");
        assert!(message.contains(name), "{name}: {message}");
        // The fix follows a semicolon or is in brackets.
        assert!(message.contains(';') || message.contains('('), "{name}: {message}");
    }
}

#[test]
fn the_table_names_every_file() {
    let mut files: Vec<String> =
        std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    let mut table: Vec<&str> = BROKEN.iter().map(|(name, _)| *name).collect();
    table.sort_unstable();
    assert_eq!(files, table);
}

#[test]
fn missing_files_folders_and_endless_lines_are_named() {
    let message = import(&folder().join("absent.csv"), FORMAT).unwrap_err().to_string();
    assert!(message.contains("absent.csv: cannot be read"), "{message}");
    let message = import(&folder(), FORMAT).unwrap_err().to_string();
    assert!(message.contains("cannot be read"), "{message}");
    let file = file_with([&b"t,q1,q2,tau1,tau2\n0,0,0,0,0\n"[..], &vec![b'1'; (1 << 20) + 10]].concat());
    let message = import(file.path(), FORMAT).unwrap_err().to_string();
    assert!(message.contains(":3: the line is longer than"), "{message}");
}

#[test]
fn absurd_filters_and_values_are_refused_and_large_ones_stay_finite() {
    let file = file_with(rows(200));
    let format: LogFormat = toml::from_str(FORMAT).unwrap();
    for (settings, words) in [
        ("trim_s = -1.0", "trim_s"),
        ("trim_s = 30.0", "longest uninterrupted piece has 200 samples"),
        ("differentiator = { method = \"butterworth\", cutoff_hz = 1e-9 }", "cutoff_hz"),
        ("differentiator = { method = \"butterworth\", cutoff_hz = 80.0 }", "half the sampling rate"),
        ("differentiator = { method = \"butterworth\", order = 99 }", "order"),
        ("differentiator = { method = \"savitzky-golay\", window = 301 }", "needs 301"),
        ("differentiator = { method = \"savitzky-golay\", window = 1000001 }", "window"),
        ("differentiator = { method = \"central-differences\", order = 7 }", "order"),
    ] {
        let settings: MotionSettings = toml::from_str(settings).unwrap();
        let mut block = MotionBlock::default();
        let result =
            MotionStream::open(&format, file.path(), &joints(), &settings).and_then(|mut s| s.next_block(&mut block));
        let message = result.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    let lines = (0..200).map(|i| format!("{},{}e59,-1e60,1e60,1e-300\n", f64::from(i) * 0.01, f64::from(i % 7)));
    let large = file_with(lines.fold("t,q1,q2,tau1,tau2\n".to_owned(), |text, line| text + &line));
    let format = FORMAT.replace("rev", "rad");
    assert!(import(large.path(), &format).is_ok());
}

fn rows(n: usize) -> String {
    use std::fmt::Write as _;
    let mut text = "t,q1,q2,tau1,tau2\n".to_owned();
    for i in 0..n {
        let t = i as f64 * 0.01;
        writeln!(text, "{t:.2},{},{},{},{}", t.sin(), t.cos(), 1.0 + t, 2.0 - t).unwrap();
    }
    text
}

#[test]
fn a_cut_off_last_line_is_left_out_and_reported() {
    for tail in ["0.50,0.1", "0.50,0.1\n", "0.50,0.1,0.2,0.3,-", "0.50,0.1,0.2,1.2e"] {
        let file = file_with(&(rows(50) + tail));
        let (samples, report) = import(file.path(), FORMAT).unwrap();
        assert_eq!((samples, report.rows), (50, 50), "{tail:?}");
        assert!(report.dropped.truncated.unwrap().ends_with(":52"), "{tail:?}");
    }
    // A missing newline at the end is valid.
    let (samples, report) = import(file_with(rows(50).trim_end()).path(), FORMAT).unwrap();
    assert_eq!((samples, report.dropped.truncated), (50, None));
}

#[test]
fn rows_with_missing_values_can_be_dropped() {
    let text = rows(50).replace("\n0.20,", "\n0.20,nan,").replace("\n0.30,", "\n0.30,,");
    let cut = text.lines().map(|line| line.split(',').take(5).collect::<Vec<_>>().join(",") + "\n").collect::<String>();
    let file = file_with(&cut);
    assert!(import(file.path(), FORMAT).unwrap_err().to_string().contains("set missing = \"drop\""));
    let (samples, report) = import(file.path(), &format!("missing = \"drop\"\n{FORMAT}")).unwrap();
    // The two holes are interpolated.
    assert_eq!((samples, report.rows, report.dropped.missing), (50, 48, 2));
}

#[test]
fn selections_pick_rows_and_refuse_nothing() {
    let file = file_with(rows(100));
    for (selection, expected, first) in [
        ("rows = [10, 60]", 50, 10),
        ("fraction = [0.0, 0.65]", 65, 0),
        ("fraction = [0.7, 1.0]", 30, 70),
        ("time_range_s = [0.295, 0.595]", 30, 30),
        ("rows = [50, 5000]", 50, 50),
    ] {
        let format: LogFormat = toml::from_str(&format!("{selection}\n{FORMAT}")).unwrap();
        let mut stream = MotionStream::open(&format, file.path(), &joints(), &MotionSettings::default()).unwrap();
        let mut block = MotionBlock::default();
        assert!(stream.next_block(&mut block).unwrap());
        assert_eq!(block.rows, expected, "{selection}");
        assert!((block.first_time_s - f64::from(first) * 0.01).abs() < 1e-9, "{selection}: {}", block.first_time_s);
        // Torques are not filtered: 1 + t.
        assert!((block.tau[0] - 1.0 - f64::from(first) * 0.01).abs() < 1e-9, "{selection}");
    }
    for selection in ["rows = [500, 600]", "time_range_s = [7.0, 8.0]", "fraction = [0.0, 0.001]"] {
        let message = import(file.path(), &format!("{selection}\n{FORMAT}")).unwrap_err().to_string();
        assert!(
            message.contains("leaves no row") && message.contains(selection.split(' ').next().unwrap()),
            "{message}"
        );
    }
}

#[test]
fn paired_files_must_contain_the_same_rows() {
    let folder = tempfile::tempdir().unwrap();
    let format = r#"
        rate_hz = 100.0
        position = { columns = ["q1", "q2"] }
        torque = { file = "torque.csv", columns = [3, 4] }
    "#;
    let main = folder.path().join("position.csv");
    std::fs::write(&main, rows(60)).unwrap();
    for (text, fits) in [(rows(60), true), (rows(59) + "0.59,0.1", true), (rows(59), false), (rows(80), false)] {
        std::fs::write(folder.path().join("torque.csv"), text).unwrap();
        let result = import(&main, format);
        assert_eq!(result.is_ok(), fits, "{result:?}");
        if let Err(error) = result {
            assert!(error.to_string().contains("must contain the same samples"), "{error}");
        }
    }
}

#[test]
fn formats_are_checked_key_by_key() {
    let file = file_with(rows(50));
    for (format, key) in [
        ("position = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }", "`time`"),
        ("rate_hz = -5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }", "`rate_hz`"),
        ("rate_hz = nan\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }", "`rate_hz`"),
        ("rate_hz = 1e300\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }", "`rate_hz`"),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..3}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`position.columns`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..99999999}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`position.columns`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\", unit = \"furlong\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`position.unit`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\", unit = \"rad\" }",
            "`torque.unit`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\", scale = [1.0] }",
            "`torque.scale`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\", scale = 0.0 }",
            "`torque.scale`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\", sign = 2 }",
            "`torque.sign`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\", offset = inf }",
            "`torque.offset`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\", matrix = [[1.0]] }\ntorque = { columns = \"tau{1..2}\" }",
            "`position.matrix`",
        ),
        (
            "rate_hz = 5.0\nposition = { columns = \"q{1..2}\", inverse_matrix = [[1.0, 1.0], [1.0, 1.0]] }\ntorque = { columns = \"tau{1..2}\" }",
            "`position.inverse_matrix`",
        ),
        (
            "rate_hz = 5.0\nrows = [5, 5]\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`rows`",
        ),
        (
            "rate_hz = 5.0\nfraction = [0.5, 1.5]\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`fraction`",
        ),
        (
            "rate_hz = 5.0\nmax_gap_steps = 0.0\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`max_gap_steps`",
        ),
        (
            "rate_hz = 5.0\ndelimiter = \"x\"\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }",
            "`delimiter`",
        ),
    ] {
        let message = import(file.path(), format).unwrap_err().to_string();
        assert!(message.contains(key) && message.contains(';'), "{key}: {message}");
    }
    for format in ["position = 1", "rate_hz = 1.0\nunknown = 2", "header = \"perhaps\""] {
        assert!(toml::from_str::<LogFormat>(format).is_err(), "{format}");
    }
}
