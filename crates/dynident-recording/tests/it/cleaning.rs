//! Detection and treatment of invalid samples in a log.

use dynident_recording::log::OneOrMany;
use dynident_recording::{IgnoredTorque, JointSamples, Level, Log, MotionBlock, MotionSettings, MotionStream, Reason};

struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (core::f64::consts::TAU * self.uniform()).cos()
    }
}

fn truth(t: f64) -> [f64; 4] {
    let parts = [(0.6, 1.3, 0.2), (0.25, 3.1, 1.0), (0.1, 5.3, 2.0)];
    let sum = |f: &dyn Fn(f64, f64, f64) -> f64| parts.iter().map(|(a, w, p)| f(*a, *w, *p)).sum::<f64>();
    let q = sum(&|a, w, p| a * (w * t + p).sin());
    let dq = sum(&|a, w, p| a * w * (w * t + p).cos());
    let ddq = sum(&|a, w, p| -a * w * w * (w * t + p).sin());
    [q, dq, ddq, 2.0 * ddq + 12.0 * q.cos() + 3.0 * dq + 4.0 * dq.signum()]
}

const NAMES: [&str; 2] = ["shoulder", "elbow"];

/// A log of two joints sampled at `times` with the time stamps `stamps`.
fn log(times: &[f64], stamps: &[f64], sigma: [f64; 2]) -> (Log, Vec<Vec<f64>>) {
    let mut random = Random::new(17);
    let mut q = vec![Vec::new(); 2];
    let mut tau = vec![Vec::new(); 2];
    for t in times {
        for joint in 0..2 {
            let [position, _, _, torque] = truth(t + 0.4 * joint as f64);
            q[joint].push(position + sigma[0] * random.normal());
            tau[joint].push(torque + sigma[1] * random.normal());
        }
    }
    let clean = tau.clone();
    let names = NAMES.map(str::to_owned);
    (JointSamples::at_times(stamps.to_vec(), q, tau).into_log("bench", &names).unwrap(), clean)
}

fn blocks(log: &Log, settings: &MotionSettings) -> (Vec<MotionBlock>, MotionStream) {
    let mut stream = MotionStream::new(log, settings).unwrap();
    let (mut blocks, mut block) = (Vec::new(), MotionBlock::default());
    while stream.next_block(&mut block).unwrap() {
        blocks.push(block.clone());
    }
    (blocks, stream)
}

/// Relative RMS errors of velocity and acceleration, without two seconds at the ends.
fn derivative_errors(blocks: &[MotionBlock], end_s: f64, at: impl Fn(f64) -> f64) -> [f64; 2] {
    let (mut squares, mut powers) = ([0.0; 2], [0.0; 2]);
    for block in blocks {
        for row in 0..block.rows {
            let t = block.first_time_s + row as f64 / block.rate_hz;
            if !(2.0..end_s - 2.0).contains(&t) {
                continue;
            }
            for joint in 0..2 {
                let [_, dq, ddq, _] = truth(at(t) + 0.4 * joint as f64);
                let found = [block.joint(&block.dq, joint)[row], block.joint(&block.ddq, joint)[row]];
                for (k, (found, truth)) in found.into_iter().zip([dq, ddq]).enumerate() {
                    squares[k] += (found - truth).powi(2);
                    powers[k] += truth * truth;
                }
            }
        }
    }
    [0, 1].map(|k| (squares[k] / powers[k]).sqrt())
}

fn even(n: usize) -> Vec<f64> {
    (0..n).map(|i| i as f64 * 0.001).collect()
}

#[test]
fn a_drifting_rate_is_followed_and_jitter_does_not_leak() {
    // Blocks of 400 rows at 895 to 1014 Hz with stamps that jitter by a fifth of a step, and encoder noise that hides
    // the jitter from the prediction by neighbours.
    let mut times = vec![0.0];
    for i in 1..21_000_usize {
        let rate_hz = 955.0 + 59.0 * ((i / 400) as f64 * 2.4).sin();
        times.push(times[i - 1] + 1.0 / rate_hz);
    }
    let mut random = Random::new(5);
    let stamps: Vec<f64> = times.iter().map(|t| t + 2e-4 * (random.uniform() - 0.5)).collect();
    let end_s = times[times.len() - 1];
    let (drifting, _) = log(&times, &stamps, [1e-5, 0.05]);
    let (found, stream) = blocks(&drifting, &MotionSettings::default());
    let clock = stream.report().clock;
    assert!(!clock.uniform && clock.drift_steps.is_some_and(|steps| steps > 20.0), "{clock:?}");
    let [dq, ddq] = derivative_errors(&found, end_s, |t| t);
    // The attenuation by the cut-off and the noise are below 0.5 %; an even grid would cause errors of 6 and 12 %.
    assert!(dq < 0.005 && ddq < 0.02, "{dq} {ddq}: {}", clock.evidence);

    // The same jitter about an even grid: samples are not interpolated.
    let times = even(21_000);
    let stamps: Vec<f64> = times.iter().map(|t| t + 2e-4 * (random.uniform() - 0.5)).collect();
    let (even, clean) = log(&times, &stamps, [1e-5, 0.05]);
    let (found, stream) = blocks(&even, &MotionSettings::default());
    assert!(stream.report().clock.uniform, "{:?}", stream.report().clock);
    assert_eq!(found[0].joint(&found[0].tau, 0)[..100], clean[0][..100]);
}

#[test]
fn a_short_gap_is_filled_and_not_used_as_rows() {
    let times: Vec<f64> = even(10_000).into_iter().filter(|t| !(5.0005..5.0075).contains(t)).collect();
    assert_eq!(times.len(), 10_000 - 7);
    let (mut gap, _) = log(&times, &times, [1e-5, 0.05]);
    let (found, stream) = blocks(&gap, &MotionSettings::default());
    let report = stream.report();
    assert_eq!((report.segments, report.bridged), (1, [1, 7]), "{:?}", report.findings);
    let rows: usize = found.iter().map(|block| block.rows).sum();
    assert_eq!(rows, 10_000);
    let mut left_out = Vec::new();
    for block in found.iter().filter(|block| !block.set_aside.is_empty()) {
        let first = (block.first_time_s * 1000.0).round() as usize;
        left_out.extend(
            block
                .set_aside
                .iter()
                .enumerate()
                .filter(|(_, aside)| **aside)
                .map(|(k, _)| (k / block.rows, first + k % block.rows)),
        );
    }
    let expected: Vec<(usize, usize)> = (0..2).flat_map(|joint| (5001..=5007).map(move |row| (joint, row))).collect();
    assert_eq!(left_out, expected);
    let [dq, ddq] = derivative_errors(&found, 10.0, |t| t);
    assert!(dq < 0.005 && ddq < 0.02, "{dq} {ddq}");

    gap.format.bridge_gaps = false;
    let (_, stream) = blocks(&gap, &MotionSettings::default());
    assert_eq!((stream.report().segments, stream.report().bridged), (2, [0, 0]));
    // A gap of one second is not short.
    let times: Vec<f64> = even(10_000).into_iter().filter(|t| !(5.0..6.0).contains(t)).collect();
    let (gap, _) = log(&times, &times, [1e-5, 0.05]);
    let (_, stream) = blocks(&gap, &MotionSettings::default());
    assert_eq!((stream.report().segments, stream.report().bridged), (2, [0, 0]));
}

#[test]
fn outliers_held_torque_and_spikes_are_reported_and_clean_logs_are_unchanged() {
    let times = even(30_000);
    let (clean, torque) = log(&times, &times, [1e-5, 0.05]);
    let (found, stream) = blocks(&clean, &MotionSettings::default());
    assert!(stream.report().set_aside.is_empty(), "{:?}", stream.report().set_aside);
    assert!(found.iter().all(|block| block.set_aside.is_empty()));

    let mut random = Random::new(23);
    let mut q = vec![Vec::new(); 2];
    for t in &times {
        (0..2).for_each(|joint| q[joint].push(truth(t + 0.4 * joint as f64)[0] + 1e-5 * random.normal()));
    }
    let mut spoilt = torque.clone();
    let outliers: Vec<usize> = (0..30_000).filter(|_| random.uniform() < 0.05).collect();
    for &i in &outliers {
        spoilt[0][i] += if random.uniform() < 0.5 { 1.0 } else { -1.0 };
    }
    // Held for 0.2 s, once across the boundary of two blocks of rows.
    for from in [4000, 17_000] {
        let value = spoilt[1][from];
        spoilt[1][from + 1..from + 200].fill(value);
    }
    q[1][22_222] += 0.5;
    let names = NAMES.map(str::to_owned);
    let bad = JointSamples::at_times(times, q, spoilt.clone()).into_log("bench", &names).unwrap();
    let (found, stream) = blocks(&bad, &MotionSettings::default());
    let report = stream.report();
    let of = |reason| report.set_aside.iter().find(|aside| aside.reason == reason).unwrap();
    assert_eq!(report.set_aside.len(), 3, "{:?}", report.set_aside);
    let (outlier, held, spike) = (of(Reason::Outlier), of(Reason::Held), of(Reason::Spike));
    assert_eq!((&outlier.joint[..], &held.joint[..], &spike.joint[..]), ("shoulder", "elbow", "elbow"));
    assert!((outlier.share / 0.05 - 1.0).abs() < 0.1, "{outlier:?}");
    assert_eq!((held.places, held.samples, spike.samples, spike.row), (2, 2 * 199, 1, 22_222), "{held:?}");
    let warnings = report.findings.iter().filter(|finding| finding.level == Level::Warning).count();
    assert!(warnings >= 2 && report.findings.iter().all(|finding| finding.level != Level::Problem), "{report:?}");
    // No valid sample is lost, and few invalid ones remain.
    let left_out: Vec<bool> = found
        .iter()
        .flat_map(|block| (0..block.rows).map(|row| block.set_aside.get(row).copied().unwrap_or(false)))
        .collect();
    let wrong = left_out.iter().enumerate().filter(|(i, out)| **out && !outliers.contains(i)).count();
    let missed = outliers.iter().filter(|i| !left_out[**i]).count();
    assert!(wrong == 0 && missed * 30 < outliers.len(), "{wrong} {missed} of {}", outliers.len());

    let kept = MotionSettings { keep_outliers: true, ..MotionSettings::default() };
    let (found, stream) = blocks(&bad, &kept);
    assert!(stream.report().set_aside.is_empty() && found.iter().all(|block| block.set_aside.is_empty()));
    assert_eq!(found[0].joint(&found[0].tau, 0)[..50], spoilt[0][..50]);
}

#[test]
fn rows_are_left_out_by_number_time_and_status() {
    let names = ["joint".to_owned()];
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    let line = |i: u32| {
        let t = f64::from(i) * 0.01;
        let torque = if i == 30 { String::new() } else { (5.0 * t.sin()).to_string() };
        format!("{t},{},{torque},{}\n", t.cos(), u8::from((200..220).contains(&i)))
    };
    std::fs::write(&file, "t,q,tau,fault\n".to_owned() + &(0..400).map(line).collect::<String>()).unwrap();
    let read = |keys: &str| {
        let text = format!(
            "time = {{ column = \"t\" }}\nposition = {{ columns = [\"q\"] }}\ntorque = {{ columns = [\"tau\"] }}\n{keys}"
        );
        let format: dynident_recording::LogFormat = toml::from_str(&text).unwrap();
        let mut stream = MotionStream::open(&format, &file, &names, &MotionSettings::default())?;
        let mut block = MotionBlock::default();
        while stream.next_block(&mut block)? {}
        Ok::<_, dynident_recording::RecordingError>(stream.report())
    };
    let refused = read("").unwrap_err().to_string();
    assert!(refused.contains("not a finite number"), "{refused}");
    for (keys, rows) in [
        ("drop_rows = [[30, 31]]", 399),
        ("drop_time_s = [[0.295, 0.305], [3.5, 9.0]]", 349),
        ("missing = \"drop\"\ndrop_where = [{ column = \"fault\", equals = 1 }]", 379),
        ("missing = \"drop\"\nkeep_where = [{ column = 3, equals = [0, 7] }, { column = \"q\", above = 0.0 }]", 157),
    ] {
        let report = read(keys).unwrap();
        assert_eq!(report.rows, rows, "{keys}");
        assert!(report.findings.iter().any(|finding| finding.message.contains("left out by the rules")), "{keys}");
    }
    for (keys, words) in [
        ("drop_rows = [[5, 5]]", "`drop_rows`"),
        ("drop_time_s = [[2.0, 1.0]]", "`drop_time_s`"),
        ("drop_where = [{ column = \"fault\" }]", "no value"),
        ("drop_where = [{ column = \"falt\", equals = 1 }]", "`drop_where.column`"),
        ("drop_rows = [[0, 4000]]", "leaves no row"),
    ] {
        let refused = read(keys).unwrap_err().to_string();
        assert!(refused.contains(words), "{keys}: {refused}");
    }
}

/// The motion of the other rows is the same to the last bit, and only the marked torques of one joint are ignored.
#[test]
fn an_ignored_torque_costs_only_its_samples() {
    let times: Vec<f64> = (0..2000).map(|k| 0.005 * f64::from(k)).collect();
    let (log, _) = log(&times, &times, [1e-6, 0.01]);
    let mut partly = log.clone();
    partly.ignored_torque.push(IgnoredTorque { time_s: [4.0, 5.0], joints: vec![1] });
    let settings = MotionSettings::default();
    let [(all, _), (some, _)] = [blocks(&log, &settings), blocks(&partly, &settings)];
    assert_eq!(all.len(), some.len());
    let mut ignored = [0; 2];
    for (all, some) in all.iter().zip(&some) {
        assert_eq!(
            (&all.q, &all.dq, &all.ddq, &all.tau, all.segment),
            (&some.q, &some.dq, &some.ddq, &some.tau, some.segment)
        );
        for (place, _) in some.set_aside.iter().enumerate().filter(|(_, marked)| **marked) {
            let time_s = some.first_time_s + (place % some.rows) as f64 / some.rate_hz;
            assert!((4.0 - 1e-6..5.0 + 1e-6).contains(&time_s), "{time_s}");
            ignored[place / some.rows] += 1;
        }
    }
    assert_eq!(ignored, [0, 201]);
    // With a lag, the torque of a row is that of a later time.
    let late = MotionSettings { torque_lag_s: Some(OneOrMany::One(0.1)), ..settings };
    let first = |block: &MotionBlock| {
        let row = block.set_aside.iter().skip(block.rows).position(|marked| *marked);
        row.map(|row| block.first_time_s + row as f64 / block.rate_hz)
    };
    let found = blocks(&partly, &late).0.iter().find_map(first).unwrap();
    assert!((found - 3.9).abs() < 0.006, "{found}");
}
