//! Results as text for people: the most important part first, at most [`WIDTH`](text::WIDTH) columns.

mod benchmark;
mod check;
mod comparison;
mod design;
mod factors;
mod findings;
mod forms;
mod identification;
mod inspection;
mod iteration;
mod load;
mod log;
mod noise;
mod reproduction;
mod servo;
mod servo_design;
mod text;
mod validation;

pub(crate) use benchmark::benchmark;
pub(crate) use check::check;
pub(crate) use comparison::comparison;
pub(crate) use design::design;
pub(crate) use factors::factors;
pub(crate) use identification::identification;
pub(crate) use inspection::{inspection, mended};
pub(crate) use iteration::{iteration, simulation};
pub(crate) use log::log;
pub(crate) use reproduction::reproduction;
pub(crate) use servo::servo;
pub(crate) use servo_design::servo_design;
pub(crate) use validation::validation;
