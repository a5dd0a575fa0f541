//! Torque offsets of a held-out recording, estimated on its first part.
//!
//! If each training log has separate offsets, the training logs do not determine the offsets of a held-out log. With
//! all other parameters fixed, the least-squares estimate of a joint's offset is the mean residual of the first part:
//!
//! ```text
//! δ = mean(τ − τ̂),   std(δ)² = var(means of B blocks)/B
//! ```
//!
//! The rest of the recording is the test. The standard deviation is computed from the means of blocks, so it includes
//! the correlation of the residuals.

use super::torque_trace::{JointTrace, LogTrace, TraceConsumer};
use crate::payload::base_column;
use dynident_dynamics::Column;
use dynident_model::terms::{Offset, TorqueTerm};
use dynident_recording::IgnoredTorque;
use dynident_rows::{JointRows, LogError, LogPass, Logs, RawSamples, Recording, RegressorModel, RowConsumer, Samples};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Number of blocks in the first part, for the standard deviation of an offset.
const OFFSET_BLOCKS: usize = 8;

/// Torque offsets of a held-out recording relative to the offsets of the model. They are estimated from the first part
/// of the recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OwnOffsets {
    /// Start and end of the first part, s after the first data row of the file.
    pub fitted_s: [f64; 2],
    /// The joints that have an offset.
    pub joints: Vec<OwnOffset>,
}

/// Torque offset of one joint in a held-out recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OwnOffset {
    /// The joint.
    pub name: String,
    /// Offset of this recording minus the offset of the model, Nm (N).
    pub change_nm: f64,
    /// Standard deviation of the change, Nm (N).
    pub std_nm: f64,
}

/// Changes of the offsets, with the indices of the joints.
pub(super) struct FittedOffsets {
    pub(super) fitted_s: [f64; 2],
    /// For each joint its index, the change of the offset, and the standard deviation of the change.
    changes: Vec<(usize, f64, f64)>,
}

/// All filtered residuals of a recording, for several sets of base parameters.
struct AllResiduals<'a>(Vec<TraceConsumer<'a>>);

impl RowConsumer for AllResiduals<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0.iter_mut().for_each(|trace| trace.filtered(rows));
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        self.0.iter_mut().for_each(|trace| trace.raw(samples));
        Ok(())
    }
}

impl FittedOffsets {
    /// Estimates the offsets from the first `share` of recording `index` (in time), for each of the base parameter sets
    /// in `sets`; their residuals have different means. `None` for a prepared motion, and without offsets or rows.
    pub(super) fn of(
        logs: &Logs<'_>,
        model: &RegressorModel,
        index: usize,
        sets: &[&[f64]],
        share: f64,
    ) -> Result<Option<Vec<Self>>, LogError> {
        let recording = &logs.recordings[index];
        let has_offset = |joint: &usize| model.terms().contains(&TorqueTerm::Offset(Offset { joint: *joint }));
        let joints: Vec<usize> = (0..model.model().dof()).filter(has_offset).collect();
        if joints.is_empty() || !matches!(recording.samples, Samples::Log(_)) {
            return Ok(None);
        }
        let traces = sets.iter().map(|theta| TraceConsumer::new(model, theta).with_all_rows());
        let mut all = AllResiduals(traces.collect());
        let statistics = LogPass { kept: None, ..logs.pass(model, index) }.run(&mut all)?;
        let finished =
            |trace: TraceConsumer<'_>| trace.finished(String::new(), recording.role, statistics.filtered_rate_hz);
        Ok(all.0.into_iter().map(|trace| Self::of_trace(&finished(trace), &joints, share)).collect())
    }

    fn of_trace(trace: &LogTrace, joints: &[usize], share: f64) -> Option<Self> {
        let (first, last) = (*trace.time_s.first()?, *trace.time_s.last()?);
        let end = first + share * (last - first);
        let rows = trace.time_s.partition_point(|time| *time <= end);
        let of_joint = |&joint: &usize| {
            let JointTrace { measured_nm, predicted_nm } = &trace.joints[joint];
            let residuals = measured_nm.iter().zip(predicted_nm).take(rows).map(|(measured, own)| measured - own);
            let valid: Vec<f64> = residuals.filter(|residual| residual.is_finite()).collect();
            let (change, std) = mean_and_std(&valid)?;
            Some((joint, change, std))
        };
        Some(Self { fitted_s: [first, end], changes: joints.iter().filter_map(of_joint).collect() })
    }

    /// The base parameters `theta` with the offsets of this recording.
    pub(super) fn applied(&self, model: &RegressorModel, theta: &[f64]) -> Vec<f64> {
        let mut values = theta.to_vec();
        for &(joint, change, _) in &self.changes {
            if let Some(column) = offset_column(model, joint, values.len()) {
                values.iter_mut().zip(column).for_each(|(value, share)| *value += change * share);
            }
        }
        values
    }

    /// Covariance of the base parameters, including that of the changed offsets.
    pub(super) fn covariance(&self, model: &RegressorModel, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let mut sum = covariance.clone();
        for &(joint, _, std) in &self.changes {
            if let Some(column) = offset_column(model, joint, sum.nrows()) {
                let column = nalgebra::DVector::from_vec(column);
                sum += &column * column.transpose() * (std * std);
            }
        }
        sum
    }

    /// The recordings, with the torque in the first part of recording `index` excluded.
    pub(super) fn rest(&self, recordings: &[Recording], index: usize) -> Vec<Recording> {
        let mut rest = recordings.to_vec();
        if let Samples::Log(log) = &mut rest[index].samples {
            let joints = (0..log.joints.len()).collect();
            log.ignored_torque.push(IgnoredTorque { time_s: [f64::MIN, self.fitted_s[1]], joints });
        }
        rest
    }

    pub(super) fn report(&self, names: &[String]) -> OwnOffsets {
        let of = |&(joint, change_nm, std_nm): &(usize, f64, f64)| OwnOffset {
            name: names[joint].clone(),
            change_nm,
            std_nm,
        };
        OwnOffsets { fitted_s: self.fitted_s, joints: self.changes.iter().map(of).collect() }
    }
}

/// Mean of the values, and its standard deviation from the means of [`OFFSET_BLOCKS`] blocks; `None` if there are fewer
/// values than blocks.
fn mean_and_std(values: &[f64]) -> Option<(f64, f64)> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    if values.len() < OFFSET_BLOCKS {
        return None;
    }
    let (all, blocks) = (mean(values), OFFSET_BLOCKS as f64);
    let of_block = |k: usize| mean(&values[k * values.len() / OFFSET_BLOCKS..(k + 1) * values.len() / OFFSET_BLOCKS]);
    let squares: f64 = (0..OFFSET_BLOCKS).map(|k| (of_block(k) - all).powi(2)).sum();
    Some((all, (squares / (blocks - 1.0) / blocks).sqrt()))
}

/// Change of the base parameters per unit of a joint's offset.
fn offset_column(model: &RegressorModel, joint: usize, rows: usize) -> Option<Vec<f64>> {
    let offset = Column::Term(TorqueTerm::Offset(Offset { joint }));
    let place = model.base().all_columns().iter().position(|column| *column == offset)?;
    Some(base_column(model, place, rows).as_slice().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_part_determines_mean_and_deviation() {
        // Residuals of 2 Nm in the first quarter (with a gap), of 5 Nm later.
        let residual = |row: usize| if row == 7 { f64::NAN } else { [2.0, 5.0][usize::from(row > 25)] };
        let joint =
            JointTrace { measured_nm: (0..101).map(|row| 1.0 + residual(row)).collect(), predicted_nm: vec![1.0; 101] };
        let time_s = (0..101).map(|row| 3.0 + 0.1 * f64::from(row)).collect();
        let trace = LogTrace { time_s, joints: vec![joint], ..LogTrace::default() };
        let found = FittedOffsets::of_trace(&trace, &[0], 0.25).expect("the trace has rows");
        assert_eq!(found.changes, [(0, 2.0, 0.0)]);
        assert!((found.fitted_s[0] - 3.0).abs() < 1e-12 && (found.fitted_s[1] - 5.5).abs() < 1e-12);
    }

    #[test]
    fn the_deviation_is_that_of_the_mean_of_independent_blocks() {
        // Blocks of ones and minus ones: sample variance 8/7, divided by 8 blocks.
        let values: Vec<f64> = (0..80).map(|k| if (k / 10) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let (mean, std) = mean_and_std(&values).expect("eight blocks");
        assert!(mean.abs() < 1e-15 && (std * std - 1.0 / 7.0).abs() < 1e-12);
        assert!(mean_and_std(&values[..7]).is_none());
    }
}
