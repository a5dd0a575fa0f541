//! Iterative identification: run the robot, identify its parameters, load the better model into the controller, run
//! again. The robot can be outside of this process, and every run is stored.
//!
//! | task | use |
//! | --- | --- |
//! | the loop | [`iterate()`] of an [`IterationTask`] with [`IterationSettings`] |
//! | one trajectory of a run, and the rows that are used | [`Leg`] |
//! | a simulated robot | [`SimulatedRobot`] |
//! | a program that uses the line protocol, or a person with a folder | [`robot`] |
//! | stops, permissions, limits of every sample | [`iterate_supervised`] with a [`Supervisor`]; [`SafetySettings`] |
//! | gains from a nominal model and a bandwidth | [`derived_controllers`] |
//! | rehearsal of a motion in simulation before it is commanded | [`RehearsalSettings`] in [`SafetySettings`] |
//! | paths from a home posture to the motion and back | [`HomeSettings`] in [`SafetySettings`] |
//! | a custom robot | a type that implements [`Robot`] |
//! | identification of one run | [`identify_run`]: all joints at once, or joint by joint from tip to base |
//! | one identification from several runs together | [`identify_runs`], each weighted by its own noise |
//! | conditions that prevent convergence | [`Iteration::shortfalls`]: tracking, parameters, clipping, lag, prediction ([`UnmetCondition`]) |
//! | the next run | [`Iteration::next`], a pure function of the stored records: controller and model, rejection of worse runs, convergence |
//! | a next motion that excites the least known combinations of parameters | a [`MotionPlanner`]: [`Redesign`], with [`Iteration::with_planner`] |
//! | storage, and resuming with the same result | [`IterationStore`] |
//!
//! The crate `dynident` provides it as `dynident iterate`, with trajectories, robots and controllers from a study file.
//!
//! ```
//! use dynident_dynamics::ParametricModel;
//! use dynident_excitation::Motion;
//! use dynident_iteration::{Iteration, IterationSettings, IterationStatus, IterationTask, SimulatedRobot, iterate};
//! use dynident_model::terms::{DriveChoice, terms_per_joint};
//! use dynident_simulation::{LoopSettings, Plant, Reference};
//! # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/>
//! #   <mass value="2"/><inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
//! #   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
//! # </robot>"#;
//! let rod = dynident_model::read_urdf(text)?.model;
//! let friction = terms_per_joint(&rod, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
//!
//! // The true pendulum has friction that is missing in the controller's model.
//! let plant = Plant::new(&rod, &friction, &[0.5])?;
//! let mut robot = SimulatedRobot::new(plant, LoopSettings::default())?;
//!
//! // Ten seconds at 500 Hz, from rest to rest.
//! # let mut motion = Motion::default();
//! # motion.reset(1, 5001);
//! # for sample in 0..5001 {
//! #     let (t, w) = (f64::from(sample as u32) * 0.002, 0.2 * core::f64::consts::TAU);
//! #     let series = [(0.6, w), (-0.5, 2.0 * w), (0.25, 3.0 * w), (-0.35, 4.0 * w)];
//! #     for (a, w) in series {
//! #         motion.q[sample] += a * (1.0 - (w * t).cos());
//! #         motion.dq[sample] += a * w * (w * t).sin();
//! #         motion.ddq[sample] += a * w * w * (w * t).cos();
//! #         motion.dddq[sample] -= a * w * w * w * (w * t).sin();
//! #     }
//! # }
//! let reference = Reference::new(500.0, motion)?;
//! let task = IterationTask::new(ParametricModel::new(rod, friction)?, reference)?;
//! let iteration = Iteration::new(task, IterationSettings::default())?;
//! let outcome = iterate(&iteration, &mut [&mut robot], None, &mut |_, _| {})?;
//!
//! assert_eq!(outcome.status, IterationStatus::Converged);
//! let (first, last) = (&outcome.runs[0], outcome.runs.last().unwrap());
//! assert!(last.tracking_error() < 0.1 * first.tracking_error());
//! let found = &last.estimate.as_ref().unwrap().values; // m r_x, m r_z, I_yy, viscous friction
//! assert!((found[1] + 1.0).abs() < 0.01 && (found[3] - 0.5).abs() < 0.01, "{found:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod estimation;
mod evidence;
mod planning;
mod policy;
pub mod robot;
mod runs;
mod setup;
mod signals;
mod storage;
mod torque_check;

pub use estimation::differentiator_choice::{DifferentiatorCandidate, DifferentiatorChoice};
pub use estimation::estimate::{RunEstimate, identify_runs};
pub use estimation::forecast::{ForecastDirection, MotionForecast};
pub use estimation::identify_run::identify_run;
pub use estimation::lengths::OtherLength;
pub use estimation::motion::measured_motion;
pub use estimation::run_logs::RunLog;
pub use estimation::run_motion::RunMotion;
pub use estimation::run_offsets::RunOffset;
pub use evidence::held_out_motion::{HeldOutMotion, HeldOutRun};
pub use evidence::run_evidence::{Clipping, JointEvidence, Prediction, RunEvidence};
pub use planning::planner::{BeforeRun, GoodRun, MotionPlanner, PlannedMotion};
pub use planning::redesign::{Redesign, RedesignSettings};
pub use policy::convergence::UnmetCondition;
pub use policy::friction_chosen::friction_chosen;
pub use policy::next_step::{Next, RunPlan};
pub use policy::record::{RunRecord, UsedController};
pub use policy::supervision::{BegunMotion, NextMotion, NextWays, Supervisor};
pub use robot::{Robot, RobotFault, RobotRun, RobotStatus, RunPurpose, RunRequest, SimulatedRobot, StopSignal};
pub use runs::course::{IterationOutcome, iterate, iterate_supervised};
pub use runs::iteration::Iteration;
pub use setup::error::IterationError;
pub use setup::gains::{DerivedControllers, GainSettings, LoweredBandwidth, derived_controllers, lowered_bandwidths};
pub use setup::home::{FoundPaths, HomeError, HomeSettings};
pub use setup::leg::{IterationTask, Leg};
pub use setup::model_parameters::ModelParameters;
pub use setup::rehearsal::{Rehearsal, RehearsalFailure, RehearsalSettings};
pub use setup::safety::SafetySettings;
pub use setup::settings::{
    ConvergenceSettings, IterationSettings, RunIdentificationSettings, RunOffsets, Scheme, StartWith,
};
pub use setup::status::IterationStatus;
pub use setup::torque_check_settings::{CauseSettings, TorqueCheckSettings};
pub use setup::typical_drives::with_typical_drives;
pub use setup::verdict_settings::{LengthSettings, VerdictSettings};
pub use setup::warm_up::WarmUp;
pub use signals::near_rest::SamplesNearRest;
pub use signals::oscillation::{Oscillation, OscillationLimits, OscillationSettings};
pub use signals::rests::StictionBand;
pub use storage::fingerprint::other_settings;
pub use storage::store::{IterationStore, RUN_SCHEMA, RunFile};
pub use torque_check::{CommandSource, JointTorqueCheck, TorqueCandidate, TorqueCause, TorqueCheck};
