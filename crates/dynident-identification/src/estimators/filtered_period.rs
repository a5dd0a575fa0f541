//! Mean period of a repeated motion after the parallel filter, for torque and all columns of the regressor.
//!
//! Columns that are not linear in the motion (above all friction) must pass the same filter as the torque: a smoothed
//! torque with an unsmoothed friction step would correspond to another friction law. A mean period is cyclic, so the
//! filter has no end effects.

use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_model::terms::JointMotion;
use dynident_recording::AveragedPeriods;
use dynident_rows::{PANEL_SAMPLES, RegressorModel};
use nalgebra::{DMatrix, DVector};

#[derive(Clone, Debug)]
pub(super) struct PeriodFilter {
    /// Symmetric, of odd length; a single 1 without a filter.
    pub(super) taps: Vec<f64>,
    pub(super) stride: usize,
}

impl PeriodFilter {
    fn half(&self) -> usize {
        self.taps.len() / 2
    }

    /// The filtered value at sample `at` of a cyclic signal.
    fn around(&self, signal: &[f64], at: usize) -> f64 {
        let length = signal.len();
        // First sample of the filter's support, shifted by whole periods to be nonnegative.
        let first = at + length * (self.half() / length + 1) - self.half();
        self.taps.iter().enumerate().map(|(k, tap)| tap * signal[(first + k) % length]).sum()
    }

    /// Covariance of all channels' deviations from the mean period after the filter, `Σ_p Σ_k d d ᵀ / (N (P − 1))`,
    /// over the samples of the rows.
    pub(super) fn covariance(&self, channels: &[&[f64]], averaged: &AveragedPeriods) -> DMatrix<f64> {
        let samples = averaged.mean.first().map_or(0, Vec::len);
        let all = samples * averaged.periods;
        let half = self.half();
        let deviations: Vec<Vec<f64>> = channels
            .iter()
            .zip(&averaged.mean)
            .map(|(channel, mean)| {
                let raw: Vec<f64> = (0..all).map(|at| channel[at] - mean[at % samples]).collect();
                // Beyond the ends the noise is unknown, with mean zero.
                let filtered = |at: usize| -> f64 {
                    let from = at.saturating_sub(half);
                    let to = (at + half + 1).min(all);
                    raw[from..to].iter().zip(&self.taps[from + half - at..]).map(|(x, tap)| x * tap).sum()
                };
                (0..all).step_by(self.stride).map(filtered).collect()
            })
            .collect();
        let rows = deviations.first().map_or(0, Vec::len);
        let degrees_of_freedom = rows as f64 * (averaged.periods as f64 - 1.0) / averaged.periods as f64;
        DMatrix::from_fn(channels.len(), channels.len(), |a, b| {
            deviations[a].iter().zip(&deviations[b]).map(|(x, y)| x * y).sum::<f64>() / degrees_of_freedom.max(1.0)
        })
    }

    /// Regressor and torque of the mean period at every row: `(instant, W, τ)`. Channels are positions of all joints,
    /// then velocities, accelerations and torques.
    pub(super) fn rows(
        &self,
        model: &RegressorModel,
        averaged: &AveragedPeriods,
    ) -> Vec<(usize, DMatrix<f64>, DVector<f64>)> {
        let (robot, layout, dof) = (model.model(), model.layout(), model.dof());
        let samples = averaged.mean.first().map_or(0, Vec::len);
        let mut workspace = BatchWorkspace::new(robot);
        let (mut panels, mut history) = (Panels::default(), TermHistory::new(None));
        let mut columns: Vec<Vec<Vec<f64>>> =
            (0..dof).map(|joint| vec![Vec::with_capacity(samples); layout.joint_columns(joint).len()]).collect();
        for from in (0..samples).step_by(PANEL_SAMPLES) {
            let count = PANEL_SAMPLES.min(samples - from);
            let [q, dq, ddq] = core::array::from_fn(|order| -> Vec<f64> {
                let joints = &averaged.mean[order * dof..(order + 1) * dof];
                joints.iter().flat_map(|joint| joint[from..from + count].iter().copied()).collect()
            });
            let motion = JointMotion { samples: count, q: &q, dq: &dq, ddq: &ddq };
            regressor_panels_following(robot, &mut workspace, layout, &motion, &mut history, &mut panels);
            for (joint, columns) in columns.iter_mut().enumerate() {
                let panel = panels.joint(joint);
                for (place, column) in columns.iter_mut().enumerate() {
                    column.extend_from_slice(&panel[place * count..(place + 1) * count]);
                }
            }
        }
        let instants = (0..samples).step_by(self.stride);
        instants
            .map(|instant| {
                let mut regressor = DMatrix::zeros(dof, layout.columns().len());
                for (joint, columns) in columns.iter().enumerate() {
                    for (&column, values) in layout.joint_columns(joint).iter().zip(columns) {
                        regressor[(joint, column)] = self.around(values, instant);
                    }
                }
                let torque = |joint: usize, _| self.around(&averaged.mean[3 * dof + joint], instant);
                (instant, regressor, DVector::from_fn(dof, torque))
            })
            .collect()
    }
}
