//! Parameters and forecasts from the logs of runs.

pub(crate) mod differentiator_choice;
pub(crate) mod estimate;
pub(crate) mod far_from_rest;
pub(crate) mod forecast;
pub(crate) mod identify_run;
pub(crate) mod lengths;
pub(crate) mod motion;
pub(crate) mod run_logs;
pub(crate) mod run_motion;
pub(crate) mod run_offsets;
pub(crate) mod step_by_step;
