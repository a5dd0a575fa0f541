//! Unknown motion and unknown parameters of a record whose motion is a Fourier series: what the simultaneous fit asks of a robot.

use super::scenario::{RATE_HZ, Scenario};
use core::f64::consts::TAU;
use dynident_dynamics::{
    BatchWorkspace, MotionGradient, PanelLayout, Panels, regressor_panels, regressor_panels_pull_back,
};
use dynident_estimation::{ChannelRows, EstimationError, SimultaneousModel};
use dynident_model::Model;
use dynident_model::laws::JointMotion;
use nalgebra::{DMatrix, DVector};

/// Samples whose regressor is made at a time.
const BLOCK: usize = 256;

/// Positions and torques of one record over joints' Fourier coefficients (offset, then sine and cosine of every harmonic) and base parameters.
///
/// A row is the mean of `mean_of` successive samples: below the rate of rows nothing is lost, and there are fewer. Channels are the joints' positions, then their torques.
pub(super) struct PeriodicModel<'a> {
    model: &'a Model,
    layout: &'a PanelLayout,
    mean_of: usize,
    /// Angular frequency of every harmonic, rad/s.
    omega: Vec<f64>,
    /// The series' functions at every sample, (samples, 1 + 2 harmonics).
    basis: DMatrix<f64>,
    /// Their means over each row.
    row_basis: DMatrix<f64>,
    /// Means of the positions, (rows, joints).
    row_q: DMatrix<f64>,
    tau: &'a [f64],
    workspace: BatchWorkspace,
}

impl<'a> PeriodicModel<'a> {
    /// For positions and torques, joint-major, of as many samples each; the motion's period is `period_s`.
    pub(super) fn new(
        scenario: &'a Scenario,
        (q, tau): (&[f64], &'a [f64]),
        (period_s, harmonics): (f64, usize),
        mean_of: usize,
    ) -> Self {
        let joints = scenario.parametric.model().dof();
        let samples = q.len() / joints;
        let omega: Vec<f64> = (1..=harmonics).map(|h| TAU * h as f64 / period_s).collect();
        let mut basis = DMatrix::from_element(samples, 1 + 2 * harmonics, 1.0);
        for (h, omega) in omega.iter().enumerate() {
            for k in 0..samples {
                let (sin, cos) = (omega * k as f64 / RATE_HZ).sin_cos();
                (basis[(k, 1 + 2 * h)], basis[(k, 2 + 2 * h)]) = (sin, cos);
            }
        }
        Self {
            model: scenario.parametric.model(),
            layout: scenario.parametric.layout(),
            mean_of,
            omega,
            row_basis: means(&basis, mean_of),
            row_q: means(&DMatrix::from_column_slice(samples, joints, q), mean_of),
            basis,
            tau,
            workspace: BatchWorkspace::new(scenario.parametric.model()),
        }
    }

    /// Unknowns of one joint's motion.
    fn own(&self) -> usize {
        self.basis.ncols()
    }

    fn joints(&self) -> usize {
        self.model.dof()
    }

    /// Coefficients of the series that fit the positions best, joint by joint.
    pub(super) fn fitted_motion(&self) -> Option<Vec<f64>> {
        let normal = self.row_basis.tr_mul(&self.row_basis).cholesky()?;
        Some(normal.solve(&self.row_basis.tr_mul(&self.row_q)).as_slice().to_vec())
    }

    /// Coefficients of the derivative's series.
    fn derivative(&self, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        let mut rate = DMatrix::zeros(coefficients.nrows(), coefficients.ncols());
        for joint in 0..coefficients.ncols() {
            for (h, omega) in self.omega.iter().enumerate() {
                rate[(1 + 2 * h, joint)] = -omega * coefficients[(2 + 2 * h, joint)];
                rate[(2 + 2 * h, joint)] = omega * coefficients[(1 + 2 * h, joint)];
            }
        }
        rate
    }

    /// Walks over the samples in blocks with their motion and regressor.
    fn walk(&mut self, motion: &[f64], mut visit: impl FnMut(&mut BatchWorkspace, usize, &JointMotion<'_>, &Panels)) {
        let coefficients = DMatrix::from_column_slice(self.own(), self.joints(), motion);
        let rate = self.derivative(&coefficients);
        let second = self.derivative(&rate);
        let samples = self.basis.nrows();
        let mut panels = Panels::default();
        for first in (0..samples).step_by(BLOCK) {
            let count = BLOCK.min(samples - first);
            let basis = self.basis.rows(first, count);
            let [q, dq, ddq] = [&coefficients, &rate, &second].map(|c| basis * c);
            let motion = JointMotion { samples: count, q: q.as_slice(), dq: dq.as_slice(), ddq: ddq.as_slice() };
            regressor_panels(self.model, &mut self.workspace, self.layout, &motion, &mut panels);
            visit(&mut self.workspace, first, &motion, &panels);
        }
    }

    fn position_residuals(&self, motion: &[f64]) -> DMatrix<f64> {
        &self.row_q - &self.row_basis * DMatrix::from_column_slice(self.own(), self.joints(), motion)
    }
}

impl SimultaneousModel for PeriodicModel<'_> {
    type Error = EstimationError;

    fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
        let (joints, samples, layout, tau) = (self.joints(), self.basis.nrows(), self.layout, self.tau);
        let mut torque = DMatrix::from_column_slice(samples, joints, tau);
        self.walk(motion, |_, first, block, panels| {
            for joint in 0..joints {
                let count = block.samples;
                let mut residual = torque.view_mut((first, joint), (count, 1));
                for (&column, w) in layout.joint_columns(joint).iter().zip(panels.joint(joint).chunks_exact(count)) {
                    let theta = parameters[column];
                    residual.iter_mut().zip(w).for_each(|(r, w)| *r -= theta * w);
                }
            }
        });
        let columns = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
            matrix.column_iter().map(|column| column.iter().copied().collect()).collect()
        };
        let mut all = columns(&self.position_residuals(motion));
        all.extend(columns(&means(&torque, self.mean_of)));
        Ok(all)
    }

    fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, EstimationError> {
        let (joints, own, mean_of, model, layout) = (self.joints(), self.own(), self.mean_of, self.model, self.layout);
        let rows = self.row_basis.nrows();
        let mut by_parameters: Vec<DMatrix<f64>> =
            (0..joints).map(|_| DMatrix::zeros(rows, parameters.len())).collect();
        // Slopes of each torque by positions, speeds and accelerations, means over rows: (rows, 3 joints).
        let mut slopes: Vec<DMatrix<f64>> = (0..joints).map(|_| DMatrix::zeros(rows, 3 * joints)).collect();
        let share = 1.0 / mean_of as f64;
        self.walk(motion, |workspace, first, block, panels| {
            let count = block.samples;
            let mut cotangent = Panels::default();
            cotangent.resize(layout, count);
            (0..joints).for_each(|joint| cotangent.joint_mut(joint).fill(0.0));
            for joint in 0..joints {
                let mut gradient = vec![0.0; 3 * joints * count];
                for (&column, to) in
                    layout.joint_columns(joint).iter().zip(cotangent.joint_mut(joint).chunks_exact_mut(count))
                {
                    to.fill(parameters[column]);
                }
                let (by_q, rest) = gradient.split_at_mut(joints * count);
                let (by_dq, by_ddq) = rest.split_at_mut(joints * count);
                let mut all = MotionGradient { by_q, by_dq, by_ddq };
                regressor_panels_pull_back(model, workspace, layout, block, &cotangent, &mut all);
                cotangent.joint_mut(joint).fill(0.0);
                for k in 0..count {
                    let row = (first + k) / mean_of;
                    if row >= rows {
                        break;
                    }
                    for variable in 0..3 * joints {
                        slopes[joint][(row, variable)] += share * gradient[variable * count + k];
                    }
                }
                for (&column, w) in layout.joint_columns(joint).iter().zip(panels.joint(joint).chunks_exact(count)) {
                    for (k, w) in w.iter().enumerate() {
                        let row = (first + k) / mean_of;
                        if row < rows {
                            by_parameters[joint][(row, column)] += share * w;
                        }
                    }
                }
            }
        });
        let residuals = self.residuals(motion, parameters)?;
        let mut channels = Vec::with_capacity(2 * joints);
        for (place, residual) in residuals.into_iter().enumerate() {
            let channel = match place.checked_sub(joints) {
                None => ChannelRows {
                    residual,
                    first_motion: place * own,
                    by_motion: self.row_basis.clone(),
                    by_parameters: DMatrix::zeros(rows, 0),
                },
                Some(joint) => ChannelRows {
                    residual,
                    first_motion: 0,
                    by_motion: self.by_coefficients(&slopes[joint]),
                    by_parameters: core::mem::replace(&mut by_parameters[joint], DMatrix::zeros(0, 0)),
                },
            };
            channels.push(channel);
        }
        Ok(channels)
    }
}

impl PeriodicModel<'_> {
    /// Derivatives of one torque by the coefficients of all joints. Over a row's few samples the series hardly changes: the mean of slope times function is the product of their means.
    fn by_coefficients(&self, slopes: &DMatrix<f64>) -> DMatrix<f64> {
        let (joints, own) = (self.joints(), self.own());
        let mut out = DMatrix::zeros(slopes.nrows(), joints * own);
        for joint in 0..joints {
            let [by_q, by_dq, by_ddq] = [0, 1, 2].map(|order| slopes.column(order * joints + joint));
            out.column_mut(joint * own).copy_from(&by_q);
            for (h, &omega) in self.omega.iter().enumerate() {
                let [sin, cos] = [1, 2].map(|part| self.row_basis.column(part + 2 * h));
                let straight: DVector<f64> = by_q - by_ddq * (omega * omega);
                let turned: DVector<f64> = by_dq * omega;
                let first = joint * own + 1 + 2 * h;
                out.column_mut(first).copy_from(&(straight.component_mul(&sin) + turned.component_mul(&cos)));
                out.column_mut(first + 1).copy_from(&(straight.component_mul(&cos) - turned.component_mul(&sin)));
            }
        }
        out
    }
}

/// Means of `count` successive rows; what is left at the end is dropped, for its mean would be noisier.
fn means(matrix: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let rows = matrix.nrows() / count;
    DMatrix::from_fn(rows, matrix.ncols(), |row, column| {
        matrix.column(column).rows(row * count, count).sum() / count as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::robots::ROBOTS;

    /// Against differences of the residuals, which know nothing of slopes: their error is rounding over the step, 1e-7 to 1e-6 of entries that are of order one to a hundred.
    #[test]
    fn derivatives_are_those_of_the_residuals() {
        let mut scenario = Scenario::new(&ROBOTS[0], 1).unwrap();
        let joints = scenario.parametric.model().dof();
        // The first second is enough.
        let cut = |x: &[f64]| -> Vec<f64> {
            x.chunks_exact(scenario.motion.samples).flat_map(|joint| joint[..1000].iter().copied()).collect()
        };
        let (q, tau) = (cut(&scenario.motion.q), cut(&scenario.torque));
        let theta = core::mem::take(&mut scenario.truth);
        for mean_of in [1, 3] {
            let mut model = PeriodicModel::new(&scenario, (&q, &tau), (1.5, 3), mean_of);
            let start = model.fitted_motion().unwrap();
            let rows = model.linearised(&start, &theta).unwrap();
            let step = 1e-7;
            for unknown in 0..start.len() + theta.len() {
                let mut at = |sign: f64| {
                    let (mut c, mut p) = (start.clone(), theta.clone());
                    match unknown.checked_sub(c.len()) {
                        None => c[unknown] += sign * step,
                        Some(place) => p[place] += sign * step,
                    }
                    model.residuals(&c, &p).unwrap()
                };
                let (above, below) = (at(1.0), at(-1.0));
                for (place, channel) in rows.iter().enumerate() {
                    let column = match unknown.checked_sub(start.len()) {
                        Some(p) if channel.by_parameters.ncols() > 0 => Some(channel.by_parameters.column(p)),
                        Some(_) => None,
                        None => unknown
                            .checked_sub(channel.first_motion)
                            .filter(|&place| place < channel.by_motion.ncols())
                            .map(|place| channel.by_motion.column(place)),
                    };
                    let differences =
                        (0..above[place].len()).map(|k| (below[place][k] - above[place][k]) / (2.0 * step));
                    let differences = DVector::from_iterator(above[place].len(), differences);
                    let scale = differences.amax().max(1.0);
                    let found = column.map_or_else(|| DVector::zeros(differences.len()), nalgebra::Matrix::into_owned);
                    // Means of products against products of means: the series turns by ωΔt = 0.04 rad over three samples.
                    let tolerance = if mean_of == 1 { 1e-5 } else { 2e-2 };
                    let error = (&found - &differences).amax();
                    assert!(
                        error <= tolerance * scale,
                        "unknown {unknown} of {joints} joints, channel {place}: {error}"
                    );
                }
            }
        }
    }
}
