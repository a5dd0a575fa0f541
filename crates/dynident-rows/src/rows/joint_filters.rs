//! Filters of all columns of a joint, with masking of invalid samples.

use super::JointRows;
use super::coverage::Coverage;
use dynident_recording::{DecimationSettings, Decimator, FilterError};

/// One low-pass for all columns of a joint, with the exclusion of invalid samples.
#[derive(Debug)]
pub struct JointFilters {
    /// Filter of each joint; `None` if every sample is a row.
    decimators: Option<Vec<Decimator>>,
    coverage: Coverage,
    out: Vec<f64>,
}

impl JointFilters {
    /// Creates the filters for joints with these numbers of columns (including the torque) at `rate_hz`. Without
    /// `filter`, every sample is a row.
    ///
    /// # Errors
    /// Invalid settings of the filter for this rate.
    pub fn new(columns: &[usize], rate_hz: f64, filter: Option<&DecimationSettings>) -> Result<Self, FilterError> {
        // The filter is designed once for all joints.
        let filter_of_all = filter.map(|settings| Decimator::new(settings, rate_hz, 0)).transpose()?;
        let decimators = filter_of_all.map(|all| columns.iter().map(|columns| all.with_columns(*columns)).collect());
        let coverage = Coverage::new(columns.len(), rate_hz, filter)?;
        Ok(Self { decimators, coverage, out: Vec::new() })
    }

    /// Begins a new uninterrupted segment of the log.
    pub fn restart(&mut self) {
        self.coverage.restart();
        self.decimators.iter_mut().flatten().for_each(|decimator| {
            decimator.finish();
        });
    }

    /// Filters the next samples of a joint and returns its new rows. Samples marked in `set_aside` (invalid samples)
    /// are excluded from all columns; an empty `set_aside` excludes nothing.
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

    /// Advances all joints by this number of samples.
    pub fn advance(&mut self, samples: usize) {
        self.coverage.advance(samples);
    }

    /// Number of samples before and after a row that the filter uses.
    pub fn reach(&self) -> usize {
        self.decimators.as_ref().and_then(|all| all.first()).map_or(0, Decimator::half_length)
    }

    /// Number of samples that the first row needs.
    pub fn needed(&self) -> usize {
        self.decimators.as_ref().and_then(|all| all.first()).map_or(1, Decimator::length)
    }
}
