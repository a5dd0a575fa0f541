//! Test of several sets of base parameters on held-out recordings, in one pass over each recording.

use crate::examination::MotionBand;
use dynident_estimation::{EstimationError, Validation, ValidationReport};
use dynident_rows::{
    JointRows, LogError, LogPass, Logs, RawSamples, RegressorModel, RowConsumer, Samples, predicted_torque,
};

struct FormsTest<'a> {
    model: &'a RegressorModel,
    log: String,
    sets: &'a [&'a [f64]],
    in_fit_band: Vec<Validation>,
    motion_band: Option<MotionBand<'a>>,
    predicted: Vec<f64>,
    counted: Vec<f64>,
}

impl RowConsumer for FormsTest<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        let rows = rows.counted(&mut self.counted);
        let columns = self.model.layout().joint_columns(rows.joint);
        let measured = &rows.panel[columns.len() * rows.rows..];
        for (set, validation) in self.sets.iter().zip(&mut self.in_fit_band) {
            predicted_torque(rows.panel, rows.rows, columns, set, &mut self.predicted);
            let added = validation.add_joint(rows.joint, measured, &self.predicted);
            added.map_err(|source: EstimationError| LogError::Rows { log: self.log.clone(), source })?;
        }
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        match &mut self.motion_band {
            Some(band) => band.raw(&self.log, samples),
            None => Ok(()),
        }
    }

    fn reads_samples(&self) -> bool {
        self.motion_band.is_some()
    }
}

/// For each of the recordings `held_out`, the torque error of every set in the frequency band of the motion, as in
/// [`examine_held_out`](crate::examination::examine_held_out).
///
/// # Errors
/// Recordings that cannot be read.
pub(super) fn tested_forms(
    logs: &Logs<'_>,
    model: &RegressorModel,
    sets: &[&[f64]],
    held_out: &[usize],
) -> Result<Vec<Vec<ValidationReport>>, LogError> {
    let names = model.joint_names();
    logs.begin("forms of the model on held-out logs", held_out);
    let one = |&index: &usize| -> Result<Vec<ValidationReport>, LogError> {
        let recording = &logs.recordings[index];
        let is_whole = matches!(recording.samples, Samples::Log(_));
        let mut test = FormsTest {
            model,
            log: recording.label(),
            sets,
            in_fit_band: sets.iter().map(|_| Validation::new(names.clone())).collect(),
            motion_band: if is_whole { MotionBand::of(logs, model, sets.to_vec()) } else { None },
            predicted: Vec::new(),
            counted: Vec::new(),
        };
        LogPass { kept: None, ..logs.pass(model, index) }.run(&mut test)?;
        let in_fit_band = || test.in_fit_band.iter().map(Validation::report).collect();
        Ok(test.motion_band.take().and_then(MotionBand::reports).unwrap_or_else(in_fit_band))
    };
    let found = held_out.iter().map(one).collect();
    logs.end();
    found
}
