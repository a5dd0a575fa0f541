//! Selection of friction: terms with nonlinear constants on a grid, then the constants.

mod choice;
mod constants;
mod passes;

pub use choice::{ChosenFriction, choose_friction};

pub(crate) use choice::{
    GridFriction, GridTerms, better_friction, constants_of_all_rows, friction_by_grid, friction_of_logs,
    is_friction_open, stated_friction,
};
