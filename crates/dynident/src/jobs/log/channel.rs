//! Statistics of one channel: range, number of values, averaged course over time.

/// Maximum number of averaged parts of the course; must be even.
const MAX_PARTS: usize = 48;

#[derive(Clone, Debug, Default)]
pub(super) struct ChannelStatistics {
    pub(super) samples: u64,
    pub(super) range: Option<[f64; 2]>,
    first: Option<f64>,
    last: Option<f64>,
    rows: u64,
    /// Number of rows per part: a power of two that doubles when all parts are full.
    rows_of_part: u64,
    parts: Vec<(f64, u64)>,
}

impl ChannelStatistics {
    pub(super) fn add(&mut self, value: f64) {
        if self.rows_of_part == 0 {
            self.rows_of_part = 1;
        }
        if self.rows == self.rows_of_part * MAX_PARTS as u64 {
            self.parts =
                self.parts.chunks(2).map(|pair| pair.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1))).collect();
            self.rows_of_part *= 2;
        }
        let part = (self.rows / self.rows_of_part) as usize;
        self.rows += 1;
        self.parts.resize(part + 1, (0.0, 0));
        if !value.is_finite() {
            return;
        }
        self.parts[part].0 += value;
        self.parts[part].1 += 1;
        self.samples += 1;
        self.first.get_or_insert(value);
        self.last = Some(value);
        let [low, high] = self.range.unwrap_or([value; 2]);
        self.range = Some([low.min(value), high.max(value)]);
    }

    /// Difference from the first to the last value; `None` if it is not positive.
    pub(super) fn increase(&self) -> Option<f64> {
        Some(self.last? - self.first?).filter(|span| *span > 0.0 && span.is_finite())
    }

    pub(super) fn course(&self) -> Vec<Option<f64>> {
        let mean =
            |(sum, count): &(f64, u64)| (*count > 0).then(|| sum / *count as f64).filter(|mean| mean.is_finite());
        self.parts.iter().map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_course_is_that_of_the_channel_at_any_length() {
        for rows in [1, 47, 48, 49, 1000, 10_000] {
            let mut tally = ChannelStatistics::default();
            (0..rows).for_each(|row| tally.add(f64::from(row)));
            let course: Vec<f64> = tally.course().into_iter().map(Option::unwrap).collect();
            assert!(course.len() <= MAX_PARTS && course.windows(2).all(|pair| pair[0] < pair[1]), "{rows}: {course:?}");
            assert_eq!((tally.samples, tally.range), (rows as u64, Some([0.0, f64::from(rows - 1)])));
        }
        let mut gap = ChannelStatistics::default();
        for value in [1.0, f64::NAN, f64::INFINITY, -2.0] {
            gap.add(value);
        }
        assert_eq!(gap.course(), [Some(1.0), None, None, Some(-2.0)]);
        assert_eq!((gap.samples, gap.increase()), (2, None));
    }
}
