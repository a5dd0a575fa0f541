//! Samples that do not count, left out before the filter.

use super::JointRows;
use dynident_recording::{DecimationSettings, FilterError, MotionBlock};

/// Share of a filter's weight on samples that count below which a row says too little to be one.
const LEAST_COVERAGE: f64 = 0.5;

/// Leaves samples out of regressor and torque alike and keeps account of how much of each filtered row is left.
///
/// A filtered row is `Σ h_k [W_k | τ_k]`; with `m_k` zero for samples that do not count and one for the others, `Σ h_k
/// m_k [W_k | τ_k]` obeys the same equation `τ = W θ` with the same θ, whatever `m` is: nothing is invented and nothing
/// biased. Rows are divided by their coverage `c = Σ h_k m_k` (at least one half), so that a mean stays a mean; those
/// with less than half of it do not count as rows ([`JointRows::counted`]).
#[derive(Debug)]
pub(super) struct Coverage {
    taps: Vec<f64>,
    factor: usize,
    /// Samples of the piece so far.
    samples: usize,
    /// Of each joint: the samples left out that later rows still see, and the rows so far.
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

    /// A new piece begins.
    pub(super) fn restart(&mut self) {
        self.samples = 0;
        self.joints.iter_mut().for_each(|(left_out, rows)| {
            left_out.clear();
            *rows = 0;
        });
    }

    /// The panel of `samples` samples with those of `set_aside` (as many; none if empty) left out.
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

    /// All joints have seen so many further samples.
    pub(super) fn advance(&mut self, samples: usize) {
        self.samples += samples;
    }

    /// Divides the next rows of a joint by their coverage, which it returns; empty where all of it is left.
    pub(super) fn divide(&mut self, joint: usize, rows: usize, panel: &mut [f64]) -> &[f64] {
        let (left_out, done) = &mut self.joints[joint];
        self.shares.clear();
        let first = *done;
        *done += rows;
        if left_out.is_empty() || rows == 0 {
            return &[];
        }
        for row in first..first + rows {
            let from = row * self.factor;
            let at = left_out.partition_point(|sample| *sample < from);
            let inside = left_out[at..].iter().take_while(|sample| **sample < from + self.taps.len());
            self.shares.push(1.0 - inside.map(|sample| self.taps[sample - from]).sum::<f64>());
        }
        let next = *done * self.factor;
        left_out.drain(..left_out.partition_point(|sample| *sample < next));
        for column in panel.chunks_exact_mut(rows) {
            divide_by_coverage(column, &self.shares);
        }
        &self.shares
    }
}

/// Divides the values of a column by the coverage of their rows, at least by one half; nothing where that is empty.
pub fn divide_by_coverage(column: &mut [f64], coverage: &[f64]) {
    for (value, coverage) in column.iter_mut().zip(coverage) {
        *value /= coverage.max(LEAST_COVERAGE);
    }
}

/// Whether the samples `from .. from + samples` of the joint at `place` are set aside; empty if all of the block count.
pub fn set_aside(block: &MotionBlock, place: usize, from: usize, samples: usize) -> &[bool] {
    match block.set_aside.get(place * block.rows + from..place * block.rows + from + samples) {
        Some(set_aside) => set_aside,
        None => &[],
    }
}

impl<'a> JointRows<'a> {
    /// Whether a row counts: at least half of the filter's weight lies on samples that do.
    pub fn counts(&self, row: usize) -> bool {
        self.coverage.get(row).is_none_or(|coverage| *coverage >= LEAST_COVERAGE)
    }

    /// The rows that count: those with at least half of the filter's weight on samples that do. `buffer` holds them
    /// where they are not all.
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

    /// Rows of `[W | τ]` with `τ = 3 W`, but for the samples that are left out.
    #[test]
    fn what_is_left_out_does_not_change_the_equation() {
        let settings = DecimationSettings { factor: 5, ..DecimationSettings::default() };
        let n = 1500;
        let left_out = |i: usize| i.is_multiple_of(19) || (700..900).contains(&i);
        let w: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64 * 0.01).sin()).collect();
        let tau: Vec<f64> = (0..n).map(|i| if left_out(i) { 1e6 } else { 3.0 * w[i] }).collect();
        let mut decimator = Decimator::new(&settings, 1000.0, 2).unwrap();
        let mut coverage = Coverage::new(1, 1000.0, Some(&settings)).unwrap();
        let (mut out, mut buffer, mut from, mut counted) = (Vec::new(), Vec::new(), 0, 0);
        while from < n {
            let samples = 256.min(n - from);
            let panel = [&w[from..from + samples], &tau[from..from + samples]].concat();
            let set_aside: Vec<bool> = (from..from + samples).map(left_out).collect();
            let rows = decimator.push(coverage.mask(0, &panel, samples, &set_aside), samples, &mut out);
            let shares = coverage.divide(0, rows, &mut out).to_vec();
            coverage.advance(samples);
            let all = JointRows { joint: 0, rows, panel: &out, coverage: &shares };
            let kept = all.counted(&mut buffer);
            counted += kept.rows;
            for row in 0..kept.rows {
                let (w, tau) = (kept.panel[row], kept.panel[kept.rows + row]);
                // Sums of a hundred products of order one.
                assert!((tau - 3.0 * w).abs() < 1e-12, "{tau} {w}");
                // A mean over what is left stays near the mean over all; a row half outside of the hole by a tenth.
                assert!((-0.1..2.1).contains(&w), "{w}");
            }
            from += samples;
        }
        let all = (n - decimator.length()) / 5 + 1;
        // Two hundred samples are forty rows.
        assert!((36..=44).contains(&(all - counted)), "{counted} of {all}");
    }
}
