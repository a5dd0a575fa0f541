//! Channels that a recorder repeats: new values at every few rows only.

/// Rows that are looked at, at least, in which something moves.
const LEAST_CHANGES: usize = 40;
/// Share of the changes that come as many rows after the one before as most do.
const EVEN: f64 = 0.8;
/// Share of the rows with a change in which every moving channel changes.
const TOGETHER: f64 = 0.8;

/// How many rows a new set of values comes after the one before, where `channels` (one vector for each joint) change
/// together and evenly, and not at every row; `None` where they do not. What is quantised and slow repeats as well,
/// but each joint at moments of its own.
pub(crate) fn rows_to_a_value(channels: &[Vec<f64>]) -> Option<u64> {
    let rows = channels.first()?.len();
    let moving: Vec<&Vec<f64>> =
        channels.iter().filter(|values| changes(values).take(LEAST_CHANGES).count() == LEAST_CHANGES).collect();
    // One channel alone may be quantised.
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
    if steps.is_empty() || (together as f64) < TOGETHER * at.len() as f64 {
        return None;
    }
    let middle = steps.len() / 2;
    let usual = *steps.select_nth_unstable(middle).1;
    let even = steps.iter().filter(|&&step| step == usual).count();
    (usual > 1 && even as f64 >= EVEN * steps.len() as f64).then_some(usual as u64)
}

/// The rows at which a channel is not what it was the row before.
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
    fn values_that_a_recorder_repeats_are_counted() {
        assert_eq!(rows_to_a_value(&swing(1000, 5, 0.0)), Some(5));
        assert_eq!(rows_to_a_value(&swing(1000, 5, 1e-3)), Some(5));
        assert_eq!(rows_to_a_value(&swing(1000, 1, 0.0)), None);
    }

    #[test]
    fn coarse_steps_are_no_repetition() {
        // At half its speed a joint stays on one step for several rows.
        assert_eq!(rows_to_a_value(&swing(2000, 1, 0.02)), None);
        assert_eq!(rows_to_a_value(&[vec![1.0; 500], vec![2.0; 500]]), None);
        assert_eq!(rows_to_a_value(&[]), None);
    }
}
