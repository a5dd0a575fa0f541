//! Maximum-likelihood estimate of motion and parameters together, with noise in positions and torques.

use super::autoregression::autoregression;
use super::simultaneous_problem::{
    ChannelNoise, SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings,
};
use super::simultaneous_rows::{ChannelRows, WhiteRows, cost};
use crate::error::{EstimationError, expect};
use crate::factor::{LinearProblem, RankSettings, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use nalgebra::{DMatrix, DVector};

/// The rows are linearised again if a step is longer than this share of the previous one.
const MAX_STEP_RATIO: f64 = 0.25;
/// The rows are linearised again at the end if the estimate moved farther than this since the last linearisation, in
/// error bars.
const MAX_MOVE_ERROR_BARS: f64 = 1.0;

/// Solves `argmin Σ_c Σ_t [A_c (y_c − f_c(motion, parameters))]_t² / σ_c²` over motion **and** parameters, for
/// channels c and instants t. This is maximum likelihood for normal errors in all channels. `A_c` is the whitening
/// filter of the channel's autoregressive noise and σ_c its standard deviation, both estimated from the residuals.
///
/// Least squares on a measured motion treats the motion as exact. Position noise then enters the torque residual of
/// heavy links. This noise is correlated in time and across joints, and can be as large as the torque noise. Here the
/// motion (for example Fourier coefficients) is also unknown, and positions and torques are weighted by their
/// precision. The estimates σ_c are consistent only if there are far fewer unknowns than rows.
///
/// Gauss-Newton steps; a step that increases the sum is halved. The rows are linearised again after the first step.
/// Later this happens only if steps do not shrink to a quarter or move further than an error bar. The autoregression
/// is estimated from the residuals of the last linearisation; σ_c is updated in every step, `σ_c² = RSS_c / (N_c −
/// leverage of the channel)`. At the end the motion is eliminated from the rows, `X̃ = X_parameters − X_motion
/// (X_motionᵀ X_motion)⁻¹ X_motionᵀ X_parameters`. The covariance of the parameters is that of a linear problem with
/// those rows. For white noise it is `(Σ X̃ᵀX̃/σ²)⁻¹`, the Cramér-Rao bound with unknown motion; otherwise a
/// sandwich. All rows are held in memory.
///
/// Fuller, Measurement Error Models (1987), 3.1 to 3.3; Seber and Wild, Nonlinear Regression (1989), 6.2
/// (autoregressive errors), 14.3 (elimination).
///
/// # Errors
/// [`EstimationError::Setting`], [`EstimationError::Mismatch`] for wrong shapes, [`EstimationError::Empty`],
/// [`EstimationError::TooFewRows`], [`EstimationError::Undetermined`] if the rows do not separate an unknown from the
/// previous ones, and the errors of the covariance and the model. Reaching `max_iterations` is a status, not an error.
#[doc(alias("joint estimation", "bundle adjustment"))]
pub fn simultaneous_least_squares<M: SimultaneousModel>(
    problem: &SimultaneousProblem,
    settings: &SimultaneousSettings,
    model: &mut M,
) -> Result<SimultaneousEstimate, M::Error> {
    settings.validate()?;
    let (names, channels) = (&problem.names, &problem.channels);
    expect("parameters of the start", names.len(), problem.parameters.len())?;
    let motion = problem.motion.len();
    let start = problem.motion.iter().chain(&problem.parameters).copied();
    let mut unknowns = DVector::from_iterator(motion + names.len(), start);
    let mut raw = model.linearised(&problem.motion, &problem.parameters)?;
    expect("channels", channels.len(), raw.len())?;
    let mut colours = vec![Vec::new(); raw.len()];
    let mut rows = WhiteRows::new(&raw, &colours, motion, names.len())?;
    let mut residuals: Vec<DVector<f64>> = raw.iter().map(|c| DVector::from_column_slice(&c.residual)).collect();
    let mut sigma = rows.sigma(&residuals, &vec![0.0; raw.len()], &unknowns)?;
    let mut centre = unknowns.clone();
    let mut previous = f64::INFINITY;
    let (mut iterations, mut converged) = (0, false);
    while !converged && iterations < settings.max_iterations {
        iterations += 1;
        let system = rows.system(&sigma).ok_or_else(|| rows.undetermined(&sigma, names))?;
        let gradient = rows.gradient(&residuals, &sigma);
        let step = system.solve(&gradient);
        let length = (step.dot(&gradient).max(0.0) / step.len().max(1) as f64).sqrt();
        let before = cost(&residuals, &sigma);
        let better = descended(model, &rows, &sigma, &unknowns, &step, before)?;
        let worse = better.is_none();
        // Steps as small as rounding may increase a sum of rounding errors.
        let settled = length <= settings.tolerance;
        if worse && !settled && unknowns == centre {
            break;
        }
        if let Some(better) = better {
            (unknowns, residuals) = (better.unknowns, better.residuals);
        }
        let moved = rows.length(&(&unknowns - &centre), &sigma);
        converged = settled && moved <= MAX_MOVE_ERROR_BARS && iterations > 1;
        let leverage = rows.leverage(&system, &sigma);
        if iterations == 1 || (!converged && (worse || settled || length > MAX_STEP_RATIO * previous)) {
            let (c, p) = rows.parts(&unknowns);
            raw = model.linearised(c, p)?;
            let colour = |rows: &ChannelRows| autoregression(&rows.residual, settings.most_autoregression);
            colours = raw.iter().map(colour).collect();
            rows = WhiteRows::new(&raw, &colours, motion, names.len())?;
            let plain: Vec<Vec<f64>> = raw.iter().map(|rows| rows.residual.clone()).collect();
            residuals = rows.filtered(&plain)?;
            centre.clone_from(&unknowns);
            previous = f64::INFINITY;
        } else {
            previous = length;
        }
        sigma = rows.sigma(&residuals, &leverage, &unknowns)?;
    }
    let noise = sigma.iter().zip(colours).map(|(&std, autoregression)| ChannelNoise { std, autoregression });
    let noise = noise.collect();
    let problem = rows.eliminated(names, channels, &sigma, &residuals, &unknowns)?;
    let estimate =
        estimate_without_motion(&problem, &settings.rank, settings.covariance, sigma, iterations, converged)?;
    Ok(SimultaneousEstimate { estimate, motion: unknowns.as_slice()[..motion].to_vec(), noise })
}

/// Unknowns and their whitened residuals by channel.
struct Evaluated {
    unknowns: DVector<f64>,
    residuals: Vec<DVector<f64>>,
}

/// Shortens the step (full, half, quarter, ...) until the cost is at most `before`, and returns the unknowns after
/// it; `None` if no step has such a cost.
fn descended<M: SimultaneousModel>(
    model: &mut M,
    rows: &WhiteRows,
    sigma: &[f64],
    unknowns: &DVector<f64>,
    step: &DVector<f64>,
    before: f64,
) -> Result<Option<Evaluated>, M::Error> {
    let mut share = 1.0;
    while share > 1.0e-3 {
        let unknowns = unknowns + step * share;
        let (c, p) = rows.parts(&unknowns);
        let residuals = rows.filtered(&model.residuals(c, p)?)?;
        // At the minimum costs differ by rounding.
        if cost(&residuals, sigma) <= before * (1.0 + 1.0e-10) {
            return Ok(Some(Evaluated { unknowns, residuals }));
        }
        share *= 0.5;
    }
    Ok(None)
}

/// Estimates the parameters from rows without the motion, with noise `sigma` of the channels.
pub(super) fn estimate_without_motion(
    problem: &LinearProblem,
    rank: &RankSettings,
    covariance: CovarianceMethod,
    sigma: Vec<f64>,
    iterations: usize,
    converged: bool,
) -> Result<Estimate, EstimationError> {
    let stacked = problem.stacked();
    let weights: Vec<f64> = sigma.iter().map(|sigma| 1.0 / sigma).collect();
    let triangle = stacked.combined(&weights)?;
    let choice = split(&triangle, rank, problem.unexcited());
    joint_degrees_of_freedom(&stacked, choice.free.len())?;
    let solution = solve(&triangle, &choice, rank, problem.fallback());
    PointEstimate {
        triangle,
        split: choice,
        solution,
        weights,
        joint_sigma: sigma,
        weighted_variance: 1.0,
        iterations,
        converged,
    }
    .into_estimate(&stacked, rank, covariance)
}

/// Cramér-Rao bound of the parameters' covariance with unknown motion: the parameters' block of `(Σ_c X_cᵀ A_cᵀ A_c
/// X_c / σ_c²)⁻¹`, for rows linearised at the true unknowns and with the true noise. `motion` is the number of
/// unknowns of the motion, `names` are the names of the parameters. Residuals are not used.
///
/// # Errors
/// [`EstimationError::Mismatch`] for wrong shapes, [`EstimationError::Setting`] for a standard deviation that is not
/// positive, [`EstimationError::Undetermined`].
pub fn simultaneous_bound(
    names: &[String],
    motion: usize,
    channels: &[ChannelRows],
    noise: &[ChannelNoise],
) -> Result<DMatrix<f64>, EstimationError> {
    expect("channels' noise", channels.len(), noise.len())?;
    if let Some(wrong) = noise.iter().find(|noise| !(noise.std.is_finite() && noise.std > 0.0)) {
        let fix = "use a positive standard deviation";
        return Err(EstimationError::Setting { setting: "std", value: wrong.std, fix });
    }
    let colours: Vec<Vec<f64>> = noise.iter().map(|noise| noise.autoregression.clone()).collect();
    let sigma: Vec<f64> = noise.iter().map(|noise| noise.std).collect();
    let rows = WhiteRows::new(channels, &colours, motion, names.len())?;
    let system = rows.system(&sigma).ok_or_else(|| rows.undetermined(&sigma, names))?;
    let inverse = system.inverse();
    Ok(inverse.view((motion, motion), (names.len(), names.len())).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    fn begun(names: &[&str], motion: &[f64], parameters: &[f64]) -> SimultaneousProblem {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        SimultaneousProblem {
            names: owned(names),
            channels: owned(&["position", "torque"]),
            motion: motion.to_vec(),
            parameters: parameters.to_vec(),
        }
    }

    /// Positions q = c s and torques τ = θ c s of a known shape s: one unknown of the motion, one parameter.
    struct Line {
        s: Vec<f64>,
        q: Vec<f64>,
        tau: Vec<f64>,
    }

    impl SimultaneousModel for Line {
        type Error = EstimationError;

        fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
            let off = |y: &[f64], gain: f64| y.iter().zip(&self.s).map(|(y, s)| y - gain * s).collect();
            Ok(vec![off(&self.q, motion[0]), off(&self.tau, parameters[0] * motion[0])])
        }

        fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, EstimationError> {
            let mut residuals = self.residuals(motion, parameters)?.into_iter();
            let column = |gain: f64| DMatrix::from_iterator(self.s.len(), 1, self.s.iter().map(|s| gain * s));
            let mut rows = |by_motion, by_parameters| ChannelRows {
                residual: residuals.next().unwrap_or_default(),
                first_motion: 0,
                by_motion,
                by_parameters,
            };
            let none = DMatrix::zeros(self.s.len(), 0);
            Ok(vec![rows(column(1.0), none), rows(column(parameters[0]), column(motion[0]))])
        }
    }

    fn line(random: &mut Random) -> Line {
        let s: Vec<f64> = (0..200).map(|k| (f64::from(k) * 0.1).sin()).collect();
        let q = s.iter().map(|s| 2.0 * s + 0.3 * random.normal()).collect();
        let tau = s.iter().map(|s| 10.0 * s + 0.5 * random.normal()).collect();
        Line { s, q, tau }
    }

    /// With as many moments as unknowns: θ = Στs/Σqs, c = Σqs/Σs² for any noise; and Var θ = (σ_τ² + θ² σ_q²)/(c² Σs²)
    /// by the delta method, which is exact for linearised rows.
    #[test]
    fn scalar_case_equals_the_closed_form() {
        let mut model = line(&mut Random::new(3));
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let (qs, ts, ss) = (dot(&model.q, &model.s), dot(&model.tau, &model.s), dot(&model.s, &model.s));
        let settings = SimultaneousSettings {
            covariance: CovarianceMethod::White,
            most_autoregression: 0,
            tolerance: 1e-9,
            ..SimultaneousSettings::default()
        };
        let problem = begun(&["gain"], &[1.0], &[3.0]);
        let found = simultaneous_least_squares(&problem, &settings, &mut model).unwrap();
        assert_eq!(found.estimate.status, crate::EstimateStatus::Complete);
        let (theta, c) = (found.estimate.values[0], found.motion[0]);
        // Step tolerance: 1e-9 of error bars of 0.1.
        assert!((theta - ts / qs).abs() < 1e-9 && (c - qs / ss).abs() < 1e-9, "{theta} {c}");
        let [sigma_q, sigma_tau] = [found.noise[0].std, found.noise[1].std];
        // The two unknowns use two degrees of freedom of both channels together, a negligible change of σ.
        assert!((sigma_q / 0.3 - 1.0).abs() < 0.2 && (sigma_tau / 0.5 - 1.0).abs() < 0.2);
        let std = ((sigma_tau.powi(2) + (theta * sigma_q).powi(2)) / (c * c * ss)).sqrt();
        assert!((found.estimate.std[0] / std - 1.0).abs() < 1e-6, "{} {std}", found.estimate.std[0]);
        let rows = model.linearised(&[2.0], &[5.0]).unwrap();
        let noise = [0.3, 0.5].map(|std| ChannelNoise { std, autoregression: Vec::new() });
        let bound = simultaneous_bound(&problem.names, 1, &rows, &noise).unwrap()[(0, 0)];
        assert!((bound / ((0.25 + 25.0 * 0.09) / (4.0 * ss)) - 1.0).abs() < 1e-10);
    }

    /// A pendulum `τ = J q̈ + m sin q + f q̇ + o` with a short Fourier series as motion and autoregressive torque
    /// noise.
    struct Pendulum {
        q: Vec<f64>,
        tau: Vec<f64>,
    }

    const STEP_S: f64 = 0.02;
    const TRUE_MOTION: [f64; 5] = [0.4, 0.9, -0.3, 0.2, 0.5];
    const TRUE_PARAMETERS: [f64; 4] = [2.0, 5.0, 0.7, 0.2];

    impl Pendulum {
        /// Value, velocity and acceleration of every basis function at sample k.
        fn basis(k: usize) -> [[f64; 5]; 3] {
            let t = k as f64 * STEP_S;
            let mut basis = [[0.0; 5]; 3];
            basis[0][0] = 1.0;
            for h in 1..=2 {
                let omega = 2.5 * h as f64;
                let (sin, cos) = (omega * t).sin_cos();
                for (place, [x, dx]) in [(2 * h - 1, [sin, cos]), (2 * h, [cos, -sin])] {
                    (basis[0][place], basis[1][place], basis[2][place]) = (x, omega * dx, -omega * omega * x);
                }
            }
            basis
        }

        fn state(k: usize, motion: &[f64]) -> [f64; 3] {
            Self::basis(k).map(|row| row.iter().zip(motion).map(|(b, c)| b * c).sum())
        }

        fn recorded(random: &mut Random) -> Self {
            let (mut error, mut q, mut tau) = (0.2 * random.normal(), Vec::new(), Vec::new());
            for k in 0..500 {
                let [x, dx, ddx] = Self::state(k, &TRUE_MOTION);
                q.push(x + 0.02 * random.normal());
                let [j, m, f, o] = TRUE_PARAMETERS;
                tau.push(j * ddx + m * x.sin() + f * dx + o + error);
                error = 0.8 * error + 0.12 * random.normal();
            }
            Self { q, tau }
        }
    }

    impl SimultaneousModel for Pendulum {
        type Error = EstimationError;

        fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
            Ok(self.linearised(motion, parameters)?.into_iter().map(|rows| rows.residual).collect())
        }

        fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, EstimationError> {
            let count = self.q.len();
            let of = |columns| (vec![0.0; count], DMatrix::zeros(count, 5), DMatrix::zeros(count, columns));
            let (mut position, mut torque) = (of(0), of(4));
            for k in 0..count {
                let (basis, [x, dx, ddx]) = (Self::basis(k), Self::state(k, motion));
                let row = [ddx, x.sin(), dx, 1.0];
                position.0[k] = self.q[k] - x;
                torque.0[k] = self.tau[k] - row.iter().zip(parameters).map(|(w, p)| w * p).sum::<f64>();
                for i in 0..5 {
                    position.1[(k, i)] = basis[0][i];
                    torque.1[(k, i)] = parameters[0] * basis[2][i]
                        + parameters[1] * x.cos() * basis[0][i]
                        + parameters[2] * basis[1][i];
                }
                for (column, value) in row.into_iter().enumerate() {
                    torque.2[(k, column)] = value;
                }
            }
            let rows = |(residual, by_motion, by_parameters)| ChannelRows {
                residual,
                first_motion: 0,
                by_motion,
                by_parameters,
            };
            Ok(vec![rows(position), rows(torque)])
        }
    }

    /// Compared with the Cramér-Rao bound, which ordinary least squares on the fitted motion does not reach. 60 runs
    /// of four parameters: the RMS has a sampling error of 1/√(2·240) = 5 %, the coverage of 240 intervals one of 1.4
    /// %; up to twice that for correlated parameters. Tolerance 3 σ.
    #[test]
    fn pendulum_reaches_the_bound_with_correct_intervals() {
        let problem = begun(&["J", "m", "f", "o"], &[0.4, 0.8, -0.2, 0.2, 0.5], &[1.0, 4.0, 0.0, 0.0]);
        let mut random = Random::new(7);
        let rows = Pendulum::recorded(&mut random).linearised(&TRUE_MOTION, &TRUE_PARAMETERS).unwrap();
        let noise = [
            ChannelNoise { std: 0.02, autoregression: Vec::new() },
            ChannelNoise { std: 0.12, autoregression: vec![0.8] },
        ];
        let bound = simultaneous_bound(&problem.names, 5, &rows, &noise).unwrap();
        for (covariance, runs) in [(CovarianceMethod::White, 60), (CovarianceMethod::Jackknife, 30)] {
            let settings = SimultaneousSettings { covariance, ..SimultaneousSettings::default() };
            let (mut squares, mut inside) = (0.0, 0);
            for _ in 0..runs {
                let mut model = Pendulum::recorded(&mut random);
                let found = simultaneous_least_squares(&problem, &settings, &mut model).unwrap();
                assert_eq!(found.estimate.status, crate::EstimateStatus::Complete);
                for p in 0..4 {
                    let error = found.estimate.values[p] - TRUE_PARAMETERS[p];
                    squares += error * error / bound[(p, p)];
                    inside += usize::from(error.abs() <= found.estimate.half_width_95[p]);
                }
            }
            let (ratio, share) = ((squares / f64::from(4 * runs)).sqrt(), inside as f64 / f64::from(4 * runs));
            assert!((0.7..1.3).contains(&ratio), "{ratio}");
            assert!(share > 0.86, "{share}");
        }
    }

    /// Without noise the estimate is exact up to the minimum σ of a channel: 1e-9 of its size, over √500 rows, times
    /// the condition number.
    #[test]
    fn noise_free_data_give_the_true_values() {
        let (mut q, mut tau) = (Vec::new(), Vec::new());
        for k in 0..500 {
            let [x, dx, ddx] = Pendulum::state(k, &TRUE_MOTION);
            let [j, m, f, o] = TRUE_PARAMETERS;
            q.push(x);
            tau.push(j * ddx + m * x.sin() + f * dx + o);
        }
        let problem = begun(&["J", "m", "f", "o"], &[0.4, 0.8, -0.2, 0.2, 0.5], &[1.0, 4.0, 0.0, 0.0]);
        let settings = SimultaneousSettings::default();
        let mut model = Pendulum { q, tau };
        let found = simultaneous_least_squares(&problem, &settings, &mut model).unwrap();
        assert_eq!(found.estimate.status, crate::EstimateStatus::Complete);
        for (found, truth) in found.estimate.values.iter().zip(TRUE_PARAMETERS) {
            assert!((found - truth).abs() < 1e-8, "{found} {truth}");
        }
    }

    #[test]
    fn undetermined_unknowns_are_named() {
        struct Still(Line);
        impl SimultaneousModel for Still {
            type Error = EstimationError;
            fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
                self.0.residuals(motion, parameters)
            }
            fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, EstimationError> {
                let mut rows = self.0.linearised(motion, parameters)?;
                rows[1].by_parameters.fill(0.0);
                Ok(rows)
            }
        }
        let mut model = Still(line(&mut Random::new(3)));
        let problem = begun(&["gain"], &[1.0], &[3.0]);
        let settings = SimultaneousSettings::default();
        let found = simultaneous_least_squares(&problem, &settings, &mut model);
        assert_eq!(found.unwrap_err(), EstimationError::Undetermined { name: "gain".into() });
        model.0.tau[4] = f64::NAN;
        let found = simultaneous_least_squares(&problem, &settings, &mut model);
        assert!(matches!(found, Err(EstimationError::Unusable { row: 4, .. })));
        let none = SimultaneousSettings { max_iterations: 0, ..settings };
        assert!(none.validate().is_err());
    }
}
