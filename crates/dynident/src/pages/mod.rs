//! Contents of each `report.html`, and plots of designs.

mod check;
pub(crate) mod comparison;
pub(crate) mod design;
pub(crate) mod design_page;
pub(crate) mod differences;
mod events;
pub(crate) mod figures;
mod forms;
pub(crate) mod identification;
mod identification_parameters;
pub(crate) mod iteration;
mod iteration_parameters;
mod iteration_remarks;
mod iteration_scene;
mod payloads;
mod provenance;
pub(crate) mod robot;
mod robot_colours;
mod run_figures;
pub(crate) mod run_trace;
pub(crate) mod servo;
mod torque_check;
pub(crate) mod torque_words;
mod verdict;
pub(crate) mod view;

/// Prevents line breaks in a unit and raises its exponents.
fn unit(unit: &str) -> String {
    unit.replace(' ', "\u{a0}").replace("^2", "²")
}
