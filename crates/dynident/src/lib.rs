//! **The whole job**: a study file in, a dynamic model with error bars and its proof out.
//!
//! [`identify()`] fits a [`Study`]'s machine to its logs and tests it on the held-out ones; [`validate()`] tests a finished model; [`inspect()`] audits a robot
//! description; [`evaluate()`] computes dynamics for a table of states; [`design_study()`] finds the motion to record, [`check_trajectory()`] and [`check_log()`] judge one that is there. The rooms below are re-exported: [`model`],
//! [`dynamics`], [`recording`], [`estimation`], [`excitation`], [`simulation`], [`identification`], [`iteration`].

#![forbid(unsafe_code)]

pub mod benchmark;
#[cfg(doctest)]
pub mod book;
mod cpu_time;
mod design;
mod error;
mod evaluate;
mod identify;
mod inspect;
mod iterate;
mod job;
mod load;
mod machine;
mod measured;
mod output;
mod progress;
mod simulate;
mod study;
mod validate;

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
pub use error::Error;
pub use evaluate::{Quantity, evaluate};
pub use identify::fit::{GrossErrors, NoiseInRegressor};
pub use identify::friction_choice::{FrictionCandidate, JointFriction};
pub use identify::instruments::{InstrumentSection, InstrumentSource, SmoothedMotion};
pub use identify::intervals::PossibleIntervalResult;
pub use identify::periodic::PeriodicFit;
pub use identify::result::{
    BaseParameterResult, BodyResult, JointResult, LawResult, LogOffset, LogSummary, LogValidation, MethodSummary,
    PhysicalBodyResult, PhysicalFitResult, PhysicalVerdict, RESULT_SCHEMA, ResultFile, RobotSummary, Timings,
    TrainingJoint, TrainingResult,
};
pub use identify::sign::SignEvidence;
pub use identify::simulated::SimulatedFit;
pub use identify::{Identification, identify, identify_with_instruments};
pub use inspect::{AuditEntry, BaseSummary, BodySummary, INSPECTION_SCHEMA, Inspection, JointSummary, inspect};
pub use iterate::{
    ITERATIONS_SCHEMA, IterationParameter, IterationRun, IterationSection, IterationWatch, IterationsFile, LegOrder,
    LegSection, PriorChoice, RobotChoice, iterate_study,
};
pub use job::RunOptions;
pub use load::gains::DriveGain;
pub use load::payload_result::{Measured, PayloadParameter, PayloadResult, PossiblePayload};
pub use machine::Machine;
pub use measured::evidence::PriorAgreement;
pub use measured::lag::TorqueLag;
pub use measured::residuals::{JointResiduals, TorqueBand};
pub use measured::torque_trace::{JointTrace, LogTrace};
pub use output::{check_writable, write_whole};
pub use progress::{Progress, Silent};
pub use simulate::section::{SimulatedTruth, SimulationSection};
pub use simulate::{BodyTruth, ParameterTruth, SIMULATION_SCHEMA, Simulation, SimulationFile, simulate_study};
pub use study::friction::{FrictionChoice, FrictionLaw};
pub use study::{
    ArmSection, CoulombChoice, CouplingSection, DriveSection, EstimatorMethod, EstimatorSection, Folders, GainChoice,
    JointDrive, LogSection, NoiseLevelSection, OffsetChoice, ParallelFilterSection, PayloadSection, PeriodSection,
    PhysicalChoice, Refit, RobotSection, Role, SimulatedSection, SimulationStart, Study,
};
pub use validate::{VALIDATION_SCHEMA, ValidationFile, validate};
