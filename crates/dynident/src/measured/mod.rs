//! From logs to regressor rows, and what the rows prove: the part that identification and validation share.

pub(crate) mod evidence;
pub(crate) mod lag;
pub(crate) mod lag_rows;
pub(crate) mod motion_log;
pub(crate) mod residuals;
pub(crate) mod rows;
pub(crate) mod torque_trace;
