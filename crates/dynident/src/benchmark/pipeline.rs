//! The pipeline's own way from a record to triangular factors, in memory.

use super::BenchmarkError;
use super::scenario::{DURATION_S, HARMONICS, RATE_HZ, Record, Scenario};
use crate::error::Error;
use crate::measured::rows::{Computer, JointRows, RawSamples, RowSink, decimation};
use crate::progress::Silent;
use crate::study::{EstimatorSection, ParallelFilterSection};
use dynident_estimation::{LinearProblem, SegmentedFactor};
use dynident_recording::{Derivatives, DifferentiatorSettings, FilterError, MotionBlock, cutoff};

/// The record's motion, by the default differentiator with the cut-off that the record itself suggests, and that cut-off.
pub(super) fn motion(record: &Record) -> Result<(MotionBlock, f64), FilterError> {
    let positions: Vec<&[f64]> = record.q.chunks_exact(record.samples).collect();
    let cutoff_hz = cutoff(&positions, RATE_HZ).cutoff_hz;
    differentiated(record, cutoff_hz).map(|block| (block, cutoff_hz))
}

/// The record's motion by the default differentiator with the given cut-off.
pub(super) fn differentiated(record: &Record, cutoff_hz: f64) -> Result<MotionBlock, FilterError> {
    differentiated_by(&DifferentiatorSettings::default(), record, cutoff_hz)
}

/// The record's motion by a Fourier series of the excitation's own frequencies, fitted to the positions: what is known of a periodic motion before the run.
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

struct Factors(Vec<SegmentedFactor>);

impl RowSink for Factors {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        self.0[rows.joint]
            .absorb(rows.panel, rows.rows)
            .map_err(|source| Error::Estimation { path: "benchmark".into(), source })
    }

    fn raw(&mut self, _samples: &RawSamples<'_>) -> Result<(), Error> {
        Ok(())
    }
}

/// Filtered rows of the motion as a problem; filter and decimation follow from the cut-off as in `identify`. Without a cut-off every sample as it is.
pub(super) fn problem(
    scenario: &Scenario,
    motion: &MotionBlock,
    cutoff_hz: Option<f64>,
) -> Result<LinearProblem, BenchmarkError> {
    let (model, layout) = (&scenario.model, &scenario.layout);
    let segments = EstimatorSection::default().segments;
    let joints: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let estimation = |source| BenchmarkError::Estimation { robot: scenario.robot.to_owned(), source };
    let factors = (0..model.dof())
        .map(|joint| SegmentedFactor::new(layout.joint_columns(joint).len(), segments))
        .collect::<Result<Vec<_>, _>>()
        .map_err(estimation)?;
    let filter =
        cutoff_hz.and_then(|cutoff| decimation(&ParallelFilterSection::default(), motion.rate_hz, Some(cutoff)));
    let places: Vec<usize> = (0..model.dof()).collect();
    let mut sink = Factors(factors);
    Computer::new(model, layout, &places, motion.rate_hz, filter.as_ref(), None, &Silent)
        .map_err(|source| BenchmarkError::Filter { robot: scenario.robot.to_owned(), source })?
        .take(motion, &mut sink)
        .map_err(|source| BenchmarkError::Pipeline(Box::new(source)))?;
    let symbols = layout.columns().iter().map(dynident_dynamics::Column::symbol).collect();
    let mut problem = LinearProblem::new(symbols, joints);
    for (joint, factor) in sink.0.into_iter().enumerate() {
        problem.add("run", joint, layout.joint_columns(joint).to_vec(), factor).map_err(estimation)?;
    }
    Ok(problem)
}
