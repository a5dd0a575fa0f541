//! A recording for tests of passes.

use crate::recording::Recording;
use dynident_recording::JointSamples;

/// Two holes and some torques that are none, at 500 Hz.
pub(crate) fn recording(joints: &[String]) -> Recording {
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

/// A pass takes as many blocks as it was asked for, from a file or from what is kept.
#[test]
fn a_pass_over_blocks_ends_where_enough_has_passed() {
    use super::{KeptLog, LogPass, ParallelFilterSettings};
    use crate::progress::Silent;
    use crate::regressor_model::RegressorModel;
    use dynident_dynamics::ParametricModel;
    use dynident_recording::{DifferentiatorSettings, MotionSettings};
    use std::sync::OnceLock;

    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
    let model = dynident_model::load_robot(robot).unwrap().model;
    let model = RegressorModel::from(ParametricModel::new(model, Vec::new()).unwrap());
    let recording = recording(&model.joint_names());
    let differentiator = DifferentiatorSettings::default().with_cutoff(4.0);
    let (motion, filter) =
        (MotionSettings { differentiator, ..MotionSettings::default() }, ParallelFilterSettings::default());
    let kept: OnceLock<KeptLog> = OnceLock::new();
    let blocks_of = |most_samples: Option<u64>| {
        let pass = LogPass {
            recording: &recording,
            model: &model,
            motion: &motion,
            filter: &filter,
            torque_hz: None,
            reader_thread: false,
            most_samples,
            progress: &Silent,
            kept: Some(&kept),
        };
        let mut blocks = Vec::new();
        pass.each_block(&mut |block| {
            blocks.push(block.rows);
            Ok(())
        })
        .unwrap();
        blocks
    };
    let some = blocks_of(Some(5_000));
    assert!(kept.get().is_none(), "a part of a log is not kept for the whole");
    let all = blocks_of(None);
    assert!(kept.get().is_some() && all.iter().sum::<usize>() > 18_000 && some.len() < all.len());
    assert_eq!(some, all[..some.len()]);
    let passed: usize = some.iter().sum();
    assert!(passed >= 5_000 && passed - some[some.len() - 1] < 5_000, "{some:?}");
    assert_eq!(blocks_of(Some(5_000)), some, "of what is kept the same part");
}
