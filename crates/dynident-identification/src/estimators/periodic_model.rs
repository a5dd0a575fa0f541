//! Robot model for the simultaneous fit, in which the motion (a Fourier series) and the parameters are unknown.

use core::f64::consts::TAU;
use dynident_dynamics::{BatchWorkspace, MotionGradient, Panels, regressor_panels, regressor_panels_adjoint};
use dynident_estimation::{ChannelRows, EstimationError, SimultaneousModel};
use dynident_model::terms::JointMotion;
use dynident_rows::RegressorModel;
use nalgebra::{DMatrix, DVector};

const BLOCK_SAMPLES: usize = 256;

/// Minimum number of rows per period of the highest harmonic. With fewer, the motion would change too much within a
/// row.
const MIN_ROWS_PER_HARMONIC: f64 = 60.0;

/// Recorded positions and torques on a uniform clock without a gap.
#[derive(Clone, Debug)]
pub struct PeriodicRecord {
    /// Sample rate, hertz.
    pub rate_hz: f64,
    /// Positions (rad, m), joint after joint, in the order of the model.
    pub q: Vec<f64>,
    /// Torques (N m, N), joint after joint, in the order of the model.
    pub tau: Vec<f64>,
}

/// Basis functions of a Fourier series: a constant, then sine and cosine of every harmonic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FourierSeries {
    /// Period of the first harmonic, s.
    pub period_s: f64,
    /// Number of harmonics.
    pub harmonics: usize,
}

impl FourierSeries {
    /// Maximum number of successive samples that are averaged to a row, so that at least sixty rows remain in a period
    /// of the highest harmonic.
    pub fn samples_of_row(&self, rate_hz: f64) -> usize {
        (rate_hz * self.period_s / (MIN_ROWS_PER_HARMONIC * self.harmonics as f64)).floor().max(1.0) as usize
    }
}

/// Positions and torques of one record as functions of the joints' Fourier coefficients (constant, then sine and cosine
/// of every harmonic) and of base parameters.
///
/// A row is the mean of `mean_of` successive samples, which keeps frequencies far below the rate of the rows. The
/// channels are the positions of the joints, then their torques. Torque terms must depend only on the motion at the
/// same instant.
#[derive(Debug)]
pub struct PeriodicModel<'a> {
    model: &'a RegressorModel,
    record: &'a PeriodicRecord,
    mean_of: usize,
    /// Angular frequency of every harmonic, rad/s.
    omega: Vec<f64>,
    /// Values of the basis functions at every sample, (samples, 1 + 2 harmonics).
    basis: DMatrix<f64>,
    /// Means of the basis functions over each row.
    row_basis: DMatrix<f64>,
    /// Means of the positions over each row, (rows, joints).
    row_q: DMatrix<f64>,
    workspace: BatchWorkspace,
}

impl<'a> PeriodicModel<'a> {
    /// Creates the model of a record whose motion is this Fourier series.
    pub fn new(model: &'a RegressorModel, record: &'a PeriodicRecord, series: FourierSeries, mean_of: usize) -> Self {
        let joints = model.dof();
        let samples = record.q.len() / joints.max(1);
        let omega: Vec<f64> = (1..=series.harmonics).map(|h| TAU * h as f64 / series.period_s).collect();
        let mut basis = DMatrix::from_element(samples, 1 + 2 * series.harmonics, 1.0);
        for (h, omega) in omega.iter().enumerate() {
            for k in 0..samples {
                let (sin, cos) = (omega * k as f64 / record.rate_hz).sin_cos();
                (basis[(k, 1 + 2 * h)], basis[(k, 2 + 2 * h)]) = (sin, cos);
            }
        }
        Self {
            model,
            record,
            mean_of,
            omega,
            row_basis: means(&basis, mean_of),
            row_q: means(&DMatrix::from_column_slice(samples, joints, &record.q), mean_of),
            basis,
            workspace: BatchWorkspace::new(model.model()),
        }
    }

    /// Number of rows of each channel.
    pub fn rows(&self) -> usize {
        self.row_basis.nrows()
    }

    fn own(&self) -> usize {
        self.basis.ncols()
    }

    fn joints(&self) -> usize {
        self.model.dof()
    }

    /// Least-squares Fourier coefficients of the positions, joint after joint; `None` if the record does not determine
    /// them.
    pub fn fitted_motion(&self) -> Option<Vec<f64>> {
        let normal = self.row_basis.tr_mul(&self.row_basis).cholesky()?;
        Some(normal.solve(&self.row_basis.tr_mul(&self.row_q)).as_slice().to_vec())
    }

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

    /// Calls `visit` for blocks of samples with their motion and regressor.
    fn walk(&mut self, motion: &[f64], mut visit: impl FnMut(&mut BatchWorkspace, usize, &JointMotion<'_>, &Panels)) {
        let coefficients = DMatrix::from_column_slice(self.own(), self.joints(), motion);
        let rate = self.derivative(&coefficients);
        let second = self.derivative(&rate);
        let samples = self.basis.nrows();
        let mut panels = Panels::default();
        for first in (0..samples).step_by(BLOCK_SAMPLES) {
            let count = BLOCK_SAMPLES.min(samples - first);
            let basis = self.basis.rows(first, count);
            let [q, dq, ddq] = [&coefficients, &rate, &second].map(|c| basis * c);
            let motion = JointMotion { samples: count, q: q.as_slice(), dq: dq.as_slice(), ddq: ddq.as_slice() };
            regressor_panels(self.model.model(), &mut self.workspace, self.model.layout(), &motion, &mut panels);
            visit(&mut self.workspace, first, &motion, &panels);
        }
    }

    /// Means over each row of the positions minus the Fourier series, (rows, joints).
    pub(super) fn position_residuals(&self, motion: &[f64]) -> DMatrix<f64> {
        &self.row_q - &self.row_basis * DMatrix::from_column_slice(self.own(), self.joints(), motion)
    }
}

impl SimultaneousModel for PeriodicModel<'_> {
    type Error = EstimationError;

    fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
        let (joints, samples, layout, tau) = (self.joints(), self.basis.nrows(), self.model.layout(), &self.record.tau);
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
        let (joints, own, mean_of) = (self.joints(), self.own(), self.mean_of);
        let (model, layout) = (self.model.model(), self.model.layout());
        let rows = self.row_basis.nrows();
        let mut by_parameters: Vec<DMatrix<f64>> =
            (0..joints).map(|_| DMatrix::zeros(rows, parameters.len())).collect();
        // Derivatives of each joint's torque by positions, velocities and accelerations, averaged over each row: (rows,
        // 3 joints).
        let mut slopes: Vec<DMatrix<f64>> = (0..joints).map(|_| DMatrix::zeros(rows, 3 * joints)).collect();
        let share = 1.0 / mean_of as f64;
        self.walk(motion, |workspace, first, block, panels| {
            let count = block.samples;
            let mut adjoint = Panels::default();
            adjoint.resize(layout, count);
            (0..joints).for_each(|joint| adjoint.joint_mut(joint).fill(0.0));
            for joint in 0..joints {
                let mut gradient = vec![0.0; 3 * joints * count];
                for (&column, to) in
                    layout.joint_columns(joint).iter().zip(adjoint.joint_mut(joint).chunks_exact_mut(count))
                {
                    to.fill(parameters[column]);
                }
                let (by_q, rest) = gradient.split_at_mut(joints * count);
                let (by_dq, by_ddq) = rest.split_at_mut(joints * count);
                let mut all = MotionGradient { by_q, by_dq, by_ddq };
                regressor_panels_adjoint(model, workspace, layout, block, &adjoint, &mut all);
                adjoint.joint_mut(joint).fill(0.0);
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
    /// Derivatives of one joint's torque by the Fourier coefficients of all joints. The motion hardly changes within a
    /// row, so the mean of a product (slope times basis function) is approximated by the product of the means.
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

/// Several records with separate motions and one common set of parameters. Channels and unknowns are ordered record by
/// record.
pub(super) struct PeriodicRecords<'a>(pub(super) Vec<PeriodicModel<'a>>);

impl SimultaneousModel for PeriodicRecords<'_> {
    type Error = EstimationError;

    fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
        let (mut first, mut all) = (0, Vec::new());
        for record in &mut self.0 {
            let unknowns = record.own() * record.joints();
            all.extend(record.residuals(&motion[first..first + unknowns], parameters)?);
            first += unknowns;
        }
        Ok(all)
    }

    fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, EstimationError> {
        let (mut first, mut all) = (0, Vec::new());
        for record in &mut self.0 {
            let unknowns = record.own() * record.joints();
            let rows = record.linearised(&motion[first..first + unknowns], parameters)?;
            all.extend(rows.into_iter().map(|rows| ChannelRows { first_motion: first + rows.first_motion, ..rows }));
            first += unknowns;
        }
        Ok(all)
    }
}

/// Means of `count` successive rows; an incomplete last row is dropped, because its mean would be noisier.
fn means(matrix: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let rows = matrix.nrows() / count;
    DMatrix::from_fn(rows, matrix.ncols(), |row, column| {
        matrix.column(column).rows(row * count, count).sum() / count as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_dynamics::ParametricModel;
    use dynident_model::read_urdf;
    use dynident_model::sample::Random;
    use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};

    /// Compared with differences of the residuals: their error is rounding over the step, 1e-7 to 1e-6 for entries of
    /// order one to a hundred.
    #[test]
    fn derivatives_are_those_of_the_residuals() {
        let robot = read_urdf(include_str!("../../../../robots/planar2r.urdf")).unwrap().model;
        let drive = DriveChoice {
            drive_inertia: true,
            viscous: true,
            coulomb: Some(CoulombShape::Smooth { width: 0.02 }),
            offset: true,
        };
        let terms = terms_per_joint(&robot, |_| drive);
        let model = RegressorModel::from(ParametricModel::new(robot, terms).unwrap());
        let mut random = Random::new(1);
        let theta: Vec<f64> = model.layout().columns().iter().map(|_| 1.0 + random.normal()).collect();
        let record = PeriodicRecord {
            rate_hz: 1000.0,
            q: (0..2000).map(|k| (0.004 * f64::from(k)).sin() + 1e-3 * random.normal()).collect(),
            tau: (0..2000).map(|_| random.normal()).collect(),
        };
        for mean_of in [1, 3] {
            let series = FourierSeries { period_s: 1.5, harmonics: 3 };
            let mut records = PeriodicRecords(vec![PeriodicModel::new(&model, &record, series, mean_of)]);
            let start = records.0[0].fitted_motion().unwrap();
            let rows = records.linearised(&start, &theta).unwrap();
            let step = 1e-7;
            for unknown in 0..start.len() + theta.len() {
                let mut at = |sign: f64| {
                    let (mut c, mut p) = (start.clone(), theta.clone());
                    match unknown.checked_sub(c.len()) {
                        None => c[unknown] += sign * step,
                        Some(place) => p[place] += sign * step,
                    }
                    records.residuals(&c, &p).unwrap()
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
                    // Mean of products compared with product of means: the series turns by ωΔt = 0.04 rad over three
                    // samples.
                    let tolerance = if mean_of == 1 { 1e-5 } else { 2e-2 };
                    let error = (&found - &differences).amax();
                    assert!(error <= tolerance * scale, "unknown {unknown}, channel {place}: {error}");
                }
            }
        }
    }
}
