//! From samples to rows of regressor and torque, filtered alike: what every estimator and every examination reads.
//!
//! Samples flow in blocks: positions to motion, motion to regressor blocks, regressor and torque through the same
//! low-pass and decimation, then to a [`RowConsumer`]. The regressor of samples is never stored; filtered rows are,
//! while they are few.

mod beside;
mod builder;
mod coverage;
mod declared;
mod filter;
mod joint_filters;
mod mask;
mod motion_noise;
mod pass;
mod row_block;
mod row_store;
mod samples;
#[cfg(test)]
mod test_log;
mod velocities;

pub use builder::RowBuilder;
pub use coverage::{divide_by_coverage, set_aside};
pub use filter::{ParallelFilterError, ParallelFilterSettings, motion_band_hz};
pub use joint_filters::JointFilters;
pub use motion_noise::noise_factors;
pub use pass::{KeptLog, LogPass, LogStatistics};
pub use row_block::RowBlock;
pub use samples::in_model_order;
pub use velocities::VelocityHistogram;

use crate::recording::LogError;
use dynident_dynamics::Panels;

/// Samples that are made into regressor blocks at a time: small enough for the cache, large enough to spread the
/// filter's overhead.
pub const PANEL_SAMPLES: usize = 256;

/// Filtered rows of one joint.
#[derive(Clone, Copy, Debug)]
pub struct JointRows<'a> {
    /// The joint.
    pub joint: usize,
    /// Number of rows.
    pub rows: usize,
    /// The joint's columns of the layout one after another, each of `rows` numbers, then its torque (N m, N).
    pub panel: &'a [f64],
    /// Row by row the share of the filter's weight on samples that count, by which the row was divided (at least by one
    /// half); empty where all do. [`counted`](Self::counted) leaves out rows with less than half.
    pub coverage: &'a [f64],
}

/// Unfiltered samples of all joints.
#[derive(Clone, Debug)]
pub struct RawSamples<'a> {
    /// Number of the uninterrupted piece of the log.
    pub segment: usize,
    /// Samples a second.
    pub rate_hz: f64,
    /// Regressor blocks with the torque as logged, or as smoothed with `smooth_torque`.
    pub panels: &'a Panels,
    /// For each joint whether a sample's torque does not count (outlier, held, in a gap that was bridged); empty if all
    /// count.
    pub set_aside: &'a [Vec<bool>],
    /// The samples whose motion does not rest on samples that a filter invented at the ends of a piece.
    pub settled: core::ops::Range<usize>,
}

/// What is done with a log's rows.
pub trait RowConsumer {
    /// Takes rows as they leave the parallel filter. Joints of the same instants come in their order, with as many rows
    /// each unless windows leave some out.
    ///
    /// # Errors
    /// What stops the pass.
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError>;

    /// Takes the same samples before the filter; they come before their rows. Ignored by default.
    ///
    /// # Errors
    /// What stops the pass.
    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let _ = samples;
        Ok(())
    }

    /// Whether [`raw`](Self::raw) has to be called: true by default. Rows that nobody wants the samples of need not be
    /// made of them anew where an earlier pass over the same motion has left them.
    fn reads_samples(&self) -> bool {
        true
    }

    /// A consumer for each joint that takes its rows alone, where joints do not matter to each other: they may be
    /// served side by side. None by default.
    fn joints(&mut self) -> Option<Vec<&mut (dyn RowConsumer + Send)>> {
        None
    }
}

/// `panel · θ` of one joint: the torque that base parameters `theta` predict for its rows; `columns` are the joint's
/// columns of the layout.
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
