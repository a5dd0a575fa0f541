//! `[[torque]]`: declared (user-defined) torques as functions of positions and velocities, for springs,
//! counterbalances, cables.

use super::{Code, Folders, Study};
use crate::error::{StudyError, StudyFileError};
use dynident_files::quoted;
use dynident_model::terms::{
    Declared, DeclaredLaw, Expression, JointNames, TorqueFunction, TorqueLaw, TorqueTable, TorqueTerm,
};
use dynident_model::{Model, ModelError};
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest accepted table file, bytes; 200 points need far less.
const MAX_TABLE_BYTES: u64 = 1 << 20;

/// Section `[[torque]]`: a torque `coefficient · f(q, dq)` on one joint, with an unknown coefficient. The sign is
/// that of the drive's torque: a spring that pulls back to `q0` is `q - q0`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TorqueSection {
    /// Name of the coefficient in results: a letter, then letters, digits and `_`.
    pub name: String,
    /// Name of the joint on which the torque acts.
    pub joint: String,
    /// Function `f` as an expression: `sin(q - 0.3)`, with `q`, `dq` of this joint, `q(NAME)` or `q3` of other
    /// joints, rad and rad/s (m, m/s).
    #[serde(default)]
    pub expression: Option<String>,
    /// Function `f` as points `[position, torque]` of this joint, ascending, with a smooth curve between them.
    #[serde(default)]
    pub table: Option<Vec<[f64; 2]>>,
    /// Function `f` as points in a file: CSV with one column of positions and one of torques.
    #[serde(default)]
    pub table_file: Option<PathBuf>,
    /// Name of the calling program's function of positions and velocities; that program provides the code.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub function: Option<String>,
    /// The code of `function`.
    #[serde(skip)]
    pub code: Code<dyn TorqueLaw>,
    /// Expected value of the coefficient: used in the prior, and in the robot that `simulate` simulates.
    #[serde(default)]
    pub nominal: Option<f64>,
    /// Unit of the coefficient, any text; by default `Nm` for an expression and `1` for a table.
    #[serde(default)]
    pub unit: Option<String>,
}

impl TorqueSection {
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if !Declared::is_symbol(&self.name) {
            let fix =
                "give a letter and then letters, digits and `_`, at most 60 characters: it becomes a parameter name";
            return Err(StudyError::conflict(format!("name `{}`", self.name), fix));
        }
        let given: Vec<&'static str> = [
            self.expression.is_some().then_some("expression"),
            self.table.is_some().then_some("table"),
            self.table_file.is_some().then_some("table_file"),
            self.function.is_some().then_some("function"),
        ]
        .into_iter()
        .flatten()
        .collect();
        match given.len() {
            0 => return Err(StudyError::missing("no expression", "give expression, table or table_file")),
            1 => {}
            _ => return Err(StudyError::Exclusive { keys: given }),
        }
        if self.nominal.is_some_and(|nominal| !nominal.is_finite()) {
            return Err(StudyError::conflict("nominal", "give a finite number"));
        }
        if self.unit.as_ref().is_some_and(|unit| unit.chars().count() > 40 || unit.chars().any(char::is_control)) {
            return Err(StudyError::conflict("unit", "give at most 40 characters on one line"));
        }
        Ok(())
    }

    /// The torque law with code of the calling program; it can depend on all joints.
    fn own_law(&self, name: &str, joints: usize) -> Result<DeclaredLaw, StudyError> {
        let code = self.code.0.as_ref().ok_or_else(|| {
            let fix = "no file holds code: set it in the calling program, or give an expression";
            StudyError::conflict(format!("function = \"{name}\""), fix)
        })?;
        Ok(DeclaredLaw::Function(TorqueFunction::new(name, (0..joints).collect(), Arc::clone(code))))
    }

    fn term(
        &self,
        model: &Model,
        read_table: impl Fn(&Path) -> Result<TorqueTable, StudyFileError>,
        wrong: impl Fn(StudyError) -> StudyFileError,
    ) -> Result<TorqueTerm, StudyFileError> {
        let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let Some(joint) = model.joint_index(&self.joint) else {
            return Err(wrong(ModelError::UnknownJoint { joint: self.joint.clone(), known: names }.into()));
        };
        let law = match (&self.expression, &self.table, &self.table_file) {
            (Some(text), ..) => DeclaredLaw::Expression(
                Expression::parse(text, &JointNames { own: Some(joint), names: &names })
                    .map_err(|error| wrong(error.into()))?,
            ),
            (None, Some(points), _) => {
                DeclaredLaw::Table(TorqueTable::new(points.clone()).map_err(|error| wrong(error.into()))?)
            }
            (None, None, Some(file)) => DeclaredLaw::Table(read_table(file)?),
            (None, None, None) => {
                let Some(name) = &self.function else {
                    let fix = "give expression, table or table_file";
                    return Err(wrong(StudyError::missing("no expression", fix)));
                };
                self.own_law(name, names.len()).map_err(wrong)?
            }
        };
        let usual = match law {
            DeclaredLaw::Expression(_) | DeclaredLaw::Function(_) => "Nm",
            DeclaredLaw::Table(_) => "1",
        };
        let unit = self.unit.clone().unwrap_or_else(|| usual.to_owned());
        Ok(TorqueTerm::Declared(Declared {
            name: self.name.clone(),
            joint,
            law,
            unit,
            nominal: self.nominal,
            is_spring: false,
        }))
    }
}

/// The terms of the study's `[[torque]]`.
///
/// # Errors
/// An unknown joint, an invalid expression, or an unreadable table.
pub(super) fn declared_terms(
    study: &Study,
    study_path: &Path,
    folders: &Folders,
    model: &Model,
) -> Result<Vec<TorqueTerm>, StudyFileError> {
    let of_section = |section: &TorqueSection| {
        let wrong = |source: StudyError| {
            StudyFileError::study(study_path)(StudyError::at(format!("torque `{}`", section.name))(source))
        };
        section.term(model, |file| read_table(&folders.find(file, study.source.as_deref())?), wrong)
    };
    study.torque.iter().map(of_section).collect()
}

/// Reads a table of two columns; a first line that contains no numbers is a header.
fn read_table(path: &Path) -> Result<TorqueTable, StudyFileError> {
    let cannot = |source| StudyFileError::File { path: path.to_owned(), source };
    let at = |line: u64, message: String| StudyFileError::Table { path: path.to_owned(), line, message };
    let file = dynident_files::open(path).map_err(cannot)?;
    if file.metadata().map_err(cannot)?.len() > MAX_TABLE_BYTES {
        return Err(at(1, "larger than 1 MiB: a table of torque has at most 200 points".to_owned()));
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .flexible(true)
        .comment(Some(b'#'))
        .from_reader(file.take(MAX_TABLE_BYTES));
    let mut points = Vec::new();
    for (place, record) in reader.records().enumerate() {
        let record = record.map_err(|error| at(error.position().map_or(1, csv::Position::line), error.to_string()))?;
        let line = record.position().map_or(1, csv::Position::line);
        let numbers: Option<Vec<f64>> = record.iter().map(|field| field.parse::<f64>().ok()).collect();
        match numbers.as_deref() {
            Some(&[position, torque]) => points.push([position, torque]),
            None if place == 0 && record.iter().all(|field| field.parse::<f64>().is_err()) => {}
            Some(_) | None => {
                let found = record.iter().collect::<Vec<_>>().join(",");
                return Err(at(line, format!("`{}`: give two numbers, position and torque", quoted(&found))));
            }
        }
    }
    TorqueTable::new(points).map_err(|error| at(1, error.to_string()))
}
