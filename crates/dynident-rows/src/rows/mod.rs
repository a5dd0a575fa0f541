//! Filtered rows of regressor and torque, the input of all estimators and examinations.
//!
//! Samples are processed in blocks: positions are differentiated, the regressor is computed from the motion, and
//! regressor and torque pass the same low-pass and decimation. A [`RowConsumer`] receives the resulting rows. The
//! unfiltered regressor is never stored; filtered rows are stored if they fit into memory.

mod builder;
mod collector;
mod coverage;
mod declared;
mod filter;
mod joint_filters;
mod kept_log;
mod mask;
mod mask_of_block;
mod motion_noise;
mod panel_pipeline;
mod pass;
mod row_block;
mod row_store;
mod samples;
#[cfg(test)]
mod test_log;
mod velocities;

pub use builder::RowBuilder;
pub use coverage::divide_by_coverage;
pub use filter::{ParallelFilterError, ParallelFilterSettings, motion_band_hz};
pub use joint_filters::JointFilters;
pub use kept_log::KeptLog;
pub use mask_of_block::set_aside;
pub use motion_noise::noise_factors;
pub use pass::{LogPass, LogStatistics};
pub use row_block::RowBlock;
pub use samples::in_model_order;
pub use velocities::VelocityHistogram;

use crate::recording::LogError;
use dynident_dynamics::Panels;

/// Samples per panel: small enough for the cache, large enough to reduce the overhead of the filter.
pub const PANEL_SAMPLES: usize = 256;

/// Filtered rows of one joint.
#[derive(Clone, Copy, Debug)]
pub struct JointRows<'a> {
    /// Index of the joint.
    pub joint: usize,
    /// Number of rows.
    pub rows: usize,
    /// Column-major: the columns of the layout that belong to the joint with `rows` values each, then the torque of the
    /// joint (N m, N).
    pub panel: &'a [f64],
    /// For each row the share of the filter's weight on valid samples; empty if all samples are valid. The row was
    /// divided by this share (by at least one half). [`counted`](Self::counted) drops rows with a share below one half.
    pub coverage: &'a [f64],
}

/// Unfiltered samples of all joints.
#[derive(Clone, Debug)]
pub struct RawSamples<'a> {
    /// Index of the uninterrupted segment of the log.
    pub segment: usize,
    /// Sample rate, hertz.
    pub rate_hz: f64,
    /// Time of the first sample, s after the first data row of the log.
    pub first_time_s: f64,
    /// Number of samples before and after a row that the filter uses. The first row of a segment is at the sample with
    /// this index.
    pub reach: usize,
    /// Regressor with the logged torque, smoothed if `smooth_torque` is set.
    pub panels: &'a Panels,
    /// Positions, velocities and accelerations, joint after joint in the order of the model.
    pub motion: &'a [Vec<f64>; 3],
    /// For each joint whether the torque of each sample is invalid (outlier, repeated value, bridged gap); empty if all
    /// are valid.
    pub set_aside: &'a [Vec<bool>],
    /// Range of the samples that are free of end effects of the differentiator.
    pub settled: core::ops::Range<usize>,
}

/// Receives the rows of a log, for example to accumulate them in a triangular factor.
pub trait RowConsumer {
    /// Receives filtered rows. For the same instants, the joints arrive in order. They have the same number of rows,
    /// unless time windows exclude some.
    ///
    /// # Errors
    /// Any error stops the pass.
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError>;

    /// Receives unfiltered samples, before the filtered rows that are computed from them. By default they are ignored.
    ///
    /// # Errors
    /// Any error stops the pass.
    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let _ = samples;
        Ok(())
    }

    /// Whether [`raw`](Self::raw) must be called; true by default. If it is not needed, a pass can reuse the filtered
    /// rows of an earlier pass.
    fn reads_samples(&self) -> bool {
        true
    }

    /// Separate consumers for the joints, if joints are independent and can be processed in parallel. `None` by
    /// default.
    fn joints(&mut self) -> Option<Vec<&mut (dyn RowConsumer + Send)>> {
        None
    }
}

/// Computes `panel · θ` for one joint: the torque that the base parameters `theta` predict for its rows. `columns` are
/// the columns of the layout that belong to the joint.
pub fn predicted_torque(panel: &[f64], rows: usize, columns: &[usize], theta: &[f64], out: &mut Vec<f64>) {
    out.clear();
    out.resize(rows, 0.0);
    for (place, &column) in columns.iter().enumerate() {
        let value = theta[column];
        for (to, x) in out.iter_mut().zip(&panel[place * rows..(place + 1) * rows]) {
            *to += value * x;
        }
    }
}
