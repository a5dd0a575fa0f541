//! Every available public recording, from its format in TOML to motion and findings.
#![allow(clippy::print_stdout, reason = "helpers of tests; the findings are printed for inspection")]

use dynident_recording::{ImportReport, Level, LogFormat, MotionBlock, MotionSettings, MotionStream};
use dynident_testing::recordings;

fn joints(n: usize) -> Vec<String> {
    (1..=n).map(|i| format!("joint_{i}")).collect()
}

struct Import {
    report: ImportReport,
    rows: usize,
    dq: f64,
    ddq: f64,
}

fn import(file: &str, n: usize, format: &str) -> Option<Import> {
    import_trimmed(file, n, format, 0.0)
}

fn import_trimmed(file: &str, n: usize, format: &str, trim_s: f64) -> Option<Import> {
    let file = recordings()?.join(file);
    let format: LogFormat = toml::from_str(format).unwrap();
    let settings = MotionSettings { trim_s, ..MotionSettings::default() };
    let mut stream = MotionStream::open(&format, &file, &joints(n), &settings).unwrap();
    let (mut block, mut rows, mut dq, mut ddq) = (MotionBlock::default(), 0, 0.0_f64, 0.0_f64);
    while stream.next_block(&mut block).unwrap() {
        rows += block.rows;
        for values in [&block.q, &block.dq, &block.ddq, &block.tau] {
            assert_eq!(values.len(), n * block.rows);
            assert!(values.iter().all(|value| value.is_finite()));
        }
        dq = block.dq.iter().fold(dq, |max, x| max.max(x.abs()));
        ddq = block.ddq.iter().fold(ddq, |max, x| max.max(x.abs()));
    }
    let report = stream.report();
    println!(
        "{}: {rows} rows, |dq| <= {dq:.3}, |ddq| <= {ddq:.3}, cut-off {:.3}",
        report.file, report.cutoff.cutoff_hz
    );
    println!("  {:?}\n  {}", report.cutoff.joints_hz, report.cutoff.evidence);
    for finding in &report.findings {
        println!("  {:?} {}: {}", finding.level, finding.channel, finding.message);
    }
    Some(Import { report, rows, dq, ddq })
}

fn has(import: &Import, level: Level, channel: &str, words: &str) -> bool {
    import.report.findings.iter().any(|f| f.level == level && f.channel == channel && f.message.contains(words))
}

#[test]
fn kuka_lwr4plus() {
    for file in ["traj1.csv", "traj2.csv", "traj3.csv"] {
        let format = r#"
            time = { column = "t_s" }
            position = { columns = "q{1..7}_rad" }
            velocity = { columns = "qd{1..7}_rad_s" }
            acceleration = { columns = "qdd{1..7}_rad_s2" }
            torque = { columns = "tau{1..7}_Nm", unit = "N m" }
        "#;
        // The source's filter has distorted the first and last second.
        let Some(import) = import_trimmed(&format!("kuka_lwr4plus/{file}"), 7, format, 1.0) else { return };
        assert_eq!(import.report.rows, 5027);
        // The even grid may differ from the rows by the rounding of the rate.
        assert!(import.rows.abs_diff(4627) <= 1, "{}", import.rows);
        assert!((import.report.rate_hz - 200.0).abs() < 0.1);
        assert!(import.report.clock.uniform, "{}", import.report.clock.evidence);
        // The steps of the three logs range from 3.2 to 6.8 ms.
        assert!((0.00315..0.0047).contains(&import.report.steps.min_s), "{:?}", import.report.steps);
        assert!((0.0053..0.00685).contains(&import.report.steps.max_s), "{:?}", import.report.steps);
        // The source was filtered at 8 Hz.
        assert!((1.0..16.0).contains(&import.report.cutoff.cutoff_hz));
        assert!(import.dq < 2.0 && import.ddq < 6.0, "{} {}", import.dq, import.ddq);
        for comparison in &import.report.velocity {
            assert!(comparison.relative_rms_difference < 0.1, "{comparison:?}");
            assert!(comparison.lag.unwrap().correlation > 0.98, "{comparison:?}");
        }
    }
}

#[test]
fn ur10() {
    let format = r#"
        time = { column = "t_s" }
        position = { columns = "q{1..6}_rad" }
        velocity = { columns = "qd{1..6}_rad_s" }
        torque = { columns = "tau{1..6}_Nm" }
    "#;
    let Some(import) = import("ur10_unisa/exciting_trajectory.csv", 6, format) else { return };
    assert_eq!((import.report.rows, import.rows), (3441, 3441));
    assert!((import.report.rate_hz - 125.0).abs() < 1e-3);
    assert_eq!(import.report.gap_count, 0);
    // The source contains nothing above 2 Hz.
    assert!((0.5..6.0).contains(&import.report.cutoff.cutoff_hz));
}

#[test]
fn ur10_model_torques() {
    let format = r#"
        time = { column = "t_s" }
        position = { columns = "q{1..6}_rad" }
        torque = { columns = "tau_model{1..6}_Nm" }
    "#;
    let Some(import) = import("ur10_unisa/model_torques_trajectory.csv", 6, format) else { return };
    assert_eq!(import.rows, 3441);
}

#[test]
fn panda_at_thirty_hertz() {
    let format = r#"
        time = { column = "t_s" }
        position = { columns = "q{1..7}_rad" }
        velocity = { columns = "qd{1..7}_rad_s" }
        torque = { columns = "tau{1..7}_Nm" }
    "#;
    let Some(import) = import("panda_unisa/exciting_trajectory.csv", 7, format) else { return };
    assert_eq!(import.report.rows, 727);
    assert!((import.report.rate_hz - 30.0).abs() < 0.1);
    assert!((1.0..12.1).contains(&import.report.cutoff.cutoff_hz));
}

#[test]
fn tx40_with_motor_angles_and_a_coupled_wrist() {
    let format = r#"
        rate_hz = 5000.0
        rows = [500, 37500]
        [position]
        columns = "Joint_{1..6}"
        inverse_matrix = [
            [32.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 32.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 45.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, -48.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 45.0, 0.0], [0.0, 0.0, 0.0, 0.0, 32.0, 32.0],
        ]
        offset = [0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0]
        [torque]
        file = "curr_data.csv"
        columns = "Joint_{1..6}"
        matrix = [
            [32.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 32.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 45.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, -48.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 45.0, 32.0], [0.0, 0.0, 0.0, 0.0, 0.0, 32.0],
        ]
    "#;
    let Some(import) = import("staubli_tx40/pos_read_data.csv", 6, format) else { return };
    assert_eq!((import.report.rows, import.rows), (37_000, 37_000));
    assert!((2.0..120.0).contains(&import.report.cutoff.cutoff_hz));
    let third = &import.report.channels[2];
    assert!(third.min > -3.2 && third.max < 3.2, "{third:?}");
}

#[test]
fn dfki_pendulum_with_jitter() {
    for (file, rows, rate) in [("00", 4993, 500.0), ("03", 4993, 500.0), ("12", 3452, 620.0)] {
        let format = r#"
            time = { column = "t_s" }
            position = { columns = "q{1..2}_rad" }
            velocity = { columns = "qd{1..2}_rad_s" }
            torque = { columns = "tau{1..2}_Nm" }
            max_gap_steps = 8
        "#;
        let file = format!("dfki_double_pendulum/designC_traj{file}.csv");
        let Some(import) = import(&file, 2, format) else { return };
        assert_eq!(import.report.rows, rows);
        assert!((import.report.rate_hz / rate - 1.0).abs() < 0.1, "{}", import.report.rate_hz);
        assert!(import.report.steps.std_s > 0.02 / rate, "{:?}", import.report.steps);
        assert!(import.report.channels[0].quantisation_step.is_some());
    }
}

#[test]
fn lbr_med7_without_a_clock() {
    let format = r#"
        rate_hz = 100.0
        position = { columns = "q_{0..6}" }
        torque = { columns = "tau_{0..6}", sign = -1 }
    "#;
    let Some(import) = import("kuka_lbr_med7/measurements.csv", 7, format) else { return };
    assert_eq!((import.report.rows, import.rows), (1647, 1647));
    assert!(import.dq < 2.0, "{}", import.dq);
}

#[test]
fn tiago_in_three_files_with_dead_channels() {
    let format = r#"
        time = { column = "t" }
        [position]
        columns = ["- torso_lift_joint_position", "- arm_{1..7}_joint_position"]
        unit = ["m", "rad", "rad", "rad", "rad", "rad", "rad", "rad"]
        [velocity]
        file = "tiago_velocity.csv"
        columns = ["- torso_lift_joint_velocity", "- arm_{1..7}_joint_velocity"]
        [torque]
        file = "tiago_effort.csv"
        columns = ["- torso_lift_joint_effort", "- arm_{1..7}_joint_effort"]
        unit = "raw"
    "#;
    let Some(import) = import("tiago_arm/tiago_position.csv", 8, format) else { return };
    assert_eq!(import.report.rows, 8022);
    assert!((import.report.rate_hz - 100.0).abs() < 1.0);
    for joint in 6..=8 {
        assert!(has(&import, Level::Problem, &format!("torque joint_{joint}"), "mostly dead"), "{joint}");
    }
    assert!(!has(&import, Level::Problem, "torque joint_2", "dead"));
}
