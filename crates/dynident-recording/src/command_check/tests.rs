use super::*;
use core::f64::consts::TAU;

const COUNT: f64 = TAU / 4096.0;
const STEP_S: f64 = 0.02;
const LIMITS: [Option<[f64; 2]>; 3] = [Some([-1.9, 1.9]); 3];

/// Three joints at 50 Hz for 30 s: first-order response (60 ms) to the command 40 ms earlier, quantised, with sag.
fn motion() -> CommandedMotion {
    let command = |joint: usize, i: usize| {
        let t = i as f64 * STEP_S;
        let sine = 0.3 * (t * (0.9 + 0.4 * joint as f64)).sin() + 0.15 * (t * (2.3 - 0.3 * joint as f64)).sin();
        let step = if (i / (150 + 40 * joint)).is_multiple_of(2) { 0.1 } else { -0.1 };
        sine + step
    };
    let samples = 1500;
    let (mut positions, mut commands) = (vec![0.0; 3 * samples], vec![0.0; 3 * samples]);
    for joint in 0..3 {
        let mut q = command(joint, 0);
        for i in 0..samples {
            let target = command(joint, i.saturating_sub(2)) + 0.03 * joint as f64;
            q += (target - q) * (STEP_S / (0.06 + STEP_S));
            positions[3 * i + joint] = (q / COUNT).round() * COUNT;
            commands[3 * i + joint] = command(joint, i);
        }
    }
    CommandedMotion {
        name: "log".to_owned(),
        joints: ["pan", "lift", "elbow"].map(str::to_owned).to_vec(),
        times_s: (0..samples).map(|i| i as f64 * STEP_S).collect(),
        positions,
        commands,
        rows: (0..samples as u64).collect(),
    }
}

fn each(values: &mut [f64], joint: usize, change: impl Fn(usize, f64) -> f64) {
    values.iter_mut().skip(joint).step_by(3).enumerate().for_each(|(i, value)| *value = change(i, *value));
}

fn found(motion: &CommandedMotion) -> Vec<CommandFinding> {
    check_commands(motion, &LIMITS, &CommandCheckSettings::default())
}

#[test]
fn a_correct_log_has_no_findings() {
    assert_eq!(found(&motion()), []);
    let response = Response::of(&[0.0; 4], &[1.0; 4], 25);
    assert_eq!((response.correlation, response.offset), (0.0, -1.0));
    for samples in [0, 1, 2, 5] {
        let mut short = motion();
        short.times_s.truncate(samples);
        short.positions.truncate(3 * samples);
        short.commands.truncate(3 * samples);
        assert_eq!(found(&short), [], "{samples}");
    }
    // Joints at rest.
    let mut still = motion();
    for joint in 0..3 {
        each(&mut still.commands, joint, |_, _| 0.5);
        each(&mut still.positions, joint, |_, _| 0.5 - 0.08);
    }
    assert_eq!(found(&still), []);
}

/// Commands that a recorder stamps late are not exchanged with positions: the positions have the steps of an encoder.
#[test]
fn late_commands_are_found() {
    for rows in [10, 15, 25] {
        let mut log = motion();
        let commands = log.commands.clone();
        for joint in 0..3 {
            each(&mut log.commands, joint, |i, _| commands[3 * i.saturating_sub(rows) + joint]);
        }
        let [CommandFinding::Late { lag_s, joints: 3 }] = found(&log)[..] else { panic!("{:?}", found(&log)) };
        // The response itself needs 0.1 s.
        assert!((lag_s - (rows as f64 * STEP_S - 0.1)).abs() < 0.041, "{rows} rows: {lag_s}");
    }
}

#[test]
fn exchanged_columns_are_found() {
    let mut log = motion();
    core::mem::swap(&mut log.positions, &mut log.commands);
    let [CommandFinding::Exchanged { lag_s, joints: 3 }] = found(&log)[..] else { panic!("{:?}", found(&log)) };
    assert!((0.06..=0.12).contains(&lag_s), "{lag_s}");
}

#[test]
fn a_clamped_command_is_found_on_its_side() {
    let mut log = motion();
    each(&mut log.positions, 1, |_, q| q.max(-0.25));
    let found_ = found(&log);
    let [CommandFinding::Clamped { joint: 1, side: Side::Lower, limit, command, total_s }] = found_[..] else {
        panic!("{found_:?}")
    };
    assert!((limit + 0.25).abs() < 1e-9 && command < -0.4 && total_s > 1.0, "{found_:?}");
    // A command that jumps beyond the limit and holds.
    let mut log = motion();
    each(&mut log.commands, 0, |i, _| if i % 400 >= 200 { 1.0 } else { 0.0 });
    each(&mut log.positions, 0, |i, _| match i % 400 {
        at @ 205..220 => 0.04 * (at - 205) as f64,
        at @ 5..20 if i > 400 => 0.6 - 0.04 * (at - 5) as f64,
        at if at >= 220 || at < 5 && i >= 400 => 0.6,
        _ => 0.0,
    });
    let found = found(&log);
    assert!(matches!(found[..], [CommandFinding::Clamped { joint: 0, side: Side::Upper, .. }]), "{found:?}");
}

#[test]
fn encoder_jumps_are_found() {
    let mut log = motion();
    each(&mut log.positions, 2, |i, q| if i >= 700 { q + TAU } else { q });
    let turn = found(&log);
    let is_turn = |finding: &CommandFinding| matches!(finding, CommandFinding::Jumps { joint: 2, count: 1, is_turn: true, time_s, .. } if (time_s - 14.0).abs() < 1e-9);
    assert!(turn.len() == 1 && is_turn(&turn[0]), "{turn:?}");
    // One sample is wrong by 64 counts.
    let mut log = motion();
    each(&mut log.positions, 0, |i, q| if i == 333 { q - 64.0 * COUNT } else { q });
    let single = found(&log);
    assert!(matches!(single[..], [CommandFinding::Jumps { joint: 0, count: 1, is_turn: false, .. }]), "{single:?}");
    // A gap of the stamps hides motion, not a jump.
    let mut log = motion();
    log.times_s.iter_mut().skip(700).for_each(|time| *time += 5.0);
    each(&mut log.positions, 2, |i, q| if i >= 700 { q + 0.1 } else { q });
    assert_eq!(found(&log), []);
}

#[test]
fn stamps_without_time_are_found() {
    let fault = |change: fn(f64) -> f64| {
        let mut log = motion();
        log.times_s.iter_mut().for_each(|time| *time = change(*time));
        found(&log)
    };
    assert_eq!(fault(|_| 0.0), [CommandFinding::Stamps { fault: StampFault::Equal }]);
    let whole = fault(f64::floor);
    assert!(whole.contains(&CommandFinding::Stamps { fault: StampFault::WholeSeconds }), "{whole:?}");
    // Stamps that repeat once are only late.
    assert_eq!(fault(|time| (time / 0.04).floor() * 0.04), []);
}

#[test]
fn a_wrong_sign_and_a_wrong_zero_are_found() {
    let mut log = motion();
    each(&mut log.commands, 1, |_, r| -r);
    let sign = found(&log);
    assert!(matches!(sign[..], [CommandFinding::Sign { joint: 1, correlation }] if correlation < -0.9), "{sign:?}");
    let mut log = motion();
    each(&mut log.commands, 0, |_, r| r - 0.5);
    let zero = found(&log);
    assert!(
        matches!(zero[..], [CommandFinding::Offset { joint: 0, offset }] if (offset - 0.5).abs() < 0.02),
        "{zero:?}"
    );
    // Also of a joint that holds still.
    let mut log = motion();
    each(&mut log.commands, 0, |_, _| 0.1);
    each(&mut log.positions, 0, |_, _| 0.5);
    assert!(matches!(found(&log)[..], [CommandFinding::Offset { joint: 0, .. }]), "{:?}", found(&log));
}

#[test]
fn a_command_without_effect_is_found() {
    let mut log = motion();
    each(&mut log.positions, 1, |i, _| if i % 7 == 0 { COUNT } else { 0.0 });
    let still = found(&log);
    assert!(matches!(still[..], [CommandFinding::NoEffect { joint: 1, follows: None, .. }]), "{still:?}");
    // Exchanged joints follow the command of each other.
    let mut log = motion();
    for row in log.commands.chunks_mut(3) {
        row.swap(0, 2);
    }
    let order = found(&log);
    let follows = |joint: usize, other: usize| {
        order.iter().any(|finding| {
            matches!(finding, CommandFinding::NoEffect { joint: own, follows, .. } if (*own, *follows) == (joint, Some(other)))
        })
    };
    assert!(order.len() == 2 && follows(0, 2) && follows(2, 0), "{order:?}");
}

#[test]
fn degrees_are_found() {
    let degrees = |of_position: bool, of_command: bool| {
        let mut log = motion();
        if of_position {
            log.positions.iter_mut().for_each(|q| *q /= DEGREE);
        }
        if of_command {
            log.commands.iter_mut().for_each(|r| *r /= DEGREE);
        }
        found(&log)
    };
    for (of, [position, command]) in
        [(UnitOf::Commands, [false, true]), (UnitOf::Positions, [true, false]), (UnitOf::Both, [true, true])]
    {
        let found = degrees(position, command);
        let is_found = |finding: &CommandFinding| matches!(finding, CommandFinding::Degrees { of: own, joints, .. } if *own == of && joints[..] == [0, 1, 2]);
        assert!(found.len() == 1 && is_found(&found[0]), "{of:?}: {found:?}");
    }
}

#[test]
fn findings_name_joint_and_fix() {
    let log = motion();
    let finding = CommandFinding::Clamped { joint: 2, side: Side::Upper, limit: 1.0, command: 1.6, total_s: 2.0 };
    let text = format!("{}: {}", finding.what(&log.joints), finding.evidence(&log.joints));
    assert!(text.contains("elbow") && text.contains("drop_time_s") && text.contains("1.600"), "{text}");
    assert_eq!(finding.level(), crate::report::Level::Warning);
    let invalid = CommandCheckSettings { min_correlation: 1.5, ..CommandCheckSettings::default() };
    assert!(invalid.validate().unwrap_err().to_string().contains("min_correlation"));
    CommandCheckSettings::default().validate().unwrap();
}
