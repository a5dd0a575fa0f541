//! Test of a model on a recording that was not used for the fit.

use super::finer_motion::{FinerRows, finer_rows};
use super::motion_band::MotionBand;
use super::nominal_agreement::{AgreementAccumulator, PriorAgreement};
use super::own_offsets::{FittedOffsets, OwnOffsets};
use super::residuals::{JointResiduals, ResidualAccumulator, Uncertainty};
use super::torque_trace::{LogTrace, TraceConsumer};
use crate::estimators::EstimationSettings;
use crate::examination_settings::ExaminationSettings;
use crate::lag::{DelayCheck, TorqueLag, lags_after_pass};
use dynident_estimation::{Validation, ValidationReport};
use dynident_rows::{
    JointRows, LogError, LogPass, LogStatistics, Logs, RawSamples, RegressorModel, Role, RowConsumer, Samples,
    predicted_torque,
};
use serde::{Deserialize, Serialize};

/// Errors of the predicted torque on one held-out recording.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LogValidation {
    /// The log.
    pub log: String,
    /// Errors for the torque in the frequency band of the motion, which does not depend on the cut-off of the fit. If
    /// the study states the cut-off, errors in the band of the fit.
    #[serde(flatten)]
    pub model: ValidationReport,
    /// Errors for the torque in the frequency band of the fit, if this is another band.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_fit_band: Option<ValidationReport>,
    /// Errors for the torque as logged, without a filter.
    pub raw: ValidationReport,
    /// Errors of the physically consistent set for the torque as logged; missing in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raw_physical: Option<ValidationReport>,
    /// Errors of the physically consistent set for the same torque as `model`.
    pub physical: Option<ValidationReport>,
    /// Errors of the robot description for the same torque as `model`.
    pub prior: Option<ValidationReport>,
    /// Residual diagnostics of each joint.
    pub residuals: Vec<JointResiduals>,
    /// Torque offsets of this log, if each log has separate offsets. They are estimated from the first part of the log;
    /// the errors are those of the rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own_offsets: Option<OwnOffsets>,
    /// Errors without the intervals of clear events; missing without such events.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub without_events: Option<WithoutEvents>,
}

impl LogValidation {
    /// Errors of the exported model: of the physically consistent set, or of the estimate if there is no such set.
    pub fn exported(&self) -> &ValidationReport {
        self.physical.as_ref().unwrap_or(&self.model)
    }

    /// Errors of the exported model for the torque as logged, without a filter; `None` in results of older versions.
    pub fn exported_raw(&self) -> Option<&ValidationReport> {
        if self.physical.is_some() { self.raw_physical.as_ref() } else { Some(&self.raw) }
    }
}

/// Errors on a held-out recording without the intervals of clear events.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WithoutEvents {
    /// Excluded intervals, s after the first data row of the file.
    pub left_out_s: Vec<[f64; 2]>,
    /// Share of the log's rows that are excluded, from 0 to 1.
    pub left_out_share: f64,
    /// Errors for the torque in the same frequency band as the errors of the complete log.
    pub model: ValidationReport,
    /// Errors of the physically consistent set for the same torque.
    pub physical: Option<ValidationReport>,
}

/// Result of testing a model on one recording.
#[derive(Clone, Debug)]
pub struct HeldOutExamination {
    /// Index of the recording.
    pub index: usize,
    /// Errors of the predicted torque.
    pub validation: LogValidation,
    /// Statistics from reading the recording.
    pub statistics: LogStatistics,
    /// Agreement of the log with the robot description; `None` without nominal values.
    pub nominal_agreement: Option<PriorAgreement>,
    /// Lag of each joint's torque; `None` if the log does not determine it.
    pub delays: Vec<Option<TorqueLag>>,
    /// Measured and predicted torque over time, if requested.
    pub trace: Option<LogTrace>,
}

struct HeldOutTest<'a> {
    rows_of: &'a RegressorModel,
    log: String,
    theta: &'a [f64],
    residuals: Vec<ResidualAccumulator>,
    model: Validation,
    physical: Option<(&'a [f64], Validation)>,
    raw: Validation,
    raw_physical: Option<(&'a [f64], Validation)>,
    prior: Option<(&'a [f64], Validation)>,
    motion_band: Option<MotionBand<'a>>,
    /// Agreement with the nominal values for each joint; `None` without nominal values.
    agreement: Option<Vec<AgreementAccumulator<'a>>>,
    delay: DelayCheck<'a>,
    trace: Option<TraceConsumer<'a>>,
    buffer: Vec<f64>,
    counted: Vec<f64>,
    /// Rows of each joint with a higher cut-off, and the number of rows already processed.
    finer: Option<Vec<(FinerRows, usize)>>,
}

impl HeldOutTest<'_> {
    /// Adds the errors and residuals of the used rows.
    fn add_errors(&mut self, rows: &JointRows<'_>, finer: &[[f64; 2]]) -> Result<(), LogError> {
        let columns = self.rows_of.layout().joint_columns(rows.joint);
        let measured = &rows.panel[columns.len() * rows.rows..];
        predicted_torque(rows.panel, rows.rows, columns, self.theta, &mut self.buffer);
        self.model.add_joint(rows.joint, measured, &self.buffer).map_err(|source| self.failed(source))?;
        self.residuals[rows.joint].add(rows.panel, rows.rows, &self.buffer, finer);
        for (prior, validation) in [&mut self.prior, &mut self.physical].into_iter().flatten() {
            predicted_torque(rows.panel, rows.rows, columns, prior, &mut self.buffer);
            let added = validation.add_joint(rows.joint, measured, &self.buffer);
            added.map_err(|source| LogError::Rows { log: self.log.clone(), source })?;
        }
        if let Some(agreement) = &mut self.agreement {
            agreement[rows.joint].filtered(rows).map_err(|source| self.failed(source))?;
        }
        Ok(())
    }

    /// For every valid row, the prediction with the higher cut-off and the largest torque of friction at rest; empty if
    /// unknown.
    fn finer_of(&mut self, rows: &JointRows<'_>) -> Vec<[f64; 2]> {
        let Some((finer, from)) = self.finer.as_mut().and_then(|joints| joints.get_mut(rows.joint)) else {
            return Vec::new();
        };
        let first = *from;
        *from += rows.rows;
        let of = |row: usize| Some([*finer.predicted.get(first + row)?, *finer.held.get(first + row)?]);
        let all: Option<Vec<[f64; 2]>> = (0..rows.rows).filter(|&row| rows.counts(row)).map(of).collect();
        all.unwrap_or_default()
    }

    fn failed(&self, source: dynident_estimation::EstimationError) -> LogError {
        LogError::Rows { log: self.log.clone(), source }
    }
}

impl RowConsumer for HeldOutTest<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        let mut counted = core::mem::take(&mut self.counted);
        let finer = self.finer_of(rows);
        let added = self.add_errors(&rows.counted(&mut counted), &finer);
        self.counted = counted;
        added?;
        // The plot of the torque also needs rows that the errors do not use.
        if let Some(trace) = &mut self.trace {
            trace.filtered(rows);
        }
        self.delay.filtered(rows)
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let rows = samples.panels.samples();
        for joint in 0..self.rows_of.model().dof() {
            let columns = self.rows_of.layout().joint_columns(joint);
            let panel = samples.panels.joint(joint);
            // Rows with extrapolated motion or rejected torque are excluded.
            let measured = &panel[columns.len() * rows..];
            let set_aside = samples.set_aside.get(joint);
            let counts = |row: &usize| set_aside.is_none_or(|set_aside| !set_aside[*row]);
            let estimate = core::iter::once((self.theta, &mut self.raw));
            let physical = self.raw_physical.iter_mut().map(|(theta, raw)| (*theta, raw));
            for (theta, raw) in estimate.chain(physical) {
                predicted_torque(panel, rows, columns, theta, &mut self.buffer);
                let kept = samples.settled.clone().filter(counts);
                let (measured, predicted): (Vec<f64>, Vec<f64>) =
                    kept.map(|row| (measured[row], self.buffer[row])).unzip();
                let added = raw.add_joint(joint, &measured, &predicted);
                added.map_err(|source| LogError::Rows { log: self.log.clone(), source })?;
            }
        }
        if let Some(band) = &mut self.motion_band {
            band.raw(&self.log, samples)?;
        }
        if let Some(trace) = &mut self.trace {
            trace.raw(samples);
        }
        self.delay.raw(samples)
    }
}

/// The model that is tested on a recording.
#[derive(Clone, Copy, Debug)]
pub struct ModelUnderTest<'a> {
    /// Base parameters.
    pub theta: &'a [f64],
    /// Base parameters of the physically consistent set.
    pub physical: Option<&'a [f64]>,
    /// Uncertainty from which the 95 % band of the predicted torque is computed.
    pub uncertainty: Option<&'a Uncertainty>,
    /// Whether to store the torque over time. The prediction uses the physically consistent set, if given.
    pub traced: bool,
    /// Share of the recording, from its start, that determines separate torque offsets of this recording, from 0 to 1;
    /// the rest is the test. `None` to use the offsets of the model.
    pub offset_share: Option<f64>,
}

/// Tests base parameters, and the base parameters of the physically consistent set, on the recording with this index.
///
/// # Errors
/// An unreadable recording.
pub fn examine_held_out(
    logs: &Logs<'_>,
    settings: &EstimationSettings,
    model: &RegressorModel,
    index: usize,
    tested: &ModelUnderTest<'_>,
) -> Result<HeldOutExamination, LogError> {
    logs.begin(&format!("testing on {}", logs.recordings[index].name), &[index]);
    let found = tested_on(logs, (settings, &ExaminationSettings::default()), model, index, tested, true);
    logs.end();
    found
}

/// [`examine_held_out`] as a part of a larger job; `alone` allows a second thread for reading.
pub(crate) fn tested_on(
    logs: &Logs<'_>,
    (settings, limits): (&EstimationSettings, &ExaminationSettings),
    model: &RegressorModel,
    index: usize,
    tested: &ModelUnderTest<'_>,
    alone: bool,
) -> Result<HeldOutExamination, LogError> {
    if let Some(share) = tested.offset_share {
        let plain = ModelUnderTest { offset_share: None, ..*tested };
        return tested_on_rest(logs, (settings, limits), model, index, &plain, share, alone);
    }
    let ModelUnderTest { theta, physical, uncertainty, traced, .. } = *tested;
    let (recording, joints) = (&logs.recordings[index], model.joint_names());
    let nominal = model.parametric.nominal_base();
    // Errors in the frequency band of the motion require the samples of a log.
    let is_whole = matches!(recording.samples, Samples::Log(_));
    let sets = [Some(theta), physical, nominal].into_iter().flatten().collect();
    let finer = if is_whole { finer_rows(logs, model, theta, index, limits.finer_cutoff_ratio)? } else { None };
    let mut test = HeldOutTest {
        finer: finer.map(|joints| joints.into_iter().map(|rows| (rows, 0)).collect()),
        motion_band: if is_whole { MotionBand::of(logs, model, sets) } else { None },
        rows_of: model,
        log: recording.label(),
        theta,
        residuals: (0..joints.len()).map(|joint| ResidualAccumulator::new(model, theta, joint, uncertainty)).collect(),
        model: Validation::new(joints.clone()),
        physical: physical.map(|physical| (physical, Validation::new(joints.clone()))),
        raw: Validation::new(joints.clone()),
        raw_physical: physical.map(|physical| (physical, Validation::new(joints.clone()))),
        prior: nominal.map(|nominal| (nominal, Validation::new(joints.clone()))),
        agreement: nominal
            .map(|nominal| (0..model.dof()).map(|joint| AgreementAccumulator::new(model, joint, nominal)).collect()),
        delay: DelayCheck::new(model, theta),
        trace: traced.then(|| TraceConsumer::new(model, physical.unwrap_or(theta))),
        buffer: Vec::new(),
        counted: Vec::new(),
    };
    let reader_thread = alone && logs.execution.parallel();
    let statistics = LogPass { reader_thread, kept: None, ..logs.pass(model, index) }.run(&mut test)?;
    let name = &recording.name;
    let (mut tested_model, mut tested_physical) = (test.model.report(), test.physical.map(|(_, set)| set.report()));
    let (mut tested_prior, mut in_fit_band) = (test.prior.map(|(_, set)| set.report()), None);
    if let Some(reports) = test.motion_band.and_then(MotionBand::reports) {
        let mut reports = reports.into_iter();
        if let Some(in_motion_band) = reports.next() {
            in_fit_band = Some(core::mem::replace(&mut tested_model, in_motion_band));
        }
        for set in [&mut tested_physical, &mut tested_prior].into_iter().flatten() {
            if let Some(in_motion_band) = reports.next() {
                *set = in_motion_band;
            }
        }
    }
    let residuals =
        test.residuals.iter().zip(&joints).map(|(residuals, joint)| residuals.report(name, joint)).collect();
    Ok(HeldOutExamination {
        index,
        validation: LogValidation {
            log: name.clone(),
            model: tested_model,
            in_fit_band,
            raw: test.raw.report(),
            raw_physical: test.raw_physical.map(|(_, set)| set.report()),
            physical: tested_physical,
            prior: tested_prior,
            residuals,
            own_offsets: None,
            without_events: None,
        },
        nominal_agreement: test.agreement.map(|rows| PriorAgreement::of_rows(model, &rows, limits)),
        delays: lags_after_pass(test.delay, (logs, settings), index)?,
        trace: test.trace.map(|trace| trace.finished(name.clone(), Role::Validate, statistics.filtered_rate_hz)),
        statistics,
    })
}

/// As [`tested_on`], but the first `share` of the recording determines its offsets, and the rest is the test.
fn tested_on_rest(
    logs: &Logs<'_>,
    limits: (&EstimationSettings, &ExaminationSettings),
    model: &RegressorModel,
    index: usize,
    tested: &ModelUnderTest<'_>,
    share: f64,
    alone: bool,
) -> Result<HeldOutExamination, LogError> {
    let sets: Vec<&[f64]> = [Some(tested.theta), tested.physical].into_iter().flatten().collect();
    let Some(fitted) = FittedOffsets::of(logs, model, index, &sets, share)? else {
        return tested_on(logs, limits, model, index, tested, alone);
    };
    let own = &fitted[0];
    let physical = tested.physical.zip(fitted.get(1)).map(|(physical, own)| own.applied(model, physical));
    let theta = own.applied(model, tested.theta);
    let uncertainty = tested.uncertainty.map(|known| known.with_covariance(own.covariance(model, known.covariance())));
    let rest = own.rest(logs.recordings, index);
    let changed =
        ModelUnderTest { theta: &theta, physical: physical.as_deref(), uncertainty: uncertainty.as_ref(), ..*tested };
    let mut found = tested_on(&logs.with_recordings(&rest), limits, model, index, &changed, alone)?;
    found.validation.own_offsets = Some(own.report(&model.joint_names()));
    Ok(found)
}
