//! Covariance of the parameters with unknown motion, from rows without the motion.

use super::banded_arrow::axpy;
use super::bspline::ACTIVE;
use super::noise::LogNoise;
use super::problem::{SplineMotionProblem, SplineMotionSettings, TorqueModel};
use super::rows::{FreeParameters, Piece};
use super::system::{System, torque_information};
use crate::error::EstimationError;
use crate::factor::{LinearProblem, SegmentSettings, SegmentedFactor};
use crate::nonlinear::simultaneous::estimate_without_motion;
use crate::uncertainty::Estimate;
use rayon::prelude::*;

/// Last linearisation of the fit.
pub(super) struct LastStep<'a> {
    pub(super) pieces: &'a [Piece<'a>],
    pub(super) noise: &'a [LogNoise],
    pub(super) free: &'a FreeParameters,
    pub(super) coefficients: &'a [Vec<f64>],
    pub(super) parameters: &'a [f64],
    pub(super) iterations: usize,
    pub(super) converged: bool,
}

/// Estimate from the last linearisation: `X̃ = X_θ − X_c B⁻¹A` for the rows of torque, positions and motion prior;
/// their normal matrix is the Schur complement.
pub(super) fn estimate_of<M: TorqueModel>(
    problem: &SplineMotionProblem,
    settings: &SplineMotionSettings,
    model: &mut M,
    last: &LastStep<'_>,
) -> Result<Estimate, M::Error> {
    let LastStep { pieces, noise, free, coefficients, parameters, iterations, converged } = *last;
    let information = pieces
        .iter()
        .zip(coefficients)
        .map(|(piece, own)| torque_information(piece, model, own, parameters, free, &noise[piece.record.log], 0))
        .collect::<Result<Vec<_>, _>>()?;
    let system = System::new(pieces, &information, coefficients, noise, free, &problem.names)?;
    drop(information);
    let channel = |what: &'static str| problem.joints.iter().map(move |joint| format!("{what} of {joint}"));
    let channels: Vec<String> = channel("torque").chain(channel("position")).chain(channel("motion")).collect();
    let mut linear = LinearProblem::new(problem.names.clone(), channels).with_fallback(parameters.to_vec())?;
    let theta: Vec<f64> = free.free.iter().map(|&place| parameters[place]).collect();
    for (place, (piece, own)) in pieces.iter().zip(coefficients).enumerate() {
        let levels = &noise[piece.record.log];
        let shares = system.shares(place);
        let mut torques: Vec<Panel> = (0..piece.joints).map(|_| Panel::new(free.count())).collect();
        piece.each_rows(model, (own, parameters, free), (&levels.colours, 0), |joints, _| {
            torques.par_iter_mut().zip(joints).enumerate().for_each(|(joint, (panel, rows))| {
                for row in 0..rows.count() {
                    let (first, x, by, r) = rows.row(row, free.count());
                    panel.add((first, 1), x, Some(by), r, (levels.torque_std[joint].recip(), &shares, &theta));
                }
            });
        })?;
        let of_joint = |joint: usize| {
            let scale = levels.positions[joint].position_std.recip();
            (
                positions(piece, own, joint, scale, &shares, &theta),
                roughness(piece, own, joint, levels, &shares, &theta),
            )
        };
        let others: Vec<(Panel, Panel)> = (0..piece.joints).into_par_iter().map(of_joint).collect();
        let (positions, roughness): (Vec<_>, Vec<_>) = others.into_iter().unzip();
        let all: Vec<Panel> = torques.into_iter().chain(positions).chain(roughness).collect();
        let factors: Vec<SegmentedFactor> = all.par_iter().map(Panel::factor).collect::<Result<_, _>>()?;
        let log = format!("record {}", piece.number + 1);
        for (channel, factor) in factors.into_iter().enumerate() {
            if factor.rows() > 0 {
                linear.add(&log, channel, free.free.clone(), factor)?;
            }
        }
    }
    let sigma = vec![1.0; linear.joints().len()];
    Ok(estimate_without_motion(&linear, &settings.rank, settings.covariance, sigma, iterations, converged)?)
}

/// Rows `[X̃ | r + X̃ θ]`, one after another.
struct Panel {
    columns: usize,
    values: Vec<f64>,
}

impl Panel {
    fn new(columns: usize) -> Self {
        Self { columns, values: Vec::new() }
    }

    /// Adds a row with the entries `own` for the unknown `first` and the following ones at distance `apart`.
    fn add(
        &mut self,
        (first, apart): (usize, usize),
        own: &[f64],
        arrow: Option<&[f64]>,
        r: f64,
        (scale, shares, theta): (f64, &[f64], &[f64]),
    ) {
        let p = self.columns;
        let from = self.values.len();
        self.values.resize(from + p + 1, 0.0);
        let row = &mut self.values[from..from + p];
        if let Some(arrow) = arrow {
            axpy(scale, arrow, row);
        }
        for (k, x) in own.iter().enumerate() {
            let at = (first + k * apart) * p;
            axpy(-scale * x, &shares[at..at + p], row);
        }
        let predicted: f64 = row.iter().zip(theta).map(|(x, t)| x * t).sum();
        self.values[from + p] = scale * r + predicted;
    }

    fn factor(&self) -> Result<SegmentedFactor, EstimationError> {
        let size = self.columns + 1;
        let rows = self.values.len() / size;
        let mut factor = SegmentedFactor::new(self.columns, SegmentSettings::for_rows(rows))?;
        let panel: Vec<f64> = (0..size).flat_map(|c| (0..rows).map(move |r| self.values[r * size + c])).collect();
        if rows > 0 {
            factor.absorb(&panel, rows)?;
        }
        Ok(factor)
    }
}

/// Position rows of a joint: means over the samples of one torque row, times the root of their number. Faster changes
/// of position carry no information about the parameters.
fn positions(
    piece: &Piece<'_>,
    coefficients: &[f64],
    joint: usize,
    scale: f64,
    shares: &[f64],
    theta: &[f64],
) -> Panel {
    let (joints, mean_of, spline) = (piece.joints, piece.mean_of, &piece.spline);
    let left = spline.residual(coefficients, joint, joints, piece.q(joint));
    let mut panel = Panel::new(theta.len());
    let weight = (mean_of as f64).sqrt().recip();
    for row in 0..piece.rows() {
        let anchor = spline.first(row * mean_of);
        let mut own = [0.0; ACTIVE + 1];
        let mut sum = 0.0;
        for (sample, left) in left.iter().enumerate().skip(row * mean_of).take(mean_of) {
            let moved = spline.first(sample) - anchor;
            spline.at(sample)[0].iter().enumerate().for_each(|(k, b)| own[moved + k] += weight * b);
            sum += weight * left;
        }
        let last = spline.functions() - anchor;
        panel.add((anchor * joints + joint, joints), &own[..last.min(own.len())], None, sum, (scale, shares, theta));
    }
    panel
}

/// Rows of the prior of a joint's motion.
fn roughness(
    piece: &Piece<'_>,
    coefficients: &[f64],
    joint: usize,
    levels: &LogNoise,
    shares: &[f64],
    theta: &[f64],
) -> Panel {
    let (joints, spline, smoothness) = (piece.joints, &piece.spline, levels.positions[joint]);
    let rows = spline.roughness_rows(smoothness.order);
    let scale = smoothness.penalty.sqrt();
    let mut panel = Panel::new(theta.len());
    for interval in 0..spline.functions() + 1 - ACTIVE {
        let first = interval * joints + joint;
        for row in &rows {
            let value: f64 = row.iter().enumerate().map(|(k, e)| e * coefficients[first + k * joints]).sum();
            panel.add((first, joints), row, None, -value, (scale, shares, theta));
        }
    }
    panel
}
