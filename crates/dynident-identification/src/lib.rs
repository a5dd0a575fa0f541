//! **Which model explains these samples?** From samples in memory or a stream to an identified model.

#![forbid(unsafe_code)]

pub mod consistent;
mod error;
pub mod estimators;
pub mod examination;
mod execution;
pub mod friction;
mod identify;
mod logs;
pub mod payload;
mod progress;
mod recording;
mod regressor_model;
pub mod rows;
mod settings;
mod task;
mod training;

pub use error::IdentificationError;
pub use execution::Execution;
pub use identify::{
    ConsistentParameters, Identification, StageTimes, TrainingExamination, consistent_stage, identify,
    identify_payload, identify_with_instruments,
};
pub use logs::Logs;
pub use progress::{Progress, Silent};
pub use recording::{Recording, Role, Samples};
pub use regressor_model::RegressorModel;
pub use settings::{EstimationSettings, GainChoice, IdentificationSettings, OffsetChoice};
pub use task::IdentificationTask;
pub use training::{LogFactors, Training, log_factors, training_rows};
