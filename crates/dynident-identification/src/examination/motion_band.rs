//! Prediction errors in the frequency band of the motion, which do not depend on the cut-off of the fit.

use dynident_estimation::{Validation, ValidationReport};
use dynident_recording::{DecimationSettings, FilterError};
use dynident_rows::{
    JointFilters, LogError, Logs, ParallelFilterSettings, RawSamples, RegressorModel, predicted_torque,
};

/// Measured torque, and predicted torque for several sets of base parameters, after a low-pass for the frequency band
/// of the motion. (In the band of the fit, a lower cut-off of the fit would reduce the errors.)
pub(crate) struct MotionBand<'a> {
    model: &'a RegressorModel,
    sets: Vec<&'a [f64]>,
    validations: Vec<Validation>,
    motion_hz: f64,
    filter: Option<(u64, usize, JointFilters)>,
    panel: Vec<f64>,
    predicted: Vec<f64>,
    counted: Vec<f64>,
}

impl<'a> MotionBand<'a> {
    /// Creates the comparison for these sets of base parameters; `None` if the band of the fit is that of the motion.
    pub(crate) fn of(logs: &Logs<'_>, model: &'a RegressorModel, sets: Vec<&'a [f64]>) -> Option<Self> {
        let motion_hz = logs.motion_hz()?;
        let validations = sets.iter().map(|_| Validation::new(model.joint_names())).collect();
        let (panel, predicted, counted) = (Vec::new(), Vec::new(), Vec::new());
        Some(Self { model, sets, validations, motion_hz, filter: None, panel, predicted, counted })
    }

    /// Adds samples before the parallel filter.
    pub(crate) fn raw(&mut self, log: &str, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let in_filter = |source| LogError::Filter { log: log.to_owned(), source };
        let rate_bits = samples.rate_hz.to_bits();
        let is_made = self.filter.as_ref().is_some_and(|(rate, ..)| *rate == rate_bits);
        if !is_made {
            let filters = self.filters(samples.rate_hz).map_err(in_filter)?;
            self.filter = Some((rate_bits, samples.segment, filters));
        }
        let Some((_, segment, filters)) = &mut self.filter else { return Ok(()) };
        if *segment != samples.segment {
            *segment = samples.segment;
            filters.restart();
        }
        let rows = samples.panels.samples();
        for joint in 0..self.model.dof() {
            let (columns, panel) = (self.model.layout().joint_columns(joint), samples.panels.joint(joint));
            self.panel.clear();
            self.panel.extend_from_slice(&panel[columns.len() * rows..][..rows]);
            for set in &self.sets {
                predicted_torque(panel, rows, columns, set, &mut self.predicted);
                self.panel.extend_from_slice(&self.predicted);
            }
            let left_out = samples.set_aside.get(joint).map_or(&[][..], Vec::as_slice);
            let left = filters.push(joint, &self.panel, rows, left_out).counted(&mut self.counted);
            if left.rows == 0 {
                continue;
            }
            let mut series = left.panel.chunks_exact(left.rows);
            let Some(measured) = series.next() else { continue };
            for (validation, predicted) in self.validations.iter_mut().zip(series) {
                let added = validation.add_joint(joint, measured, predicted);
                added.map_err(|source| LogError::Rows { log: log.to_owned(), source })?;
            }
        }
        filters.advance(rows);
        Ok(())
    }

    fn filters(&self, rate_hz: f64) -> Result<JointFilters, FilterError> {
        let every_sample = DecimationSettings { factor: 1, cutoff_hz: None, ..DecimationSettings::default() };
        let filter =
            ParallelFilterSettings::default().decimation(rate_hz, Some(self.motion_hz)).unwrap_or(every_sample);
        JointFilters::new(&vec![1 + self.sets.len(); self.model.dof()], rate_hz, Some(&filter))
    }

    /// One report for each set of base parameters; `None` without rows.
    pub(crate) fn reports(self) -> Option<Vec<ValidationReport>> {
        let reports: Vec<ValidationReport> = self.validations.iter().map(Validation::report).collect();
        reports.iter().all(|report| report.samples > 0).then_some(reports)
    }
}
