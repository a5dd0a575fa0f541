//! The pipeline from a recording to a motion, in memory.

use super::scenario::{DURATION_S, HARMONICS, RATE_HZ, Record};
use dynident_recording::{Derivatives, DifferentiatorSettings, FilterError, MotionBlock, cutoff};

/// Motion of the recording by the default differentiator with the automatic cut-off, and that cut-off.
pub(super) fn motion(record: &Record) -> Result<(MotionBlock, f64), FilterError> {
    let positions: Vec<&[f64]> = record.q.chunks_exact(record.samples).collect();
    let cutoff_hz = cutoff(&positions, RATE_HZ).cutoff_hz;
    differentiated(record, cutoff_hz).map(|block| (block, cutoff_hz))
}

/// Motion of the recording by the default differentiator with the given cut-off.
pub(super) fn differentiated(record: &Record, cutoff_hz: f64) -> Result<MotionBlock, FilterError> {
    differentiated_by(&DifferentiatorSettings::default(), record, cutoff_hz)
}

/// Motion of the recording as a Fourier series at the frequencies of the excitation, fitted to the positions.
pub(super) fn periodic(record: &Record) -> Result<MotionBlock, FilterError> {
    let settings = DifferentiatorSettings::FourierFit { base_hz: 1.0 / DURATION_S, harmonics: HARMONICS, trend: false };
    differentiated_by(&settings, record, 1.0)
}

fn differentiated_by(
    settings: &DifferentiatorSettings,
    record: &Record,
    cutoff_hz: f64,
) -> Result<MotionBlock, FilterError> {
    let positions: Vec<&[f64]> = record.q.chunks_exact(record.samples).collect();
    let differentiator = settings.build(cutoff_hz)?;
    let mut block = MotionBlock {
        rate_hz: RATE_HZ,
        rows: record.samples,
        joints: positions.len(),
        q: vec![0.0; record.q.len()],
        dq: vec![0.0; record.q.len()],
        ddq: vec![0.0; record.q.len()],
        tau: record.tau.clone(),
        ..MotionBlock::default()
    };
    for (joint, q) in positions.iter().enumerate() {
        let own = joint * record.samples..(joint + 1) * record.samples;
        let out =
            Derivatives { q: &mut block.q[own.clone()], dq: &mut block.dq[own.clone()], ddq: &mut block.ddq[own] };
        differentiator.differentiate(RATE_HZ, q, out)?;
    }
    Ok(block)
}
