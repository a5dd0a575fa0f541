//! Decimation of long logs for plots: minimum and maximum of every pixel column.

/// Indices of the samples to draw for curves over a common axis, ascending. All samples if there are at most `4 ·
/// columns`; otherwise, for each of `columns` equal intervals of x and each curve, the minimum and maximum, the first
/// and last sample, and the ends of a gap (a value that is not finite). So every peak and gap is visible, and every
/// point is a measured sample.
///
/// ```
/// let x: Vec<f64> = (0..1_000_000).map(f64::from).collect();
/// let mut y = vec![0.0; x.len()];
/// y[123_456] = 1.0;
/// let kept = dynident_report::kept_samples(&x, &[&y], 1000);
/// assert!(kept.len() < 5000 && kept.contains(&123_456));
/// ```
pub fn kept_samples(x: &[f64], curves: &[&[f64]], columns: usize) -> Vec<usize> {
    let n = x.len();
    let (Some(first), Some(last)) = (x.first(), x.last()) else { return Vec::new() };
    let columns = columns.max(1);
    if n <= 4 * columns {
        return (0..n).collect();
    }
    let width = (last - first) / columns as f64;
    let column_of = |i: usize| {
        // All samples at one x belong to one column.
        let column = (x[i] - first) / width;
        if column.is_finite() { (column as usize).min(columns - 1) } else { 0 }
    };
    let mut kept = Vec::new();
    let mut from = 0;
    while from < n {
        let column = column_of(from);
        let mut to = from + 1;
        while to < n && column_of(to) == column {
            to += 1;
        }
        kept.push(from);
        kept.push(to - 1);
        for curve in curves {
            extremes(curve, from, to, &mut kept);
        }
        from = to;
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Indices of the minimum and maximum, and of the ends of the longest gap, in `from..to`.
fn extremes(curve: &[f64], from: usize, to: usize, kept: &mut Vec<usize>) {
    let (mut least, mut largest) = (None, None);
    let mut gap: Option<[usize; 2]> = None;
    let mut longest: Option<[usize; 2]> = None;
    for i in from..to.min(curve.len()) {
        let value = curve[i];
        if !value.is_finite() {
            let here = match gap {
                Some([start, _]) => [start, i],
                None => [i, i],
            };
            gap = Some(here);
            if longest.is_none_or(|[start, end]| here[1] - here[0] >= end - start) {
                longest = Some(here);
            }
            continue;
        }
        gap = None;
        if least.is_none_or(|at: usize| value < curve[at]) {
            least = Some(i);
        }
        if largest.is_none_or(|at: usize| value > curve[at]) {
            largest = Some(i);
        }
    }
    kept.extend(least.into_iter().chain(largest));
    kept.extend(longest.into_iter().flatten());
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_and_little_stay_as_they_are() {
        assert!(kept_samples(&[], &[], 10).is_empty());
        assert_eq!(kept_samples(&[1.0, 2.0], &[&[1.0, 2.0]], 10), [0, 1]);
        assert_eq!(kept_samples(&[3.0; 100], &[&[1.0; 100]], 1), [0, 99]);
    }

    proptest! {
        /// Compared with a direct search: in every column the kept samples have the same range, and gaps remain.
        #[test]
        fn every_column_keeps_its_span(values in prop::collection::vec(prop_oneof![9 => -1e3_f64..1e3, 1 => Just(f64::NAN)], 100..2000)) {
            let x: Vec<f64> = (0..values.len()).map(|i| i as f64 * 0.5).collect();
            let columns = 20;
            let kept = kept_samples(&x, &[&values], columns);
            prop_assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(kept.len() <= 6 * columns);
            let width = x[x.len() - 1] / columns as f64;
            for column in 0..columns {
                let inside = |i: &usize| ((x[*i] / width) as usize).min(columns - 1) == column;
                let span = |places: &mut dyn Iterator<Item = usize>| {
                    places.map(|i| values[i]).filter(|v| v.is_finite()).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
                };
                let all: Vec<usize> = (0..values.len()).filter(|i| inside(i)).collect();
                let ours: Vec<usize> = kept.iter().copied().filter(|i| inside(i)).collect();
                prop_assert_eq!(span(&mut all.iter().copied()), span(&mut ours.iter().copied()));
                let gap = |places: &[usize]| places.iter().any(|i| !values[*i].is_finite());
                prop_assert_eq!(gap(&all), gap(&ours));
            }
        }
    }
}
