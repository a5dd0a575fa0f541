//! Identification of a robot model from samples in memory or a stream. Study files and reports are in the crate
//! `dynident`.
//!
//! # A UR10 from arrays
//!
//! `q` and `tau` contain one array for each joint (rad, N m), sampled at 200 Hz; a second recording tests the model.
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/ur10_arrays.rs"));
//! use dynident_dynamics::ParametricModel;
//! use dynident_identification::{Execution, IdentificationTask, Recording, identify};
//! use dynident_model::terms::{DriveChoice, terms_per_joint};
//! use dynident_recording::JointSamples;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
//! # let urdf = std::fs::read_to_string(path)?;
//! # let (q, tau) = recorded(&dynident_model::read_urdf(&urdf)?.model, 0.3);
//! # let (q_test, tau_test) = recorded(&dynident_model::read_urdf(&urdf)?.model, 2.0);
//!
//! let arm = dynident_model::read_urdf(&urdf)?.model;
//! let friction = terms_per_joint(&arm, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
//! let robot = ParametricModel::new(arm, friction)?;
//!
//! let train = JointSamples::at_rate(200.0, q, tau).into_log("train", &robot.joint_names())?;
//! let test = JointSamples::at_rate(200.0, q_test, tau_test).into_log("test", &robot.joint_names())?;
//! let recordings = vec![Recording::training("train", train), Recording::held_out("test", test)];
//! let found = identify(&IdentificationTask::new(robot, recordings), Execution::default())?;
//!
//! // The masses in the URDF are 20 % wrong; the identified model predicts held-out motion.
//! let test = &found.held_out[0].validation;
//! assert!(test.prior.as_ref().unwrap().relative_error_percent.unwrap() > 15.0);
//! assert!(test.model.relative_error_percent.unwrap() < 0.5);
//!
//! // Every base parameter has a readable name, a value and an error bar; every body is physically consistent.
//! let (names, estimate) = (found.model().base().expressions(), found.estimate());
//! let viscous = names.iter().position(|name| name == "fv1").unwrap();
//! assert!((estimate.values[viscous] - 2.0).abs() < 0.05, "{} ± {}", estimate.values[viscous], estimate.std[viscous]);
//! assert!(found.inertials().iter().all(|body| body.mass_kg() > 0.0));
//! # Ok(())
//! # }
//! ```
//!
//! # Stage by stage
//!
//! [`identify()`] has five stages, each a public function that returns a plain struct:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/ur10_arrays.rs"));
//! use dynident_identification::estimators::estimate;
//! use dynident_identification::examination::{ModelUnderTest, examine_held_out, examine_training};
//! use dynident_identification::{Execution, IdentificationSettings, Logs, consistent_stage, training_rows};
//! # use dynident_dynamics::ParametricModel;
//! # use dynident_identification::Recording;
//! # use dynident_model::terms::{DriveChoice, terms_per_joint};
//! # use dynident_recording::JointSamples;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
//! # let arm = dynident_model::read_urdf(&std::fs::read_to_string(path)?)?.model;
//! # let (train, test) = (recorded(&arm, 0.3), recorded(&arm, 2.0));
//! # let friction = terms_per_joint(&arm, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
//! # let truth = [true_arm(&arm).parameter_vector(), vec![VISCOUS; 6]].concat();
//! # let robot = ParametricModel::new(arm, friction)?;
//! # let log = |(q, tau)| JointSamples::at_rate(RATE_HZ, q, tau).into_log("arrays", &robot.joint_names());
//! # let recordings = [Recording::training("train", log(train)?), Recording::held_out("test", log(test)?)];
//! let settings = IdentificationSettings::default();
//!
//! // Rows of the regressor, kept as triangular factors; one cut-off frequency for all recordings.
//! let logs = Logs::new(robot.model(), &recordings, settings.row_settings(), &[0], None, Execution::default())?;
//! let training = training_rows(&logs, &settings, robot.clone().into(), &[0], &[], None)?;
//!
//! // Base parameters with their covariance, by the estimator of the settings.
//! let estimate = estimate(&training.rows(&logs, &settings, &[0]), None)?.estimate;
//!
//! // Physically consistent bodies and friction with the best fit.
//! let consistent = consistent_stage(&logs, &settings, &training, &estimate)?;
//! let fit = consistent.fit.expect("a consistent set exists");
//!
//! // Lag of the torque, and error on held-out motion.
//! let (lags, _) = examine_training(&logs, &settings.estimation, &training.model, 0, &estimate.values)?;
//! assert_eq!(lags.len(), 6);
//! let tested = ModelUnderTest {
//!     theta: &fit.base_values,
//!     physical: None,
//!     uncertainty: None,
//!     traced: false,
//!     offset_share: None,
//! };
//! let held_out = examine_held_out(&logs, &settings.estimation, &training.model, 1, &tested)?;
//! assert!(held_out.validation.model.relative_error_percent.unwrap() < 1.0);
//! # for (value, truth) in estimate.values.iter().zip(robot.base().values(&truth)) {
//! #     // The low-pass changes the motion but not the torque.
//! #     assert!((value - truth).abs() < 0.05 * truth.abs().max(1.0), "{value} and {truth}");
//! # }
//! # Ok(())
//! # }
//! ```
//!
//! # By task
//!
//! | task | use |
//! | --- | --- |
//! | a model from recordings | [`identify()`] of an [`IdentificationTask`] |
//! | a log file, a stream, arrays | [`Recording`] with a [`Log`](dynident_recording::Log); a prepared motion: [`Recording::of_motion`] |
//! | another estimator | [`Estimator`](estimators::Estimator) in [`EstimationSettings`]; its findings: [`Findings`](estimators::Findings) |
//! | instruments from a simulated loop or a second run | [`identify_with_instruments`] |
//! | drive inertia, tested with the training logs | [`IdentificationSettings::drive_inertia`] |
//! | friction selected from the training logs | [`IdentificationSettings::friction`] |
//! | prior knowledge of the bodies | [`ConsistencySettings`](consistent::ConsistencySettings) |
//! | possible range of a mass | [`IdentificationSettings::intervals`] |
//! | drifting zeros of torque sensors | [`OffsetChoice::PerLog`] |
//! | motor constants | [`GainChoice::Unknown`], with a known payload in some of the logs |
//! | a payload on a known arm | [`identify_payload`] with a [`KnownArm`](payload::KnownArm) |
//! | the lag of the torque, its sign, its residuals | [`TrainingExamination`], [`examination`] |
//! | consistency of study, robot and logs | [`examine_study`], [`diagnosis`] |
//! | the rows | [`LogPass`](rows::LogPass) with a custom [`RowConsumer`](rows::RowConsumer) |
//! | a progress bar | [`Progress`] in [`Execution`] |
//!
//! A recording that fits into memory is read and differentiated once, for any number of passes; of a longer one, only
//! triangular factors are kept. The result does not depend on the number of threads.

#![forbid(unsafe_code)]

mod bandwidth;
mod bars;
mod between_logs;
pub mod changes;
mod check;
mod chosen_friction;
mod conditional;
pub mod consistent;
mod decisions;
pub mod diagnosis;
mod diagnosis_settings;
mod doubt;
mod drive_inertia;
mod error;
pub mod estimators;
mod event_findings;
mod event_traces;
mod events;
pub mod examination;
mod examination_settings;
mod fitted;
pub mod forms;
pub mod friction;
mod friction_by_log;
mod identify;
mod lag;
mod left_to_the_logs;
mod less_noise;
mod likelihood;
mod limits;
mod log_factors;
mod log_noise;
pub mod payload;
mod reduced;
mod reducible;
mod settings;
mod stage_times;
mod stages;
mod task;
mod thresholds;
mod training;

pub use bandwidth::{CutoffByError, CutoffCandidate, choose_cutoff};
pub use bars::{ErrorBars, ErrorSource};
pub use between_logs::LogVariation;
pub use check::{StudyExamination, examine_study};
pub use chosen_friction::{ChosenFriction, choose_friction};
pub use conditional::{Condition, ConditionalEstimate, conditionals, resting_joints};
pub use drive_inertia::{DriveInertiaChoice, DriveInertiaEstimate, choose_drive_inertia};
pub use dynident_events::{EventChoice, EventKind, EventSearch, EventSettings, EventSettingsError, LogEvent};
pub use dynident_rows as rows;
pub use dynident_rows::{
    Execution, LogError, Logs, MotionRecord, Progress, Recording, RegressorModel, Role, RowSettings, Samples, Silent,
};
pub use error::{IdentificationError, ReduceError};
pub use estimators::EstimationSettings;
pub use event_findings::event_findings;
pub use event_traces::event_traces;
pub use events::{RecordingEvents, recording_events};
pub use identify::{Identification, identify, identify_payload, identify_with_instruments};
pub use likelihood::bic;
pub use log_factors::{LogFactors, log_factors};
pub use log_noise::LogNoise;
pub use reduced::{ReducedLog, identify_reduced, reduce, reduced_errors};
pub use settings::{DiagnosisChoice, GainChoice, IdentificationSettings, OffsetChoice};
pub use stage_times::StageTimes;
pub use stages::{ConsistentParameters, TrainingExamination, consistent_stage};
pub use task::IdentificationTask;
pub use thresholds::{
    CutoffThresholds, DecisionThresholds, DescriptionThresholds, DoubtThresholds, DriveInertiaThresholds,
    EstimationThresholds, FrictionThresholds, GainThresholds, LagThresholds, LogLoadThresholds, LogVariationThresholds,
    MotionThresholds, NoiseThresholds, ThresholdError,
};
pub use training::{Training, training_rows};
