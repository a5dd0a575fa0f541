use crate::robot::trajectory_csv;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use dynident_excitation::Motion;
use dynident_simulation::Reference;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Trajectories of a run that replace those of the task. `run.json` contains their sampling rates; the samples are in
/// `motion.csv` next to it (`motion_2.csv` and so on for further trajectories).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunMotion {
    /// Sampling rate of each trajectory, Hz.
    pub rates_hz: Vec<f64>,
    /// The trajectories.
    #[serde(skip)]
    pub references: Vec<Reference>,
}

impl RunMotion {
    /// Creates the motion from trajectories. Jerks are removed, because no controller uses them and no table contains
    /// them.
    pub fn new(references: Vec<Reference>) -> Self {
        let kept = |reference: Reference| {
            let motion = Motion { dddq: Vec::new(), ..reference.motion().clone() };
            Reference::new(reference.rate_hz(), motion).unwrap_or(reference)
        };
        let references: Vec<Reference> = references.into_iter().map(kept).collect();
        Self { rates_hz: references.iter().map(Reference::rate_hz).collect(), references }
    }

    /// Names and contents of the tables: columns `t_s`, `q1..`, `dq1..`, `ddq1..`; s, rad (m). Reading them gives
    /// bit-identical numbers.
    pub(crate) fn tables(&self) -> impl Iterator<Item = (String, String)> {
        self.references.iter().enumerate().map(|(leg, reference)| (table_name(leg), trajectory_csv(reference, None)))
    }

    /// Reads the samples of the tables in a folder, for `joints` joints.
    pub(crate) fn with_tables(self, folder: &Path, joints: usize) -> Result<Self, IterationError> {
        let of_leg = |(leg, rate_hz): (usize, &f64)| read_table(&folder.join(table_name(leg)), joints, *rate_hz);
        let references = self.rates_hz.iter().enumerate().map(of_leg).collect::<Result<_, _>>()?;
        Ok(Self { references, ..self })
    }
}

/// The trajectories of a run: those of the task, or the run's own.
///
/// # Errors
/// A motion with another number of legs.
pub(crate) fn legs_along<'a>(
    task: &'a IterationTask,
    motion: Option<&RunMotion>,
) -> Result<Cow<'a, [Leg]>, IterationError> {
    let Some(motion) = motion else { return Ok(Cow::Borrowed(&task.legs)) };
    dynident_simulation::require_length("trajectories of the run", task.legs.len(), motion.references.len())?;
    let pairs = task.legs.iter().zip(&motion.references);
    let legs: Result<Vec<Leg>, _> = pairs.map(|(leg, reference)| leg.along(reference.clone())).collect();
    Ok(Cow::Owned(legs?))
}

fn table_name(leg: usize) -> String {
    if leg == 0 { "motion.csv".to_owned() } else { format!("motion_{}.csv", leg + 1) }
}

const MAX_TABLE_BYTES: u64 = 1 << 30;

fn read_table(path: &Path, joints: usize, rate_hz: f64) -> Result<Reference, IterationError> {
    let wrong = |problem: String| IterationError::State { path: PathBuf::from(path), problem };
    let fix = "the run used this motion: put the file back, or remove this folder and those after it";
    let text = dynident_files::read_text(path, MAX_TABLE_BYTES).map_err(|error| wrong(format!("{error}; {fix}")))?;
    let columns = 1 + 3 * joints;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for (line, row) in text.lines().enumerate().skip(1) {
        let values: Option<Vec<f64>> = row.split(',').map(|field| field.parse().ok()).collect();
        match values.filter(|values| values.len() == columns) {
            Some(values) => rows.push(values),
            None => return Err(wrong(format!("line {} is not {columns} numbers; {fix}", line + 1))),
        }
    }
    let part = |kind: usize| -> Vec<f64> {
        (0..joints).flat_map(|joint| rows.iter().map(move |row| row[1 + kind * joints + joint])).collect()
    };
    let motion = Motion { samples: rows.len(), joints, q: part(0), dq: part(1), ddq: part(2), dddq: Vec::new() };
    Reference::new(rate_hz, motion).map_err(|error| wrong(format!("{error}; {fix}")))
}
