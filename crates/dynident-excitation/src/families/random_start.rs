//! Random starts that use a reasonable part of each joint's range and velocity.

use dynident_model::sample::Random;

/// Scale and shift of the shape `q`, `dq` of one joint. The scaled motion uses a random part (0.3 to 0.9) of the
/// position range or of the velocity limit, whichever is reached first, at a random place inside the range.
///
/// An infinite range is replaced by ±π, a velocity limit that is infinite or not positive is ignored, and an empty
/// range is a single point.
pub(crate) fn scale_and_shift(q: &[f64], dq: &[f64], range: [f64; 2], speed: f64, random: &mut Random) -> [f64; 2] {
    use core::f64::consts::PI;
    let lower = if range[0].is_finite() { range[0] } else { -PI };
    let upper = (if range[1].is_finite() { range[1] } else { PI }).max(lower);
    let low = q.iter().copied().fold(f64::INFINITY, f64::min);
    let high = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let peak = dq.iter().fold(0.0_f64, |peak, v| peak.max(v.abs()));
    let part = random.uniform(0.3, 0.9);
    let place = random.uniform(0.0, 1.0);
    let mut scale = f64::INFINITY;
    if high > low {
        scale = scale.min((upper - lower) / (high - low));
    }
    if peak > 0.0 && speed.is_finite() && speed > 0.0 {
        scale = scale.min(speed / peak);
    }
    let scale = if scale.is_finite() { part * scale } else { 0.0 };
    let (low, high) = if scale > 0.0 { (scale * low, scale * high) } else { (0.0, 0.0) };
    let (from, to) = (lower - low, upper - high);
    [scale, from + place * (to - from)]
}

pub(crate) fn grid(duration_s: f64) -> Vec<f64> {
    const SAMPLES: usize = 128;
    (0..=SAMPLES).map(|sample| duration_s * (sample as f64 / SAMPLES as f64)).collect()
}
