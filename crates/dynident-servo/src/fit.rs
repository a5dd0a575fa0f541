//! Search for the values of drives and bodies whose simulated motion is most similar to the measured motion.
//!
//! Each unknown is described by a coordinate `z`, which is zero for the nominal value and has the prior standard
//! deviation `sd`. The cost is minus twice the logarithm of the likelihood of all joints (`likelihood.rs`) plus the
//! priors, `Σ (z / sd)²`. Newton steps within a trust region (`trust.rs`) minimise the cost, with exact first
//! derivatives of the simulation.
//!
//! The search starts at the given coordinates and at coordinates from the joints' responses (`start.rs`). It first
//! minimises with long time steps and short simulations that restart from the measured motion, which have few local
//! minima, and then without restarts. The best result is refined with short time steps. All stages use the midpoint
//! rule: long implicit Euler steps add the damping stiffness × step, which moves the minimum so far that the last stage
//! would begin outside of the region of the best minimum.

use crate::covariance::{correlated_samples, jackknife};
use crate::error::ServoError;
use crate::likelihood::{JointLikelihood, joint_likelihood};
use crate::normal::{PeriodSums, Periods, period_errors, period_sums, total_gram};
use crate::parameters::{FreeParameter, ServoRobot, VariedRobot};
use crate::quantity::Quantity;
use crate::run::Run;
use crate::settings::ServoSettings;
use crate::start::{drive_coordinates, equal_drives, response_coordinates};
use crate::step_state::Stepping;
use crate::trust::Quadratic;
use crate::unknowns::unknowns;
use nalgebra::{DMatrix, DVector};

/// Ratio of the time step in the first stages of the search to that of the settings.
const LONG_STEP: f64 = 4.0;
/// Time between restarts of the simulation in the first stage, s: longer than the response of a servo.
const RESTART_S: f64 = 0.5;
/// Maximum difference between the coordinates of two starts that are treated as the same start.
const SAME_START: f64 = 1e-3;
/// Maximum number of steps in each of the first stages.
const ROUGH_ITERATIONS: usize = 15;
/// Maximum number of steps from each of several starts before the best of them is selected.
const TRIAL_ITERATIONS: usize = 5;
/// Decrease of the cost in one step below which the first stages end.
const ROUGH_TOLERANCE: f64 = 1.0;
/// Maximum number of periods of all runs together; each needs memory for a matrix.
const MOST_PERIODS: f64 = 500.0;
/// Initial value of the number of neighbouring samples whose errors are equal.
const FIRST_CORRELATED: f64 = 25.0;
/// Weight of a period in the fit below which it is reported as unexplained; its error is then at least five times the
/// usual error.
const UNEXPLAINED_WEIGHT: f64 = 0.05;
/// Increase of the cost without a coordinate below which the coordinate is not needed: the 95 % quantile of the changes
/// by random errors (χ² distribution with one degree of freedom).
const UNNEEDED_COST: f64 = 3.84;
/// Scale of the logarithm of a value in the trust region; other coordinates have at most the scale of their prior.
const LONGEST_STEP: f64 = 1.0;
/// Radius of the first trust region, in units of the scales.
const FIRST_RADIUS: f64 = 2.0;
/// Ratio of the decrease of the cost to the expected decrease below which the trust region shrinks, and above which it
/// may grow (Nocedal and Wright, Numerical Optimization, 2006, algorithm 4.1).
const LOW_RATIO: f64 = 0.25;
const HIGH_RATIO: f64 = 0.75;
/// Radius of the next trust region, in units of the last step.
const SHRINK: f64 = 0.25;
const GROW: f64 = 2.0;
/// Maximum number of trust regions in one step.
const ATTEMPTS: usize = 12;

/// Result of a search.
#[derive(Clone, Debug)]
pub struct Search {
    /// Coordinate of each unknown: the change from its nominal value.
    pub coordinates: Vec<f64>,
    /// Covariance of the coordinates, by a jackknife over time periods. It is valid if errors of the model are
    /// correlated for less than a period.
    pub covariance: DMatrix<f64>,
    /// Information matrix of the data alone: the Hessian of half of the cost, without the priors.
    pub information: DMatrix<f64>,
    /// Cost, in units of minus twice the log-likelihood.
    pub cost: f64,
    /// Root mean square error of each joint over all runs, rad (m).
    pub errors: Vec<f64>,
    /// Time intervals that the model does not explain. They have little weight in the fit.
    pub unexplained: Vec<Unexplained>,
    /// Number of steps of the search.
    pub iterations: usize,
    /// Whether the last step changed the cost by less than the tolerance.
    pub settled: bool,
}

/// A time interval in which the error of a joint is much larger than elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unexplained {
    /// Index of the run.
    pub run: usize,
    /// The joint.
    pub joint: usize,
    /// Start and end, s, as time stamps of the run.
    pub interval_s: [f64; 2],
}

/// Likelihood and cost at one set of coordinates.
struct Point {
    joints: Vec<JointLikelihood>,
    cost: f64,
}

/// A search among the coordinates of the unknowns.
struct Searcher<'a> {
    nominal: &'a ServoRobot,
    parameters: &'a [FreeParameter],
    runs: &'a [Run],
    settings: &'a ServoSettings,
    periods: Periods,
    stepping: Stepping,
    /// Decrease of the cost in one step below which a descent ends.
    tolerance: f64,
    /// Number of neighbouring samples with equal errors, for each joint.
    correlated: Vec<f64>,
}

impl Searcher<'_> {
    fn point(&self, z: &[f64]) -> Option<Point> {
        let varied = VariedRobot::new(self.nominal, self.parameters, z).ok()?;
        let errors = period_errors(&varied, self.runs, self.stepping, &self.periods)?;
        let (floor, freedom) = (self.settings.least_error, self.settings.period_freedom);
        let likelihood = |(own, &correlated): (&Vec<_>, &f64)| joint_likelihood(own, floor, correlated, freedom);
        let joints: Vec<JointLikelihood> = errors.iter().zip(&self.correlated).map(likelihood).collect();
        let prior: f64 = self.parameters.iter().zip(z).map(|(p, z)| (z / p.prior_sd).powi(2)).sum();
        let cost = joints.iter().map(|own| own.cost).sum::<f64>() + prior;
        cost.is_finite().then_some(Point { joints, cost })
    }

    /// Sums over each period, with the weights of a point.
    fn sums(&self, z: &[f64], point: &Point) -> Option<Vec<PeriodSums>> {
        let varied = VariedRobot::new(self.nominal, self.parameters, z).ok()?;
        let weights: Vec<Vec<f64>> = point.joints.iter().map(|own| own.weights.clone()).collect();
        period_sums(&varied, self.runs, (self.stepping, &self.periods), &weights)
    }

    /// The point at some coordinates, and its sums.
    fn sums_at(&self, z: &[f64]) -> Option<(Point, Vec<PeriodSums>)> {
        let point = self.point(z)?;
        let sums = self.sums(z, &point)?;
        Some((point, sums))
    }

    fn with_priors(&self, gram: &DMatrix<f64>) -> DMatrix<f64> {
        let mut matrix = gram.clone();
        for (k, parameter) in self.parameters.iter().enumerate() {
            matrix[(k, k)] += parameter.prior_sd.powi(-2);
        }
        matrix
    }

    /// Hessian of half of the cost, without second derivatives of the simulation. The weights and variances of the
    /// likelihood follow the errors, which lowers the curvature. Without this decrease, steps towards a minimum in
    /// which a period loses its weight are much too short.
    fn curvature(&self, sums: &[PeriodSums], now: &Point) -> DMatrix<f64> {
        let columns = self.parameters.len();
        let mut matrix = self.with_priors(&total_gram(sums, columns));
        for (joint, own) in now.joints.iter().enumerate() {
            let mut by_variance = DVector::zeros(columns);
            for ((period, decrease), part) in sums.iter().zip(&own.decrease).zip(&own.variance_part) {
                let moment = &period.moments[joint];
                matrix.ger(-decrease, moment, moment, 1.0);
                by_variance.axpy(*part, moment, 1.0);
            }
            matrix.ger(-1.0, &by_variance, &by_variance, 1.0);
        }
        matrix
    }

    /// Makes steps until the cost converges, at most `most`. Returns the number of steps and whether the cost
    /// converged.
    fn descend(&self, z: &mut Vec<f64>, now: &mut Point, most: usize) -> (usize, bool) {
        let scales = self.parameters.iter().map(|parameter| parameter.prior_sd.min(LONGEST_STEP));
        let scales = DVector::from_iterator(z.len(), scales);
        let mut radius = FIRST_RADIUS;
        for iteration in 1..=most {
            let Some(sums) = self.sums(z, now) else { return (iteration, false) };
            let model = Quadratic::new(&self.curvature(&sums, now), &self.moment(z, &sums), scales.clone());
            let Some((next, point)) = self.lower(z, now.cost, &model, &mut radius) else {
                return (iteration, true);
            };
            let fall = now.cost - point.cost;
            *z = next;
            *now = point;
            if fall < self.tolerance {
                return (iteration, true);
            }
        }
        (most, false)
    }

    /// Coordinates with a lower cost; sets the radius of the next trust region. `None` if no step is expected to
    /// decrease the cost by more than the tolerance.
    fn lower(&self, z: &[f64], cost: f64, model: &Quadratic, radius: &mut f64) -> Option<(Vec<f64>, Point)> {
        for _ in 0..ATTEMPTS {
            let step = model.step(*radius);
            if step.expected < self.tolerance {
                return None;
            }
            let next: Vec<f64> = z.iter().zip(step.change.iter()).map(|(z, d)| z + d).collect();
            let point = self.point(&next);
            let ratio = point.as_ref().map_or(0.0, |point| (cost - point.cost) / step.expected);
            if ratio < LOW_RATIO {
                *radius = SHRINK * step.length;
            } else if ratio > HIGH_RATIO {
                *radius = radius.max(GROW * step.length);
            }
            if ratio > 0.0 {
                return point.map(|point| (next, point));
            }
        }
        None
    }

    /// Sets the torque limits that the motion does not determine to the mean of their prior, so that they do not limit
    /// other motion. A limit near the largest torque of the logs can follow the errors of single samples.
    fn release_limits(&self, z: &mut Vec<f64>, now: &mut Point) {
        for (k, parameter) in self.parameters.iter().enumerate() {
            let is_own = parameter.quantity == Quantity::TorqueLimit && parameter.members.len() == 1;
            if !is_own || z[k] == 0.0 {
                continue;
            }
            let mut without = z.clone();
            without[k] = 0.0;
            if let Some(point) = self.point(&without).filter(|point| point.cost < now.cost + UNNEEDED_COST) {
                (*z, *now) = (without, point);
            }
        }
    }

    /// Error of the coordinates by the length of the time steps: their change with steps of twice the length, as for an
    /// error of first order (Richardson), which dry friction causes. The change is one step of the search.
    fn shift_by_step(&mut self, z: &[f64]) -> Option<DVector<f64>> {
        self.stepping.step_s *= 2.0;
        let (_, sums) = self.sums_at(z)?;
        self.stepping.step_s *= 0.5;
        let matrix = self.with_priors(&total_gram(&sums, z.len()));
        Some(matrix.cholesky()?.solve(&self.moment(z, &sums)))
    }

    /// Half of the negative gradient of the cost.
    fn moment(&self, z: &[f64], sums: &[PeriodSums]) -> DVector<f64> {
        let mut moment: DVector<f64> = sums.iter().map(PeriodSums::moment).sum();
        for (k, parameter) in self.parameters.iter().enumerate() {
            moment[k] -= z[k] / parameter.prior_sd.powi(2);
        }
        moment
    }

    /// Coordinates of the best robot with nearly equal drives, and the number of iterations to find it. With separate
    /// values for each joint, the search has more local minima; a start with equal drives avoids most of them.
    fn equal_drives_start(&self) -> (Option<Vec<f64>>, usize) {
        let settings = ServoSettings { alike: true, ..self.settings.clone() };
        let nominal = ServoRobot { drives: equal_drives(&self.nominal.drives), ..self.nominal.clone() };
        let parameters = unknowns(&nominal, &settings);
        let starts = vec![vec![0.0; parameters.len()], response_coordinates(&nominal, &parameters, self.runs, false)];
        let mut searcher = Searcher {
            nominal: &nominal,
            parameters: &parameters,
            settings: &settings,
            periods: self.periods.clone(),
            correlated: self.correlated.clone(),
            runs: self.runs,
            stepping: self.stepping,
            tolerance: self.tolerance,
        };
        let (found, iterations) = searcher.best_of(starts, None);
        let start = found.and_then(|z| {
            let robot = VariedRobot::new(&nominal, &parameters, &z).ok()?.robot;
            let mut start = drive_coordinates(self.nominal, self.parameters, &robot, |_| true, true);
            for (own, parameter) in start.iter_mut().zip(self.parameters).filter(|(_, own)| !own.quantity.is_of_drive())
            {
                let is_same =
                    |other: &FreeParameter| other.quantity == parameter.quantity && other.members == parameter.members;
                *own = parameters.iter().position(is_same).map_or(0.0, |place| z[place]);
            }
            Some(start)
        });
        (start, iterations)
    }

    /// Searches for the region of the best minimum with long time steps: first from each of `starts`, with restarts
    /// from the measured motion, and then without restarts from the best result and from `near`, which is close to a
    /// minimum. `None` if no start can be simulated.
    fn best_of(&mut self, starts: Vec<Vec<f64>>, near: Option<Vec<f64>>) -> (Option<Vec<f64>>, usize) {
        let long = Stepping::accurate(LONG_STEP * self.settings.step_s);
        self.stepping = Stepping { restart_s: RESTART_S, ..long };
        let (first, iterations) = self.best(starts);
        self.stepping = long;
        let (best, more) = self.best(first.into_iter().chain(near).collect());
        (best, iterations + more)
    }

    /// Minimises from the best of `starts`: after a few steps from each, only the one with the lowest cost continues.
    fn best(&self, starts: Vec<Vec<f64>>) -> (Option<Vec<f64>>, usize) {
        let (mut best, mut iterations): (Option<(Point, Vec<f64>)>, usize) = (None, 0);
        let most = ROUGH_ITERATIONS.min(self.settings.iterations);
        let trial = if starts.len() > 1 { TRIAL_ITERATIONS.min(most) } else { 0 };
        for mut z in starts {
            let Some(mut now) = self.point(&z) else { continue };
            iterations += self.descend(&mut z, &mut now, trial).0;
            if best.as_ref().is_none_or(|(least, _)| now.cost < least.cost) {
                best = Some((now, z));
            }
        }
        let best = best.map(|(mut now, mut z)| {
            iterations += self.descend(&mut z, &mut now, most - trial).0;
            z
        });
        (best, iterations)
    }
}

/// Searches for the coordinates with the smallest cost: first with long time steps, then with the time step of the
/// settings.
///
/// # Errors
/// Invalid settings or runs; a first simulation that fails.
pub fn search(
    nominal: &ServoRobot,
    parameters: &[FreeParameter],
    start: &[f64],
    runs: &[Run],
    settings: &ServoSettings,
) -> Result<Search, ServoError> {
    settings.validate()?;
    let first = runs.first().ok_or(ServoError::NoRuns)?;
    for run in runs {
        run.validate(nominal.model.dof())?;
    }
    let no_start = || ServoError::Start { run: first.name.clone() };
    let length = |run: &Run| run.times_s[run.times_s.len() - 1] - run.times_s[0];
    let total_s: f64 = runs.iter().map(length).sum();
    let mut searcher = Searcher {
        nominal,
        parameters,
        runs,
        settings,
        periods: Periods::new(runs, settings.period_s.max(total_s / MOST_PERIODS)),
        stepping: Stepping::accurate(settings.step_s),
        tolerance: settings.tolerance.max(ROUGH_TOLERANCE),
        correlated: vec![FIRST_CORRELATED; nominal.model.dof()],
    };
    let mut starts = vec![start.to_vec()];
    let responses = response_coordinates(nominal, parameters, runs, !settings.alike);
    if responses.iter().zip(start).any(|(response, start)| (response - start).abs() > SAME_START) {
        starts.push(responses);
    }
    let (mut near, mut extra) = (None, 0);
    if !settings.alike && nominal.model.dof() > 1 {
        (near, extra) = searcher.equal_drives_start();
    }
    let (z, mut iterations) = searcher.best_of(starts, near);
    iterations += extra;
    let mut z = z.ok_or_else(no_start)?;
    // The number of neighbouring samples with equal errors is that at the end of the previous stage.
    for _ in 0..2 {
        let (_, sums) = searcher.sums_at(&z).ok_or_else(no_start)?;
        searcher.correlated = correlated_samples(&searcher.correlated, &sums);
        let (next, more) = searcher.best(vec![z]);
        z = next.ok_or_else(no_start)?;
        iterations += more;
    }
    searcher.stepping = Stepping::accurate(settings.step_s);
    searcher.tolerance = settings.tolerance;
    let mut now = searcher.point(&z).ok_or_else(no_start)?;
    searcher.release_limits(&mut z, &mut now);
    let (steps, settled) = searcher.descend(&mut z, &mut now, settings.iterations);
    iterations += steps;
    let sums = searcher.sums(&z, &now).ok_or_else(no_start)?;
    let information = total_gram(&sums, z.len());
    let shift = searcher.shift_by_step(&z).ok_or_else(no_start)?;
    let hessian = searcher.with_priors(&information);
    let covariance = jackknife(&sums, &hessian, parameters).ok_or_else(no_start)? + &shift * shift.transpose();
    Ok(Search {
        covariance,
        information,
        cost: now.cost,
        errors: now.joints.iter().map(|own| own.error).collect(),
        unexplained: unexplained(&now.joints, &searcher.periods, runs),
        coordinates: z,
        iterations,
        settled,
    })
}

/// Time intervals in which the error of a joint is much larger than elsewhere.
fn unexplained(joints: &[JointLikelihood], periods: &Periods, runs: &[Run]) -> Vec<Unexplained> {
    let mut found: Vec<Unexplained> = Vec::new();
    for (joint, own) in joints.iter().enumerate() {
        for (period, _) in own.relative.iter().enumerate().filter(|(_, weight)| **weight < UNEXPLAINED_WEIGHT) {
            let (run, begin_s) = periods.place(period);
            let interval_s = [begin_s, begin_s + periods.length_s()].map(|time| time + runs[run].times_s[0]);
            match found.last_mut() {
                Some(last) if last.joint == joint && last.run == run && last.interval_s[1] >= interval_s[0] - 1e-9 => {
                    last.interval_s[1] = interval_s[1];
                }
                _ => found.push(Unexplained { run, joint, interval_s }),
            }
        }
    }
    found
}
