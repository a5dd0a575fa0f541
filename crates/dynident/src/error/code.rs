//! Codes of errors: the book's page "Messages" lists the errors by these codes.

use super::{Error, FactorsError, FigureError, NewStudyError, ResultFileError, StudyError, StudyFileError};
use core::error::Error as StdError;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_estimation::consistent::PhysicalError;
use dynident_excitation::families::FamilyError;
use dynident_excitation::limits::LimitError;
use dynident_excitation::optimisers::OptimiserError;
use dynident_excitation::step_wise::StepWiseError;
use dynident_export::ExportError;
use dynident_identification::consistent::ConsistencyError;
use dynident_identification::diagnosis::{DiagnosisError, InvalidLimit};
use dynident_identification::estimators::{EstimatorError, PeriodError};
use dynident_identification::payload::PayloadError;
use dynident_identification::rows::{LogError, ParallelFilterError};
use dynident_identification::{EventSettingsError, IdentificationError, ReduceError, ThresholdError};
use dynident_iteration::{HomeError, IterationError, RehearsalFailure, RobotFault};
use dynident_model::collision::{MeshError, MeshFault, MeshInertiaFault};
use dynident_model::terms::{ExpressionError, ExpressionProblem, TorqueTableError};
use dynident_model::{
    DhFault, DhWriteError, LoopError, MjcfFault, MjcfWriteError, ModelError, ReadError, SdfFault, SdfWriteError,
    UrdfFault, UrdfWriteError,
};
use dynident_online::OnlineError;
use dynident_recording::{FileError, FilterError, FormatError, RecordingError};
use dynident_report::ReportError;
use dynident_servo::{RunFault, ServoError};
use dynident_simulation::{PlantFault, SimulationError};
use dynident_study::XacroError;
use dynident_system::{ProgramRefused, RunError};

/// Returns the code of an error of this type, or of a box that contains such an error.
type CodeOf = fn(&(dyn StdError + 'static)) -> Option<String>;

/// The errors that can be the cause of an [`Error`].
const CODES: &[CodeOf] = &[
    of::<ConsistencyError>,
    of::<DhFault>,
    of::<DhWriteError>,
    of::<DiagnosisError>,
    of::<Error>,
    of::<EstimationError>,
    of::<EstimatorError>,
    of::<ExportError>,
    of::<ExpressionError>,
    of::<ExpressionProblem>,
    of::<FactorsError>,
    of::<FamilyError>,
    of::<FigureError>,
    of::<FileError>,
    of::<FilterError>,
    of::<FormatError>,
    of::<HomeError>,
    of::<IdentificationError>,
    of::<InvalidLimit>,
    of::<IterationError>,
    of::<LimitError>,
    of::<LogError>,
    of::<LoopError>,
    of::<MeshError>,
    of::<MeshFault>,
    of::<MeshInertiaFault>,
    of::<MjcfFault>,
    of::<MjcfWriteError>,
    of::<ModelError>,
    of::<NewStudyError>,
    of::<OnlineError>,
    of::<OptimiserError>,
    of::<ParallelFilterError>,
    of::<ParametricModelError>,
    of::<PayloadError>,
    of::<PeriodError>,
    of::<PhysicalError>,
    of::<PlantFault>,
    of::<ProgramRefused>,
    of::<ReadError>,
    of::<RecordingError>,
    of::<ReduceError>,
    of::<RehearsalFailure>,
    of::<ReportError>,
    of::<ResultFileError>,
    of::<RobotFault>,
    of::<RunError>,
    of::<RunFault>,
    of::<SdfFault>,
    of::<SdfWriteError>,
    of::<ServoError>,
    of::<SimulationError>,
    of::<StepWiseError>,
    of::<StudyError>,
    of::<StudyFileError>,
    of::<ThresholdError>,
    of::<EventSettingsError>,
    of::<TorqueTableError>,
    of::<UrdfFault>,
    of::<UrdfWriteError>,
    of::<XacroError>,
];

impl Error {
    /// Code of the innermost cause that has a code, such as `study-toml`. The code consists of type and variant of
    /// the error. The page "Messages" of the book explains each code.
    pub fn code(&self) -> Option<String> {
        let causes = core::iter::successors(Some(self as &(dyn StdError + 'static)), |error| (**error).source());
        causes.filter_map(|cause| CODES.iter().find_map(|code| code(cause))).last()
    }
}

fn of<E: StdError + 'static>(error: &(dyn StdError + 'static)) -> Option<String> {
    let error = error.downcast_ref::<E>().or_else(|| error.downcast_ref::<Box<E>>().map(|inner| &**inner))?;
    let path = core::any::type_name::<E>();
    let kind = path.rsplit("::").next().unwrap_or(path);
    // The debug text of an enum begins with the name of the variant, that of a struct with the name of the type.
    let shown = format!("{error:?}");
    let variant = shown.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
    Some(error_code(kind, (variant != kind).then_some(variant)))
}

/// Code of an error from the names of its type and variant: `StudyError::NotUtf8` has the code `study-not-utf8`.
pub fn error_code(kind: &str, variant: Option<&str>) -> String {
    let stem = kind.strip_suffix("Error").filter(|stem| !stem.is_empty());
    let mut code = String::new();
    for letter in stem.unwrap_or(kind).chars().chain(variant.unwrap_or_default().chars()) {
        if letter.is_uppercase() && !code.is_empty() {
            code.push('-');
        }
        code.extend(letter.to_lowercase());
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    #[test]
    fn the_code_is_that_of_the_innermost_cause() {
        let path = || PathBuf::from("study.toml");
        let at = |error: StudyError| StudyError::At { place: "[[log]]".to_owned(), source: Box::new(error) };
        let code =
            |error: StudyError| Error::from(StudyFileError::Study { path: path(), source: Box::new(error) }).code();
        assert_eq!(code(at(StudyError::NotUtf8)).as_deref(), Some("study-not-utf8"));
        // A forwarded error, and one that a box forwards.
        let cutoff = StudyError::Filter(FilterError::AboveNyquist { cutoff_hz: 50.0, rate_hz: 80.0 });
        assert_eq!(code(at(cutoff)).as_deref(), Some("filter-above-nyquist"));
        let io = std::io::Error::from(std::io::ErrorKind::NotFound);
        let file = Error::from(StudyFileError::Robot(Box::new(ReadError::File { path: path(), source: io })));
        assert_eq!(file.code().as_deref(), Some("read-file"));
        assert_eq!(Error::Changed { path: path() }.code().as_deref(), Some("error-changed"));
    }
}
