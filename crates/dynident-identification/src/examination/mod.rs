//! Tests of an estimate on the logs: lags and sign of the torque, residuals, prediction errors on held-out logs.

mod finer_motion;
mod friction_sign;
mod held_out;
mod motion_band;
mod motion_trace;
mod nominal_agreement;
mod own_offsets;
mod position_torque;
mod residuals;
mod stiction;
mod torque_sign;
mod torque_trace;
mod training;

pub use crate::examination_settings::ExaminationSettings;
pub use crate::lag::{
    LagCandidates, LagChoice, LagFit, LagKind, LagRounds, TorqueLag, delay_findings, lag_fit, lags_of_recordings,
    pooled_delay,
};
pub use friction_sign::{FrictionSign, friction_sign_findings, friction_signs};
pub use held_out::{HeldOutExamination, LogValidation, ModelUnderTest, WithoutEvents, examine_held_out};
pub use motion_trace::MotionTrace;
pub use nominal_agreement::{PriorAgreement, agreement_findings};
pub use own_offsets::{OwnOffset, OwnOffsets};
pub use position_torque::{PositionTorque, position_torque_findings, position_torques};
pub use residuals::{JointResiduals, TorqueBand, Uncertainty};
pub use stiction::Stiction;
pub use torque_sign::{TorqueSignCheck, sign_evidence, sign_findings};
pub use torque_trace::{EventTrace, JointTrace, LogTrace};
pub use training::examine_training;

pub(crate) use held_out::tested_on;
pub(crate) use motion_band::MotionBand;
