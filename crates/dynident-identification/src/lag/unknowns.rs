//! Unknowns of a lag estimation in addition to the lags.

use crate::payload::{LoadColumns, SeenColumns};
use nalgebra::DVector;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Unknowns<'a> {
    /// Values of the fit, in the order of its columns.
    pub(crate) values: &'a [f64],
    /// Columns of payloads and offsets of single logs, with the indices of the logs; `None` if the values are base
    /// parameters.
    pub(crate) loads: Option<(&'a LoadColumns, &'a [usize])>,
    /// Joints whose torque gain has an unknown relative error.
    pub(crate) gains: &'a [usize],
}

impl<'a> Unknowns<'a> {
    pub(crate) fn of_log(theta: &'a [f64]) -> Self {
        Self { values: theta, loads: None, gains: &[] }
    }

    /// Number of columns before the columns of the lags: parameters, then gains.
    pub(crate) fn count(&self) -> usize {
        self.values.len() + self.gains.len()
    }

    /// Columns of the problem that act on a joint in log `place` through its regressor columns `own`. `theta` are the
    /// base parameters of the log.
    pub(crate) fn seen(&self, place: usize, joint: usize, own: &[usize], theta: &[f64]) -> SeenColumns {
        let mut seen = match self.loads {
            Some((columns, logs)) => columns.seen(logs[place], own),
            None => SeenColumns::of_base(own),
        };
        if let Some(gain) = self.gains.iter().position(|&free| free == joint) {
            seen.columns.push(self.values.len() + gain);
            let predicted = DVector::from_iterator(own.len(), own.iter().map(|&column| theta[column]));
            let last = seen.map.ncols();
            seen.map = seen.map.insert_column(last, 0.0);
            seen.map.set_column(last, &predicted);
        }
        seen
    }
}
