//! Selection of the samples of a block that are kept.

use core::ops::Range;

/// Ranges of rows of a block without a mark. Marks are index ranges in a window, in any order and possibly overlapping;
/// sample `first` of the window is the first row of the block.
pub(crate) fn kept_runs(marked: &[Range<usize>], first: usize, rows: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = marked
        .iter()
        .map(|range| range.start.saturating_sub(first).min(rows)..range.end.saturating_sub(first).min(rows))
        .filter(|range| !range.is_empty())
        .collect();
    ranges.sort_by_key(|range| range.start);
    let (mut runs, mut from) = (Vec::new(), 0);
    for range in ranges {
        if range.start > from {
            runs.push(from..range.start);
        }
        from = from.max(range.end);
    }
    if from < rows {
        runs.push(from..rows);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::kept_runs;
    use crate::MotionBlock;

    #[test]
    fn runs_are_the_unmarked_rows() {
        assert_eq!(kept_runs(&[], 5, 10), vec![0..10; 1]);
        assert_eq!(kept_runs(&[12..20, 3..7, 6..8], 5, 10), vec![3..7; 1]);
        assert!(kept_runs(&vec![0..100; 1], 5, 10).is_empty());
        assert_eq!(kept_runs(&[7..8, 9..10], 5, 10), [0..2, 3..4, 5..10]);
    }

    #[test]
    fn parts_contain_the_rows_of_each_joint() {
        let block = MotionBlock {
            rate_hz: 10.0,
            rows: 3,
            joints: 2,
            q: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            ..MotionBlock::default()
        };
        let part = block.part(1..3);
        assert_eq!((part.rows, &part.q[..], part.tau.len()), (2, &[2.0, 3.0, 5.0, 6.0][..], 0));
        assert!((part.first_time_s - 0.1).abs() < 1e-15);
    }
}
