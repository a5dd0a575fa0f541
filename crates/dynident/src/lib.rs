//! **Facade and jobs**: from a study file to a validated dynamic model with error bars.
//!
//! | task | function |
//! | --- | --- |
//! | read a study file | [`Study::load`], [`Study::parse`] |
//! | logs to a model | [`identify()`]; result: [`ResultFile`], page: [`IdentificationOutcome::report`] |
//! | validate a model on other logs | [`validate()`] |
//! | reduce logs to triangular factors, and factors to one model | [`reduce()`], [`Factors`], [`identify_factors()`], [`factors_errors()`] |
//! | figures and tables for papers | [`Figure`] |
//! | predict torque along a motion, with its error band | [`TorquePredictor`] |
//! | inspect a robot description | [`inspect()`]; correct it: [`mended()`] |
//! | export a model as C, C++, Rust, Python, MATLAB, CasADi, JAX, Pinocchio, MJCF, URDF, SDF, ROS 2 parameters, JSON; drives for a simulator; a payload for a controller | [`export_model()`], [`export_simulator()`], [`export_payload()`] |
//! | dynamics for a table of states | [`evaluate()`] |
//! | design a motion | [`design_study()`]; check an existing one: [`check_trajectory()`], [`check_log()`] |
//! | contents of a recording | [`log_contents()`] |
//! | create a study from a robot and its recordings | [`new_study()`] |
//! | simulate one run | [`simulate_study()`] |
//! | repeated runs and identification | [`iterate_study()`]; with a robot in code: [`iterate_with_robot()`] |
//! | sections of a study, parts of results | [`study`], [`result`] |
//! | progress | [`Progress`] in [`RunOptions`] |
//!
//! A study can contain its samples and its robot in memory ([`samples`](study::LogSection::samples),
//! [`description`](study::RobotSection::description)). [`identification`] works on arrays without a study. The lower
//! crates are re-exported:
//! [`model`], [`dynamics`], [`recording`], [`estimation`], [`excitation`], [`simulation`], [`identification`],
//! [`iteration`], [`export`].
//!
//! ```
//! use dynident::{RunOptions, Silent, Study, identify};
//! use std::path::Path;
//!
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/ur10_simulated.toml");
//! let path = Path::new(path); // examples/ur10_simulated.toml
//! let study = Study::load(path)?;
//! let found = identify(&study, path, &RunOptions { data: None, threads: 1, progress: &Silent })?;
//!
//! let test = &found.result.validation[0];
//! let prior = test.prior.as_ref().expect("the robot description has all inertials");
//! assert!(test.model.relative_error_percent < prior.relative_error_percent);
//! assert!(found.result.physical.consistent && found.urdf.is_some());
//! # Ok::<(), dynident::Error>(())
//! ```

#![forbid(unsafe_code)]

#[cfg(doctest)]
pub mod book;
mod clock;
mod cpu_time;
mod digest;
mod error;
pub mod factors;
mod inputs;
mod jobs;
mod output;
mod output_set;
mod pages;

pub use dynident_dynamics as dynamics;
pub use dynident_estimation as estimation;
pub use dynident_excitation as excitation;
pub use dynident_export as export;
pub use dynident_identification as identification;
pub use dynident_iteration as iteration;
pub use dynident_model as model;
pub use dynident_online as online;
pub use dynident_recording as recording;
pub use dynident_result as result;
pub use dynident_simulation as simulation;
pub use dynident_study as study;
pub use dynident_system as system;
pub use dynident_text as text;

pub use dynident_identification::{Progress, Role, Silent};
pub use dynident_report::{PrintStyle, ReportError};
pub use dynident_system::{ProgramPermission, ProgramPurpose, ProgramRefused, ProgramRequest};
pub use dynident_text::shortened_message;
pub use error::{
    Error, ErrorPlace, FactorsError, FigureError, NewStudyError, RecognisedFile, error_code, place_in_log,
    place_in_robot,
};
pub use factors::{FactorLog, Factors, seconds_of};
pub use inputs::{refuse_overwriting, study_inputs};
pub use jobs::check::{CheckSettings, check, check_with};
pub use jobs::compare::compare;
pub use jobs::design::{DesignOutcome, check_log, check_trajectory, design_study};
pub use jobs::evaluate::{Quantity, evaluate};
pub use jobs::export::{
    EXPORT_VALIDATION_SUFFIX, ExportSettings, ServoExport, ServoTarget, export_model, export_payload, export_result,
    export_servos, export_simulator, export_stored, export_validation, payload_validation, selected_payload,
    servo_validation, table_validation,
};
pub use jobs::identify::{IdentificationOutcome, identify, identify_with_instruments};
pub use jobs::inspect::{
    CorrectedDescription, InspectSettings, inspect, inspect_robot, inspect_with, mended, mended_robot,
};
pub use jobs::iterate::{IterationWatch, MotionObserver, RobotMaker, iterate_study, iterate_with_robot};
pub use jobs::lerobot::{LeRobotActions, lerobot_actions};
pub use jobs::log::log_contents;
pub use jobs::new_study::{NewStudy, NewStudySettings, new_study, new_study_with};
pub use jobs::options::RunOptions;
pub use jobs::predict::{PredictedTorque, TorquePredictor};
pub use jobs::reduce::{ReduceSettings, factors_errors, identify_factors, reduce};
pub use jobs::servo::{ServoDesignOutcome, ServoOutcome, design_servos, identify_servos};
pub use jobs::simulate::{Simulation, simulate_study};
pub use jobs::test_samples::test_samples;
pub use jobs::validate::{validate, validate_result, validation_traces};
pub use jobs::view::{view_result, view_robot, view_study};
pub use output::{check_writable, write_atomically};
pub use output_set::OutputSet;
pub use pages::comparison::{comparison_page, explanation_words};
pub use pages::differences::difference_words;
pub use pages::figures::{Figure, FigureForm};
pub use pages::identification::identification_report;
pub use pages::robot::RobotAppearance;
pub use pages::servo::verdict_words;
pub use pages::torque_words::{
    consistency_words, dead_torques, format_error_words, joint_error_words, poorly_known_words,
};
pub use result::{
    CheckFile, DesignFile, Inspection, IterationsFile, LogContents, MAX_RESULT_BYTES, ResultFile, ResultFileError,
    SimulationFile, ValidationFile, read_result,
};
pub use study::{
    Expected, Folders, LoadSettings, Study, StudyError, StudyFile, StudyFileError, StudyRobot, XacroError,
    XacroSettings, load_robot,
};
