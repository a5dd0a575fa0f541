//! **The whole job**: a study file in, a dynamic model with error bars and its proof out.
//!
//! [`identify()`] fits a [`Study`]'s model to its logs and tests it on the held-out ones; [`validate()`] tests a finished model; [`inspect()`] audits a robot
//! description; [`evaluate()`] computes dynamics for a table of states; [`design_study()`] finds the motion to record, [`check_trajectory()`] and [`check_log()`] judge one that is there. The rooms below are re-exported: [`model`],
//! [`dynamics`], [`recording`], [`estimation`], [`excitation`], [`simulation`], [`identification`], [`iteration`].

#![forbid(unsafe_code)]

pub mod benchmark;
#[cfg(doctest)]
pub mod book;
mod cpu_time;
mod design;
mod error;
mod iterate;
mod jobs;
mod output;
mod pages;
mod result;
mod simulate;
mod study;

pub use dynident_dynamics as dynamics;
pub use dynident_estimation as estimation;
pub use dynident_excitation as excitation;
pub use dynident_identification as identification;
pub use dynident_iteration as iteration;
pub use dynident_model as model;
pub use dynident_recording as recording;
pub use dynident_simulation as simulation;

pub use design::{
    CriterionChoice, DESIGN_SCHEMA, DesignFile, DesignOutcome, DesignSection, DirectionForecast, FamilyChoice,
    GivenStroke, JoinedChoice, OptimiserChoice, ParameterForecast, PriorSection, StartPosture, StrokeFile,
    StrokeLimitFile, TorqueNoise, WindowedCondition, WindowedFile, WindowedProblem, check_log, check_trajectory,
    design_study,
};
pub use dynident_identification::{GainChoice, OffsetChoice, Progress, Role, Silent};
pub use error::Error;
pub use iterate::{
    ITERATIONS_SCHEMA, IterationParameter, IterationRun, IterationSection, IterationWatch, IterationsFile, LegOrder,
    LegSection, PriorChoice, RobotChoice, iterate_study,
};
pub use jobs::evaluate::{Quantity, evaluate};
pub use jobs::identify::{IdentificationOutcome, identify, identify_with_instruments};
pub use jobs::inspect::{AuditEntry, BaseSummary, BodySummary, INSPECTION_SCHEMA, Inspection, JointSummary, inspect};
pub use jobs::options::RunOptions;
pub use jobs::validate::validate;
pub use output::{check_writable, write_whole};
pub use result::identification::{
    BaseParameterResult, BodyResult, JointFrictionResult, JointResult, LawResult, LogOffset, LogSummary, MethodSummary,
    PhysicalBodyResult, PhysicalFitResult, PhysicalVerdict, RESULT_SCHEMA, ResultFile, RobotSummary, Timings,
    TrainingJoint, TrainingResult,
};
pub use result::validation::{VALIDATION_SCHEMA, ValidationFile};
pub use simulate::section::{SimulatedTruth, SimulationSection};
pub use simulate::{BodyTruth, ParameterTruth, SIMULATION_SCHEMA, Simulation, SimulationFile, simulate_study};
pub use study::friction::{FrictionChoice, FrictionLaw};
pub use study::{
    ArmSection, CoulombChoice, CouplingSection, DriveSection, EstimatorMethod, EstimatorSection, Folders, JointDrive,
    LogSection, PayloadSection, PhysicalChoice, RobotSection, SimulatedSection, Study, StudyRobot,
};
