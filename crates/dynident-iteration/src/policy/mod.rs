//! Records of runs, conditions of convergence, and the next step.

pub(crate) mod convergence;
pub(crate) mod friction_chosen;
pub(crate) mod good_log;
pub(crate) mod next_step;
pub(crate) mod record;
pub(crate) mod supervision;
