//! What differs from log to log: payloads, offsets, and the unit that torque is logged in.

pub(crate) mod arm;
pub(crate) mod columns;
pub(crate) mod gains;
pub(crate) mod payload_body;
pub(crate) mod payload_result;
pub(crate) mod report;
