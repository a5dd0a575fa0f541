//! The step of a channel that knows only multiples of it.

/// The step of which nine tenths of the differences between successive values are multiples (within 2 %).
pub(crate) fn quantisation_step(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect();
    if steps.len() < 20 {
        return None;
    }
    steps.sort_by(f64::total_cmp);
    // Not the smallest as such: the rounding of the printed text makes far smaller ones.
    let least = 0.02 * steps[steps.len() / 20];
    let candidate = *steps.iter().find(|step| **step >= least)?;
    let multiples = steps.iter().filter(|step| {
        let ratio = *step / candidate;
        (ratio - ratio.round()).abs() <= 0.02
    });
    (multiples.count() as f64 >= 0.9 * steps.len() as f64).then_some(candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantised_and_smooth_channels_are_distinguished() {
        let smooth: Vec<f64> = (0..2000).map(|i| (f64::from(i) * 0.01).sin()).collect();
        let quantised: Vec<f64> = smooth.iter().map(|x| (x / 0.003).round() * 0.003).collect();
        assert!(quantisation_step(&smooth).is_none());
        assert!((quantisation_step(&quantised).unwrap() - 0.003).abs() < 1e-9);
    }
}
