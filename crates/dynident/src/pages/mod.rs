//! The pages and pictures that people look at: what stands in each `report.html`, and beside a design.

mod check;
pub(crate) mod design;
pub(crate) mod identification;
pub(crate) mod iteration;
mod payloads;
mod provenance;
mod torque_check;
