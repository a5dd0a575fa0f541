//! Normal equations of motion and parameters with the motion eliminated. Also the effective number of unknowns that
//! positions, torques and the motion prior each determine.

use super::banded_arrow::{BandedArrow, Eliminated, InverseBand, axpy, dot};
use super::noise::LogNoise;
use super::problem::TorqueModel;
use super::rows::{FreeParameters, JointRows, Piece};
use super::smoothing::{MIN_SIGMA, most_penalty, rough_trace, sample_trace};
use crate::error::EstimationError;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

const LEVERAGE_ROWS: usize = 200;
/// Pivot of the scaled Schur complement that is treated as zero (rounding).
const MIN_PIVOT: f64 = 1e-12;
/// Maximum factor of a change of noise levels per step.
const MAX_LEVEL_RATIO: f64 = 10.0;

/// Linearised information of the torque of a record about motion and parameters.
#[derive(Clone, Debug)]
pub(super) struct TorqueInformation {
    matrix: BandedArrow,
    /// A sample of unwhitened rows of each joint, in groups of `lags + 1` consecutive rows, the latest last.
    some: Vec<JointRows>,
    lags: usize,
}

pub(super) fn torque_information<M: TorqueModel>(
    piece: &Piece<'_>,
    model: &mut M,
    coefficients: &[f64],
    parameters: &[f64],
    free: &FreeParameters,
    noise: &LogNoise,
    lags: usize,
) -> Result<TorqueInformation, M::Error> {
    let count = free.count();
    let bandwidth = piece.bandwidth(noise.most_order().max(lags));
    let mut matrix = BandedArrow::new(piece.unknowns(), bandwidth, count);
    let mut some = vec![JointRows::default(); piece.joints];
    let every = piece.rows().div_ceil(LEVERAGE_ROWS).max(1);
    let mut passed = 0;
    piece.each_rows(model, (coefficients, parameters, free), (&noise.colours, lags), |joints, raw| {
        let part = |(joint, own): (usize, &JointRows)| own.information(count, bandwidth, noise.torque_std[joint]);
        let parts: Vec<_> = joints.par_iter().enumerate().map(part).collect();
        for (first, part) in parts.iter().flatten() {
            matrix.add_part(*first, part);
        }
        for (kept, own) in some.iter_mut().zip(raw) {
            let carried = if passed == 0 { 0 } else { lags.max(noise.most_order()) };
            for row in carried.max(lags)..own.count() {
                if (passed + row - carried) % every == every / 2 {
                    kept.append(&own.part(row - lags..row + 1, count));
                }
            }
        }
        passed += raw.first().map_or(0, JointRows::count) - if passed == 0 { 0 } else { lags.max(noise.most_order()) };
    })?;
    Ok(TorqueInformation { matrix, some, lags })
}

/// System of all records: motions eliminated, parameters solved.
pub(super) struct System {
    pieces: Vec<Eliminated>,
    scale: DVector<f64>,
    /// Factor of the scaled Schur complement.
    factor: Option<Cholesky<f64, Dyn>>,
    right: DVector<f64>,
}

impl System {
    /// Combines the information of the torque with that of positions and smoothness at these noise levels.
    pub(super) fn new(
        pieces: &[Piece<'_>],
        torques: &[TorqueInformation],
        coefficients: &[Vec<f64>],
        noise: &[LogNoise],
        free: &FreeParameters,
        names: &[String],
    ) -> Result<Self, EstimationError> {
        let one = |((piece, torque), coefficients): ((&Piece<'_>, &TorqueInformation), &Vec<f64>)| {
            let mut matrix = torque.matrix.clone();
            let own = &noise[piece.record.log];
            for (joint, smoothness) in own.positions.iter().enumerate() {
                let (joints, spline) = (piece.joints, &piece.spline);
                let gram = spline.roughness(smoothness.order);
                let left = spline.residual(coefficients, joint, joints, piece.q(joint));
                let (_, pulled) = spline.penalty(&gram, coefficients, joint, joints);
                let position = smoothness.position_std.powi(-2);
                spline.add_positions(&mut matrix, joint, joints, position, &left);
                spline.add_roughness(&mut matrix, joint, joints, smoothness.penalty, &gram, &pulled);
            }
            matrix.eliminated().map_err(|unknown| EstimationError::Undetermined {
                name: format!("unknown {} of the motion", unknown + 1),
            })
        };
        let all: Vec<_> = pieces.iter().zip(torques).zip(coefficients).collect();
        let pieces: Vec<Eliminated> = all.into_par_iter().map(one).collect::<Result<_, _>>()?;
        let count = free.count();
        let (mut schur, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for piece in &pieces {
            schur += &piece.schur;
            right += DVector::from_column_slice(&piece.right);
        }
        let scale = schur.diagonal().map(|x: f64| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
        let undetermined = |place: usize| EstimationError::Undetermined { name: names[free.free[place]].clone() };
        if let Some(place) = scale.iter().position(|scale| *scale == 0.0) {
            return Err(undetermined(place));
        }
        let scaled = DMatrix::from_fn(count, count, |i, j| schur[(i, j)] * scale[i] * scale[j]);
        let factor = if count > 0 {
            let factor = scaled.cholesky().ok_or_else(|| undetermined(count - 1))?;
            if let Some(place) = factor.l_dirty().diagonal().iter().position(|pivot| pivot * pivot < MIN_PIVOT) {
                return Err(undetermined(place));
            }
            Some(factor)
        } else {
            None
        };
        Ok(Self { pieces, scale, factor, right })
    }

    /// Step of the free parameters, and its length in error bars over all directions.
    pub(super) fn step(&self) -> (Vec<f64>, f64) {
        let Some(factor) = &self.factor else { return (Vec::new(), 0.0) };
        let step = factor.solve(&self.right.component_mul(&self.scale)).component_mul(&self.scale);
        let length = (step.dot(&self.right).max(0.0) / step.len().max(1) as f64).sqrt();
        (step.as_slice().to_vec(), length)
    }

    pub(super) fn motion_step(&self, piece: usize, of_parameters: &[f64]) -> Vec<f64> {
        self.pieces[piece].band_solution(of_parameters)
    }

    /// Sensitivity of the motion of a record to the parameters, row-major.
    pub(super) fn shares(&self, piece: usize) -> Vec<f64> {
        self.pieces[piece].shares()
    }

    /// Entries of the full inverse near its diagonal.
    fn inverse(&self, piece: usize) -> Inverse {
        let eliminated = &self.pieces[piece];
        let parameters = self.right.len();
        let root = self.factor.as_ref().map(|factor| {
            let mut inverse = factor.l().solve_lower_triangular(&DMatrix::identity(parameters, parameters));
            if let Some(inverse) = &mut inverse {
                inverse.column_iter_mut().zip(&self.scale).for_each(|(mut column, scale)| column *= *scale);
            }
            inverse.unwrap_or_else(|| DMatrix::zeros(parameters, parameters))
        });
        let root = root.unwrap_or_else(|| DMatrix::zeros(0, 0));
        let shares = eliminated.shares();
        let columns = shares.len() / parameters.max(1);
        let spread = if parameters == 0 {
            Vec::new()
        } else {
            (&root * DMatrix::from_column_slice(parameters, columns, &shares)).as_slice().to_vec()
        };
        Inverse { near: eliminated.inverse(), root, shares, spread, parameters }
    }
}

struct Inverse {
    near: InverseBand,
    /// `L⁻¹` of the parameters' information.
    root: DMatrix<f64>,
    shares: Vec<f64>,
    /// `L⁻¹ Vᵀ`, column-major: one column per unknown of the motion.
    spread: Vec<f64>,
    parameters: usize,
}

impl Inverse {
    fn entry(&self, row: usize, column: usize) -> f64 {
        let p = self.parameters;
        let far = dot(&self.spread[row * p..(row + 1) * p], &self.spread[column * p..(column + 1) * p]);
        self.near.entry(row, column) + far
    }

    /// `x_tᵀ H⁻¹ x_{t−l}` for l = 0 to `rows − 1`, rows in order of time.
    fn covariances(&self, rows: &JointRows) -> Vec<f64> {
        let p = self.parameters;
        let far = |row: usize| {
            let (first, own, arrow, _) = rows.row(row, p);
            let mut left = DVector::from_column_slice(arrow);
            for (k, x) in own.iter().enumerate() {
                if *x != 0.0 {
                    axpy(-x, &self.shares[(first + k) * p..(first + k + 1) * p], left.as_mut_slice());
                }
            }
            &self.root * left
        };
        let last = rows.count() - 1;
        let (first, own, ..) = rows.row(last, p);
        let latest = far(last);
        let of = |lag: usize| {
            let (other, earlier, ..) = rows.row(last - lag, p);
            let mut near = 0.0;
            for (k, x) in earlier.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                let column = own.iter().enumerate().filter(|(_, y)| **y != 0.0);
                near += x * column.map(|(l, y)| y * self.near.entry(first + l, other + k)).sum::<f64>();
            }
            near + if lag == 0 { latest.norm_squared() } else { latest.dot(&far(last - lag)) }
        };
        (0..rows.count()).map(of).collect()
    }
}

/// Effective number of unknowns that each source of information (torque, positions, motion prior) determines, by log
/// and joint.
#[derive(Clone, Debug)]
pub(super) struct EffectiveUnknowns {
    pub(super) position: Vec<Vec<f64>>,
    pub(super) smoothness: Vec<Vec<f64>>,
    /// Mean covariance of the torque predictions of two rows, for each lag between the rows.
    pub(super) torque: Vec<Vec<Vec<f64>>>,
}

impl EffectiveUnknowns {
    pub(super) fn new(
        system: &System,
        pieces: &[Piece<'_>],
        torques: &[TorqueInformation],
        noise: &[LogNoise],
        free: &FreeParameters,
    ) -> Self {
        let joints = pieces.first().map_or(0, |piece| piece.joints);
        let none = || vec![vec![0.0; joints]; noise.len()];
        let (mut position, mut smoothness) = (none(), none());
        let lags = torques.first().map_or(0, |torque| torque.lags);
        let mut torque = vec![vec![vec![0.0; lags + 1]; joints]; noise.len()];
        let mut groups = none();
        let of = |(place, (piece, information)): (usize, (&Piece<'_>, &TorqueInformation))| {
            let own = &noise[piece.record.log];
            let inverse = system.inverse(place);
            let entry = |row: usize, column: usize| inverse.entry(row, column);
            let of_joint = |joint: usize| {
                let smooth = own.positions[joint];
                let gram = piece.spline.roughness(smooth.order);
                let at = (joint, piece.joints);
                let rough = smooth.penalty * rough_trace(&piece.spline, &gram, at.0, at.1, &entry);
                let near = sample_trace(&piece.spline, at.0, at.1, &entry) / smooth.position_std.powi(2);
                let some = &information.some[joint];
                let mut sums = vec![0.0; lags + 1];
                for group in 0..some.count() / (lags + 1) {
                    let rows = some.part(group * (lags + 1)..(group + 1) * (lags + 1), free.count());
                    axpy(1.0, &inverse.covariances(&rows), &mut sums);
                }
                (near, rough, sums, (some.count() / (lags + 1)) as f64)
            };
            (piece.record.log, (0..joints).into_par_iter().map(of_joint).collect::<Vec<_>>())
        };
        for (log, all) in pieces.iter().zip(torques).enumerate().map(of) {
            for (joint, (near, rough, sums, count)) in all.into_iter().enumerate() {
                position[log][joint] += near;
                smoothness[log][joint] += rough;
                axpy(1.0, &sums, &mut torque[log][joint]);
                groups[log][joint] += count;
            }
        }
        for (torque, groups) in torque.iter_mut().flatten().zip(groups.iter().flatten()) {
            for sum in torque.iter_mut() {
                *sum /= groups.max(1.0);
            }
        }
        Self { position, smoothness, torque }
    }

    /// Updates noise of the positions and smoothness of the motion: a step towards the maximum of the restricted
    /// likelihood (Harville, JASA 72 (1977) 320; Wood and Fasiolo, Biometrics 73 (2017) 1071).
    pub(super) fn levels(&self, pieces: &[Piece<'_>], coefficients: &[Vec<f64>], noise: &mut [LogNoise]) {
        for (log, own) in noise.iter_mut().enumerate() {
            for (joint, smoothness) in own.positions.iter_mut().enumerate() {
                let (mut squares, mut samples, mut rough, mut rank) = (0.0, 0, 0.0, 0);
                let mut most = f64::INFINITY;
                let of_log = pieces.iter().zip(coefficients).filter(|(piece, _)| piece.record.log == log);
                for (piece, coefficients) in of_log {
                    let left = piece.spline.residual(coefficients, joint, piece.joints, piece.q(joint));
                    squares += left.iter().map(|x| x * x).sum::<f64>();
                    samples += left.len();
                    let gram = piece.spline.roughness(smoothness.order);
                    rough += piece.spline.penalty(&gram, coefficients, joint, piece.joints).0;
                    rank += piece.spline.functions() - smoothness.order;
                    most = most.min(most_penalty(&piece.spline, &gram, smoothness.position_std));
                }
                let within = |old: f64, new: f64| {
                    let new = if new.is_finite() { new } else { old };
                    new.clamp(old / MAX_LEVEL_RATIO, old * MAX_LEVEL_RATIO)
                };
                let freedom = (samples as f64 - self.position[log][joint]).max(1.0);
                let sigma = (squares / freedom).sqrt().max(MIN_SIGMA);
                smoothness.position_std = within(smoothness.position_std, sigma).max(MIN_SIGMA);
                let moved = (rank as f64 - self.smoothness[log][joint]).max(1e-3);
                if rough > 0.0 {
                    smoothness.penalty = within(smoothness.penalty, moved / rough);
                }
                smoothness.penalty = smoothness.penalty.min(most);
            }
        }
    }
}
