//! Samples in memory give the same motion, bit by bit, as a file with the same numbers.
use super::file_with;
use dynident_recording::{
    ImportReport, JointSamples, Log, LogFormat, MemoryLog, MotionBlock, MotionSettings, MotionStream, RecordingError,
};
use proptest::prelude::*;
use std::fmt::Write as _;

fn joints() -> Vec<String> {
    vec!["shoulder".to_owned(), "elbow".to_owned()]
}

fn motion(log: &Log, settings: &MotionSettings) -> Result<(Vec<MotionBlock>, ImportReport), RecordingError> {
    let mut stream = MotionStream::new(log, settings)?;
    let (mut block, mut blocks) = (MotionBlock::default(), Vec::new());
    while stream.next_block(&mut block)? {
        blocks.push(block.clone());
    }
    Ok((blocks, stream.report()))
}

/// Rows of t, q1, q2, dq1, dq2, tau1, tau2, temperature, with jitter and a gap.
fn rows(n: usize) -> Vec<[f64; 8]> {
    (0..n)
        .map(|i| {
            let jitter = 0.5 * ((i as f64 * 0.754_877_666).fract() - 0.5);
            let t = (i as f64 + jitter) * 0.004 + if i > 2 * n / 3 { 1.0 } else { 0.0 };
            [t, (2.0 * t).sin(), 0.3 * (3.0 * t).cos(), 2.0 * (2.0 * t).cos(), 0.0, 5.0 - t, t * t, 30.0 + t]
        })
        .collect()
}

fn column(rows: &[[f64; 8]], k: usize) -> Vec<f64> {
    rows.iter().map(|row| row[k]).collect()
}

fn file(rows: &[[f64; 8]]) -> tempfile::NamedTempFile {
    let mut text = "t,q1,q2,v1,v2,tau1,tau2,temp\n".to_owned();
    for row in rows {
        // The shortest text that is parsed to the same bits.
        writeln!(text, "{}", row.map(|x| format!("{x:?}")).join(",")).unwrap();
    }
    file_with(text)
}

const CHANNELS: &str = r#"
    time = { column = "t" }
    position = { columns = "q{1..2}" }
    velocity = { columns = "v{1..2}" }
    torque = { columns = "tau{1..2}" }
    temperature = { columns = ["temp", "temp"] }
"#;

#[test]
fn arrays_are_bit_identical_to_a_file_with_the_same_numbers() {
    let rows = rows(20_000);
    let file = file(&rows);
    let arrays = JointSamples {
        dq: vec![column(&rows, 3), column(&rows, 4)],
        temperature_c: vec![column(&rows, 7); 2],
        ..JointSamples::at_times(
            column(&rows, 0),
            vec![column(&rows, 1), column(&rows, 2)],
            vec![column(&rows, 5), column(&rows, 6)],
        )
    };
    let settings = MotionSettings { smooth_torque: true, trim_s: 0.1, ..MotionSettings::default() };
    for selection in ["", "rows = [100, 9000]", "fraction = [0.25, 0.9]", "time_range_s = [3.0, 60.5]"] {
        let format: LogFormat = toml::from_str(&format!("{selection}\n{CHANNELS}")).unwrap();
        let mut from_arrays = arrays.clone().into_log("arrays", &joints()).unwrap();
        from_arrays.format.rows = format.rows;
        from_arrays.format.fraction = format.fraction;
        from_arrays.format.time_range_s = format.time_range_s;
        let (expected, expected_report) =
            motion(&Log::file(file.path(), format.clone(), &joints()), &settings).unwrap();
        let (found, report) = motion(&from_arrays, &settings).unwrap();
        assert!(!expected.is_empty() && expected == found, "{selection}");
        assert_eq!(ImportReport { file: expected_report.file.clone(), ..report }, expected_report, "{selection}");

        let flat = rows.iter().flatten().copied().collect();
        let names = "t,q1,q2,v1,v2,tau1,tau2,temp".split(',').map(str::to_owned).collect();
        let source = MemoryLog::row_major("flat", Some(names), 8, flat).unwrap();
        assert_eq!(motion(&Log::new(source, format, &joints()), &settings).unwrap().0, expected, "{selection}");
    }
}

#[test]
fn errors_name_the_label_and_the_place() {
    let ramp = || (0..200).map(f64::from).collect::<Vec<f64>>();
    let log = |q: Vec<Vec<f64>>, tau| JointSamples::at_rate(100.0, q, tau).into_log("bench run", &joints());
    let message = log(vec![ramp()], vec![ramp(); 2]).unwrap_err().to_string();
    assert!(message.contains("bench run: q has 1 arrays for 2 joints"), "{message}");
    let message = log(vec![ramp(), vec![0.0; 7]], vec![ramp(); 2]).unwrap_err().to_string();
    assert!(message.contains("column 1 (0-based) has 7 values"), "{message}");
    let settings = MotionSettings::default();
    let mut holed = ramp();
    holed[17] = f64::NAN;
    let mut holed = log(vec![ramp(), holed], vec![ramp(); 2]).unwrap();
    let message = motion(&holed, &settings).unwrap_err().to_string();
    assert!(message.starts_with("bench run, row 17, column 1: `NaN`"), "{message}");
    holed.format.missing = dynident_recording::log::Missing::Drop;
    assert_eq!(motion(&holed, &settings).unwrap().1.dropped.missing, 1);
    let message = motion(&log(vec![vec![]; 2], vec![vec![]; 2]).unwrap(), &settings).unwrap_err().to_string();
    assert!(message.starts_with("bench run: no data rows; "), "{message}");
    holed.format.rows = Some([300, 400]);
    let message = motion(&holed, &settings).unwrap_err().to_string();
    assert!(message.starts_with("bench run: the selection (rows = [300, 400]) leaves no row"), "{message}");
    holed.format.torque.as_mut().unwrap().file = Some("torque.csv".into());
    let message = motion(&holed, &settings).unwrap_err().to_string();
    assert!(message.contains("`torque.file`"), "{message}");
    let source = MemoryLog::row_major("flat", None, 8, vec![0.0; 16]).unwrap();
    let by_name: LogFormat = toml::from_str(CHANNELS).unwrap();
    let message = motion(&Log::new(source, by_name, &joints()), &settings).unwrap_err().to_string();
    assert!(message.starts_with("flat: no column `t`") && message.contains("0-based"), "{message}");
    assert!(MemoryLog::row_major("flat", None, 3, vec![0.0; 16]).is_err());
    assert!(MemoryLog::columns("named", Some(vec!["a".to_owned()]), vec![vec![0.0]; 2]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// For any numbers, arrays give the same result as a file with the same numbers.
    #[test]
    fn arrays_and_file_agree(
        steps in prop::collection::vec(-0.2_f64..4.0, 1..80),
        values in prop::collection::vec(prop::array::uniform3(-1e3_f64..1e3), 80),
        drop_missing: bool,
        hole in 0_usize..160,
    ) {
        let mut t = 0.0;
        let mut rows: Vec<[f64; 8]> = Vec::new();
        for (i, (step, [a, b, c])) in steps.iter().zip(&values).enumerate() {
            t += step;
            rows.push([t, *a, if i == hole { f64::NAN } else { *b }, *c, 0.0, a - b, *c, *b]);
        }
        let file = file(&rows);
        let missing = if drop_missing { "missing = \"drop\"" } else { "" };
        let format: LogFormat = toml::from_str(&format!("{missing}\n{CHANNELS}")).unwrap();
        let names = "t,q1,q2,v1,v2,tau1,tau2,temp".split(',').map(str::to_owned).collect();
        let columns = (0..8).map(|k| column(&rows, k)).collect();
        let source = MemoryLog::columns("arrays", Some(names), columns).unwrap();
        let settings = MotionSettings::default();
        let found = motion(&Log::new(source, format.clone(), &joints()), &settings);
        let expected = motion(&Log::file(file.path(), format, &joints()), &settings);
        match (found, expected) {
            (Ok(found), Ok(expected)) => prop_assert_eq!(found.0, expected.0),
            (Err(found), Err(expected)) => {
                // The same error, except for the label.
                prop_assert_eq!(core::mem::discriminant(&found), core::mem::discriminant(&expected));
            }
            (found, expected) => prop_assert!(false, "{:?}\n{:?}", found.is_ok(), expected.is_ok()),
        }
    }
}

#[test]
fn a_report_survives_json() {
    let rows = rows(3000);
    let format: LogFormat = toml::from_str(CHANNELS).unwrap();
    let (_, mut report) =
        motion(&Log::file(file(&rows).path(), format, &joints()), &MotionSettings::default()).unwrap();
    let text = serde_json::to_string(&report).unwrap();
    // Not stored in files.
    report.cutoff.velocity_hz.clear();
    assert_eq!(serde_json::from_str::<ImportReport>(&text).unwrap(), report);
}
