//! Whitened torque rows at given motion and parameters. A row depends on a window of the motion's functions of all
//! joints, and on the parameters.
//!
//! A row is the mean over a few samples, minus the prediction of the autoregression from previous rows.

use super::banded_arrow::{BandedArrow, axpy};
use super::bspline::{ACTIVE, Spline};
use super::problem::{SplineRecord, TorqueModel, TorqueSlopes};
use crate::error::{EstimationError, expect};
use dynident_model::terms::JointMotion;
use rayon::prelude::*;

const CHUNK_ROWS: usize = 512;

/// A record with the functions of its motion.
#[derive(Clone, Debug)]
pub(super) struct Piece<'a> {
    pub(super) number: usize,
    pub(super) record: &'a SplineRecord,
    pub(super) spline: Spline,
    pub(super) joints: usize,
    /// Samples per row.
    pub(super) mean_of: usize,
}

/// Some whitened rows of one joint.
#[derive(Clone, Debug, Default)]
pub(super) struct JointRows {
    /// First unknown of the window of each row.
    pub(super) first: Vec<usize>,
    pub(super) width: usize,
    /// Derivatives with respect to the motion's unknowns, by row.
    pub(super) own: Vec<f64>,
    /// Derivatives with respect to the free parameters, by row.
    pub(super) arrow: Vec<f64>,
    pub(super) residual: Vec<f64>,
}

/// Indices of the free parameters, and the position of each parameter among them.
#[derive(Clone, Debug)]
pub(super) struct FreeParameters {
    pub(super) free: Vec<usize>,
    places: Vec<Option<usize>>,
}

impl FreeParameters {
    pub(super) fn new(held: &[bool]) -> Self {
        let free: Vec<usize> = (0..held.len()).filter(|&k| !held[k]).collect();
        let mut places = vec![None; held.len()];
        free.iter().enumerate().for_each(|(place, &k)| places[k] = Some(place));
        Self { free, places }
    }

    pub(super) fn count(&self) -> usize {
        self.free.len()
    }
}

impl Piece<'_> {
    pub(super) fn samples(&self) -> usize {
        self.spline.samples
    }

    /// Number of rows of each joint before whitening; incomplete rows at the end are dropped.
    pub(super) fn rows(&self) -> usize {
        self.samples() / self.mean_of
    }

    pub(super) fn unknowns(&self) -> usize {
        self.spline.functions() * self.joints
    }

    /// Number of functions that act on a row whitened with `order` previous rows.
    fn window(&self, order: usize) -> usize {
        ACTIVE + (self.mean_of * (order + 1) - 1).div_ceil(self.spline.step)
    }

    /// Half bandwidth of the coupled unknowns.
    pub(super) fn bandwidth(&self, order: usize) -> usize {
        self.window(order).min(self.spline.functions()) * self.joints - 1
    }

    pub(super) fn q(&self, joint: usize) -> &[f64] {
        &self.record.q[joint * self.samples()..(joint + 1) * self.samples()]
    }

    /// Positions, velocities and accelerations of a range of samples, joint-major.
    pub(super) fn motion(&self, coefficients: &[f64], from: usize, count: usize) -> [Vec<f64>; 3] {
        let mut out = [vec![0.0; count * self.joints], vec![0.0; count * self.joints], vec![0.0; count * self.joints]];
        let [q, dq, ddq] = &mut out;
        let each = q.chunks_exact_mut(count).zip(dq.chunks_exact_mut(count)).zip(ddq.chunks_exact_mut(count));
        for (joint, ((q, dq), ddq)) in each.enumerate() {
            self.spline.motion(coefficients, joint, self.joints, from, [q, dq, ddq]);
        }
        out
    }

    /// Row means of the measured minus the modelled torque, by joint.
    pub(super) fn residuals<M: TorqueModel>(
        &self,
        model: &mut M,
        coefficients: &[f64],
        parameters: &[f64],
    ) -> Result<Vec<Vec<f64>>, M::Error> {
        let mut all = vec![Vec::with_capacity(self.rows()); self.joints];
        for from in (0..self.rows()).step_by(CHUNK_ROWS) {
            let rows = CHUNK_ROWS.min(self.rows() - from);
            let (first, count) = (from * self.mean_of, rows * self.mean_of);
            let [q, dq, ddq] = self.motion(coefficients, first, count);
            let motion = JointMotion { samples: count, q: &q, dq: &dq, ddq: &ddq };
            let torque = model.torque((self.number, first), &motion, parameters)?;
            expect("torques of a block", count * self.joints, torque.len())?;
            for (joint, (all, torque)) in all.iter_mut().zip(torque.chunks_exact(count)).enumerate() {
                self.append_means(joint, first, torque, all);
            }
        }
        Ok(all)
    }

    fn append_means(&self, joint: usize, first: usize, torque: &[f64], to: &mut Vec<f64>) {
        let measured = &self.record.tau[joint * self.samples() + first..][..torque.len()];
        let rows = measured.chunks_exact(self.mean_of).zip(torque.chunks_exact(self.mean_of));
        let mean = |(measured, torque): (&[f64], &[f64])| {
            measured.iter().zip(torque).map(|(x, y)| x - y).sum::<f64>() / self.mean_of as f64
        };
        to.extend(rows.map(mean));
    }

    /// Passes all rows to `take` in chunks for all joints: whitened, and unwhitened with up to `lags` previous rows.
    pub(super) fn each_rows<M: TorqueModel>(
        &self,
        model: &mut M,
        (coefficients, parameters, free): (&[f64], &[f64], &FreeParameters),
        (colours, lags): (&[Vec<f64>], usize),
        mut take: impl FnMut(&[JointRows], &[JointRows]),
    ) -> Result<(), M::Error> {
        let lags = colours.iter().map(Vec::len).fold(lags, usize::max);
        // Unwhitened rows carried over to the next chunk.
        let mut carried: Vec<JointRows> = vec![JointRows::default(); self.joints];
        for from in (0..self.rows()).step_by(CHUNK_ROWS) {
            let rows = CHUNK_ROWS.min(self.rows() - from);
            let (first, count) = (from * self.mean_of, rows * self.mean_of);
            let [q, dq, ddq] = self.motion(coefficients, first, count);
            let motion = JointMotion { samples: count, q: &q, dq: &dq, ddq: &ddq };
            let slopes = model.slopes((self.number, first), &motion, parameters)?;
            self.check(&slopes, count, parameters.len())?;
            let of = |(joint, carried): (usize, &mut JointRows)| {
                let new = carried.count();
                carried.append(&self.raw(joint, from, rows, &slopes, free));
                self.whitened(carried, new, &colours[joint], free.count())
            };
            let whitened: Vec<JointRows> = carried.par_iter_mut().enumerate().map(of).collect();
            take(&whitened, &carried);
            for rows in &mut carried {
                rows.keep_last(lags, free.count());
            }
        }
        Ok(())
    }

    fn check(&self, slopes: &TorqueSlopes, count: usize, parameters: usize) -> Result<(), EstimationError> {
        expect("torques of a block", count * self.joints, slopes.torque.len())?;
        expect("derivatives of a block's torques", 3 * count * self.joints * self.joints, slopes.by_motion.len())?;
        expect("joints with derivatives by parameters", self.joints, slopes.by_parameters.len())?;
        expect("joints with parameters", self.joints, slopes.columns.len())?;
        for (columns, values) in slopes.columns.iter().zip(&slopes.by_parameters) {
            expect("derivatives of a joint's torques by parameters", count * columns.len(), values.len())?;
            let most = columns.iter().map(|column| column + 1).max().unwrap_or(0);
            expect("parameters up to a joint's last one", parameters, parameters.max(most))?;
        }
        let by = slopes.by_parameters.iter().flatten();
        match slopes.torque.iter().chain(&slopes.by_motion).chain(by).find(|x| !x.is_finite()) {
            Some(&value) => Err(EstimationError::Unusable { row: 0, column: 0, value, limit: f64::MAX }),
            None => Ok(()),
        }
    }

    /// Unwhitened rows, with windows as wide as one row's functions.
    fn raw(&self, joint: usize, from: usize, rows: usize, slopes: &TorqueSlopes, free: &FreeParameters) -> JointRows {
        let (joints, mean_of) = (self.joints, self.mean_of);
        let (count, share) = (rows * mean_of, 1.0 / mean_of as f64);
        let width = self.window(0) * joints;
        let mut out = JointRows {
            first: Vec::with_capacity(rows),
            width,
            own: vec![0.0; rows * width],
            arrow: vec![0.0; rows * free.count()],
            residual: Vec::with_capacity(rows),
        };
        let of_joint = &slopes.by_motion[joint * 3 * joints * count..(joint + 1) * 3 * joints * count];
        for (row, own) in out.own.chunks_exact_mut(width).enumerate() {
            let anchor = self.spline.first((from + row) * mean_of);
            out.first.push(anchor * joints);
            for k in 0..mean_of {
                let (place, sample) = (row * mean_of + k, (from + row) * mean_of + k);
                let moved = self.spline.first(sample) - anchor;
                let [values, rates, seconds] = self.spline.at(sample);
                for other in 0..joints {
                    let [by_q, by_dq, by_ddq] =
                        [0, 1, 2].map(|order| share * of_joint[(order * joints + other) * count + place]);
                    for a in 0..ACTIVE {
                        own[(moved + a) * joints + other] += by_q * values[a] + by_dq * rates[a] + by_ddq * seconds[a];
                    }
                }
            }
        }
        let columns = slopes.columns[joint].iter().zip(slopes.by_parameters[joint].chunks_exact(count));
        for (&column, values) in columns {
            let Some(place) = free.places[column] else { continue };
            for (row, values) in values.chunks_exact(mean_of).enumerate() {
                out.arrow[row * free.count() + place] = share * values.iter().sum::<f64>();
            }
        }
        let torque = &slopes.torque[joint * count..(joint + 1) * count];
        self.append_means(joint, from * mean_of, torque, &mut out.residual);
        out
    }

    /// Rows from `new` on minus the prediction of the autoregression; the first rows of a piece, which have no
    /// predecessors, are dropped.
    fn whitened(&self, raw: &JointRows, new: usize, colour: &[f64], parameters: usize) -> JointRows {
        let (order, rows) = (colour.len(), raw.first.len());
        let width = self.window(order).min(self.spline.functions()) * self.joints;
        let mut out = JointRows { width, ..JointRows::default() };
        for row in order.max(new)..rows {
            // A window beyond the last function begins earlier.
            let first = raw.first[row - order].min(self.unknowns() - width);
            let (own_from, arrow_from) = (out.own.len(), out.arrow.len());
            out.own.resize(own_from + width, 0.0);
            out.arrow.resize(arrow_from + parameters, 0.0);
            let mut residual = 0.0;
            for lag in 0..=order {
                let weight = if lag == 0 { 1.0 } else { -colour[lag - 1] };
                let other = row - lag;
                let own = &raw.own[other * raw.width..(other + 1) * raw.width];
                let at = raw.first[other] - first;
                let kept = raw.width.min(width - at);
                axpy(weight, &own[..kept], &mut out.own[own_from + at..own_from + at + kept]);
                let arrow = &raw.arrow[other * parameters..(other + 1) * parameters];
                axpy(weight, arrow, &mut out.arrow[arrow_from..]);
                residual += weight * raw.residual[other];
            }
            out.first.push(first);
            out.residual.push(residual);
        }
        out
    }
}

impl JointRows {
    pub(super) fn part(&self, run: core::ops::Range<usize>, parameters: usize) -> Self {
        Self {
            first: self.first[run.clone()].to_vec(),
            width: self.width,
            own: self.own[run.start * self.width..run.end * self.width].to_vec(),
            arrow: self.arrow[run.start * parameters..run.end * parameters].to_vec(),
            residual: self.residual[run].to_vec(),
        }
    }

    pub(super) fn append(&mut self, more: &Self) {
        self.width = more.width;
        self.first.extend_from_slice(&more.first);
        self.own.extend_from_slice(&more.own);
        self.arrow.extend_from_slice(&more.arrow);
        self.residual.extend_from_slice(&more.residual);
    }

    fn keep_last(&mut self, rows: usize, parameters: usize) {
        let from = self.first.len().saturating_sub(rows);
        self.first.drain(..from);
        self.own.drain(..from * self.width);
        self.arrow.drain(..from * parameters);
        self.residual.drain(..from);
    }

    pub(super) fn count(&self) -> usize {
        self.first.len()
    }

    /// Window, parameters and residual of row `row`.
    pub(super) fn row(&self, row: usize, parameters: usize) -> (usize, &[f64], &[f64], f64) {
        let own = &self.own[row * self.width..(row + 1) * self.width];
        let arrow = &self.arrow[row * parameters..(row + 1) * parameters];
        (self.first[row], own, arrow, self.residual[row])
    }

    /// Adds the rows, divided by `sigma`, to a matrix of the motion's unknowns.
    pub(super) fn information(&self, parameters: usize, bandwidth: usize, sigma: f64) -> Option<(usize, BandedArrow)> {
        let first = *self.first.first()?;
        let last = self.first.last()? + self.width;
        let mut part = BandedArrow::new(last - first, bandwidth, parameters);
        let (mut own, mut arrow) = (vec![0.0; self.width], vec![0.0; parameters]);
        for row in 0..self.count() {
            let (at, x, by, r) = self.row(row, parameters);
            own.iter_mut().zip(x).for_each(|(to, x)| *to = x / sigma);
            arrow.iter_mut().zip(by).for_each(|(to, x)| *to = x / sigma);
            part.add_row(at - first, &own, &arrow, r / sigma);
        }
        Some((first, part))
    }
}
