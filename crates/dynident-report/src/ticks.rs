//! Ticks of axes, and numbers and labels as text.

/// About `count` round numbers (multiples of 1, 2 or 5 times a power of ten) in `[low, high]`, ascending; empty unless
/// both are finite and low < high.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) {
        return Vec::new();
    }
    let rough = span / count.max(1) as f64;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * power).find(|step| *step >= rough).unwrap_or(rough);
    let (first, last) = ((low / step).ceil(), (high / step).floor());
    if last - first > 1000.0 || (last - first).is_nan() {
        return Vec::new();
    }
    // Multiplying the step, instead of adding it repeatedly, avoids accumulated rounding errors.
    (0..=(last - first).max(0.0) as usize).map(|k| (first + k as f64) * step).collect()
}

/// A number with `digits` significant digits, with an exponent if that is shorter; a dash if it is not finite.
///
/// ```
/// assert_eq!(dynident_report::short(0.123456, 3), "0.123");
/// assert_eq!(dynident_report::short(1.5e-9, 3), "1.5e-9");
/// ```
pub fn short(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "–".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..=5).contains(&exponent) {
        let text = format!("{value:.*e}", digits.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", without_zeros(mantissa));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    without_zeros(&format!("{value:.decimals$}")).to_owned()
}

/// The first `most` characters of a label, with an ellipsis if it is longer.
pub(crate) fn shortened(label: &str, most: usize) -> String {
    if label.chars().count() <= most {
        return label.to_owned();
    }
    label.chars().take(most - 1).chain(['…']).collect()
}

fn without_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(-0.31, 0.29, 6), [-0.30000000000000004, -0.2, -0.1, 0.0, 0.1, 0.2]);
        assert!(ticks(1.0, 1.0, 5).is_empty());
        assert!(ticks(f64::NAN, 1.0, 5).is_empty());
        // A range below the resolution of the numbers must terminate.
        assert!(ticks(1e300, f64::MAX, 5).len() < 20);
    }

    #[test]
    fn numbers_are_short() {
        let cases = [(0.30000000000000004, "0.3"), (1234.5678, "1235"), (1.5e-7, "1.5e-7"), (-2e9, "-2e9"), (0.0, "0")];
        for (value, text) in cases {
            assert_eq!(short(value, 4), text);
        }
        assert_eq!(short(f64::NAN, 4), "–");
    }
}
