//! Settings of an iteration, and the parts of a run that do not depend on data: trajectories, posture, home posture,
//! warm-up.

pub(crate) mod error;
pub(crate) mod gains;
pub(crate) mod home;
pub(crate) mod leg;
pub(crate) mod loop_delay;
pub(crate) mod model_parameters;
pub(crate) mod parameter_shares;
pub(crate) mod posture;
pub(crate) mod rehearsal;
pub(crate) mod run_information;
pub(crate) mod safety;
pub(crate) mod settings;
pub(crate) mod status;
pub(crate) mod torque_check_settings;
pub(crate) mod typical_drives;
pub(crate) mod verdict_settings;
pub(crate) mod warm_up;
