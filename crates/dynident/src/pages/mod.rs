//! Contents of each `report.html`, and plots of designs.

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

/// Prevents line breaks in a unit and raises its exponents.
fn unit(unit: &str) -> String {
    unit.replace(' ', "\u{a0}").replace("^2", "²")
}
