//! Motion and parameters of any log from one likelihood, with a smoothing spline as motion.

use super::bspline::Spline;
use super::covariance::{LastStep, estimate_of};
use super::noise::LogNoise;
use super::problem::{
    SplineJointFit, SplineLogFit, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    TorqueModel,
};
use super::rows::{FreeParameters, Piece};
use super::smoothing::smoothed;
use super::system::{EffectiveUnknowns, System, TorqueInformation, torque_information};
use crate::error::EstimationError;
use crate::nonlinear::autoregression::{from_covariances, shortened, whitened};
use rayon::prelude::*;

/// Ratio between successive tested knot spacings.
const SPACING_RATIO: f64 = 1.5;
/// Minimum number of rows between knots, if the rate allows, so that friction reversals within an interval are
/// resolved.
const MIN_ROWS_PER_INTERVAL: usize = 6;
/// Lower limit of a torque's σ relative to the size of the torque, for noise-free data.
const MIN_TORQUE_SIGMA_SHARE: f64 = 1e-7;
/// Maximum relative change of noise levels at convergence.
const LEVEL_TOLERANCE: f64 = 0.05;
const MIN_REMAINING_NOISE_SHARE: f64 = 0.1;
/// After ORDERS_DECREASE_AFTER steps the autoregression orders may only decrease, and after LEVELS_FIXED_AFTER steps
/// the noise levels are fixed, to stop oscillation between two equally good noise models.
const ORDERS_DECREASE_AFTER: usize = 6;
const LEVELS_FIXED_AFTER: usize = 12;
/// Updates of the noise levels per linearisation: in early steps, and later.
const LEVEL_UPDATES: (usize, usize) = (3, 3);

#[derive(Clone)]
struct State {
    coefficients: Vec<Vec<f64>>,
    parameters: Vec<f64>,
}

/// Maximises `p(q, τ | motion, θ) p(motion)` over the motion of every joint and the parameters θ, for any log. This
/// minimises
///
/// ```text
///     Σ_j ‖q_j − B c_j‖²/σ_qj²  +  Σ_j ‖A_j (τ_j − f_j(Bc, Ḃc, B̈c, θ))‖²/σ_τj²  +  Σ_j λ_j ∫ (dʳq_j/dtʳ)² dt
/// ```
///
/// B are quintic B-splines. The third sum is a Gaussian process prior: the r-th derivative of a motion is white noise
/// of intensity 1/λ (integrated Wiener process). A_j whitens the torque noise, an autoregression of its residuals.
/// σ_q, σ_τ, λ maximise the restricted likelihood (motion and parameters integrated out at their optimum); r and the
/// knot spacing are selected from the positions. There is no cut-off frequency: noisy frequencies of the positions are
/// smoothed, and torque contributes to the motion by its precision.
///
/// Each step linearises the torque at all samples (Gauss-Newton; a step that increases the sum is halved). In the
/// normal equations the motion is a band and the parameters are an arrow. The motion is eliminated by a banded
/// Cholesky factor; the inverse of the Schur complement is the covariance of the parameters with unknown motion.
/// Torque rows are means of a few samples, at least six between knots. The levels follow `σ² = RSS/(N − effective
/// unknowns)`, `λ = (rank P − effective unknowns)/(cᵀPc)` from the entries of the inverse inside the band (Harville,
/// JASA 72 (1977) 320; Wood and Fasiolo, Biometrics 73 (2017) 1071).
///
/// Ramsay, Hooker, Campbell and Cao, J. R. Statist. Soc. B 69 (2007) 741, for fits of equations of motion to smoothed
/// records; Wahba, Spline Models for Observational Data (1990), for the prior.
///
/// # Errors
/// [`EstimationError::Setting`], [`EstimationError::Mismatch`] for wrong shapes, [`EstimationError::Unusable`] for
/// values that are not finite, [`EstimationError::TooFewRows`], [`EstimationError::Undetermined`] if the rows do not
/// separate a parameter from the previous ones, and the errors of the model. Reaching `max_iterations` is a status,
/// not an error.
#[doc(alias("smoothing spline", "Gaussian process", "state estimation", "errors in variables"))]
pub fn spline_motion_least_squares<M: TorqueModel>(
    problem: &SplineMotionProblem,
    settings: &SplineMotionSettings,
    model: &mut M,
) -> Result<SplineMotionEstimate, M::Error> {
    settings.validate()?;
    problem.check()?;
    let (pieces, mut noise, coefficients) = begin(problem, settings)?;
    let fit = Fit { problem, settings, free: FreeParameters::new(&problem.held), pieces };
    let mut state = State { coefficients, parameters: problem.parameters.clone() };
    let mut residuals = all_residuals(&fit.pieces, model, &state)?;
    first_torque_levels(&fit.pieces, &residuals, &mut noise);
    let first = state.clone();
    let (mut iterations, mut converged) = (0, false);
    let mut effective = None;
    while !converged && iterations < settings.max_iterations {
        iterations += 1;
        let information = fit.information(model, &state, &noise)?;
        let before_levels = noise.clone();
        let again = match iterations {
            early if early <= LEVEL_UPDATES.0 => LEVEL_UPDATES.1,
            late if late > LEVELS_FIXED_AFTER => 0,
            _ => 1,
        };
        for _ in 0..again {
            effective = Some(fit.find_levels(&information, &state, &mut noise)?);
        }
        let Solved { step, .. } = fit.solve(&information, &state, &noise)?;
        let before = cost(&fit.pieces, &state, &residuals, &noise);
        let better = fit.descended(model, &state, &step, &noise, before)?;
        let worse = better.is_none();
        if let Some(better) = better {
            (state, residuals) = (better.state, better.residuals);
        }
        if let Some(effective) = effective.as_ref().filter(|_| iterations <= LEVELS_FIXED_AFTER) {
            let longest_noise_s = settings.max_noise_memory_s * settings.own_second_s;
            let most = settings.most_autoregression;
            torque_levels(&fit.pieces, &residuals, effective, &mut noise, most, iterations, longest_noise_s);
        }
        let change = noise.iter().zip(&before_levels).map(|(new, old)| new.change(old)).fold(0.0, f64::max);
        converged = step.length <= settings.tolerance && change <= LEVEL_TOLERANCE && iterations > 2;
        if worse && step.length > settings.tolerance && change <= LEVEL_TOLERANCE {
            break;
        }
    }
    let Fit { pieces, free, .. } = fit;
    let cost_now = cost(&pieces, &state, &residuals, &noise);
    let at_start = all_residuals(&pieces, model, &first)?;
    let cost_at_start = cost(&pieces, &first, &at_start, &noise);
    let converged = converged && cost_now <= cost_at_start * (1.0 + 1e-9);
    let logs = log_fits(&pieces, &noise, effective.as_ref());
    let estimate = estimate_of(
        problem,
        settings,
        model,
        &LastStep {
            pieces: &pieces,
            noise: &noise,
            free: &free,
            coefficients: &state.coefficients,
            parameters: &state.parameters,
            iterations,
            converged,
        },
    )?;
    let motion = pieces.iter().zip(&state.coefficients).map(|(piece, own)| piece.motion(own, 0, piece.samples()));
    Ok(SplineMotionEstimate { estimate, motion: motion.collect(), logs, cost_at_start, cost: cost_now })
}

struct Fit<'a> {
    problem: &'a SplineMotionProblem,
    settings: &'a SplineMotionSettings,
    free: FreeParameters,
    pieces: Vec<Piece<'a>>,
}

struct Solved {
    system: System,
    step: Step,
}

struct Step {
    parameters: Vec<f64>,
    motion: Vec<Vec<f64>>,
    /// Length of the step in error bars over all directions.
    length: f64,
}

/// A state with its torque residuals, by piece and joint.
struct Evaluated {
    state: State,
    residuals: Vec<Vec<Vec<f64>>>,
}

impl Fit<'_> {
    /// Linearised torque at a state, by piece.
    fn information<M: TorqueModel>(
        &self,
        model: &mut M,
        state: &State,
        noise: &[LogNoise],
    ) -> Result<Vec<TorqueInformation>, M::Error> {
        let most = self.settings.most_autoregression;
        let each = self.pieces.iter().zip(&state.coefficients);
        each.map(|(piece, own)| {
            let log = &noise[piece.record.log];
            torque_information(piece, model, own, &state.parameters, &self.free, log, most)
        })
        .collect()
    }

    fn solve(
        &self,
        information: &[TorqueInformation],
        state: &State,
        noise: &[LogNoise],
    ) -> Result<Solved, EstimationError> {
        let (pieces, names) = (&self.pieces, &self.problem.names);
        let system = System::new(pieces, information, &state.coefficients, noise, &self.free, names)?;
        let (parameters, length) = system.step();
        let motion = (0..pieces.len()).map(|k| system.motion_step(k, &parameters)).collect();
        Ok(Solved { system, step: Step { parameters, motion, length } })
    }

    /// Updates the noise levels of positions and the smoothness at the linearised optimum.
    fn find_levels(
        &self,
        information: &[TorqueInformation],
        state: &State,
        noise: &mut [LogNoise],
    ) -> Result<EffectiveUnknowns, EstimationError> {
        let Solved { system, step } = self.solve(information, state, noise)?;
        let found = EffectiveUnknowns::new(&system, &self.pieces, information, noise, &self.free);
        let moved: Vec<Vec<f64>> =
            state.coefficients.iter().zip(&step.motion).map(|(c, step)| sum(c, step, 1.0)).collect();
        found.levels(&self.pieces, &moved, noise);
        Ok(found)
    }

    /// Shortens the step (full, half, quarter, ...) until the cost is at most `before`, and returns the state after
    /// it; `None` if no step has such a cost.
    fn descended<M: TorqueModel>(
        &self,
        model: &mut M,
        state: &State,
        step: &Step,
        noise: &[LogNoise],
        before: f64,
    ) -> Result<Option<Evaluated>, M::Error> {
        let mut share = 1.0;
        while share > 1e-3 {
            let mut candidate = State {
                coefficients: state.coefficients.iter().zip(&step.motion).map(|(c, s)| sum(c, s, share)).collect(),
                parameters: state.parameters.clone(),
            };
            for (&place, step) in self.free.free.iter().zip(&step.parameters) {
                candidate.parameters[place] += share * step;
            }
            let residuals = all_residuals(&self.pieces, model, &candidate)?;
            // At the minimum costs differ by rounding.
            if cost(&self.pieces, &candidate, &residuals, noise) <= before * (1.0 + 1e-9) {
                return Ok(Some(Evaluated { state: candidate, residuals }));
            }
            share *= 0.5;
        }
        Ok(None)
    }
}

/// First torque noise levels: RMS of the residuals.
fn first_torque_levels(pieces: &[Piece<'_>], residuals: &[Vec<Vec<f64>>], noise: &mut [LogNoise]) {
    for (log, own) in noise.iter_mut().enumerate() {
        let of_log = || pieces.iter().zip(residuals).filter(move |(piece, _)| piece.record.log == log);
        for joint in 0..own.torque_std.len() {
            let (sum, rows) = of_log().fold((0.0, 0), |(sum, rows), (_, r)| {
                (sum + r[joint].iter().map(|x| x * x).sum::<f64>(), rows + r[joint].len())
            });
            let sigma = (sum / rows.max(1) as f64).sqrt().max(least_sigma(pieces, log, joint));
            (own.torque_std[joint], own.torque_variance[joint]) = (sigma, sigma * sigma);
        }
    }
}

/// Pieces with their knots, noise levels of every log, and coefficients of every piece.
type Beginning<'a> = (Vec<Piece<'a>>, Vec<LogNoise>, Vec<Vec<f64>>);

/// Chooses the knots, and estimates the motion and its noise levels from the positions alone.
fn begin<'a>(
    problem: &'a SplineMotionProblem,
    settings: &SplineMotionSettings,
) -> Result<Beginning<'a>, EstimationError> {
    let joints = problem.joints.len();
    let samples = |record: &SplineRecord| record.q.len() / joints;
    let logs = problem.records.iter().map(|record| record.log + 1).max().unwrap_or(0);
    let all: usize = problem.records.iter().map(samples).sum();
    let of_log = |log: usize| {
        let own: Vec<(usize, &SplineRecord)> =
            problem.records.iter().enumerate().filter(|(_, record)| record.log == log).collect();
        let Some(&(_, any)) = own.first() else { return Err(EstimationError::Empty) };
        let rate_hz = any.rate_hz;
        if let Some((_, other)) = own.iter().find(|(_, record)| record.rate_hz != rate_hz) {
            let fix = "pieces of one log must have the same rate: use separate log numbers";
            return Err(EstimationError::Setting { setting: "rate_hz", value: other.rate_hz, fix });
        }
        // The maximum number of unknowns is divided among the logs in proportion to their samples.
        let least = (all * joints).div_ceil(settings.max_unknowns).max(2);
        let mut ladder = Vec::new();
        let mut step = settings.max_knot_spacing_s * settings.own_second_s * rate_hz;
        while step.round() as usize > least {
            ladder.push(step.round() as usize);
            step /= SPACING_RATIO;
        }
        ladder.push(least);
        if let Some(spacing_s) = settings.knot_spacing_s {
            ladder = vec![((spacing_s * rate_hz).round() as usize).max(least)];
        }
        let position = |joint: usize| {
            let of = |(_, record): &(usize, &'a SplineRecord)| -> &'a [f64] {
                let count = samples(record);
                &record.q[joint * count..(joint + 1) * count]
            };
            own.iter().map(of).collect::<Vec<_>>()
        };
        let positions: Vec<Vec<&[f64]>> = (0..joints).map(position).collect();
        let (step, found) = smoothed(&positions, rate_hz, &ladder);
        let mean_of = (step / MIN_ROWS_PER_INTERVAL).max(1);
        let mut pieces = Vec::new();
        for (place, (number, record)) in own.into_iter().enumerate() {
            let spline = Spline::new(samples(record), step, rate_hz);
            let mut coefficients = vec![0.0; spline.functions() * joints];
            for (joint, found) in found.iter().enumerate() {
                for (k, c) in found.coefficients.get(place).into_iter().flatten().enumerate() {
                    coefficients[k * joints + joint] = *c;
                }
            }
            pieces.push((Piece { number, record, spline, joints, mean_of }, coefficients));
        }
        let noise = LogNoise {
            positions: found.iter().map(|found| found.smoothness).collect(),
            torque_std: vec![1.0; joints],
            torque_variance: vec![1.0; joints],
            colours: vec![Vec::new(); joints],
        };
        Ok((noise, pieces))
    };
    let found: Vec<_> = (0..logs).into_par_iter().map(of_log).collect::<Result<_, _>>()?;
    let (mut noise, mut pieces) = (Vec::new(), Vec::new());
    for (own, of_log) in found {
        noise.push(own);
        pieces.extend(of_log);
    }
    pieces.sort_by_key(|(piece, _)| piece.number);
    let (pieces, coefficients) = pieces.into_iter().unzip();
    Ok((pieces, noise, coefficients))
}

fn sum(values: &[f64], step: &[f64], share: f64) -> Vec<f64> {
    values.iter().zip(step).map(|(x, step)| x + share * step).collect()
}

fn all_residuals<M: TorqueModel>(
    pieces: &[Piece<'_>],
    model: &mut M,
    state: &State,
) -> Result<Vec<Vec<Vec<f64>>>, M::Error> {
    let each = pieces.iter().zip(&state.coefficients);
    each.map(|(piece, own)| piece.residuals(model, own, &state.parameters)).collect()
}

/// The sum of squares to minimise, at these noise levels.
fn cost(pieces: &[Piece<'_>], state: &State, residuals: &[Vec<Vec<f64>>], noise: &[LogNoise]) -> f64 {
    let mut sum = 0.0;
    for ((piece, coefficients), torques) in pieces.iter().zip(&state.coefficients).zip(residuals) {
        let own = &noise[piece.record.log];
        for joint in 0..piece.joints {
            let at = (joint, piece.joints);
            let smoothness = own.positions[joint];
            let left = piece.spline.residual(coefficients, at.0, at.1, piece.q(joint));
            sum += left.iter().map(|x| x * x).sum::<f64>() / smoothness.position_std.powi(2);
            let gram = piece.spline.roughness(smoothness.order);
            sum += smoothness.penalty * piece.spline.penalty(&gram, coefficients, at.0, at.1).0;
            sum += whitened(&torques[joint], &own.colours[joint]).norm_squared() / own.torque_std[joint].powi(2);
        }
    }
    sum
}

fn least_sigma(pieces: &[Piece<'_>], log: usize, joint: usize) -> f64 {
    let of_log = pieces.iter().filter(|piece| piece.record.log == log);
    let own = of_log.flat_map(|piece| &piece.record.tau[joint * piece.samples()..(joint + 1) * piece.samples()]);
    let (sum, count) = own.fold((0.0, 0), |(sum, count), tau| (sum + tau * tau, count + 1));
    let size = (sum / f64::from(count.max(1))).sqrt();
    if size > 0.0 { MIN_TORQUE_SIGMA_SHARE * size } else { MIN_TORQUE_SIGMA_SHARE }
}

/// Autoregression and σ of the torque noise from the residuals.
fn torque_levels(
    pieces: &[Piece<'_>],
    residuals: &[Vec<Vec<f64>>],
    effective: &EffectiveUnknowns,
    noise: &mut [LogNoise],
    most: usize,
    iterations: usize,
    longest_noise_s: f64,
) {
    for (log, own) in noise.iter_mut().enumerate() {
        for joint in 0..own.colours.len() {
            let of_log = pieces.iter().zip(residuals).filter(|(piece, _)| piece.record.log == log);
            let of_joint: Vec<&[f64]> = of_log.map(|(_, r)| r[joint].as_slice()).collect();
            // The lags are counted within each piece, because samples between pieces are missing. Motion and
            // parameters absorb part of the noise; its expectation is added back (expectation step of Dempster, Laird
            // and Rubin, J. R. Statist. Soc. B 39 (1977) 1).
            let rows: usize = of_joint.iter().map(|r| r.len()).sum();
            let taken = &effective.torque[log][joint];
            let product =
                |r: &&[f64], lag: usize| r.iter().zip(&r[lag.min(r.len())..]).map(|(a, b)| a * b).sum::<f64>();
            let left = |lag: usize| of_joint.iter().map(|r| product(r, lag)).sum::<f64>() / rows.max(1) as f64;
            // The absorbed part grows with the noise; `growth` makes both consistent in small steps.
            let before = own.torque_variance[joint];
            let growth = (left(0) / (before - taken[0]).max(MIN_REMAINING_NOISE_SHARE * before)).clamp(0.5, 2.0);
            let covariances: Vec<f64> =
                taken.iter().enumerate().map(|(lag, taken)| left(lag) + growth * taken).collect();
            let most = if iterations > ORDERS_DECREASE_AFTER { own.colours[joint].len() } else { most };
            let (colour, variance) = from_covariances(&covariances[..=most.min(rows / 4)], rows);
            let row_s = pieces.iter().find(|piece| piece.record.log == log);
            let row_s = row_s.map_or(1.0, |piece| piece.mean_of as f64 / piece.record.rate_hz);
            let (colour, variance) = shortened(colour, variance, &covariances, (-row_s / longest_noise_s).exp());
            own.colours[joint] = colour;
            own.torque_variance[joint] = covariances[0].max(least_sigma(pieces, log, joint).powi(2));
            own.torque_std[joint] = variance.sqrt().max(least_sigma(pieces, log, joint));
        }
    }
}

fn log_fits(pieces: &[Piece<'_>], noise: &[LogNoise], effective: Option<&EffectiveUnknowns>) -> Vec<SplineLogFit> {
    let of_log = |(log, own): (usize, &LogNoise)| {
        let of_log: Vec<&Piece<'_>> = pieces.iter().filter(|piece| piece.record.log == log).collect();
        let functions: usize = of_log.iter().map(|piece| piece.spline.functions()).sum();
        let joint = |joint: usize| SplineJointFit {
            position_std: own.positions[joint].position_std,
            torque_std: own.torque_std[joint],
            torque_autoregression: own.colours[joint].clone(),
            order: own.positions[joint].order,
            used_functions: effective.map_or(0.0, |effective| functions as f64 - effective.smoothness[log][joint]),
        };
        let any = of_log.first();
        SplineLogFit {
            knot_spacing_s: any.map_or(0.0, |piece| piece.spline.step as f64 / piece.record.rate_hz),
            functions,
            rows: of_log.iter().map(|piece| piece.rows()).sum(),
            samples_of_row: any.map_or(1, |piece| piece.mean_of),
            joints: (0..own.positions.len()).map(joint).collect(),
        }
    };
    noise.iter().enumerate().map(of_log).collect()
}
