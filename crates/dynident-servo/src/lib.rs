//! Identification of servo drives and bodies from recorded commands and measured positions.
//!
//! Use it for robots without torque measurement: servo arms, and every robot with an internal position controller.
//! [`search`] fits the drives ([`Drive`]) and bodies of a [`ServoRobot`] so that its simulated motion for the recorded
//! commands of the [`Run`]s is most similar to the measured motion (output-error method: Gautier, Janot and Vandanjon,
//! IEEE TCST 2013; Brunot et al., ASME JDSMC 142, 2020).
#![forbid(unsafe_code)]

mod command;
mod covariance;
#[cfg(test)]
mod derivative_tests;
mod design;
mod drive;
mod error;
mod fit;
mod floor;
mod law;
mod likelihood;
mod normal;
mod parameters;
mod profile;
mod quantity;
mod rollout;
mod run;
mod sensitivity;
mod settings;
mod start;
mod step;
mod step_state;
mod trust;
mod unknowns;
mod validation;
mod values;

pub use design::{CommandRange, DesignedCommands, Forecast, MotionCheck, ServoDesignSettings, design_commands};
pub use drive::Drive;
pub use error::{RunFault, ServoError};
pub use fit::{Search, Unexplained, search};
pub use floor::{Floor, FloorPoint};
pub use law::DriveLaw;
pub use parameters::{Change, FreeParameter, ServoRobot, robot_at};
pub use quantity::{Axis, Quantity};
pub use run::Run;
pub use settings::ServoSettings;
pub use start::start_drives;
pub use unknowns::unknowns;
pub use validation::{errors, simulate, simulate_with_law};
pub use values::{Scale, ServoValue, values};
