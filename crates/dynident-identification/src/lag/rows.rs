//! Rows for the estimation of a lag. A row contains the regressor, the time derivatives of the predicted torque and of
//! its friction step, and the torque at six neighbouring samples (nodes) between which it is interpolated.

use dynident_estimation::{EstimationError, SegmentSettings, SegmentedFactor};
use dynident_recording::{DecimationSettings, Decimator};
use dynident_rows::{JointRows, divide_by_coverage as divide};

/// Number of samples (nodes) for the interpolation of the torque.
pub(crate) const NODES: usize = 6;
/// Number of columns with time derivatives, before those of the nodes.
pub(crate) const SLOPES: usize = 2;
/// Index of the first node relative to the central sample.
const FIRST_NODE: isize = -2;
/// Number of samples on each side that the time derivative needs.
const SLOPE_REACH: isize = 2;

pub(crate) struct Piece {
    pub(crate) segment: usize,
    /// Predicted torque of each sample, by joint.
    pub(crate) model: Vec<Vec<f64>>,
    /// Predicted torque of the friction that changes its sign with the velocity, of each sample, by joint.
    pub(crate) step: Vec<Vec<f64>>,
    /// Measured torque of each sample, by joint.
    pub(crate) measured: Vec<Vec<f64>>,
    /// Indices of invalid samples, ascending, by joint.
    left_out: Vec<Vec<usize>>,
    /// Filtered regressor rows by joint.
    pub(crate) rows: Vec<Vec<FilteredRows>>,
}

pub(crate) struct FilteredRows {
    pub(crate) rows: usize,
    /// Regressor, column-major.
    pub(crate) regressor: Vec<f64>,
    pub(crate) coverage: Vec<f64>,
}

impl Piece {
    pub(crate) fn new(segment: usize, joints: usize) -> Self {
        let none = || vec![Vec::new(); joints];
        let rows = (0..joints).map(|_| Vec::new()).collect();
        Self { segment, model: none(), step: none(), measured: none(), left_out: vec![Vec::new(); joints], rows }
    }

    /// Marks the invalid samples among the samples that were added last.
    pub(crate) fn leave_out(&mut self, joint: usize, set_aside: &[bool]) {
        let first = self.measured[joint].len() - set_aside.len();
        let marked = set_aside.iter().enumerate().filter(|(_, marked)| **marked);
        self.left_out[joint].extend(marked.map(|(sample, _)| first + sample));
    }
}

/// Filtered rows `[Y | −∂(Yθ)/∂t | −∂τ_s/∂t | τ at the six nodes]` of one joint: regressor Y, time derivatives of the
/// predicted torque Yθ and of its friction step τ_s, and torque τ. The last node is in the column of the torque.
pub(crate) struct DelayRows {
    pub(crate) factor: SegmentedFactor,
    pub(crate) merged: SegmentedFactor,
    /// Index of the sample before the lag; the lag is at most one sample later.
    pub(crate) centre: isize,
    /// Root mean square of the filtered time derivative of the torque, Nm (N) per sample.
    pub(crate) slope_rms: f64,
}

impl DelayRows {
    /// Computes the rows around a lag of `shift` samples; `columns` is the number of regressor columns.
    pub(crate) fn new(
        pieces: &[Piece],
        joint: usize,
        columns: usize,
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
        shift: f64,
        segments: SegmentSettings,
    ) -> Result<Self, EstimationError> {
        let centre = shift.floor() as isize;
        let mut factor = SegmentedFactor::new(columns + SLOPES + NODES - 1, segments)?;
        let mut panel = Vec::new();
        let (mut shares, mut counted) = (Vec::new(), Vec::new());
        for piece in pieces {
            let (measured, left_out) = (&piece.measured[joint], &piece.left_out[joint]);
            let predicted = [&piece.model[joint][..], &piece.step[joint]];
            let further = LagColumns::new(predicted, measured, left_out, centre, rate_hz, filter);
            let mut first = 0;
            for FilteredRows { rows, regressor, coverage } in &piece.rows[joint] {
                let from = further.valid.start.max(first).min(first + rows);
                let to = further.valid.end.clamp(from, first + rows);
                panel.clear();
                for column in regressor.chunks_exact(*rows) {
                    panel.extend_from_slice(&column[from - first..to - first]);
                }
                shares.clear();
                shares.extend(coverage.get(from - first..to - first).unwrap_or_default());
                for column in further.values.chunks_exact(further.rows.max(1)) {
                    let whole = panel.len();
                    panel.extend_from_slice(&column[from..to]);
                    divide(&mut panel[whole..], &shares);
                }
                if to > from {
                    let all = JointRows { joint, rows: to - from, panel: &panel, coverage: &shares };
                    let counted = all.counted(&mut counted);
                    factor.absorb(counted.panel, counted.rows)?;
                }
                first += rows;
            }
        }
        let merged = factor.as_one_segment();
        let slope_rms = merged.total().column_norms()[columns] / (factor.rows().max(1) as f64).sqrt();
        Ok(Self { factor, merged, centre, slope_rms })
    }

    /// Whether a lag of `shift` samples is still between the nodes.
    pub(crate) fn reaches(&self, shift: f64) -> bool {
        (-0.5..=1.5).contains(&(shift - self.centre as f64))
    }
}

/// Filtered time derivatives, filtered shifted torques, and the range of rows for which all samples exist.
struct LagColumns {
    rows: usize,
    values: Vec<f64>,
    valid: core::ops::Range<usize>,
}

impl LagColumns {
    /// Computes the columns from the predicted torque and its friction step, the measured torque, and the indices of
    /// samples that are invalid in the regressor.
    fn new(
        predicted: [&[f64]; SLOPES],
        measured: &[f64],
        left_out: &[usize],
        centre: isize,
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
    ) -> Self {
        let samples = measured.len();
        let n = samples as isize;
        let at = |signal: &[f64], k: isize| usize::try_from(k).ok().and_then(|k| signal.get(k).copied()).unwrap_or(0.0);
        // Finite differences of fourth order: the error is below 1 % at a tenth of the sample rate.
        let slope =
            |of: &[f64], k: isize| (8.0 * (at(of, k + 1) - at(of, k - 1)) - (at(of, k + 2) - at(of, k - 2))) / 12.0;
        let mut signals = Vec::with_capacity((SLOPES + NODES) * samples);
        for of in predicted {
            signals.extend((0..n).map(|k| -slope(of, k)));
        }
        for node in 0..NODES as isize {
            signals.extend((0..n).map(|k| at(measured, k + centre + FIRST_NODE + node)));
        }
        for column in signals.chunks_exact_mut(samples.max(1)) {
            for &sample in left_out {
                column[sample] = 0.0;
            }
        }
        let last_node = FIRST_NODE + NODES as isize - 1;
        let low = SLOPE_REACH.max(-(centre + FIRST_NODE)).max(0);
        let high = n - SLOPE_REACH.max(centre + last_node).max(0);
        let decimator = filter.and_then(|settings| Decimator::new(settings, rate_hz, SLOPES + NODES).ok());
        let Some(mut decimator) = decimator else {
            let valid = low.min(n) as usize..high.max(low.min(n)) as usize;
            return Self { rows: n as usize, values: signals, valid };
        };
        let mut values = Vec::new();
        let rows = decimator.push(&signals, n as usize, &mut values);
        let reach = decimator.half_length() as isize;
        let whole = |row: &usize| {
            let middle = decimator.input_row(*row as u64) as isize;
            middle - reach >= low && middle + reach < high
        };
        let start = (0..rows).find(whole).unwrap_or(rows);
        let end = (start..rows).rev().find(whole).map_or(start, |row| row + 1);
        Self { rows, values, valid: start..end }
    }
}

/// Weights of the six nodes for the value `x` samples after the central sample, by a Lagrange polynomial of degree
/// five.
pub(crate) fn lagrange(x: f64) -> [f64; NODES] {
    let node = |k: usize| (k as isize + FIRST_NODE) as f64;
    core::array::from_fn(|i| {
        (0..NODES).filter(|&k| k != i).map(|k| (x - node(k)) / (node(i) - node(k))).product::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_between_samples_is_exact_for_polynomials() {
        let value = |t: f64| 0.3 - t + 0.2 * t.powi(3) - 0.01 * t.powi(5);
        for x in [-0.4, 0.0, 0.37, 0.5, 1.0, 1.3] {
            let found: f64 = lagrange(x).iter().enumerate().map(|(k, w)| w * value(k as f64 - 2.0)).sum();
            // Rounding of six products of order ten.
            assert!((found - value(x)).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn rows_at_the_ends_are_invalid() {
        let signal: Vec<f64> = (0..50).map(f64::from).collect();
        for (centre, valid) in [(0, 2..47), (4, 2..43), (-5, 7..48)] {
            let found = LagColumns::new([&signal; SLOPES], &signal, &[], centre, 100.0, None);
            assert_eq!(found.valid, valid, "{centre}");
            for k in valid {
                // The slope of a ramp, and the ramp shifted.
                assert!((found.values[k] + 1.0).abs() < 1e-12);
                assert_eq!(found.values[100 + k], (k as isize + centre - 2) as f64);
            }
        }
        assert!(LagColumns::new([&signal[..3]; SLOPES], &signal[..3], &[], 20, 100.0, None).valid.is_empty());
    }
}
