//! Rows of a log with their instruments, `[Z | W | τ]`: instruments Z from a second motion, regressor W from the
//! measured motion, and torque τ, all after the same parallel filter.

use super::instruments::InstrumentSource;
use super::{EstimatorError, TrainingRows};
use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_estimation::{EstimationError, SegmentedFactor};
use dynident_model::terms::JointMotion;
use dynident_recording::MotionBlock;
use dynident_rows::{
    JointFilters, LogError, LogPass, PANEL_SAMPLES, RegressorModel, Samples, in_model_order, motion_band_hz,
    predicted_torque, set_aside,
};
use std::borrow::Cow;

/// Triangular factors of `[Z | W | τ]` of one log, one for each joint.
pub(super) fn instrumented_factors(
    rows: &TrainingRows<'_>,
    index: usize,
    source: &mut dyn InstrumentSource,
) -> Result<Vec<SegmentedFactor>, EstimatorError> {
    made_rows(rows, index, None, None, source).map(|made| made.factors)
}

/// Triangular factors of `[(W − Z) θ | τ − Z θ]` of one log or of its first samples, one for each joint, and
/// `‖(W − Z) θ‖²` of each joint.
pub(super) fn fast_motion_factors(
    rows: &TrainingRows<'_>,
    index: usize,
    theta: &[f64],
    most_samples: Option<u64>,
    source: &mut dyn InstrumentSource,
) -> Result<(Vec<SegmentedFactor>, Vec<f64>), EstimatorError> {
    made_rows(rows, index, Some(theta), most_samples, source).map(|made| (made.factors, made.squares))
}

fn made_rows<'r, 'a>(
    rows: &'r TrainingRows<'a>,
    index: usize,
    theta: Option<&'r [f64]>,
    most_samples: Option<u64>,
    source: &mut dyn InstrumentSource,
) -> Result<InstrumentedRows<'r, 'a>, EstimatorError> {
    let (logs, recording) = (rows.logs, &rows.logs.recordings[index]);
    let mut builder = InstrumentedRows::new(rows, index, theta)?;
    source.begin(index)?;
    if let Samples::Motion(_) = recording.samples {
        let Some(mut stream) = recording.open(rows.model.model(), &logs.motion)? else {
            let message = "a prepared motion has no instruments; give raw samples".to_owned();
            return Err(EstimatorError::Instruments { log: recording.name.clone(), message });
        };
        let mut block = MotionBlock::default();
        while stream.next_block(&mut block).map_err(|source| LogError::recording(&recording.name, source))? {
            builder.take(&block, source)?;
            logs.execution.progress.advance(block.rows as u64);
        }
        return Ok(builder);
    }
    let mut refused = None;
    let pass = LogPass { most_samples, ..logs.pass(rows.model, index) };
    pass.each_block(&mut |block| {
        if refused.is_none() {
            refused = builder.take(block, source).err();
        }
        Ok(())
    })?;
    refused.map_or(Ok(builder), Err)
}

/// For each sample, whether it is invalid in the measured motion or extrapolated at an end of the instruments' motion.
fn left_out<'m>(
    measured: &'m MotionBlock,
    instruments: &MotionBlock,
    place: usize,
    from: usize,
    samples: usize,
) -> Cow<'m, [bool]> {
    let of_measured = set_aside(measured, place, from, samples);
    let ends = MotionBlock { rows: instruments.rows, unsettled: instruments.unsettled, ..MotionBlock::default() };
    let of_instruments = set_aside(&ends, 0, from, samples);
    if of_instruments.is_empty() || of_measured.is_empty() {
        return if of_measured.is_empty() { Cow::Owned(of_instruments.into_owned()) } else { of_measured };
    }
    of_measured.iter().zip(of_instruments.iter()).map(|(own, other)| *own || *other).collect()
}

struct InstrumentedRows<'r, 'a> {
    rows: &'r TrainingRows<'a>,
    log: String,
    label: String,
    places: Vec<usize>,
    /// Base parameters, if only the torques of both motions are needed; `None` for complete regressors.
    theta: Option<&'r [f64]>,
    /// Number of columns in each joint's rows, without the last.
    widths: Vec<usize>,
    /// Sum of squares of the first filtered column of each joint.
    squares: Vec<f64>,
    /// Filters; created with the first block, because it defines the sample rate.
    filters: Option<JointFilters>,
    factors: Vec<SegmentedFactor>,
    /// Regressors of both motions, the instruments first.
    makers: [RowMaker; 2],
    other: MotionBlock,
    temperature_c: Vec<f64>,
    panel: Vec<f64>,
    slow: Vec<f64>,
    counted: Vec<f64>,
    segment: usize,
}

struct RowMaker {
    workspace: BatchWorkspace,
    history: TermHistory,
    panels: Panels,
    motion: [Vec<f64>; 3],
}

impl RowMaker {
    fn new(model: &RegressorModel) -> Self {
        let (workspace, history) =
            (BatchWorkspace::new(model.model()), TermHistory::new(model.load_parameters.clone()));
        Self { workspace, history, panels: Panels::default(), motion: Default::default() }
    }

    /// Computes the regressor panels of some samples of `block`. The joints of the model have the indices `places` in
    /// the block.
    fn make(&mut self, model: &RegressorModel, block: &MotionBlock, places: &[usize], from: usize, samples: usize) {
        in_model_order(block, places, from, samples, &mut self.motion);
        let [q, dq, ddq] = &self.motion;
        let motion = JointMotion { samples, q, dq, ddq };
        let (history, panels) = (&mut self.history, &mut self.panels);
        regressor_panels_following(model.model(), &mut self.workspace, model.layout(), &motion, history, panels);
    }
}

impl<'r, 'a> InstrumentedRows<'r, 'a> {
    fn new(rows: &'r TrainingRows<'a>, index: usize, theta: Option<&'r [f64]>) -> Result<Self, EstimatorError> {
        let recording = &rows.logs.recordings[index];
        let (model, layout) = (rows.model.model(), rows.model.layout());
        let widths: Vec<usize> = (0..model.dof())
            .map(|joint| if theta.is_some() { 1 } else { 2 * layout.joint_columns(joint).len() })
            .collect();
        let label = recording.label();
        let factors = widths
            .iter()
            .map(|width| SegmentedFactor::new(*width, rows.settings.segments))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|source: EstimationError| LogError::Rows { log: label.clone(), source })?;
        Ok(Self {
            rows,
            log: recording.name.clone(),
            label,
            places: recording.joint_indices(model)?,
            theta,
            squares: vec![0.0; widths.len()],
            widths,
            filters: None,
            factors,
            makers: [RowMaker::new(rows.model), RowMaker::new(rows.model)],
            other: MotionBlock::default(),
            temperature_c: Vec::new(),
            panel: Vec::new(),
            slow: Vec::new(),
            counted: Vec::new(),
            segment: 0,
        })
    }

    fn filters_at(&self, rate_hz: f64) -> Result<JointFilters, LogError> {
        let logs = self.rows.logs;
        let settings = logs.filter.decimation(rate_hz, motion_band_hz(&logs.motion));
        let columns: Vec<usize> = self.widths.iter().map(|width| width + 1).collect();
        JointFilters::new(&columns, rate_hz, settings.as_ref())
            .map_err(|source| LogError::Filter { log: self.log.clone(), source })
    }

    fn take(&mut self, measured: &MotionBlock, source: &mut dyn InstrumentSource) -> Result<(), EstimatorError> {
        source.motion(measured, &mut self.other)?;
        (self.other.rows, self.other.joints) = (measured.rows, measured.joints);
        let numbers = measured.rows * measured.joints;
        for (name, values) in [("q", &self.other.q), ("dq", &self.other.dq), ("ddq", &self.other.ddq)] {
            if values.len() != numbers {
                let found = values.len();
                let message =
                    format!("{found} values for {name}, but {numbers} are needed: give one for each joint and row");
                return Err(EstimatorError::Instruments { log: self.log.clone(), message });
            }
        }
        let filters = match self.filters.take() {
            Some(filters) => filters,
            None => self.filters_at(measured.rate_hz)?,
        };
        let filters = self.filters.insert(filters);
        if measured.segment != self.segment {
            self.segment = measured.segment;
            self.makers.iter_mut().for_each(|maker| maker.history.restart());
            filters.restart();
        }
        let layout = self.rows.model.layout();
        for from in (0..measured.rows).step_by(PANEL_SAMPLES) {
            let samples = PANEL_SAMPLES.min(measured.rows - from);
            if !measured.temperature_c.is_empty() {
                self.temperature_c.clear();
                for &place in &self.places {
                    let temperature = measured.joint(&measured.temperature_c, place);
                    self.temperature_c.extend_from_slice(&temperature[from..from + samples]);
                }
                self.makers.iter_mut().for_each(|maker| maker.history.set_temperature(&self.temperature_c));
            }
            let (model, places) = (self.rows.model, &self.places);
            let [other, own] = &mut self.makers;
            rayon::join(
                || other.make(model, &self.other, places, from, samples),
                || own.make(model, measured, places, from, samples),
            );
            for (joint, &place) in self.places.iter().enumerate() {
                let columns = layout.joint_columns(joint);
                let gain = self.rows.model.torque_gains.get(joint).copied().unwrap_or(1.0);
                let torque = &measured.joint(measured.fitted_tau(), place)[from..from + samples];
                let [other, own] = [&self.makers[0].panels, &self.makers[1].panels];
                self.panel.clear();
                if let Some(theta) = self.theta {
                    predicted_torque(other.joint(joint), samples, columns, theta, &mut self.slow);
                    predicted_torque(own.joint(joint), samples, columns, theta, &mut self.panel);
                    self.panel.iter_mut().zip(&self.slow).for_each(|(own, slow)| *own -= slow);
                    self.panel.extend(torque.iter().zip(&self.slow).map(|(torque, slow)| gain * torque - slow));
                } else {
                    let width = columns.len() * samples;
                    self.panel.extend_from_slice(&other.joint(joint)[..width]);
                    self.panel.extend_from_slice(&own.joint(joint)[..width]);
                    self.panel.extend(torque.iter().map(|torque| gain * torque));
                }
                // Invalid samples are excluded from both motions and from the torque, as in the rows of a fit.
                let left_out = left_out(measured, &self.other, place, from, samples);
                let rows = filters.push(joint, &self.panel, samples, &left_out).counted(&mut self.counted);
                if rows.rows > 0 {
                    self.squares[joint] += rows.panel[..rows.rows].iter().map(|value| value * value).sum::<f64>();
                    self.factors[joint]
                        .absorb(rows.panel, rows.rows)
                        .map_err(|source| LogError::Rows { log: self.label.clone(), source })?;
                }
            }
            filters.advance(samples);
        }
        Ok(())
    }
}
