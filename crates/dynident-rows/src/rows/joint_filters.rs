//! The low-pass and decimation that all columns of a joint go through alike, samples that do not count left out.

use super::JointRows;
use super::coverage::Coverage;
use dynident_recording::{DecimationSettings, Decimator, FilterError};

/// Of every joint a filter for all of its columns, and the account of what was left out before it.
#[derive(Debug)]
pub struct JointFilters {
    /// None where every sample is a row.
    decimators: Option<Vec<Decimator>>,
    coverage: Coverage,
    out: Vec<f64>,
}

impl JointFilters {
    /// For joints with so many columns each (torque included) at `rate_hz`; without a filter every sample is a row.
    pub fn new(columns: &[usize], rate_hz: f64, filter: Option<&DecimationSettings>) -> Result<Self, FilterError> {
        // One filter for all.
        let filter_of_all = filter.map(|settings| Decimator::new(settings, rate_hz, 0)).transpose()?;
        let decimators = filter_of_all.map(|all| columns.iter().map(|columns| all.with_columns(*columns)).collect());
        let coverage = Coverage::new(columns.len(), rate_hz, filter)?;
        Ok(Self { decimators, coverage, out: Vec::new() })
    }

    /// A new piece begins.
    pub fn restart(&mut self) {
        self.coverage.restart();
        self.decimators.iter_mut().flatten().for_each(|decimator| {
            decimator.finish();
        });
    }

    /// The rows of a joint that its next samples make; those of `set_aside` (as many as samples; none if empty) are
    /// left out of all columns.
    pub fn push(&mut self, joint: usize, panel: &[f64], samples: usize, set_aside: &[bool]) -> JointRows<'_> {
        let panel = self.coverage.mask(joint, panel, samples, set_aside);
        let rows = if let Some(decimators) = &mut self.decimators {
            decimators[joint].push(panel, samples, &mut self.out)
        } else {
            self.out.clear();
            self.out.extend_from_slice(panel);
            samples
        };
        let coverage = self.coverage.divide(joint, rows, &mut self.out);
        JointRows { joint, rows, panel: &self.out, coverage }
    }

    /// All joints have seen so many further samples.
    pub fn advance(&mut self, samples: usize) {
        self.coverage.advance(samples);
    }

    /// Samples to either side of a row that it is made from.
    pub fn reach(&self) -> usize {
        self.decimators.as_ref().and_then(|all| all.first()).map_or(0, Decimator::half_length)
    }

    /// Samples that the first row needs.
    pub fn needed(&self) -> usize {
        self.decimators.as_ref().and_then(|all| all.first()).map_or(1, Decimator::length)
    }
}
