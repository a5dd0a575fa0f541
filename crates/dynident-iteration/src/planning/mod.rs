//! Planning of the motion of the next run.

pub(crate) mod planned_run;
pub(crate) mod planner;
pub(crate) mod redesign;
