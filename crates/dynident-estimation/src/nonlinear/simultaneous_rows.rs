//! Linear algebra of [`simultaneous_least_squares`](crate::simultaneous_least_squares()): whitened rows, normal
//! matrices and elimination of the motion.

use super::autoregression::{whitened, whitened_columns};
use crate::error::{EstimationError, expect};
use crate::factor::{LinearProblem, SegmentSettings, SegmentedFactor};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A pivot of the information matrix (scaled to a unit diagonal) below this value is treated as zero. The value is
/// far below that of an excited column and above rounding.
const MIN_PIVOT: f64 = 1.0e-13;
/// Lower limit of a channel's σ relative to the size of its prediction, for noise-free data.
const MIN_SIGMA_SHARE: f64 = 1.0e-9;
/// Number of columns multiplied at a time; only half of the symmetric normal matrix is computed.
const STRIP_COLUMNS: usize = 64;

/// One channel's rows at given unknowns: positions or torques of a joint in one uninterrupted piece of one log, in
/// order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelRows {
    /// `y − f(motion, parameters)` (measurement minus prediction), one number for each row.
    pub residual: Vec<f64>,
    /// Index of the motion unknown of the first column of `by_motion`; the other columns are the unknowns that
    /// follow.
    pub first_motion: usize,
    /// `∂f/∂motion`, shape (rows, any); unknowns without a column do not act on this channel.
    pub by_motion: DMatrix<f64>,
    /// `∂f/∂parameters`, shape (rows, parameters), or (rows, 0) if they do not act on this channel.
    pub by_parameters: DMatrix<f64>,
}

/// Whitened rows of all channels and their normal matrices, independent of σ.
pub(crate) struct WhiteRows {
    motion: usize,
    parameters: usize,
    colours: Vec<Vec<f64>>,
    channels: Vec<WhiteChannel>,
}

struct WhiteChannel {
    /// Index of every column among all unknowns.
    places: Vec<usize>,
    /// Number of columns that belong to the motion.
    motion: usize,
    /// Derivatives with respect to these unknowns.
    columns: DMatrix<f64>,
    /// `columnsᵀ columns`.
    normal: DMatrix<f64>,
}

/// Normal equations of all channels, with columns scaled to unit norm.
pub(crate) struct System {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl System {
    pub(crate) fn solve(&self, gradient: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(&gradient.component_mul(&self.scale)).component_mul(&self.scale)
    }

    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for i in 0..inverse.nrows() {
            inverse.row_mut(i).scale_mut(self.scale[i]);
            inverse.column_mut(i).scale_mut(self.scale[i]);
        }
        inverse
    }
}

pub(crate) fn cost(residuals: &[DVector<f64>], sigma: &[f64]) -> f64 {
    residuals.iter().zip(sigma).map(|(r, sigma)| r.norm_squared() / (sigma * sigma)).sum()
}

impl WhiteRows {
    pub(crate) fn new(
        channels: &[ChannelRows],
        colours: &[Vec<f64>],
        motion: usize,
        parameters: usize,
    ) -> Result<Self, EstimationError> {
        if channels.iter().all(|channel| channel.residual.is_empty()) {
            return Err(EstimationError::Empty);
        }
        let channels = channels.iter().zip(colours).map(|(rows, colour)| channel(rows, colour, motion, parameters));
        Ok(Self { motion, parameters, colours: colours.to_vec(), channels: channels.collect::<Result<_, _>>()? })
    }

    fn unknowns(&self) -> usize {
        self.motion + self.parameters
    }

    pub(crate) fn parts<'a>(&self, unknowns: &'a DVector<f64>) -> (&'a [f64], &'a [f64]) {
        unknowns.as_slice().split_at(self.motion)
    }

    pub(crate) fn filtered(&self, residuals: &[Vec<f64>]) -> Result<Vec<DVector<f64>>, EstimationError> {
        expect("channels of residuals", self.channels.len(), residuals.len())?;
        let one = |((residual, colour), channel): ((&Vec<f64>, &Vec<f64>), &WhiteChannel)| {
            let found = whitened(residual, colour);
            expect("rows of a channel's residuals", channel.columns.nrows(), found.len())?;
            Ok(found)
        };
        residuals.iter().zip(&self.colours).zip(&self.channels).map(one).collect()
    }

    pub(crate) fn gradient(&self, residuals: &[DVector<f64>], sigma: &[f64]) -> DVector<f64> {
        let mut gradient = DVector::zeros(self.unknowns());
        for ((channel, r), sigma) in self.channels.iter().zip(residuals).zip(sigma) {
            let own = channel.columns.tr_mul(r) / (sigma * sigma);
            for (&place, value) in channel.places.iter().zip(&own) {
                gradient[place] += value;
            }
        }
        gradient
    }

    /// Length of a step in error bars over all directions.
    pub(crate) fn length(&self, step: &DVector<f64>, sigma: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (channel, sigma) in self.channels.iter().zip(sigma) {
            let own = DVector::from_iterator(channel.places.len(), channel.places.iter().map(|&place| step[place]));
            sum += (&channel.normal * &own).dot(&own).max(0.0) / (sigma * sigma);
        }
        (sum / step.len().max(1) as f64).sqrt()
    }

    fn information(&self, sigma: &[f64]) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(self.unknowns(), self.unknowns());
        for (channel, sigma) in self.channels.iter().zip(sigma) {
            let weight = 1.0 / (sigma * sigma);
            for (b, &column) in channel.places.iter().enumerate() {
                for (a, &row) in channel.places.iter().enumerate() {
                    sum[(row, column)] += weight * channel.normal[(a, b)];
                }
            }
        }
        sum
    }

    /// The factored information; `None` if it is singular.
    pub(crate) fn system(&self, sigma: &[f64]) -> Option<System> {
        let (scaled, scale) = scaled(self.information(sigma))?;
        let factor = scaled.cholesky()?;
        let least = factor.l_dirty().diagonal().iter().map(|pivot| pivot * pivot).fold(1.0, f64::min);
        (least > MIN_PIVOT).then_some(System { scale, factor })
    }

    /// The first unknown whose effect the rows do not separate from that of the previous unknowns.
    pub(crate) fn undetermined(&self, sigma: &[f64], names: &[String]) -> EstimationError {
        let information = self.information(sigma);
        let size = information.nrows();
        let diagonal = information.diagonal();
        let mut left = DMatrix::from_fn(size, size, |i, j| {
            let scale = (diagonal[i] * diagonal[j]).sqrt();
            if scale > 0.0 { information[(i, j)] / scale } else { 0.0 }
        });
        let mut place = size - 1;
        for k in 0..size {
            if left[(k, k)].is_nan() || left[(k, k)] <= MIN_PIVOT {
                place = k;
                break;
            }
            let column = left.column(k).into_owned();
            for j in k + 1..size {
                let share = column[j] / column[k];
                for i in k + 1..size {
                    left[(i, j)] -= share * column[i];
                }
            }
        }
        let of_motion = format!("unknown {} of the motion", place + 1);
        let name = place.checked_sub(self.motion).map_or(of_motion, |place| names[place].clone());
        EstimationError::Undetermined { name }
    }

    /// `tr(G_c H⁻¹)/σ_c²`: effective number of unknowns determined by each channel.
    pub(crate) fn leverage(&self, system: &System, sigma: &[f64]) -> Vec<f64> {
        let inverse = system.inverse();
        let of = |(channel, sigma): (&WhiteChannel, &f64)| {
            let mut trace = 0.0;
            for (b, &column) in channel.places.iter().enumerate() {
                for (a, &row) in channel.places.iter().enumerate() {
                    trace += channel.normal[(a, b)] * inverse[(row, column)];
                }
            }
            trace / (sigma * sigma)
        };
        self.channels.iter().zip(sigma).map(of).collect()
    }

    /// σ_c of every channel: `√(‖r_c‖²/(N_c − leverage_c))`.
    pub(crate) fn sigma(
        &self,
        residuals: &[DVector<f64>],
        leverage: &[f64],
        unknowns: &DVector<f64>,
    ) -> Result<Vec<f64>, EstimationError> {
        let mut sigma = Vec::with_capacity(residuals.len());
        for (place, ((channel, r), leverage)) in self.channels.iter().zip(residuals).zip(leverage).enumerate() {
            let rows = r.len();
            let degrees_of_freedom = rows as f64 - leverage;
            if degrees_of_freedom < 1.0 {
                let what = format!("channel {}", place + 1);
                return Err(EstimationError::TooFewRows { what, rows, parameters: *leverage });
            }
            if let Some(row) = r.iter().position(|value| !value.is_finite()) {
                let (column, value, limit) = (channel.places.len(), r[row], f64::MAX);
                return Err(EstimationError::Unusable { row, column, value, limit });
            }
            let places = channel.places.iter().enumerate();
            let moved: f64 = places.map(|(k, &place)| channel.normal[(k, k)] * unknowns[place].powi(2)).sum();
            let floor = MIN_SIGMA_SHARE * (moved / rows as f64).sqrt();
            let found = (r.norm_squared() / degrees_of_freedom).sqrt().max(floor);
            sigma.push(if found > 0.0 { found } else { 1.0 });
        }
        Ok(sigma)
    }

    /// Linear problem of the parameters alone: rows `[X_p − X_m B | r + (X_p − X_m B) θ]`, `B = H_mm⁻¹ H_mp`, whose
    /// normal matrix is the Schur complement of the motion's block.
    pub(crate) fn eliminated(
        &self,
        names: &[String],
        channels: &[String],
        sigma: &[f64],
        residuals: &[DVector<f64>],
        unknowns: &DVector<f64>,
    ) -> Result<LinearProblem, EstimationError> {
        let information = self.information(sigma);
        let (m, p) = (self.motion, self.parameters);
        let mixed = information.view((0, m), (m, p)).into_owned();
        let none = || self.undetermined(sigma, names);
        let shares = if m == 0 {
            DMatrix::zeros(0, p)
        } else {
            let (own, scale) = scaled(information.view((0, 0), (m, m)).into_owned()).ok_or_else(none)?;
            let rows = |mut matrix: DMatrix<f64>| {
                matrix.row_iter_mut().zip(&scale).for_each(|(mut row, scale)| row *= *scale);
                matrix
            };
            rows(own.cholesky().ok_or_else(none)?.solve(&rows(mixed)))
        };
        let theta = unknowns.rows(m, p).into_owned();
        let fallback = theta.iter().copied().collect();
        let mut problem = LinearProblem::new(names.to_vec(), channels.to_vec()).with_fallback(fallback)?;
        for (place, (channel, r)) in self.channels.iter().zip(residuals).enumerate() {
            let rows = channel.columns.nrows();
            let mut panel = DMatrix::zeros(rows, p + 1);
            if channel.places.len() > channel.motion {
                let own = channel.columns.columns_range(channel.motion..);
                panel.columns_range_mut(..p).copy_from(&own);
            }
            if channel.motion > 0 {
                let shares = shares.rows(channel.places[0], channel.motion);
                panel.columns_range_mut(..p).gemm(-1.0, &channel.columns.columns_range(..channel.motion), &shares, 1.0);
            }
            let right = r + panel.columns_range(..p) * &theta;
            panel.set_column(p, &right);
            let mut factor = SegmentedFactor::new(p, SegmentSettings::for_rows(rows))?;
            factor.absorb(panel.as_slice(), rows)?;
            problem.add("all", place, (0..p).collect(), factor)?;
        }
        Ok(problem)
    }
}

fn channel(
    rows: &ChannelRows,
    colour: &[f64],
    motion: usize,
    parameters: usize,
) -> Result<WhiteChannel, EstimationError> {
    let count = rows.residual.len();
    expect("rows of a channel's derivatives by the motion", count, rows.by_motion.nrows())?;
    expect("rows of a channel's derivatives by the parameters", count, rows.by_parameters.nrows())?;
    let own = rows.by_motion.ncols();
    expect("unknowns of the motion from a channel's first one on", motion, motion.max(rows.first_motion + own))?;
    let acting = rows.by_parameters.ncols();
    if acting > 0 {
        expect("a channel's derivatives by the parameters", parameters, acting)?;
    }
    if count <= colour.len() {
        let what = "a channel".to_owned();
        return Err(EstimationError::TooFewRows { what, rows: count, parameters: colour.len() as f64 });
    }
    let mut columns = DMatrix::zeros(count - colour.len(), own + acting);
    columns.columns_range_mut(..own).copy_from(&whitened_columns(&rows.by_motion, colour));
    columns.columns_range_mut(own..).copy_from(&whitened_columns(&rows.by_parameters, colour));
    if let Some(place) = columns.iter().position(|value| !value.is_finite()) {
        let (row, column) = (place % columns.nrows(), place / columns.nrows());
        return Err(EstimationError::Unusable { row, column, value: columns[(row, column)], limit: f64::MAX });
    }
    let places = (rows.first_motion..rows.first_motion + own).chain((0..acting).map(|k| motion + k)).collect();
    Ok(WhiteChannel { places, motion: own, normal: normal(&columns), columns })
}

fn normal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let count = columns.ncols();
    let mut normal = DMatrix::zeros(count, count);
    for first in (0..count).step_by(STRIP_COLUMNS) {
        let width = STRIP_COLUMNS.min(count - first);
        let strip = columns.columns(first, width).transpose();
        normal.view_mut((first, first), (width, count - first)).gemm(1.0, &strip, &columns.columns_range(first..), 0.0);
    }
    normal.fill_lower_triangle_with_upper_triangle();
    normal
}

/// A matrix scaled to a unit diagonal, and the scale; `None` if a diagonal entry is not positive.
fn scaled(mut matrix: DMatrix<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let scale = matrix.diagonal().map(|x| 1.0 / x.sqrt());
    if scale.iter().any(|x| !(x.is_finite() && *x > 0.0)) {
        return None;
    }
    for (i, &scale) in scale.iter().enumerate() {
        matrix.row_mut(i).scale_mut(scale);
        matrix.column_mut(i).scale_mut(scale);
    }
    Some((matrix, scale))
}
