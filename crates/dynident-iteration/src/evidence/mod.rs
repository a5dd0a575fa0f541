//! Evaluation of a run: noise, clipping, prediction, tracking floor, held-out motion.

pub(crate) mod clipping;
pub(crate) mod expected_torque;
pub(crate) mod held_out_motion;
pub(crate) mod prediction;
pub(crate) mod run_evidence;
pub(crate) mod run_examination;
pub(crate) mod torque_noise;
pub(crate) mod torque_of_all;
pub(crate) mod tracking_floor;
