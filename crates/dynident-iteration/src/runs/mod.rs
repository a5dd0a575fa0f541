//! The loop: preparation, commanding, identification, held-out runs, the final fit.

pub(crate) mod before_motion;
pub(crate) mod commanding;
pub(crate) mod course;
pub(crate) mod drive;
pub(crate) mod final_fit;
pub(crate) mod held_out;
pub(crate) mod iteration;
pub(crate) mod run_torque_check;
