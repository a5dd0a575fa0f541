//! Bias and noise of every differentiator as functions of noise level and tracking error. Prints the tables of the
//! book's page on differentiators.
//!
//! `cargo run --release -p dynident-recording --example differentiators [SEEDS [SECONDS]]`: 3 seeds and 40 s for the
//! book; use less for a trial.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "printing tables is what this program is for")]

use core::f64::consts::TAU;
use dynident_recording::{Derivatives, DifferentiatorSettings, LogisticPath, Place, Reference, cutoff};
use std::sync::Arc;

const RATE_HZ: f64 = 1000.0;
/// The three levels of BIRDy, and two larger ones; degrees.
const NOISE_DEG: [f64; 5] = [0.0, 1e-4, 1e-3, 1e-2, 1e-1];
/// Values for the tables of the book.
const SEEDS: u64 = 3;
const DURATION_S: f64 = 40.0;
/// Time left out at both ends, s.
const TRIM_S: f64 = 1.0;

const TRACKING: [(&str, Tracking); 6] = [
    ("none", Tracking { delay_s: 0.0, shape: 0.0, vibration: 0.0 }),
    ("10 ms late", Tracking { delay_s: 0.01, shape: 0.0, vibration: 0.0 }),
    ("100 ms late", Tracking { delay_s: 0.1, shape: 0.0, vibration: 0.0 }),
    ("shape 0.1 %", Tracking { delay_s: 0.0, shape: 1e-3, vibration: 0.0 }),
    ("shape 1 %", Tracking { delay_s: 0.0, shape: 1e-2, vibration: 0.0 }),
    ("vibration", Tracking { delay_s: 0.0, shape: 0.0, vibration: 1e-4 }),
];

const DIFFERENTIATORS: [(&str, &str); 16] = [
    ("low-pass", ""),
    ("butterworth", ""),
    ("central-differences", "order = 2"),
    ("central-differences", "order = 8"),
    ("savitzky-golay", "window = 201"),
    ("smoothed-differences", "window = 101"),
    ("five-point-cubic", ""),
    ("frequency-domain", ""),
    ("frequency-domain", "ends = \"mirrored\""),
    ("frequency-domain", "ends = \"periodic\""),
    ("fourier-fit", "SERIES"),
    ("speed-series", "SERIES"),
    ("position-map", ""),
    ("time-warp", ""),
    ("deviation", "smoother = { method = \"butterworth\" }"),
    ("deviation", "smoother = { method = \"butterworth\", cutoff_hz = 0.5 }\nmax_lag_s = 0.5"),
];

#[derive(Clone, Copy)]
struct Tracking {
    delay_s: f64,
    /// Stroke: relative increase of the steepness. Series: relative increase k times this of harmonic k.
    shape: f64,
    /// Amplitude at 3.3 Hz, rad.
    vibration: f64,
}

#[derive(Clone, Copy)]
enum CommandKind {
    /// The paper's joint 2 (Table 3), there and back.
    Stroke,
    /// Five harmonics of 0.1 Hz, four periods.
    Series,
}

impl CommandKind {
    fn name(self) -> &'static str {
        match self {
            Self::Stroke => "The paper's stroke (A = 2.094 rad, ω = 0.996 1/s, T = 40/ω)",
            Self::Series => "A Fourier series (five harmonics of 0.1 Hz, four periods)",
        }
    }

    fn series(self) -> &'static str {
        match self {
            Self::Stroke => "base_hz = 0.0249\nharmonics = 10",
            Self::Series => "base_hz = 0.1\nharmonics = 5",
        }
    }

    fn at(self, t: f64, tracking: Tracking) -> [f64; 3] {
        let Tracking { delay_s, shape, vibration } = tracking;
        let t_late = t - delay_s;
        let mut state = match self {
            Self::Stroke => {
                let omega = 0.996;
                LogisticPath {
                    amplitude: 2.094,
                    omega: omega * (1.0 + shape),
                    offset: 0.0,
                    period_s: 40.0 / omega,
                    repetitions: 1,
                }
                .at(t_late)
            }
            Self::Series => {
                let mut sum = [0.0; 3];
                for k in 1..=5 {
                    let w = TAU * 0.1 * f64::from(k);
                    let size = 0.6 / f64::from(k) * (1.0 + shape * f64::from(k));
                    let (sin, cos) = (w * t_late + f64::from(k * k)).sin_cos();
                    sum[0] += size * sin;
                    sum[1] += size * w * cos;
                    sum[2] -= size * w * w * sin;
                }
                sum
            }
        };
        let w = TAU * 3.3;
        let (sin, cos) = (w * t).sin_cos();
        state[0] += vibration * sin;
        state[1] += vibration * w * cos;
        state[2] -= vibration * w * w * sin;
        state
    }
}

/// RMS error without noise, RMS effect of the noise, and RMS of the sum; for dq and ddq.
#[derive(Clone, Copy, Default)]
struct Figures {
    bias: [f64; 2],
    deviation: [f64; 2],
    total: [f64; 2],
    /// Share of samples at which the differentiator does not apply.
    refused: f64,
}

/// Number of noise samples, and duration of the motion, s.
#[derive(Clone, Copy)]
struct Extent {
    seeds: u64,
    duration_s: f64,
}

fn main() {
    let argument = |n: usize| std::env::args().nth(n);
    let extent = Extent {
        seeds: argument(1).map_or(SEEDS, |text| text.parse().unwrap()),
        duration_s: argument(2).map_or(DURATION_S, |text| text.parse().unwrap()),
    };
    for command in [CommandKind::Stroke, CommandKind::Series] {
        let n = (extent.duration_s * RATE_HZ) as usize;
        let none = TRACKING[0].1;
        let times: Vec<f64> = (0..n + 200).map(|i| i as f64 / RATE_HZ).collect();
        let columns = [0, 1, 2].map(|order| times.iter().map(|t| command.at(*t, none)[order]).collect());
        let reference = Arc::new(Reference::sampled(&times, &[columns]).unwrap());
        // By differentiator, noise, tracking error.
        let figures: Vec<Vec<Vec<Figures>>> = DIFFERENTIATORS
            .iter()
            .map(|(method, settings)| {
                let settings = settings.replace("SERIES", command.series());
                let differentiator: DifferentiatorSettings =
                    toml::from_str(&format!("method = {method:?}\n{settings}")).unwrap();
                let cell =
                    |noise, tracking: Tracking| measured(command, extent, &differentiator, &reference, noise, tracking);
                NOISE_DEG.iter().map(|noise| TRACKING.iter().map(|(_, t)| cell(*noise, *t)).collect()).collect()
            })
            .collect();
        println!("## {}\n", command.name());
        for (order, quantity) in ["q̇, rad/s", "q̈, rad/s²"].into_iter().enumerate() {
            table(&figures, order, quantity);
            winners(&figures, order, quantity);
        }
    }
}

fn label(differentiator: usize) -> String {
    let (method, settings) = DIFFERENTIATORS[differentiator];
    let short = match differentiator {
        2 | 3 => settings.replace("order = ", "order "),
        14 => "of Butterworth, cut-off from the data".to_owned(),
        15 => "of Butterworth at 0.5 Hz, behind the lag".to_owned(),
        8 => "mirrored".to_owned(),
        9 => "periodic".to_owned(),
        _ => return method.to_owned(),
    };
    format!("{method}, {short}")
}

/// Bias at BIRDy's standard noise for each tracking error, deviation without tracking error for each noise level.
fn table(figures: &[Vec<Vec<Figures>>], order: usize, quantity: &str) {
    let biases: Vec<String> = TRACKING.iter().map(|(name, _)| format!("bias: {name}")).collect();
    let deviations: Vec<String> = NOISE_DEG[1..].iter().map(|noise| format!("std: {noise:.0e}°")).collect();
    println!("| {quantity} | {} | {} |", biases.join(" | "), deviations.join(" | "));
    println!("| --- |{}", " --- |".repeat(biases.len() + deviations.len()));
    for (differentiator, figures) in figures.iter().enumerate() {
        if figures[2].iter().all(|cell| cell.refused > 0.99) {
            println!("| {} |{}", label(differentiator), " refused |".repeat(biases.len() + deviations.len()));
            continue;
        }
        let bias = figures[2].iter().map(|cell| {
            let refused =
                if cell.refused > 0.005 { format!(" ({:.0} % refused)", 100.0 * cell.refused) } else { String::new() };
            format!("{:.1e}{refused}", cell.bias[order])
        });
        let deviation = figures[1..].iter().map(|by_noise| format!("{:.1e}", by_noise[0].deviation[order]));
        println!("| {} | {} |", label(differentiator), bias.chain(deviation).collect::<Vec<_>>().join(" | "));
    }
    println!();
}

/// The differentiator with the minimum RMS error, among those that apply to nearly all samples.
fn winners(figures: &[Vec<Vec<Figures>>], order: usize, quantity: &str) {
    let names: Vec<&str> = TRACKING.iter().map(|(name, _)| *name).collect();
    println!("| least error of {quantity} | {} |\n| --- |{}", names.join(" | "), " --- |".repeat(names.len()));
    for (noise, level) in NOISE_DEG.iter().enumerate() {
        let cells = (0..TRACKING.len()).map(|tracking| {
            let error = |differentiator: &usize| figures[*differentiator][noise][tracking].total[order];
            let applies = (0..DIFFERENTIATORS.len())
                .filter(|differentiator| figures[*differentiator][noise][tracking].refused < 0.005);
            let best = applies.min_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or(0);
            format!("{} ({:.1e})", label(best), error(&best))
        });
        println!("| {level:.0e}° | {} |", cells.collect::<Vec<_>>().join(" | "));
    }
    println!();
}

fn measured(
    command: CommandKind,
    extent: Extent,
    differentiator: &DifferentiatorSettings,
    reference: &Arc<Reference>,
    noise_deg: f64,
    tracking: Tracking,
) -> Figures {
    let n = (extent.duration_s * RATE_HZ) as usize;
    let exact: Vec<[f64; 3]> = (0..n).map(|i| command.at(i as f64 / RATE_HZ, tracking)).collect();
    let clean: Vec<f64> = exact.iter().map(|x| x[0]).collect();
    let run = |q: &[f64], cutoff_hz: f64| {
        let mut out = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        let [y, dq, ddq] = &mut out;
        let place = Place { rate_hz: RATE_HZ, joint: 0, first_time_s: 0.0 };
        let built = differentiator.build_following(cutoff_hz, Some(reference)).unwrap();
        let marked = built.differentiate_at(place, q, Derivatives { q: y, dq, ddq }).unwrap();
        let mut kept = vec![true; n];
        for range in marked {
            kept[range].fill(false);
        }
        (out, kept)
    };
    let trim = (TRIM_S * RATE_HZ) as usize;
    let (mut figures, mut count, mut refused) = (Figures::default(), 0.0, 0.0);
    for seed in 0..if noise_deg > 0.0 { extent.seeds } else { 1 } {
        let q: Vec<f64> = clean.iter().zip(normal(seed, n)).map(|(x, e)| x + noise_deg.to_radians() * e).collect();
        // Without noise, but with the cut-off of the noisy data.
        let cutoff_hz = cutoff(&[&q[..]], RATE_HZ).cutoff_hz;
        let (noisy, kept) = run(&q, cutoff_hz);
        let (quiet, kept_quiet) = run(&clean, cutoff_hz);
        for i in trim..n - trim {
            if !(kept[i] && kept_quiet[i]) {
                refused += 1.0;
                continue;
            }
            count += 1.0;
            for order in 0..2 {
                let (noisy, quiet, exact) = (noisy[order + 1][i], quiet[order + 1][i], exact[i][order + 1]);
                figures.bias[order] += (quiet - exact).powi(2);
                figures.deviation[order] += (noisy - quiet).powi(2);
                figures.total[order] += (noisy - exact).powi(2);
            }
        }
    }
    figures.refused = refused / (refused + count);
    for sums in [&mut figures.bias, &mut figures.deviation, &mut figures.total] {
        *sums = sums.map(|sum| (sum / f64::max(count, 1.0)).sqrt());
    }
    figures
}

/// White noise of unit variance: Box-Muller transform of a linear congruential generator.
fn normal(seed: u64, n: usize) -> Vec<f64> {
    let mut state = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    (0..n).map(|_| (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos()).collect()
}
