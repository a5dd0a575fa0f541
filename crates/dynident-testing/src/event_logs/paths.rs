//! Motions of simulated logs.

use super::{DURATION_S, Path, RATE_HZ, Style, Truth};
use dynident_model::sample::Random;
use std::f64::consts::TAU;

/// The motion fades in and out over this time.
const RAMP_S: f64 = 2.0;
/// Time for braking and accelerating around a stop of the motion.
const BRAKE_S: f64 = 0.25;

/// The motion of a style.
pub(super) fn path(truth: &Truth, style: Style, random: &mut Random) -> Path {
    match style {
        Style::PickAndPlace | Style::Stiction => pick_and_place(truth, 1.0, usize::MAX, random),
        Style::RepeatedProgram => pick_and_place(truth, 0.7, 4, random),
        Style::FastReversals => excitation(truth, 2.5, random),
        Style::FastMotion => pick_and_place(truth, 2.0, usize::MAX, random),
        Style::Rests => {
            let path = excitation(truth, 1.0, random);
            let path = halted(&path, 5.0, 8.0);
            halted(&path, 14.0, 16.5)
        }
        Style::SlowThenFast => {
            let mut path = excitation(truth, 1.0, random);
            let warped = |k: usize| {
                let t = k as f64 / RATE_HZ;
                if t < 12.0 { 0.35 * t } else { 4.2 + 1.4 * (t - 12.0) }
            };
            for q in &mut path {
                *q = (0..q.len()).map(|k| interpolated(q, warped(k) * RATE_HZ)).collect();
                *q = smoothed(q, 20);
            }
            path
        }
        _ => excitation(truth, 1.0, random),
    }
}

pub(super) fn excitation(truth: &Truth, speed: f64, random: &mut Random) -> Path {
    let samples = (DURATION_S * RATE_HZ) as usize;
    let one = |(home, reach): (&f64, &f64)| {
        let coefficients: Vec<[f64; 2]> =
            (1..=5).map(|k| [(); 2].map(|()| random.uniform(-1.0, 1.0) / f64::from(k))).collect();
        let shape: Vec<f64> = (0..samples)
            .map(|s| {
                let t = s as f64 / RATE_HZ;
                let fade = |t: f64| {
                    let u = (t / RAMP_S).clamp(0.0, 1.0);
                    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
                };
                let sum: f64 = coefficients
                    .iter()
                    .enumerate()
                    .map(|(k, [a, b])| {
                        let (sin, cos) = ((k + 1) as f64 * 0.11 * speed * TAU * t).sin_cos();
                        a * sin + b * cos
                    })
                    .sum();
                fade(t) * fade(DURATION_S - t) * sum
            })
            .collect();
        let peak = shape.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        shape.iter().map(|value| home + reach * value / peak / speed.sqrt()).collect()
    };
    truth.home.iter().zip(&truth.reach).map(one).collect()
}

/// Point-to-point motion with rests of different length, between the same `points` in turn.
pub(super) fn pick_and_place(truth: &Truth, speed: f64, points: usize, random: &mut Random) -> Path {
    let samples = (DURATION_S * RATE_HZ) as usize;
    let dof = truth.home.len();
    let mut path = vec![Vec::with_capacity(samples); dof];
    let mut from = truth.home.clone();
    let mut program: Vec<(Vec<f64>, f64)> = Vec::new();
    let mut stroke = 0;
    while path[0].len() < samples {
        if program.len() < points {
            let of_joint = |(home, reach): (&f64, &f64)| home + reach * random.uniform(-1.0, 1.0);
            let to = truth.home.iter().zip(&truth.reach).map(of_joint).collect();
            program.push((to, random.uniform(0.8, 1.6) / speed));
        }
        let (to, moving_s) = program[stroke % points].clone();
        stroke += 1;
        let rest_s = random.uniform(0.05, 0.7);
        for k in 0..((moving_s + rest_s) * RATE_HZ) as usize {
            let u = (k as f64 / RATE_HZ / moving_s).min(1.0);
            let s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            for joint in 0..dof {
                path[joint].push(from[joint] + s * (to[joint] - from[joint]));
            }
        }
        from = to;
    }
    for q in &mut path {
        q.truncate(samples);
    }
    path
}

/// The path with a stop of the motion from `from_s` to `to_s`: it brakes, rests and goes on.
pub(super) fn halted(path: &Path, from_s: f64, to_s: f64) -> Path {
    let samples = path[0].len();
    let mut place = 0.0;
    let mut places = Vec::with_capacity(samples);
    for k in 0..samples {
        let t = k as f64 / RATE_HZ;
        places.push(place);
        let braking = 1.0 - ((t - from_s) / BRAKE_S).clamp(0.0, 1.0);
        let going = ((t - to_s) / BRAKE_S).clamp(0.0, 1.0);
        place += braking.max(going);
    }
    let ended = places[samples - 1];
    let rate = (samples - 1) as f64 / ended.max(1.0);
    let rate = if to_s > DURATION_S { 1.0 } else { rate.min(1.0) };
    path.iter()
        .map(|q| smoothed(&places.iter().map(|place| interpolated(q, place * rate)).collect::<Vec<_>>(), 3))
        .collect()
}

/// A joint that meets a stop below its largest position: positions, distance beyond the stop, interval.
pub(super) fn stopped(q: &[f64]) -> (Vec<f64>, Vec<f64>, [f64; 2]) {
    let inner = (4.0 * RATE_HZ) as usize..q.len() - (4.0 * RATE_HZ) as usize;
    let top = inner.max_by(|a, b| q[*a].total_cmp(&q[*b])).unwrap_or(0);
    let stop = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // The commanded motion goes 0.3 rad higher around its highest point.
    let bump = |k: usize| {
        let u = (k as f64 - top as f64) / (1.2 * RATE_HZ);
        if u.abs() < 1.0 { 0.15 * (1.0 + (std::f64::consts::PI * u).cos()) } else { 0.0 }
    };
    let raised: Vec<f64> = q.iter().enumerate().map(|(k, q)| q + bump(k)).collect();
    let over: Vec<f64> = raised.iter().map(|q| (q - stop).max(0.0)).collect();
    let clipped = smoothed(&raised.iter().zip(&over).map(|(q, over)| q - over).collect::<Vec<_>>(), 8);
    let begin = over.iter().position(|over| *over > 0.0).unwrap_or(0);
    let end = over.iter().rposition(|over| *over > 0.0).unwrap_or(0);
    (clipped, over, [begin as f64 / RATE_HZ, end as f64 / RATE_HZ])
}

pub(super) fn differences(values: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    (0..=last)
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            (values[after] - values[before]) * RATE_HZ / (after - before) as f64
        })
        .collect()
}

pub(super) fn interpolated(values: &[f64], place: f64) -> f64 {
    let at = (place.max(0.0) as usize).min(values.len() - 2);
    let share = (place - at as f64).clamp(0.0, 1.0);
    values[at] + share * (values[at + 1] - values[at])
}

/// Two moving averages over `2 reach + 1` samples.
pub(super) fn smoothed(values: &[f64], reach: usize) -> Vec<f64> {
    let once = |values: &[f64]| -> Vec<f64> {
        (0..values.len())
            .map(|k| {
                let range = k.saturating_sub(reach)..(k + reach + 1).min(values.len());
                values[range.clone()].iter().sum::<f64>() / range.len() as f64
            })
            .collect()
    };
    once(&once(values))
}

pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
