//! What jobs write: one type for each file, and how a result is read back.

pub(crate) mod identification;
pub(crate) mod log_summary;
pub(crate) mod sections;
pub(crate) mod stored;
pub(crate) mod urdf;
pub(crate) mod validation;
