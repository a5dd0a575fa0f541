//! A log's rows with their instruments, `[Z | W | τ]`: two motions through the same regressor and the same parallel
//! filter.

use super::instruments::InstrumentSource;
use super::{EstimatorError, TrainingRows};
use crate::recording::LogError;
use crate::rows::{PANEL_SAMPLES, in_model_order, motion_band_hz, set_aside};
use dynident_dynamics::{BatchWorkspace, Panels, regressor_panels};
use dynident_estimation::{EstimationError, SegmentedFactor};
use dynident_model::terms::JointMotion;
use dynident_recording::{Decimator, MotionBlock};

/// The factors of one log's `[Z | W | τ]`, one for each joint.
pub(super) fn instrumented_factors(
    rows: &TrainingRows<'_>,
    index: usize,
    source: &mut dyn InstrumentSource,
) -> Result<Vec<SegmentedFactor>, EstimatorError> {
    let (logs, recording) = (rows.logs, &rows.logs.recordings[index]);
    let log = recording.name.clone();
    let failed = |source| LogError::recording(&log, source);
    let in_log = |source: EstimationError| LogError::Rows { log: recording.label(), source };
    let (model, layout) = (rows.model.model(), rows.model.layout());
    let places = recording.places(model)?;
    let Some(mut stream) = recording.open(model, &logs.motion)? else {
        let message = "a motion that is made already has no instruments: give its raw samples".to_owned();
        return Err(EstimatorError::Instruments { log, message });
    };
    let settings = logs.filter.decimation(stream.rate_hz(), motion_band_hz(&logs.motion));
    let segments = rows.settings.segments;
    let widths: Vec<usize> = (0..model.dof()).map(|joint| 2 * layout.joint_columns(joint).len()).collect();
    let mut decimators = settings
        .map(|settings| {
            let one = |width: &usize| Decimator::new(&settings, stream.rate_hz(), width + 1);
            widths.iter().map(one).collect::<Result<Vec<_>, _>>()
        })
        .transpose()
        .map_err(|source| LogError::Filter { log: log.clone(), source })?;
    let mut factors = widths
        .iter()
        .map(|width| SegmentedFactor::new(*width, segments))
        .collect::<Result<Vec<_>, _>>()
        .map_err(in_log)?;
    let mut workspace = BatchWorkspace::new(model);
    let (mut instruments, mut regressors) = (Panels::default(), Panels::default());
    let (mut measured, mut other) = (MotionBlock::default(), MotionBlock::default());
    let (mut motion, mut panel, mut out) = ([Vec::new(), Vec::new(), Vec::new()], Vec::new(), Vec::new());
    let mut segment = 0;
    source.begin(index)?;
    while stream.next_block(&mut measured).map_err(failed)? {
        source.motion(&measured, &mut other)?;
        (other.rows, other.joints) = (measured.rows, measured.joints);
        let numbers = measured.rows * measured.joints;
        for (name, values) in [("q", &other.q), ("dq", &other.dq), ("ddq", &other.ddq)] {
            if values.len() != numbers {
                let found = values.len();
                let message =
                    format!("{found} numbers for {name} where {numbers} are needed: one for each joint and row");
                return Err(EstimatorError::Instruments { log, message });
            }
        }
        if measured.segment != segment {
            segment = measured.segment;
            decimators.iter_mut().flatten().for_each(|decimator| {
                decimator.finish();
            });
        }
        for from in (0..measured.rows).step_by(PANEL_SAMPLES) {
            let samples = PANEL_SAMPLES.min(measured.rows - from);
            for (block, panels) in [(&other, &mut instruments), (&measured, &mut regressors)] {
                in_model_order(block, &places, from, samples, &mut motion);
                let [q, dq, ddq] = &motion;
                regressor_panels(model, &mut workspace, layout, &JointMotion { samples, q, dq, ddq }, panels);
            }
            for (joint, &place) in places.iter().enumerate() {
                let width = widths[joint] / 2 * samples;
                panel.clear();
                panel.extend_from_slice(&instruments.joint(joint)[..width]);
                panel.extend_from_slice(&regressors.joint(joint)[..width]);
                panel.extend_from_slice(&measured.joint(measured.fitted_tau(), place)[from..from + samples]);
                // What does not count is left out of all columns alike, before the filter.
                for (sample, _) in
                    set_aside(&measured, place, from, samples).iter().enumerate().filter(|(_, left_out)| **left_out)
                {
                    panel.chunks_exact_mut(samples).for_each(|column| column[sample] = 0.0);
                }
                let (rows, panel) = match &mut decimators {
                    Some(decimators) => (decimators[joint].push(&panel, samples, &mut out), &out),
                    None => (samples, &panel),
                };
                if rows > 0 {
                    factors[joint].absorb(panel, rows).map_err(in_log)?;
                }
            }
        }
        logs.execution.progress.advance(measured.rows as u64);
    }
    Ok(factors)
}
