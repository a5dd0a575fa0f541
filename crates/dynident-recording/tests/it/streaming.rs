//! Streams give the same motion as the whole log for any file layout; random files never cause a panic.
use super::file_with;
use dynident_recording::{
    Derivatives, DifferentiatorSettings, Log, LogFormat, LogReader, LogisticPath, MotionBlock, MotionSettings,
    MotionStream, RawBlock, ReferenceSettings,
};
use proptest::prelude::*;
use std::fmt::Write as _;

fn format(text: &str) -> LogFormat {
    toml::from_str(text).unwrap()
}

#[test]
fn pieces_equal_the_whole_log() {
    let (rate, n) = (1000.0, 60_000_usize);
    let mut text = String::new();
    let mut q = Vec::new();
    for i in 0..n {
        let t = i as f64 / rate;
        // A motion with an offset and with noise far above the cut-off.
        let x = 2.0 + (1.7 * t).sin() + 0.3 * (9.0 * t).cos() + 1e-4 * (i as f64 * i as f64 * 0.1).sin();
        q.push(x);
        writeln!(text, "{x},{}", -x).unwrap();
    }
    let file = file_with(&text);
    let format = format("rate_hz = 1000.0\nposition = { columns = [0] }\ntorque = { columns = [1] }");
    for differentiator in [
        DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(8.0) },
        DifferentiatorSettings::Butterworth { order: 8, cutoff_hz: Some(30.0) },
        DifferentiatorSettings::Butterworth { order: 5, cutoff_hz: None },
        DifferentiatorSettings::CentralDifferences { order: 8 },
        DifferentiatorSettings::SavitzkyGolay { window: 41, degree: 4 },
        DifferentiatorSettings::LowPass { order: 4, cutoff_hz: Some(8.0) },
        DifferentiatorSettings::FivePointCubic { passes: 3, cutoff_hz: Some(20.0) },
        DifferentiatorSettings::SmoothedDifferences { order: 4, window: 21 },
    ] {
        let settings = MotionSettings { differentiator, smooth_torque: true, ..MotionSettings::default() };
        let mut stream = MotionStream::open(&format, file.path(), &["joint".to_owned()], &settings).unwrap();
        let whole = settings.differentiator.build(stream.cutoff().cutoff_hz).unwrap();
        let (mut y, mut dq, mut ddq) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        whole.differentiate(rate, &q, Derivatives { q: &mut y, dq: &mut dq, ddq: &mut ddq }).unwrap();
        let (mut block, mut at, mut blocks) = (MotionBlock::default(), 0, 0);
        while stream.next_block(&mut block).unwrap() {
            for (ours, whole) in [(&block.q, &y), (&block.dq, &dq), (&block.ddq, &ddq)] {
                let scale = whole.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
                for (i, value) in ours.iter().enumerate() {
                    // The documented accuracy of the trait, with a margin of three digits for rounding.
                    assert!((value - whole[at + i]).abs() < 1e-9 * scale, "{settings:?}, sample {}", at + i);
                }
            }
            for i in 0..block.rows {
                assert_eq!(block.tau[i], -q[at + i]);
            }
            let mut smooth = vec![0.0; n];
            whole.smooth(rate, &q, &mut smooth).unwrap();
            for (ours, whole) in block.tau_smooth.iter().zip(&smooth[at..]) {
                assert!((ours + whole).abs() < 1e-9);
            }
            at += block.rows;
            blocks += 1;
        }
        assert_eq!(at, n);
        assert!(blocks > 1, "{settings:?} was not cut into pieces");
    }
}

#[test]
fn gaps_split_the_log_and_trimming_cuts_both_ends() {
    let mut text = "t;q;tau\n".to_owned();
    for i in 0..400 {
        let t = f64::from(i) * 0.01 + if i < 150 { 0.0 } else { 3.0 };
        writeln!(text, "{t};{};{}", t.sin(), t).unwrap();
    }
    let file = file_with(&text);
    let format = format("time = { column = \"t\" }\nposition = { columns = \"q\" }\ntorque = { columns = \"tau\" }");
    let settings = MotionSettings {
        differentiator: DifferentiatorSettings::SavitzkyGolay { window: 11, degree: 4 },
        trim_s: 0.2,
        ..MotionSettings::default()
    };
    let mut stream = MotionStream::open(&format, file.path(), &["joint".to_owned()], &settings).unwrap();
    let (mut block, mut seen) = (MotionBlock::default(), Vec::new());
    while stream.next_block(&mut block).unwrap() {
        for i in 0..block.rows {
            let t = block.first_time_s + i as f64 / block.rate_hz;
            assert!((block.tau[i] - t).abs() < 1e-9);
            // A quartic over eleven samples follows a sine to 1e-8; samples on both sides of the gap are not combined.
            assert!((block.dq[i] - t.cos()).abs() < 1e-6 && (block.ddq[i] + t.sin()).abs() < 1e-4, "{t}");
        }
        seen.push((block.segment, block.rows));
    }
    assert_eq!(seen, [(0, 110), (1, 210)]);
    let report = stream.report();
    assert_eq!((report.gap_count, report.gaps[0].row, report.segments), (1, 149, 2));
}

/// One joint follows the paper's stroke with a lag, the other overshoots by 10 %. Where the second joint is off its
/// stroke, the samples of both are left out, and the remaining samples form separate pieces.
#[test]
fn samples_off_the_stroke_are_cut_out_and_counted() {
    let path = LogisticPath { amplitude: 1.5, omega: 2.0, offset: 0.2, period_s: 20.0, repetitions: 1 };
    let mut text = "t,q1,q2,tau1,tau2\n".to_owned();
    for i in 0..2000 {
        let t = f64::from(i) * 0.01;
        let second = path.offset + 1.1 * (path.at(t)[0] - path.offset);
        writeln!(text, "{t},{},{second},{i},0", path.at(t - 0.05)[0]).unwrap();
    }
    let file = file_with(&text);
    let format =
        format("time = { column = \"t\" }\nposition = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }");
    let reference = ReferenceSettings { joints: vec![path; 2], ..ReferenceSettings::default() };
    let settings = |reference| MotionSettings {
        differentiator: DifferentiatorSettings::PositionMap { reference, max_lag_s: 0.5 },
        ..MotionSettings::default()
    };
    let names = ["a".to_owned(), "b".to_owned()];
    let mut stream = MotionStream::open(&format, file.path(), &names, &settings(reference.clone())).unwrap();
    let (mut block, mut pieces, mut rows) = (MotionBlock::default(), Vec::new(), 0);
    while stream.next_block(&mut block).unwrap() {
        pieces.push(block.segment);
        rows += block.rows;
        for i in 0..block.rows {
            let t = block.first_time_s + i as f64 / block.rate_hz;
            assert!((block.joint(&block.tau, 0)[i] / 100.0 - t).abs() < 1e-9, "the torque of another sample");
            let exact = path.at(t - 0.05)[1];
            // At the splice the velocity is at most 1e-3 of its peak of 0.75.
            assert!((block.joint(&block.dq, 0)[i] - exact).abs() < 1.5e-3, "{t}");
        }
    }
    let report = stream.report();
    assert!(pieces.windows(2).all(|pair| pair[1] == pair[0] + 1), "{pieces:?}");
    assert!(pieces.len() > 1 && report.unmapped_samples > 100, "{pieces:?} {}", report.unmapped_samples);
    assert_eq!(rows as u64 + report.unmapped_samples, 2000);
    assert!(report.findings.iter().any(|finding| finding.message.contains("off the stroke")));

    // A start that is far off causes an error that names `start_s`.
    let far = ReferenceSettings { start_s: -500.0, ..reference };
    let mut stream = MotionStream::open(&format, file.path(), &names, &settings(far)).unwrap();
    let error = loop {
        match stream.next_block(&mut block) {
            Ok(true) => {}
            Ok(false) => panic!("a motion that nobody follows"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(error.contains("position-map") && error.contains("start_s"), "{error}");
}

/// A differentiator that processes pieces gets the reference at the right times.
#[test]
fn a_deviation_is_the_same_in_pieces_as_at_once() {
    let (rate, n) = (500.0, 40_000_usize);
    let path = LogisticPath { amplitude: 1.0, omega: 1.0, offset: 0.0, period_s: 40.0, repetitions: 2 };
    let q: Vec<f64> = (0..n).map(|i| i as f64 / rate).map(|t| path.at(t - 1.0)[0] + 0.01 * (5.0 * t).sin()).collect();
    let mut text = String::new();
    for x in &q {
        writeln!(text, "{x},0").unwrap();
    }
    let file = file_with(&text);
    let format = format("rate_hz = 500.0\nposition = { columns = [0] }\ntorque = { columns = [1] }");
    let differentiator = DifferentiatorSettings::Deviation {
        reference: ReferenceSettings { joints: vec![path], start_s: 1.0, ..ReferenceSettings::default() },
        smoother: Box::new(DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(8.0) }),
        max_lag_s: None,
    };
    let settings = MotionSettings { differentiator, ..MotionSettings::default() };
    let whole = settings.differentiator.build(1.0).unwrap();
    let mut out = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    let [y, dq, ddq] = &mut out;
    whole.differentiate(rate, &q, Derivatives { q: y, dq, ddq }).unwrap();
    let mut stream = MotionStream::open(&format, file.path(), &["joint".to_owned()], &settings).unwrap();
    let (mut block, mut at, mut blocks) = (MotionBlock::default(), 0, 0);
    while stream.next_block(&mut block).unwrap() {
        for (ours, whole) in [(&block.q, &out[0]), (&block.dq, &out[1]), (&block.ddq, &out[2])] {
            for (i, value) in ours.iter().enumerate() {
                // Velocities and accelerations of order one; the reference's time is rounded to 1e-14 s.
                assert!((value - whole[at + i]).abs() < 1e-9, "sample {}", at + i);
            }
        }
        (at, blocks) = (at + block.rows, blocks + 1);
    }
    assert!(at == n && blocks > 1, "{blocks}");
}

#[test]
fn samples_at_jittered_stamps_are_interpolated() {
    let mut text = "t,q,tau\n".to_owned();
    for i in 0..2000 {
        let jitter = 0.6 * ((f64::from(i) * 0.754_877_666).fract() - 0.5);
        let t = (f64::from(i) + jitter) * 0.005;
        writeln!(text, "{t},{},{}", (3.0 * t).sin(), (5.0 * t).cos()).unwrap();
    }
    let file = file_with(&text);
    let format = format("time = { column = \"t\" }\nposition = { columns = \"q\" }\ntorque = { columns = \"tau\" }");
    let mut stream =
        MotionStream::open(&format, file.path(), &["joint".to_owned()], &MotionSettings::default()).unwrap();
    let mut block = MotionBlock::default();
    assert!(stream.next_block(&mut block).unwrap());
    assert!(!stream.report().clock.uniform);
    let first = block.first_time_s;
    let origin = 0.6 * -0.5 * 0.005;
    for i in 0..block.rows {
        let t = origin + first + i as f64 / block.rate_hz;
        // Error of the local cubic: a few h⁴/60 of the fourth derivative.
        assert!((block.tau[i] - (5.0 * t).cos()).abs() < 1e-7, "{i}: {} {}", block.tau[i], (5.0 * t).cos());
    }
}

/// Stamps that are far too late are not a late packet; filling the gap would need millions of samples. Rows after such
/// stamps keep their places, and two such stamps do not cause an endless loop.
#[test]
fn absurd_stamps_are_not_bridged() {
    let (rows, absurd) = (220_u32, 82);
    for (size, wandering, count) in [1e3, 1e6, 1e14, 1e308]
        .into_iter()
        .flat_map(|size| [false, true].map(|wandering| (size, wandering)))
        .flat_map(|(size, wandering)| [1, 2, 5].map(|count| (size, wandering, count)))
    {
        let mut text = "t,q,tau\n".to_owned();
        for i in 0..rows {
            let t = f64::from(i) * 0.01 + if wandering && i == 60 { 0.018 } else { 0.0 };
            let stamp = if (absurd..absurd + count).contains(&i) { size } else { t };
            writeln!(text, "{stamp:e},{},{}", (3.0 * t).sin(), (5.0 * t).cos()).unwrap();
        }
        let file = file_with(&text);
        let format =
            format("time = { column = \"t\" }\nposition = { columns = \"q\" }\ntorque = { columns = \"tau\" }");
        let mut stream =
            MotionStream::open(&format, file.path(), &["joint".to_owned()], &MotionSettings::default()).unwrap();
        let (mut block, mut given) = (MotionBlock::default(), 0);
        while stream.next_block(&mut block).unwrap() {
            given += block.rows;
        }
        // At most the rows with wrong stamps and some adjacent rows are missing.
        let least = (rows - count) as usize - 10;
        assert!((least..=rows as usize).contains(&given), "{count} of {size:e}, {wandering}: {given}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Any table of numbers is read back bit by bit, for any delimiter, newline, header and byte-order mark.
    #[test]
    fn tables_round_trip(
        rows in prop::collection::vec(prop::array::uniform3(-1e12_f64..1e12), 1..40),
        delimiter in prop::sample::select(vec![",", ";", "\t", " ", " ; "]),
        newline in prop::sample::select(vec!["\n", "\r\n"]),
        header: bool,
        bom: bool,
        quoted: bool,
        comment: bool,
        last_newline: bool,
    ) {
        let mut text = if bom { "\u{feff}".to_owned() } else { String::new() };
        if comment {
            text += "# a, comment; here";
            text += newline;
            text += newline;
        }
        if header {
            let names = if quoted { ["\"a\"", "\"b\"", "\"c\""] } else { ["a", "b", "c"] };
            text += &(names.join(delimiter) + newline);
        }
        let lines: Vec<String> = rows.iter().map(|row| row.map(|x| format!("{x:?}")).join(delimiter)).collect();
        text += &lines.join(newline);
        if last_newline {
            text += newline;
        }
        let file = file_with(&text);
        let format = format("rate_hz = 10.0\nposition = { columns = [2, 0] }\ntorque = { columns = [1, 1] }");
        let joints = ["x".to_owned(), "y".to_owned()];
        let mut reader = LogReader::open(&Log::file(file.path(), format, &joints)).unwrap();
        let mut block = RawBlock::default();
        prop_assert!(reader.next_block(&mut block).unwrap());
        prop_assert_eq!(block.rows(), rows.len());
        for (i, row) in rows.iter().enumerate() {
            prop_assert_eq!([block.q[1][i], block.tau[0][i], block.q[0][i]], *row);
            prop_assert_eq!(block.tau[1][i], row[1]);
        }
        prop_assert!(!reader.next_block(&mut block).unwrap());
    }

    /// Random bytes and random near-tables give a result or an error: no panic, no value that is not finite.
    #[test]
    fn no_file_panics(
        bytes in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..400),
            "[-0-9.,;eEinfa\n\r\"# \t]{0,400}".prop_map(String::into_bytes),
            "([-0-9]{1,3}(\\.[0-9]{1,3})?,){2}[-0-9]{1,3}\n([0-9]{1,2},[0-9]{1,2},[0-9]{1,2}\n){0,60}".prop_map(String::into_bytes),
        ],
        drop_missing: bool,
    ) {
        let file = file_with(&bytes);
        let missing = if drop_missing { "missing = \"drop\"" } else { "" };
        let format = format(&format!(
            "{missing}\ntime = {{ column = 0 }}\nposition = {{ columns = [1] }}\ntorque = {{ columns = [2] }}"
        ));
        if let Ok(mut stream) = MotionStream::open(&format, file.path(), &["x".to_owned()], &MotionSettings::default()) {
            let mut block = MotionBlock::default();
            while let Ok(true) = stream.next_block(&mut block) {
                for values in [&block.q, &block.dq, &block.ddq, &block.tau] {
                    prop_assert!(values.iter().all(|x| x.is_finite()));
                }
            }
            prop_assert!(!stream.report().findings.is_empty());
        }
    }
}

/// A counter of microseconds with 32 bits overflows in the log.
#[test]
fn stamps_of_an_overflowing_counter_rise() {
    let stamp = |i: u64| (4_294_967_296 - 300 * 8000 + i * 8000) % 4_294_967_296;
    let mut text = "t_us,q,tau\n".to_owned();
    for i in 0..600 {
        writeln!(text, "{},{:?},0", stamp(i), (0.02 * i as f64).sin()).unwrap();
    }
    let file = file_with(&text);
    let format = format(
        "time = { column = \"t_us\", unit = \"us\" }\nposition = { columns = [\"q\"] }\ntorque = { columns = [\"tau\"] }",
    );
    let log = Log::file(file.path(), format, &["joint".to_owned()]);
    let (mut reader, mut block) = (LogReader::open(&log).unwrap(), RawBlock::default());
    assert!(reader.next_block(&mut block).unwrap());
    for (i, time_s) in block.time_s.iter().enumerate() {
        assert!((time_s - 0.008 * i as f64).abs() < 1e-9, "{i}: {time_s}");
    }
    assert_eq!(block.rows(), 600);
}
