//! **Simulation**: controllers at a fixed rate, a robot with stiction, realistic sensors, and the closed loop of
//! these three.
//!
//! | task | use |
//! | --- | --- |
//! | simulate a robot | [`Plant`]: a model, torque terms and their values, disturbances, locked joints |
//! | simulate a robot that differs from its description | [`with_length_errors`], [`with_placements`] |
//! | define the motion | [`Reference`]: samples, or a family of trajectories |
//! | select the controller | [`ControllerSettings`], or implement [`Controller`] |
//! | stop a run at limits | [`RunLimits`] in [`LoopSettings`] |
//! | run the loop | [`closed_loop()`] returns a [`Run`]: true motion, measurements of the controller, tracking errors, a [`RunStatus`] |
//! | record a log | [`SensorSettings::record`]: quantised, noisy, delayed |
//!
//! ```
//! use dynident_simulation::controllers::{JointPd, JointPdSettings};
//! use dynident_simulation::{LoopSettings, Plant, Reference, SensorSettings, closed_loop};
//! # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/>
//! #   <mass value="2"/><inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
//! #   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
//! # </robot>"#;
//! let model = dynident_model::read_urdf(text)?.model;
//! let mut plant = Plant::new(&model, &[], &[])?;
//! let mut controller = JointPd::new(1, &JointPdSettings { kp: 200.0.into(), kd: 40.0.into() })?;
//!
//! // One second at 1 kHz, held horizontally against gravity.
//! let reference = Reference::standing(&[1.57], 1000.0, 1.0)?;
//! let run = closed_loop(&mut plant, &mut controller, &reference, &LoopSettings::default())?;
//! assert!(run.status.is_done());
//! // A spring of 200 N m/rad deflects by 2 kg · 9.81 m/s² · 0.5 m.
//! assert!((run.max_error[0] - 9.81 / 200.0).abs() < 0.005);
//!
//! let log = SensorSettings::birdy_standard(1).record(&model, &run)?;
//! assert!(log.csv().lines().count() > 900);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod closed_loop;
pub mod controllers;
mod error;
mod feedback;
mod motion_buffer;
mod per_joint;
mod plant;
mod record;
mod reference;
mod run;
mod sensors;
mod slow_motion;

pub use closed_loop::{LoopSettings, RunLimits, Start, closed_loop};
pub use controllers::{Controller, ControllerModel, ControllerSettings, FrictionCompensation};
pub use error::{SimulationError, require, require_length};
pub use per_joint::PerJoint;
pub use plant::{Disturbance, Integrator, Plant, PlantFault, TimeCourse, with_length_errors, with_placements};
pub use record::Record;
pub use reference::{Reference, ReferenceSample};
pub use run::{Divergence, LimitedQuantity, Run, RunStatus};
pub use sensors::{SensorSettings, VelocitySource};
