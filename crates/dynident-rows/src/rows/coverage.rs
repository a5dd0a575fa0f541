//! Exclusion of invalid samples from filtered rows.

use super::JointRows;
use dynident_recording::{DecimationSettings, FilterError};

/// Minimum share of the filter's weight that must be on valid samples for a valid row.
const MIN_COVERAGE: f64 = 0.5;

/// Sets invalid samples of regressor W and torque τ to zero before the low-pass, and computes the remaining filter
/// weight of each filtered row.
///
/// A filtered row is `Σ h_k [W_k | τ_k]`, with the filter coefficients `h_k`. With `m_k = 0` for invalid samples and
/// `m_k = 1` for the others, `Σ h_k m_k [W_k | τ_k]` satisfies the same equation `τ = W θ` with the same parameters θ
/// for any `m`, so the exclusion of samples adds no bias. Rows are divided by their coverage `c = Σ h_k m_k` (at least
/// one half) to keep their scale. Rows with a coverage below one half are invalid ([`JointRows::counted`]).
#[derive(Debug)]
pub(super) struct Coverage {
    taps: Vec<f64>,
    factor: usize,
    samples: usize,
    /// For each joint the invalid samples that later rows still contain, and the number of rows so far.
    joints: Vec<(Vec<usize>, usize)>,
    panel: Vec<f64>,
    shares: Vec<f64>,
}

impl Coverage {
    pub(super) fn new(dof: usize, rate_hz: f64, filter: Option<&DecimationSettings>) -> Result<Self, FilterError> {
        let taps = filter.map_or_else(|| Ok(vec![1.0]), |settings| settings.taps(rate_hz))?;
        Ok(Self {
            taps,
            factor: filter.map_or(1, |settings| settings.factor),
            samples: 0,
            joints: vec![(Vec::new(), 0); dof],
            panel: Vec::new(),
            shares: Vec::new(),
        })
    }

    pub(super) fn restart(&mut self) {
        self.samples = 0;
        self.joints.iter_mut().for_each(|(masked, rows)| {
            masked.clear();
            *rows = 0;
        });
    }

    /// The panel with the samples of `set_aside` (invalid samples) set to zero; unchanged if `set_aside` is empty.
    pub(super) fn mask<'a>(
        &'a mut self,
        joint: usize,
        panel: &'a [f64],
        samples: usize,
        set_aside: &[bool],
    ) -> &'a [f64] {
        if !set_aside.contains(&true) {
            return panel;
        }
        self.panel.clear();
        self.panel.extend_from_slice(panel);
        for (sample, _) in set_aside.iter().enumerate().filter(|(_, set_aside)| **set_aside) {
            self.joints[joint].0.push(self.samples + sample);
            for column in self.panel.chunks_exact_mut(samples) {
                column[sample] = 0.0;
            }
        }
        &self.panel
    }

    pub(super) fn advance(&mut self, samples: usize) {
        self.samples += samples;
    }

    /// Divides the next rows of a joint by their coverage and returns the coverage; empty if all samples are valid.
    pub(super) fn divide(&mut self, joint: usize, rows: usize, panel: &mut [f64]) -> &[f64] {
        let (masked, done) = &mut self.joints[joint];
        self.shares.clear();
        let first = *done;
        *done += rows;
        if masked.is_empty() || rows == 0 {
            return &[];
        }
        for row in first..first + rows {
            let from = row * self.factor;
            let at = masked.partition_point(|sample| *sample < from);
            let inside = masked[at..].iter().take_while(|sample| **sample < from + self.taps.len());
            self.shares.push(1.0 - inside.map(|sample| self.taps[sample - from]).sum::<f64>());
        }
        let next = *done * self.factor;
        masked.drain(..masked.partition_point(|sample| *sample < next));
        for column in panel.chunks_exact_mut(rows) {
            divide_by_coverage(column, &self.shares);
        }
        &self.shares
    }
}

/// Divides a column by the coverage of its rows (at least one half); an empty coverage changes nothing.
pub fn divide_by_coverage(column: &mut [f64], coverage: &[f64]) {
    for (value, coverage) in column.iter_mut().zip(coverage) {
        *value /= coverage.max(MIN_COVERAGE);
    }
}

impl<'a> JointRows<'a> {
    /// Whether a row is valid: at least half of the filter's weight is on valid samples.
    pub fn counts(&self, row: usize) -> bool {
        self.coverage.get(row).is_none_or(|coverage| *coverage >= MIN_COVERAGE)
    }

    /// The valid rows: rows with at least half of the filter's weight on valid samples. `buffer` stores them if some
    /// rows are invalid.
    pub fn counted<'b>(&self, buffer: &'b mut Vec<f64>) -> JointRows<'b>
    where
        'a: 'b,
    {
        let JointRows { joint, rows, panel, coverage } = *self;
        let kept: Vec<usize> =
            if coverage.is_empty() { Vec::new() } else { (0..rows).filter(|row| self.counts(*row)).collect() };
        if coverage.is_empty() || kept.len() == rows {
            return JointRows { joint, rows, panel, coverage: &[] };
        }
        buffer.clear();
        for column in panel.chunks_exact(rows) {
            buffer.extend(kept.iter().map(|row| column[*row]));
        }
        JointRows { joint, rows: kept.len(), panel: buffer, coverage: &[] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_recording::Decimator;

    /// Rows of `[W | τ]` with `τ = 3 W`, except for the samples that are marked as invalid.
    #[test]
    fn masked_samples_do_not_change_the_equation() {
        let settings = DecimationSettings { factor: 5, ..DecimationSettings::default() };
        let n = 1500;
        let masked = |i: usize| i.is_multiple_of(19) || (700..900).contains(&i);
        let w: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64 * 0.01).sin()).collect();
        let tau: Vec<f64> = (0..n).map(|i| if masked(i) { 1e6 } else { 3.0 * w[i] }).collect();
        let mut decimator = Decimator::new(&settings, 1000.0, 2).unwrap();
        let mut coverage = Coverage::new(1, 1000.0, Some(&settings)).unwrap();
        let (mut out, mut buffer, mut from, mut counted) = (Vec::new(), Vec::new(), 0, 0);
        while from < n {
            let samples = 256.min(n - from);
            let panel = [&w[from..from + samples], &tau[from..from + samples]].concat();
            let set_aside: Vec<bool> = (from..from + samples).map(masked).collect();
            let rows = decimator.push(coverage.mask(0, &panel, samples, &set_aside), samples, &mut out);
            let shares = coverage.divide(0, rows, &mut out).to_vec();
            coverage.advance(samples);
            let all = JointRows { joint: 0, rows, panel: &out, coverage: &shares };
            let kept = all.counted(&mut buffer);
            counted += kept.rows;
            for row in 0..kept.rows {
                let (w, tau) = (kept.panel[row], kept.panel[kept.rows + row]);
                // Tolerance for the rounding of sums of a hundred products of order one.
                assert!((tau - 3.0 * w).abs() < 1e-12, "{tau} {w}");
                // The mean over the remaining samples is close to the mean over all; a row half inside the gap differs
                // by a tenth.
                assert!((-0.1..2.1).contains(&w), "{w}");
            }
            from += samples;
        }
        let all = (n - decimator.length()) / 5 + 1;
        // Two hundred samples are forty rows.
        assert!((36..=44).contains(&(all - counted)), "{counted} of {all}");
    }
}
