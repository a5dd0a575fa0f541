//! A robot that is a function: the simulator's run through it, and a verdict for each of its failures.

use crate::robots::{joints, model, pd, reference};
use dynident_iteration::robot::{ControlledRun, EnvelopeSettings, FunctionRobot, FunctionStop};
use dynident_iteration::{Robot, RobotFault, RobotRun, RobotStatus, RunRequest, StopSignal};

type Outcome = Result<(), FunctionStop>;

fn run(
    envelope: bool,
    stop: Option<&StopSignal>,
    mut function: impl FnMut(&mut ControlledRun) -> Outcome,
) -> (RobotRun, usize) {
    let (reference, controller) = (reference(), pd());
    let envelope = envelope.then(|| EnvelopeSettings::default().envelope(&model()).unwrap());
    let request = RunRequest { envelope: envelope.as_ref(), stop, ..RunRequest::new(1, &reference, &controller) };
    let mut asked = 0;
    let mut robot = FunctionRobot::new(joints(), |mut run: ControlledRun| {
        let said = function(&mut run);
        asked = run.samples_done();
        (run, said)
    });
    let run = robot.run(&request).unwrap();
    (run, asked)
}

fn standing(run: &mut ControlledRun, samples: usize) {
    for sample in 0..samples {
        if run.torque(sample as f64 / 500.0, &[-0.4, 0.3], &[0.0, 0.0]).is_none() {
            break;
        }
    }
}

#[test]
fn what_it_asks_with_is_the_record() {
    let (found, _) = run(true, None, |run| {
        assert_eq!((run.run(), run.reference().samples()), (1, 201));
        for sample in 0..201 {
            let q = [-0.4 + 1e-3 * f64::from(sample) / 201.0, 0.3];
            let tau = run.torque(f64::from(sample) / 500.0, &q, &[0.1, 0.0]).unwrap();
            // Joint PD about the constant reference.
            let expected = [200.0 * (-0.4 - q[0]) - 20.0 * 0.1, 0.0];
            assert!((tau[0] - expected[0]).abs() < 1e-9 && tau[1].abs() < 1e-9, "{tau:?}");
        }
        assert!(run.torque(0.5, &[-0.4, 0.3], &[0.0, 0.0]).is_none());
        Ok(())
    });
    assert!(found.status.is_done(), "{}", found.status);
    assert_eq!((found.record.samples, found.record.q[201], found.record.q[0]), (201, 0.3, -0.4));
    assert!((found.record.tau[200] + 200.0 * (found.record.q[200] + 0.4) + 2.0).abs() < 1e-9);
}

#[test]
fn it_is_stopped_before_the_next_torque() {
    let (found, asked) = run(true, None, |run| {
        standing(run, 10);
        assert!(run.torque(0.02, &[0.2, 0.3], &[0.0, 0.0]).is_none());
        // A function that continues gets no torque.
        assert!(run.torque(0.022, &[-0.4, 0.3], &[0.0, 0.0]).is_none());
        Ok(())
    });
    assert!(matches!(found.status, RobotStatus::LeftEnvelope { .. }), "{}", found.status);
    assert_eq!((asked, found.record.samples), (11, 11));

    let stop = StopSignal::default();
    let (found, asked) = run(false, Some(&stop), |run| {
        standing(run, 5);
        stop.request();
        standing(run, 1);
        Ok(())
    });
    assert!(matches!(found.status, RobotStatus::Interrupted { .. }), "{}", found.status);
    assert_eq!(asked, 5);
}

#[test]
fn what_it_does_wrong_is_named() {
    // Input: time and positions of each call of `torque`.
    let fault = |calls: &[(f64, &[f64])]| {
        let (found, _) = run(false, None, |run| {
            for (time_s, q) in calls {
                run.torque(*time_s, q, &[0.0, 0.0]);
            }
            Ok(())
        });
        match found.status {
            RobotStatus::Failed { fault, .. } => fault,
            other => panic!("{other}"),
        }
    };
    let still: &[f64] = &[0.0, 0.0];
    assert!(matches!(fault(&[(0.0, still), (0.002, still)]), RobotFault::Short { .. }));
    assert!(matches!(fault(&[(0.0, &[0.0])]), RobotFault::WrongJoints { found: 1, .. }));
    assert!(matches!(fault(&[(0.0, &[0.0, f64::NAN])]), RobotFault::NotANumber { .. }));
    assert!(matches!(fault(&[(f64::INFINITY, still)]), RobotFault::NotANumber { .. }));
    assert!(matches!(fault(&[(0.1, still), (0.1, still)]), RobotFault::Time { sample: 1, .. }));
    // Milliseconds in place of seconds.
    assert!(matches!(fault(&[(0.0, still), (2.0, still)]), RobotFault::Clock { sample: 1, .. }));
    let reason = "the cable is out".to_owned();
    let (found, _) = run(false, None, |_| Err(FunctionStop::Robot { reason: reason.clone() }));
    assert_eq!(found.status, RobotStatus::Stopped { reason: reason.clone() });
    let (found, _) = run(false, None, |run| {
        standing(run, 3);
        Err(FunctionStop::Function { reason: reason.clone() })
    });
    assert_eq!(found.status, RobotStatus::Failed { fault: RobotFault::Function { sample: 3, reason }, stopping: None });
}

#[test]
fn the_end_of_a_run_has_a_reason() {
    run(true, None, |run| {
        assert_eq!(run.end_reason(), None);
        standing(run, 201);
        assert!(run.end_reason().unwrap().contains("all samples"));
        Ok(())
    });
    run(true, None, |run| {
        run.torque(0.0, &[2.0, 0.3], &[0.0, 0.0]);
        assert!(run.end_reason().unwrap().contains("out of the envelope"));
        Ok(())
    });
    run(false, None, |run| {
        run.torque(0.0, &[-0.4], &[0.0, 0.0]);
        assert!(run.end_reason().unwrap().contains("q has 1 entries for 2 joints"));
        Ok(())
    });
}
