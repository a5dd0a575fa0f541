//! Samples, motions and expected torque that an observer receives.

use super::simulated_arm::{self, Simulated};
use dynident_iteration::robot::{ExpectedTorque, ObservedSample, SampleObserver};
use dynident_iteration::{BegunMotion, Iteration, RobotRun, Supervisor, iterate_supervised};
use dynident_simulation::Record;

#[derive(Debug, Default)]
struct Samples;

impl SampleObserver for Samples {
    fn sample(&self, _: &ObservedSample<'_>) {}
}

#[derive(Default)]
struct Observing {
    samples: Samples,
    begun: Vec<(usize, Option<ExpectedTorque>)>,
    ended: Vec<Record>,
}

impl Supervisor for Observing {
    fn observer(&self) -> Option<&dyn SampleObserver> {
        Some(&self.samples)
    }

    fn begins(&mut self, begun: &BegunMotion<'_>) {
        assert_eq!(begun.reference.samples(), simulated_arm::reference().samples());
        self.begun.push((begun.motion.run, begun.expected.cloned()));
    }

    fn ended(&mut self, run: &RobotRun) {
        self.ended.push(run.record.clone());
    }
}

/// The prediction of the first run's estimate holds for the torque of the second run.
#[test]
fn a_motion_is_announced_with_its_expected_torque() {
    let mut settings = simulated_arm::settings();
    settings.max_runs = 2;
    let iteration = Iteration::new(simulated_arm::task(), settings).unwrap();
    let mut robot = Simulated::default().robot();
    let mut observing = Observing::default();
    let outcome = iterate_supervised(&iteration, &mut [&mut robot], None, &mut observing).unwrap();
    assert!(outcome.runs[0].accepted && outcome.runs.len() == 2);
    let Observing { begun, ended, .. } = observing;
    assert_eq!((begun[0].0, begun[1].0, begun.len(), ended.len()), (1, 2, 2, 2));
    assert!(begun[0].1.is_none());
    let (expected, record) = (begun[1].1.as_ref().unwrap(), &ended[1]);
    assert!((300..=600).contains(&expected.times_s.len()));
    for joint in 0..2 {
        let measured = &record.tau[record.of(joint)];
        let at = |place: usize| (expected.times_s[place] * record.rate_hz).round() as usize;
        let squares = |of: &dyn Fn(usize) -> f64| (0..expected.times_s.len()).map(|k| of(k).powi(2)).sum::<f64>();
        let error = squares(&|place| measured[at(place)] - expected.torque[joint][place]);
        let torque = squares(&|place| measured[at(place)]);
        // Single samples have noise of 0.05 Nm, and the arm is a few milliradians away from the desired motion.
        assert!(error < 0.1 * 0.1 * torque, "joint {joint}: {}", (error / torque).sqrt());
        // The band is narrow: the torques of the motion are several Nm.
        assert!(expected.half_width_95[joint].iter().all(|half| *half > 0.0 && *half < 1.0));
    }
}
