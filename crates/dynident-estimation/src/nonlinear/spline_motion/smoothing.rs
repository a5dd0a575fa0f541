//! Motion from positions alone: smoothing splines whose smoothness is selected by the likelihood of the positions.
//!
//! Model: `q_t = q(t) + σ e_t` with white noise e, and `dʳq/dtʳ` white noise of intensity 1/λ (an integrated Wiener
//! process). The mean of q given the positions is a spline with the penalty `λ ∫ (dʳq/dtʳ)² dt`. Noise σ, penalty
//! weight λ and order r maximise the restricted likelihood. Wahba, Ann. Statist. 13 (1985) 1378; Wecker and Ansley,
//! JASA 78 (1983) 81.

use super::banded_arrow::{BandedArrow, dot};
use super::bspline::{ACTIVE, Spline};
use rayon::prelude::*;

/// Tested orders r of the derivative that is white noise.
pub(super) const ORDERS: core::ops::RangeInclusive<usize> = 2..=5;
/// The search ends after this number of consecutive shorter spacings with a lower likelihood.
const MAX_WORSE_SPACINGS: usize = 3;
/// Searched decades of the ratio λσ², relative to the value at which position and roughness terms are equal at the
/// highest frequency. Beyond the last decade both terms do not fit into double precision.
const RATIO_DECADES: (i32, i32) = (-6, 11);
const GOLDEN_SECTION_STEPS: usize = 14;
/// Lower limit of σ of a position, rad (m): an encoder of 26 bits has steps of 9e-8 rad, and noise-free data contain
/// only rounding errors.
pub(super) const MIN_SIGMA: f64 = 1e-7;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Smoothness {
    /// r: order of the derivative that is white noise.
    pub(super) order: usize,
    /// λ: weight of the roughness penalty.
    pub(super) penalty: f64,
    /// σ of a sample's position, rad (m).
    pub(super) position_std: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Smoothed {
    pub(super) smoothness: Smoothness,
    pub(super) coefficients: Vec<Vec<f64>>,
    /// −2 ln of the restricted likelihood.
    criterion: f64,
}

/// Selects the most likely knot spacing for all joints together, and returns the next narrower spacing, in samples,
/// with each joint's motion. The narrower spacing is used because torque resolves accelerations better than positions
/// do. `positions[joint][piece]`; `ladder` contains the tested spacings from wide to narrow.
pub(super) fn smoothed(positions: &[Vec<&[f64]>], rate_hz: f64, ladder: &[usize]) -> (usize, Vec<Smoothed>) {
    let likeliest = |own: &Vec<&[f64]>, step: usize| {
        let pieces: Option<Vec<Rough>> = own.iter().map(|q| Rough::new(q, rate_hz, step)).collect();
        let pieces = pieces.unwrap_or_default();
        let all = ORDERS.map(|order| of_order(&pieces, order));
        all.min_by(|a, b| a.criterion.total_cmp(&b.criterion)).unwrap_or_else(|| empty(3))
    };
    let mut tried: Vec<(f64, usize, Vec<Smoothed>)> = Vec::new();
    let mut best = 0;
    for &step in ladder {
        let found: Vec<Smoothed> = positions.par_iter().map(|own| likeliest(own, step)).collect();
        tried.push((found.iter().map(|found| found.criterion).sum(), step, found));
        let last = tried.len() - 1;
        if tried[last].0 < tried[best].0 {
            best = last;
        }
        if last - best == MAX_WORSE_SPACINGS {
            break;
        }
    }
    let chosen = (best + 1).min(tried.len().saturating_sub(1));
    if chosen < tried.len() {
        let (_, step, found) = tried.swap_remove(chosen);
        return (step, found);
    }
    (2, Vec::new())
}

/// Positions of a piece relative to a spline with very little smoothing, so that the differences are small for any
/// smoothness.
struct Rough {
    spline: Spline,
    samples: usize,
    /// Position offset, which avoids cancellation for a joint far from zero.
    offset: f64,
    coefficients: Vec<f64>,
    /// `BᵀB` with right-hand side `Bᵀ r`; r is the residual of the lightly smoothed spline.
    normal: BandedArrow,
    right: Vec<f64>,
    /// Sum of squares of r.
    squares: f64,
}

impl Rough {
    fn new(q: &[f64], rate_hz: f64, step: usize) -> Option<Self> {
        let spline = Spline::new(q.len(), step, rate_hz);
        let offset = q.first().copied().unwrap_or_default();
        let moved: Vec<f64> = q.iter().map(|q| q - offset).collect();
        let (count, gram) = (spline.functions(), spline.roughness(3));
        let least = unit(&spline, &gram) * 10.0_f64.powi(RATIO_DECADES.0);
        let mut matrix = BandedArrow::new(count, ACTIVE - 1, 0);
        spline.add_positions(&mut matrix, 0, 1, 1.0, &moved);
        spline.add_roughness(&mut matrix, 0, 1, least, &gram, &[]);
        let coefficients = matrix.eliminated().ok()?.band_solution(&[]);
        let left = spline.residual(&coefficients, 0, 1, &moved);
        let mut normal = BandedArrow::new(count, ACTIVE - 1, 0);
        spline.add_positions(&mut normal, 0, 1, 1.0, &left);
        let right = normal.right().to_vec();
        let squares = left.iter().map(|x| x * x).sum();
        Some(Self { spline, samples: q.len(), offset, coefficients, normal, right, squares })
    }
}

/// Largest λ that double precision allows for positions with this noise.
pub(super) fn most_penalty(spline: &Spline, gram: &[[f64; ACTIVE]; ACTIVE], position_std: f64) -> f64 {
    unit(spline, gram) * 10.0_f64.powi(RATIO_DECADES.1) / (position_std * position_std)
}

/// Ratio λσ² at which position and roughness terms are equal at the highest frequency.
fn unit(spline: &Spline, gram: &[[f64; ACTIVE]; ACTIVE]) -> f64 {
    let trace = |matrix: &[[f64; ACTIVE]; ACTIVE]| (0..ACTIVE).map(|k| matrix[k][k]).sum::<f64>();
    trace(&spline.products(spline.step)) / trace(gram)
}

/// Most likely smoothness of a given order.
fn of_order(pieces: &[Rough], order: usize) -> Smoothed {
    let Some(any) = pieces.first() else { return empty(order) };
    let gram = any.spline.roughness(order);
    let unit = unit(&any.spline, &gram);
    let normal = any.spline.mean_log_roughness(order);
    let at = |decades: f64| fitted(pieces, unit * 10.0_f64.powf(decades), &gram, normal, order);
    let mut best = (f64::from(RATIO_DECADES.0), at(f64::from(RATIO_DECADES.0)));
    for decade in RATIO_DECADES.0 + 1..=RATIO_DECADES.1 {
        let next = at(f64::from(decade));
        if next.criterion < best.1.criterion {
            best = (f64::from(decade), next);
        }
    }
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (best.0 - 1.0, best.0 + 1.0);
    let places = |low: f64, high: f64| (high - golden * (high - low), low + golden * (high - low));
    let (mut a, mut b) = places(low, high);
    let (mut left, mut right) = (at(a), at(b));
    for _ in 0..GOLDEN_SECTION_STEPS {
        if left.criterion <= right.criterion {
            (high, b, right) = (b, a, left);
            a = places(low, high).0;
            left = at(a);
        } else {
            (low, a, left) = (a, b, right);
            b = places(low, high).1;
            right = at(b);
        }
    }
    [best.1, left, right].into_iter().min_by(|x, y| x.criterion.total_cmp(&y.criterion)).unwrap_or_else(|| empty(order))
}

fn empty(order: usize) -> Smoothed {
    let smoothness = Smoothness { order, penalty: 1.0, position_std: MIN_SIGMA };
    Smoothed { smoothness, coefficients: Vec::new(), criterion: f64::INFINITY }
}

/// Spline for one ratio λσ², with −2 ln of its restricted likelihood.
fn fitted(pieces: &[Rough], ratio: f64, gram: &[[f64; ACTIVE]; ACTIVE], normal: f64, order: usize) -> Smoothed {
    let (mut squares, mut rough, mut log_determinant) = (0.0, 0.0, 0.0);
    let (mut samples, mut functions, mut free) = (0, 0, 0);
    let mut coefficients = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let (spline, count) = (&piece.spline, piece.spline.functions());
        let mut matrix = piece.normal.clone();
        let (_, pulled) = spline.penalty(gram, &piece.coefficients, 0, 1);
        spline.add_roughness(&mut matrix, 0, 1, ratio, gram, &pulled);
        let Ok(solved) = matrix.eliminated() else { return empty(order) };
        let step = solved.band_solution(&[]);
        let own: Vec<f64> = piece.coefficients.iter().zip(&step).map(|(c, step)| c + step).collect();
        rough += spline.penalty(gram, &own, 0, 1).0;
        let curved = dot(&step, &piece.normal.product(&step));
        squares += (piece.squares - 2.0 * dot(&step, &piece.right) + curved).max(0.0);
        // The prior is flat over polynomials of the motion, independent of the number of knots.
        log_determinant += solved.log_determinant() + order as f64 * (count as f64).ln();
        samples += piece.samples;
        functions += count;
        free += order;
        coefficients.push(own.iter().map(|c| c + piece.offset).collect());
    }
    let freedom = samples as f64 - free as f64;
    if freedom < 1.0 {
        return empty(order);
    }
    let variance = ((squares + ratio * rough) / freedom).max(MIN_SIGMA * MIN_SIGMA);
    let proper = (functions - free) as f64;
    let criterion = freedom * variance.ln() + (squares + ratio * rough) / variance + log_determinant
        - proper * (ratio.ln() + normal);
    let smoothness = Smoothness { order, penalty: ratio / variance, position_std: variance.sqrt() };
    Smoothed { smoothness, coefficients, criterion }
}

/// `tr(Z BᵀB)` for a joint from the entries of Z.
pub(super) fn sample_trace(spline: &Spline, joint: usize, joints: usize, entry: &dyn Fn(usize, usize) -> f64) -> f64 {
    let full = spline.products(spline.step);
    let of = |interval: usize| {
        let count = spline.interval_samples(interval);
        let own = if count == spline.step { full } else { spline.products(count) };
        of_interval(&own, interval, joint, joints, entry)
    };
    (0..spline.functions() + 1 - ACTIVE).map(of).sum()
}

pub(super) fn rough_trace(
    spline: &Spline,
    gram: &[[f64; ACTIVE]; ACTIVE],
    joint: usize,
    joints: usize,
    entry: &dyn Fn(usize, usize) -> f64,
) -> f64 {
    let of = |interval: usize| of_interval(gram, interval, joint, joints, entry);
    (0..spline.functions() + 1 - ACTIVE).map(of).sum()
}

fn of_interval(
    own: &[[f64; ACTIVE]; ACTIVE],
    interval: usize,
    joint: usize,
    joints: usize,
    entry: &dyn Fn(usize, usize) -> f64,
) -> f64 {
    let place = |k: usize| (interval + k) * joints + joint;
    let mut sum = 0.0;
    for a in 0..ACTIVE {
        sum += own[a][a] * entry(place(a), place(a));
        for b in 0..a {
            sum += 2.0 * own[a][b] * entry(place(a), place(b));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// White noise of 2 mrad on a motion of three harmonics: σ of 2000 samples has an error of 1.6 %; tolerance 4 σ.
    #[test]
    fn noise_and_smoothness_are_estimated_from_positions() {
        let mut random = Random::new(11);
        let truth = |t: f64| (2.0 * t).sin() + 0.5 * (3.1 * t).cos() + 0.2 * (7.3 * t).sin();
        let rate = |t: f64| 2.0 * (2.0 * t).cos() - 1.55 * (3.1 * t).sin() + 1.46 * (7.3 * t).cos();
        let q: Vec<f64> = (0..2000).map(|k| truth(f64::from(k) / 200.0) + 2e-3 * random.normal()).collect();
        let (step, found) = smoothed(&[vec![&q]], 200.0, &[200, 141, 100, 71, 50, 35, 25, 18, 12, 9, 6, 4, 3, 2]);
        let own = &found[0];
        let sigma = own.smoothness.position_std;
        assert!((sigma / 2e-3 - 1.0).abs() < 0.064, "{sigma}");
        assert!((10..=100).contains(&step), "{step}");
        let spline = Spline::new(q.len(), step, 200.0);
        let mut out = [vec![0.0; 1600], vec![0.0; 1600], vec![0.0; 1600]];
        let [q, dq, ddq] = &mut out;
        spline.motion(&own.coefficients[0], 0, 1, 200, [q, dq, ddq]);
        let error = dq.iter().enumerate().map(|(k, dq)| (dq - rate((200 + k) as f64 / 200.0)).powi(2)).sum::<f64>();
        // A filter of 4 Hz, three and a half times the highest frequency, gives σ √(2 · 4/200) · 2π 4/√3 = 5.8 mrad/s;
        // differences of samples 400 mrad/s.
        assert!((error / 1600.0).sqrt() < 5.8e-3, "{}", (error / 1600.0).sqrt());
    }

    /// Constant positions: no motion and no division by zero.
    #[test]
    fn a_resting_joint_has_no_velocity() {
        let q = vec![0.7; 500];
        let (_, found) = smoothed(&[vec![&q]], 100.0, &[50, 20, 10, 5, 2]);
        assert!(found[0].coefficients[0].iter().all(|c| (c - 0.7).abs() < 1e-9));
        assert!(found[0].smoothness.penalty.is_finite() && found[0].smoothness.position_std >= MIN_SIGMA);
    }
}
