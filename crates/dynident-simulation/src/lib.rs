//! **What would it do?** Controllers at a fixed rate, a simulated robot with friction that sticks, sensors as robots have them, and the closed loop
//! of the three.
//!
//! [`closed_loop()`] runs a [`Controller`] on a [`Plant`] along a [`Reference`] and gives a [`Run`]: what truly was, what the controller saw, how
//! well the joints followed, and a [`RunStatus`]. [`SensorSettings::record`] makes of it what a log would hold.

#![forbid(unsafe_code)]

mod closed_loop;
pub mod controllers;
mod error;
mod feedback;
mod per_joint;
mod plant;
mod record;
mod reference;
mod run;
mod sensors;
mod tape;

pub use closed_loop::{LoopSettings, RunLimits, Start, closed_loop};
pub use controllers::{Controller, ControllerModel, ControllerSettings, FrictionCompensation};
pub use error::{SimulationError, require, require_length};
pub use per_joint::PerJoint;
pub use plant::{Disturbance, Integrator, Plant, PlantFault, TimeCourse, with_length_errors, with_placements};
pub use record::Record;
pub use reference::{Reference, ReferenceSample};
pub use run::{Divergence, LimitedQuantity, Run, RunStatus};
pub use sensors::{SensorSettings, SpeedSource};
