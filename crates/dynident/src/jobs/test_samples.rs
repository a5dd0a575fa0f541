//! The samples of a validation as tables, for programs that evaluate an exported file on the same samples.

use crate::error::Error;
use crate::jobs::options::RunOptions;
use crate::result::{ResultFile, TestSamplesFile, TestedLog};
use crate::study::{Folders, Study, StudyRobot};
use core::fmt::Write;
use dynident_identification::rows::{
    JointRows, LogError, LogPass, ParallelFilterSettings, RawSamples, RowConsumer, motion_band_hz,
};
use dynident_identification::{Logs, Role};
use std::path::Path;

/// One CSV table for each log of the study, with the samples that `validate` uses for the model of `stored`: after
/// the import, the correction of the lag and the differentiator, and before the parallel filter. Columns are
/// `segment`, then `q_NAME`, `dq_NAME`, `ddq_NAME`, `tau_NAME` (SI units) and `used_NAME` of each joint NAME of the
/// model (1, or 0 for a sample that the filter excludes). Returns the tables by file name, and a description with the
/// filter of each log. `result_path` is the name of the result in messages.
///
/// # Errors
/// Same as for [`validate_result()`](crate::validate_result).
pub fn test_samples(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<(TestSamplesFile, Vec<(String, String)>), Error> {
    study.require_log(study_path)?;
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let study = &stored.as_fitted(study);
    let robot = StudyRobot::new(study, study_path, &folders)?;
    let model = stored.regressor_model(result_path, &robot.parametric)?;
    let task = study.task(study_path, &robot, &folders)?;
    let all: Vec<usize> = (0..task.recordings.len()).collect();
    let (rows, execution) = (task.settings.row_settings(), options.execution());
    let (mut description, mut tables) = (TestSamplesFile::new(model.joint_names()), Vec::new());
    let made = execution.install(|| -> Result<(), LogError> {
        let logs = Logs::new(robot.model(), &task.recordings, rows, &all, stored.cutoff_hz(), execution)?;
        for (index, recording) in task.recordings.iter().enumerate() {
            let mut table = SampleTable::of(&description.joints);
            LogPass { kept: None, ..logs.pass(&model, index) }.run(&mut table)?;
            let file = format!("samples_{}.csv", index + 1);
            let in_filter = |source| LogError::Filter { log: recording.label(), source };
            let fit = logs.filter.decimation(table.rate_hz, motion_band_hz(&logs.motion));
            let band = stored
                .motion_hz()
                .map(|motion_hz| ParallelFilterSettings::default().decimation(table.rate_hz, Some(motion_hz)));
            let is_held_out = recording.role == Role::Validate;
            let filter = if is_held_out { band.unwrap_or(fit) } else { fit };
            description.logs.push(TestedLog {
                log: recording.name.clone(),
                role: recording.role,
                file: file.clone(),
                rate_hz: table.rate_hz,
                taps: filter
                    .as_ref()
                    .map(|filter| filter.taps(table.rate_hz))
                    .transpose()
                    .map_err(in_filter)?
                    .unwrap_or_default(),
                filter,
            });
            tables.push((file, table.text));
        }
        Ok(())
    });
    made.map_err(Error::identification(study_path))?;
    Ok((description, tables))
}

struct SampleTable {
    text: String,
    joints: usize,
    rate_hz: f64,
}

impl SampleTable {
    fn of(joints: &[String]) -> Self {
        let columns = ["q", "dq", "ddq", "tau", "used"].into_iter();
        let names = columns.flat_map(|kind| {
            joints.iter().map(move |joint| dynident_text::csv_field(&format!("{kind}_{joint}")).into_owned())
        });
        let head: Vec<String> = core::iter::once("segment".to_owned()).chain(names).collect();
        Self { text: head.join(",") + "\n", joints: joints.len(), rate_hz: 0.0 }
    }
}

impl RowConsumer for SampleTable {
    fn filtered(&mut self, _: &JointRows<'_>) -> Result<(), LogError> {
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        self.rate_hz = samples.rate_hz;
        let (rows, panels) = (samples.panels.samples(), samples.panels);
        for row in 0..rows {
            let _ = write!(self.text, "{}", samples.segment);
            for values in samples.motion {
                values.chunks_exact(rows).for_each(|joint| self.push(joint[row]));
            }
            for joint in 0..self.joints {
                let panel = panels.joint(joint);
                self.push(panel[panel.len() - rows + row]);
            }
            for joint in 0..self.joints {
                let is_masked = samples.set_aside.get(joint).is_some_and(|masked| masked[row]);
                self.text += if is_masked { ",0" } else { ",1" };
            }
            self.text.push('\n');
        }
        Ok(())
    }
}

impl SampleTable {
    /// Writes the shortest text that parses to the same number.
    fn push(&mut self, value: f64) {
        let _ = write!(self.text, ",{value:?}");
    }
}
