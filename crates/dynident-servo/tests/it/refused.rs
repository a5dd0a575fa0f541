//! Runs and settings that cannot be simulated are refused with the place.

use dynident_servo::{Run, RunFault, ServoError, ServoSettings};

fn run() -> Run {
    let times_s: Vec<f64> = (0..30).map(|k| 0.02 * f64::from(k)).collect();
    let still = vec![vec![0.0; times_s.len()]];
    Run {
        name: "log".into(),
        commands: still.clone(),
        positions: still,
        times_s,
        payloads: Vec::new(),
        gains: Vec::new(),
    }
}

fn fault(change: impl Fn(&mut Run)) -> RunFault {
    let mut run = run();
    change(&mut run);
    match run.validate(1) {
        Err(ServoError::Run { fault, .. }) => fault,
        other => panic!("{other:?}"),
    }
}

#[test]
fn faults_of_a_run_name_the_sample() {
    run().validate(1).unwrap();
    assert_eq!(fault(|run| run.times_s[7] = run.times_s[6]), RunFault::Stamps { sample: 7 });
    assert_eq!(fault(|run| run.positions[0][3] = f64::NAN), RunFault::NotANumber { sample: 3 });
    assert_eq!(fault(|run| run.commands[0].truncate(9)), RunFault::Lengths);
    assert_eq!(fault(|run| run.commands.clear()), RunFault::Joints { found: 0, expected: 1 });
    assert_eq!(fault(|run| run.times_s.truncate(0)), RunFault::Lengths);
    // A simulation over years would not end.
    let late = fault(|run| run.times_s.iter_mut().skip(20).for_each(|time| *time += 1e9));
    assert!(matches!(late, RunFault::Gap { sample: 20, .. }), "{late:?}");
}

#[test]
fn settings_out_of_range_are_named() {
    let refused = |settings: ServoSettings| match settings.validate() {
        Err(ServoError::Setting { setting, .. }) => setting,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(ServoSettings { step_s: 1e-9, ..ServoSettings::default() }), "step_s");
    assert_eq!(refused(ServoSettings { step_s: f64::NAN, ..ServoSettings::default() }), "step_s");
    assert_eq!(refused(ServoSettings { zero: -1.0, ..ServoSettings::default() }), "zero");
    assert_eq!(refused(ServoSettings { mass: 0.0, ..ServoSettings::default() }), "mass");
}
