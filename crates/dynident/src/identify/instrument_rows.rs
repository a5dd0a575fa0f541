//! A log's rows with their instruments, `[Z | W | τ]`: two motions through the same regressor and the same parallel filter.

use crate::error::Error;
use crate::identify::instruments::InstrumentSource;
use crate::measured::motion_log::motion_stream;
use crate::measured::rows::{PANEL_SAMPLES, Pass, decimation, in_model_order, motion_band_hz};
use dynident_dynamics::{BatchWorkspace, Panels, regressor_panels};
use dynident_estimation::{EstimationError, SegmentSettings, SegmentedFactor};
use dynident_model::laws::JointMotion;
use dynident_recording::{Decimator, MotionBlock};

/// The factors of one log's `[Z | W | τ]`, one for each joint.
pub(crate) fn instrumented_factors(
    pass: &Pass<'_>,
    source: &mut dyn InstrumentSource,
    segments: SegmentSettings,
) -> Result<Vec<SegmentedFactor>, Error> {
    let log = pass.study.log_name(pass.index);
    let failed = |source| Error::recording(&log, source);
    let in_log = |source: EstimationError| Error::Estimation { path: pass.file.to_owned(), source };
    let (model, layout, log_place) = (pass.machine.model(), pass.machine.layout(), &pass.machine.log_place);
    let mut stream = motion_stream(pass.study, pass.machine, pass.motion, pass.index, pass.file)?;
    let settings = decimation(&pass.study.parallel_filter, stream.rate_hz(), motion_band_hz(pass.motion));
    let widths: Vec<usize> = (0..model.dof()).map(|joint| 2 * layout.joint_columns(joint).len()).collect();
    let mut decimators = settings
        .map(|settings| {
            let one = |width: &usize| Decimator::new(&settings, stream.rate_hz(), width + 1);
            widths.iter().map(one).collect::<Result<Vec<_>, _>>()
        })
        .transpose()
        .map_err(|source| Error::Filter { log: log.clone(), source })?;
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
    source.begin(pass.index)?;
    while stream.next_block(&mut measured).map_err(failed)? {
        source.motion(&measured, &mut other)?;
        (other.rows, other.joints) = (measured.rows, measured.joints);
        let numbers = measured.rows * measured.joints;
        for (name, values) in [("q", &other.q), ("dq", &other.dq), ("ddq", &other.ddq)] {
            if values.len() != numbers {
                let found = values.len();
                let message =
                    format!("{found} numbers for {name} where {numbers} are needed: one for each joint and row");
                return Err(Error::Instruments { log, message });
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
                in_model_order(block, log_place, from, samples, &mut motion);
                let [q, dq, ddq] = &motion;
                regressor_panels(model, &mut workspace, layout, &JointMotion { samples, q, dq, ddq }, panels);
            }
            for (joint, &place) in log_place.iter().enumerate() {
                let width = widths[joint] / 2 * samples;
                panel.clear();
                panel.extend_from_slice(&instruments.joint(joint)[..width]);
                panel.extend_from_slice(&regressors.joint(joint)[..width]);
                panel.extend_from_slice(&measured.joint(measured.fitted_tau(), place)[from..from + samples]);
                let (rows, panel) = match &mut decimators {
                    Some(decimators) => (decimators[joint].push(&panel, samples, &mut out), &out),
                    None => (samples, &panel),
                };
                if rows > 0 {
                    factors[joint].absorb(panel, rows).map_err(in_log)?;
                }
            }
        }
        pass.progress.advance(measured.rows as u64);
    }
    Ok(factors)
}
