use super::{KeptLog, LogPass, ParallelFilterSettings};
use crate::progress::Silent;
use crate::recording::Recording;
use crate::regressor_model::RegressorModel;
use dynident_recording::{DifferentiatorSettings, JointSamples, MotionSettings};
use std::sync::OnceLock;

/// A recording with its filters and stored motion, for tests of passes.
pub(crate) struct TestLog {
    recording: Recording,
    motion: MotionSettings,
    filter: ParallelFilterSettings,
    pub(crate) kept: OnceLock<KeptLog>,
}

impl TestLog {
    pub(crate) fn new(joints: &[String]) -> Self {
        let differentiator = DifferentiatorSettings::default().with_cutoff(4.0);
        Self {
            recording: recording(joints),
            motion: MotionSettings { differentiator, ..MotionSettings::default() },
            filter: ParallelFilterSettings::default(),
            kept: OnceLock::new(),
        }
    }

    /// A single-threaded pass over all samples. The parallel filter keeps torque above the frequency band of the
    /// motion.
    pub(crate) fn pass<'p>(&'p self, model: &'p RegressorModel) -> LogPass<'p> {
        LogPass {
            recording: &self.recording,
            model,
            motion: &self.motion,
            filter: &self.filter,
            torque_hz: Some(12.0),
            reader_thread: false,
            most_samples: None,
            progress: &Silent,
            kept: Some(&self.kept),
        }
    }
}

/// A log at 500 Hz with two gaps and some torque outliers.
fn recording(joints: &[String]) -> Recording {
    let rows = (0..20_000).filter(|row| !(7_000..7_300).contains(row) && !(15_000..15_500).contains(row));
    let time_s: Vec<f64> = rows.map(|row| f64::from(row) / 500.0).collect();
    let wave = |joint: usize, t: f64| (0.9 * t + joint as f64).sin() + 0.2 * (2.3 * t).cos();
    let columns = |of: &dyn Fn(usize, f64) -> f64| {
        (0..joints.len()).map(|joint| time_s.iter().map(|t| of(joint, *t)).collect()).collect::<Vec<Vec<f64>>>()
    };
    let q = columns(&wave);
    let mut tau = columns(&|joint, t| 10.0 * wave(joint, t + 0.3));
    for (joint, tau) in tau.iter_mut().enumerate() {
        tau[2_000 + 37 * joint] = 1e4;
    }
    let samples = JointSamples::at_times(time_s.clone(), q, tau);
    Recording::training("log", samples.into_log("log", joints).unwrap())
}
