//! The pages and pictures that people look at: what stands in each `report.html`, and beside a design.

mod check;
pub(crate) mod design;
mod forms;
pub(crate) mod identification;
pub(crate) mod iteration;
mod iteration_parameters;
mod iteration_remarks;
mod payloads;
mod provenance;
mod run_figures;
mod torque_check;
