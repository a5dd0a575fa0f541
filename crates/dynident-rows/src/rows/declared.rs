//! Check that a log is within the domain of the torques declared by `[[torque]]`.

use super::samples::in_model_order;
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use dynident_model::terms::{JointMotion, TorqueTerm};
use dynident_recording::MotionBlock;

/// Checks that every declared torque of the model is defined at each sample of a block, except in the end effects of
/// the differentiator.
pub(super) fn require_declared(
    model: &RegressorModel,
    log: &str,
    block: &MotionBlock,
    places: &[usize],
) -> Result<(), LogError> {
    if !model.terms().iter().any(TorqueTerm::is_declared) {
        return Ok(());
    }
    let [begin, end] = block.unsettled;
    let samples = block.rows.saturating_sub(begin + end);
    let mut motion = [Vec::new(), Vec::new(), Vec::new()];
    in_model_order(block, places, begin.min(block.rows), samples, &mut motion);
    let [q, dq, ddq] = &motion;
    let motion = JointMotion { samples, q, dq, ddq };
    for term in model.terms() {
        let (Some(function), Some(sample)) = (term.state_function(), term.undefined(&motion)) else { continue };
        let state = |joint: usize| {
            let (name, q, dq) = (&model.model().joints()[joint].name, motion.q_of(joint), motion.dq_of(joint));
            format!("{name} at {:.4} with velocity {:.4}", q[sample], dq[sample])
        };
        return Err(LogError::Undeclared {
            log: log.to_owned(),
            time_s: block.first_time_s + (begin + sample) as f64 / block.rate_hz,
            torque: term.symbol(),
            law: function.description(),
            at: function.follows().into_iter().map(state).collect::<Vec<_>>().join(", "),
        });
    }
    Ok(())
}
