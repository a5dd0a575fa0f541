//! Estimation of the quantisation step of a channel.

/// The step size of which 90 % of the differences between successive values are multiples (within 2 %).
pub(crate) fn quantisation_step(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect();
    if steps.len() < 20 {
        return None;
    }
    steps.sort_unstable_by(f64::total_cmp);
    // The minimum is not used, because rounding of printed text causes much smaller differences.
    let least = 0.02 * steps[steps.len() / 20];
    let mut candidate = *steps.iter().find(|step| **step >= least)?;
    // Printed text rounds the smallest differences by about 1 %, so over a hundred steps the errors add up to a whole
    // step. Larger differences determine the step better, but only after it is accurate enough to count the steps in
    // them.
    for most in [8.0, 64.0, 512.0, 4096.0] {
        let counted = steps.iter().map(|step| (step, (step / candidate).round()));
        let counted = counted.filter(|(_, count)| (1.0..=most).contains(count));
        let sums = counted.fold([0.0; 2], |[a, b], (step, count)| [a + step * count, b + count * count]);
        candidate = if sums[1] > 0.0 { sums[0] / sums[1] } else { candidate };
    }
    let multiples = steps.iter().filter(|step| {
        let ratio = *step / candidate;
        (ratio - ratio.round()).abs() <= 0.02
    });
    (multiples.count() as f64 >= 0.9 * steps.len() as f64).then_some(candidate)
}

/// Median change of a signal in which at least 10 % of the samples repeat. This is the step of a quantised signal that
/// is slow or at rest, also if the step is below the printed resolution. `None` for other signals.
pub(crate) fn usual_change(values: &[f64]) -> Option<f64> {
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let mut changes: Vec<f64> = changes.filter(|change| *change > 0.0).collect();
    if 10 * changes.len() > 9 * values.len() || changes.is_empty() {
        return None;
    }
    let half = changes.len() / 2;
    Some(*changes.select_nth_unstable_by(half, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeating_signal_has_a_usual_change() {
        let slow: Vec<f64> = (0..100).map(|i| f64::from(i / 4) * 0.5).collect();
        assert_eq!(usual_change(&slow), Some(0.5));
        assert_eq!(usual_change(&(0..100).map(f64::from).collect::<Vec<f64>>()), None);
        assert_eq!(usual_change(&[1.0; 9]), None);
        assert_eq!(usual_change(&[]), None);
    }

    #[test]
    fn quantised_and_smooth_channels_are_distinguished() {
        let smooth: Vec<f64> = (0..2000).map(|i| (f64::from(i) * 0.01).sin()).collect();
        let quantised: Vec<f64> = smooth.iter().map(|x| (x / 0.003).round() * 0.003).collect();
        assert!(quantisation_step(&smooth).is_none());
        assert!((quantisation_step(&quantised).unwrap() - 0.003).abs() < 1e-9);
        // Counts of 2π/65536 printed with six decimals, up to 500 counts in a step.
        let count = core::f64::consts::TAU / 65_536.0;
        let counts = |i: i32| (2e4 * (f64::from(i) * 0.025).sin() + 40.0 * (f64::from(i) * 0.7).sin()).round();
        let printed: Vec<f64> = (0..4000).map(|i| (counts(i) * count * 1e6).round() * 1e-6).collect();
        // Half a digit of the last decimal in the largest step.
        assert!((quantisation_step(&printed).unwrap() / count - 1.0).abs() < 1e-4);
    }
}
