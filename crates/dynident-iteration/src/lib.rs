//! Iterative identification: run the robot, identify, load the better model into the controller, run again. Supports
//! robots outside of this process and stores every run.
//!
//! | task | use |
//! | --- | --- |
//! | the loop | [`iterate()`] of an [`IterationTask`] with [`IterationSettings`] |
//! | the trajectory of a run and the rows that are used | [`Leg`] |
//! | a simulated robot | [`SimulatedRobot`] |
//! | a program that uses the line protocol, or a person with a folder | [`robot`] |
//! | stops, permissions, limits of every sample | [`iterate_supervised`] with a [`Supervisor`]; [`SafetySettings`] |
//! | gains from a nominal model and a bandwidth | [`derived_controllers`] |
//! | rehearsal of a motion in simulation before it is commanded | [`RehearsalSettings`] in [`SafetySettings`] |
//! | paths from a home posture to the motion and back | [`HomeSettings`] in [`SafetySettings`] |
//! | a custom robot | a type that implements [`Robot`] |
//! | identification of one run | [`identify_run`]: all joints at once, or joint by joint from tip to base as in the paper |
//! | joint identification of several runs | [`identify_runs`], each weighted by its own noise |
//! | unmet conditions | [`Iteration::shortfalls`]: tracking, parameters, clipping, lag, prediction ([`Shortfall`]) |
//! | the next run | [`Iteration::next`], a pure function of the records: controller and model, rejection of worse runs, convergence |
//! | a next motion that excites the least known directions | a [`MotionPlanner`]: [`Redesign`], with [`Iteration::with_planner`] |
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

mod before_motion;
mod clipping;
mod commanding;
mod convergence;
mod course;
mod cut_short;
mod differentiator_choice;
mod drive;
mod dry_steps;
mod error;
mod estimate;
mod evidence;
mod far_from_rest;
mod final_fit;
mod fingerprint;
mod forecast;
mod friction_chosen;
mod gains;
mod good_log;
mod held_out;
mod held_out_motion;
mod home;
mod identify_run;
mod iteration;
mod leg;
mod lengths;
mod loop_delay;
mod model_parameters;
mod motion;
mod near_rest;
mod oscillation;
mod parameter_shares;
mod planner;
mod planning;
mod policy;
mod posture;
mod prediction;
mod record;
mod redesign;
mod rehearsal;
mod rests;
pub mod robot;
mod run_examination;
mod run_information;
mod run_logs;
mod run_motion;
mod run_offsets;
mod run_torque_check;
mod runs_folder;
mod safety;
mod sealed;
mod settings;
mod status;
mod step_by_step;
mod store;
mod supervision;
mod torque_check;
mod torque_check_settings;
mod torque_noise;
mod torque_of_all;
mod tracking_floor;
mod typical_drives;
mod verdict_settings;
mod warm_up;

pub use convergence::Shortfall;
pub use course::{IterationOutcome, iterate, iterate_supervised};
pub use differentiator_choice::{DifferentiatorCandidate, DifferentiatorChoice};
pub use error::IterationError;
pub use estimate::{RunEstimate, identify_runs};
pub use evidence::{Clipping, JointEvidence, Prediction, RunEvidence};
pub use fingerprint::other_settings;
pub use forecast::{ForecastDirection, MotionForecast};
pub use friction_chosen::friction_chosen;
pub use gains::{DerivedControllers, GainSettings, LoweredBandwidth, derived_controllers, lowered_bandwidths};
pub use held_out_motion::{HeldOutMotion, HeldOutRun};
pub use home::{FoundWays, HomeError, HomeSettings};
pub use identify_run::identify_run;
pub use iteration::Iteration;
pub use leg::{IterationTask, Leg};
pub use lengths::OtherLength;
pub use model_parameters::ModelParameters;
pub use motion::measured_motion;
pub use near_rest::NearRest;
pub use oscillation::{Oscillation, OscillationLimits, OscillationSettings};
pub use planner::{BeforeRun, GoodRun, MotionPlanner, PlannedMotion};
pub use policy::{Next, RunPlan};
pub use record::{RunRecord, UsedController};
pub use redesign::{Redesign, RedesignSettings};
pub use rehearsal::{Rehearsal, RehearsalFailure, RehearsalSettings};
pub use rests::RestMargin;
pub use robot::{Robot, RobotFault, RobotRun, RobotStatus, RunPurpose, RunRequest, SimulatedRobot, StopSignal};
pub use run_logs::RunLog;
pub use run_motion::RunMotion;
pub use run_offsets::RunOffset;
pub use safety::SafetySettings;
pub use settings::{IterationSettings, RunIdentificationSettings, RunOffsets, Scheme, SettledSettings, StartWith};
pub use status::IterationStatus;
pub use store::{IterationStore, RUN_SCHEMA, RunFile};
pub use supervision::{NextMotion, NextWays, Supervisor};
pub use torque_check::{CommandSource, JointTorqueCheck, TorqueCandidate, TorqueCause, TorqueCheck};
pub use torque_check_settings::{CauseSettings, TorqueCheckSettings};
pub use typical_drives::with_typical_drives;
pub use verdict_settings::{LengthSettings, VerdictSettings};
pub use warm_up::WarmUp;
