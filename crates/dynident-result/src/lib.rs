//! **Output files of jobs**: one type per file, for writing and reading. Within a version of a schema keys are added,
//! never renamed.

#![forbid(unsafe_code)]

mod check;
mod comparison;
mod design;
mod error;
mod error_terms;
mod evaluation;
mod export;
mod export_validation;
mod factors;
mod fit;
mod forms;
mod grouped;
mod identification;
mod inspection;
mod iterations;
mod log;
mod method;
mod new_study;
mod numbers;
mod parameters;
mod poorly_known;
mod problems;
mod provenance;
mod read;
mod seal;
mod servo;
mod servo_design;
mod servo_form;
mod simulation;
mod sound;
mod stored;
mod test_samples;
mod torque_errors;
mod validation;

pub use check::{CHECK_SCHEMA, CheckFile, CheckFinding, HypothesisResult, StudyChange, StudyCheck};
pub use comparison::{
    COMPARISON_SCHEMA, ChangeExplanation, ChangedPart, ChangesFrom, ComparedBody, ComparedFriction, ComparedParameter,
    ComparedResult, ComparisonFile, DescriptionComparison,
};
pub use design::{
    DESIGN_SCHEMA, DesignFile, DirectionForecast, ParameterForecast, StrokeFile, StrokeLimitFile, WindowedFile,
};
pub use dynident_study::{DifferenceSettings, ProblemSettings, ReportThresholds, TorqueErrorSettings};
pub use error::ResultFileError;
pub use error_terms::ErrorTermResult;
pub use evaluation::{EVALUATION_SCHEMA, EvaluationFile};
pub use export::{EXPORT_SCHEMA, ExportFile};
pub use export_validation::{EXPORT_VALIDATION_SCHEMA, ExportValidationFile};
pub use factors::{FACTORS_SCHEMA, FactorsFile, FactorsLog};
pub use fit::{PhysicalBodyResult, PhysicalFitResult, PhysicalVerdict, TrainingErrors, TrainingJoint, TrainingResult};
pub use forms::{FormError, FormJointError, FormResult, FormTerm, StoredModel};
pub use grouped::{FindingGroup, grouped_check_findings, grouped_findings};
pub use identification::{RESULT_SCHEMA, ResultFile};
pub use inspection::{
    AuditEntry, BaseSummary, BodySummary, CorrectionEntry, INSPECTION_SCHEMA, Inspection, JointSummary, SlipEntry,
};
pub use iterations::{
    INTERRUPTED, ITERATIONS_SCHEMA, IterationParameter, IterationRun, IterationsFile, RunForecast, UnmetConditionEntry,
};
pub use log::{LOG_SCHEMA, LogChannel, LogContents, LogGroupContents};
pub use method::{LogSummary, MethodSummary, RobotSummary, Timings};
pub use new_study::{NEW_STUDY_SCHEMA, NewStudyFile, Unsure};
pub use parameters::{
    BaseParameterResult, BodyResult, JointFrictionResult, JointResult, LogOffset, TermResult, ValueSource,
};
pub use poorly_known::{POORLY_KNOWN_PERCENT, ParameterKind, PoorlyKnown};
pub use provenance::{InputFile, Provenance};
pub use read::{MAX_RESULT_BYTES, read_result};
pub use servo::{SERVO_SCHEMA, ServoBody, ServoDrive, ServoFile, ServoLog, ServoMotion, ServoNumber, ServoScale};
pub use servo_design::{SERVO_DESIGN_SCHEMA, ServoDesignFile, ServoForecast, ServoForecastValue};
pub use servo_form::{ServoForm, ServoFormLog};
pub use simulation::{BodyTruth, ParameterTruth, SIMULATION_SCHEMA, SimulationFile};
pub use test_samples::{TEST_SAMPLES_SCHEMA, TestSamplesFile, TestedLog};
pub use torque_errors::{FormatError, JointError};
// Types of lower crates in these files.
pub use dynident_excitation::check::LimitReport;
pub use dynident_identification::ErrorSource;
pub use dynident_iteration::{RobotFault, RobotStatus};
pub use stored::{StoredPayloads, read_part};
pub use validation::{VALIDATION_SCHEMA, ValidationFile};
