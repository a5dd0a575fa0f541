//! Detection of channels whose values a recorder repeats, so that only every few rows contain a new value.

/// Minimum number of changes with which a channel is treated as moving.
const MIN_CHANGES: usize = 40;
/// Minimum share of changes that follow each other at the usual distance in rows.
const MIN_EVEN_SHARE: f64 = 0.8;
/// Minimum share of the rows with a change in which most moving channels change together.
const MIN_COMMON_SHARE: f64 = 0.8;

/// Number of rows per new set of values, if the `channels` (one vector for each joint) change together, at even
/// distances, and not in every row; otherwise `None`. Slow quantised channels also repeat values, but each joint
/// changes in different rows.
pub(crate) fn rows_to_a_value(channels: &[Vec<f64>]) -> Option<u64> {
    let rows = channels.first()?.len();
    let moving: Vec<&Vec<f64>> =
        channels.iter().filter(|values| changes(values).take(MIN_CHANGES).count() == MIN_CHANGES).collect();
    // A single channel that repeats values may be quantised.
    if moving.len() < 2 {
        return None;
    }
    let mut changing = vec![0_usize; rows];
    for values in &moving {
        changes(values).for_each(|row| changing[row] += 1);
    }
    let at: Vec<usize> = (0..rows).filter(|&row| changing[row] > 0).collect();
    let together = at.iter().filter(|&&row| 2 * changing[row] > moving.len()).count();
    let mut steps: Vec<usize> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() || (together as f64) < MIN_COMMON_SHARE * at.len() as f64 {
        return None;
    }
    let middle = steps.len() / 2;
    let usual = *steps.select_nth_unstable(middle).1;
    let even = steps.iter().filter(|&&step| step == usual).count();
    (usual > 1 && even as f64 >= MIN_EVEN_SHARE * steps.len() as f64).then_some(usual as u64)
}

fn changes(values: &[f64]) -> impl Iterator<Item = usize> {
    (1..values.len()).filter(|&row| values[row] != values[row - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(rows: usize, every: usize, step: f64) -> Vec<Vec<f64>> {
        let value = |row: usize, joint: f64| {
            let at = (row / every * every) as f64;
            let value = (0.01 * at * (1.0 + 0.3 * joint)).sin();
            if step > 0.0 { (value / step).round() * step } else { value }
        };
        (0..3).map(|joint| (0..rows).map(|row| value(row, f64::from(joint))).collect()).collect()
    }

    #[test]
    fn repeated_values_are_detected() {
        assert_eq!(rows_to_a_value(&swing(1000, 5, 0.0)), Some(5));
        assert_eq!(rows_to_a_value(&swing(1000, 5, 1e-3)), Some(5));
        assert_eq!(rows_to_a_value(&swing(1000, 1, 0.0)), None);
    }

    #[test]
    fn coarse_quantisation_is_not_repetition() {
        // At half the velocity, a joint remains on one quantisation step for several rows.
        assert_eq!(rows_to_a_value(&swing(2000, 1, 0.02)), None);
        assert_eq!(rows_to_a_value(&[vec![1.0; 500], vec![2.0; 500]]), None);
        assert_eq!(rows_to_a_value(&[]), None);
    }
}
