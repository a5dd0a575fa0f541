//! Test of the paper's claim: logistic strokes and a Fourier series under equal conditions.
//!
//! Arm, limits (18), 40 s, design criterion, sample rate, first controller and law (23), number of runs, differentiator
//! and noise are equal, so that a difference is caused by the motion.

use crate::arm::{Arm, TRUTH};
use crate::base_parameters::COLUMNS;
use crate::joint_runs::{failed, prior, with_all_runs};
use crate::literal_map::LiteralMap;
use core::ops::ControlFlow;
use dynident::{Error, RunOptions, Study, design_study, write_atomically};
use dynident_dynamics::ParametricModel;
use dynident_iteration::{Iteration, IterationError, IterationSettings, IterationTask, Leg, iterate};
use dynident_iteration::{Robot, SimulatedRobot};
use dynident_recording::{DecimationSettings, DifferentiatorSettings, LogisticPath, ReferenceSettings};
use dynident_simulation::{Integrator, LoopSettings, Plant, Reference, Run, SensorSettings};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Names of the studies in the output, and their texts.
pub(crate) const FOURIER: (&str, &str) = ("study/design_fourier.toml", include_str!("../study/design_fourier.toml"));
pub(crate) const LOGISTIC: (&str, &str) = ("study/design_logistic.toml", include_str!("../study/design_logistic.toml"));

/// Sample rate of robot and log, Hz, with one Runge-Kutta step each; both motions change within seconds.
pub(crate) const RATE_HZ: f64 = 100.0;
/// Duration of either motion, s.
pub(crate) const DURATION_S: f64 = 40.0;
pub(crate) const RUNS: usize = 3;
pub(crate) const SEEDS: u64 = 16;
/// Cut-off of smoothers and of the filter for torque and columns, Hz; the power of both motions ends at 0.5 Hz.
pub(crate) const CUTOFF_HZ: f64 = 6.0;
/// Decimation factor of the rows after that filter.
const DECIMATION: usize = 5;
/// Half width δ of the paper's windows, s: that of the optimum inside (18).
pub(crate) const WINDOW_S: f64 = 5.76;
/// Harmonics of the series fitted to measured positions: the commanded five, and more for the tracking error.
pub(crate) const FITTED_HARMONICS: usize = 15;
/// Standard deviations of the noise of positions (1e-3 degrees) and torques, as in BIRDy's protocol.
pub(crate) const POSITION_STD_RAD: f64 = 1.745_329_251_994_33e-5;
pub(crate) const TORQUE_STD_NM: f64 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    Logistic,
    Fourier,
}

/// Computation of velocity and acceleration from positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Differentiation {
    /// Smoothed deviation from the commanded motion plus the commanded derivatives; the default of studies.
    Deviation,
    /// Zero-phase Butterworth filter of the positions.
    Filter,
    /// That of each method: the paper's map, or a Fourier series fitted to the positions.
    Own,
}

impl Differentiation {
    pub(crate) const ALL: [Self; 3] = [Self::Deviation, Self::Filter, Self::Own];
}

pub(crate) struct DesignedMotion {
    method: Method,
    pub(crate) reference: Reference,
    /// Closed form of logistic strokes, one per joint.
    paths: Vec<LogisticPath>,
    /// Standard deviation of each θ for white torque noise of 1 Nm: the Cramér-Rao bound of this motion.
    pub(crate) bounds: [f64; 6],
    /// Whether the design keeps all limits.
    pub(crate) feasible: bool,
}

/// One iteration of three runs.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// The six parameters after each run, from that run alone.
    pub(crate) theta: Vec<[f64; 6]>,
    /// Largest tracking error of each run and joint, rad.
    pub(crate) tracking: Vec<[f64; 2]>,
    /// Motions of the trial without noise; empty for others.
    pub(crate) runs: Vec<Run>,
}

pub(crate) struct Trials {
    pub(crate) method: Method,
    pub(crate) way: Differentiation,
    pub(crate) clean: Trial,
    /// By seed.
    pub(crate) noisy: Vec<Trial>,
}

pub(crate) struct Comparison {
    pub(crate) motions: [DesignedMotion; 2],
    pub(crate) trials: Vec<Trials>,
}

impl Comparison {
    pub(crate) fn of(&self, method: Method, way: Differentiation) -> Option<&Trials> {
        self.trials.iter().find(|trials| trials.method == method && trials.way == way)
    }
}

impl Trial {
    pub(crate) fn last(&self) -> [f64; 6] {
        self.theta.last().copied().unwrap_or([f64::NAN; 6])
    }
}

impl Trials {
    /// Root mean square error of each θ after run `run` (from 0) over the seeds.
    pub(crate) fn noisy_errors(&self, run: usize) -> [f64; 6] {
        let mut squares = [0.0; 6];
        for trial in &self.noisy {
            let theta = trial.theta.get(run).copied().unwrap_or([f64::NAN; 6]);
            for ((square, value), truth) in squares.iter_mut().zip(theta).zip(TRUTH) {
                *square += (value - truth).powi(2) / self.noisy.len() as f64;
            }
        }
        squares.map(f64::sqrt)
    }
}

/// Geometric mean of the quotients of two methods' errors.
pub(crate) fn quotient(one: [f64; 6], other: [f64; 6]) -> f64 {
    (one.iter().zip(other).map(|(one, other)| (one / other).ln()).sum::<f64>() / 6.0).exp()
}

/// Designs both motions and runs all trials; the noise of trial `k` has seed `seed` + k.
pub(crate) fn compared(arm: &Arm, folder: &Path, seed: u64, options: &RunOptions<'_>) -> Result<Comparison, Error> {
    let designed = |method| designed(arm, folder, method, seed, options);
    let motions = [designed(Method::Logistic)?, designed(Method::Fourier)?];
    let pairs = motions.iter().flat_map(|motion| Differentiation::ALL.map(|way| (motion, way)));
    // One job per trial; the trials are independent.
    let jobs: Vec<(&DesignedMotion, Differentiation, Option<u64>)> = pairs
        .flat_map(|(motion, way)| {
            let seeds = (0..SEEDS).map(move |k| Some(seed.wrapping_add(k)));
            core::iter::once(None).chain(seeds).map(move |seed| (motion, way, seed))
        })
        .collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|why| Error::Result { path: arm.description.clone(), message: why.to_string() })?;
    let made: Vec<Trial> = pool
        .install(|| jobs.par_iter().map(|&(motion, way, seed)| trial(arm, motion, way, seed)).collect::<Result<_, _>>())
        .map_err(|why| failed(&arm.description, why))?;
    let mut made = jobs.iter().zip(made).peekable();
    let mut trials = Vec::new();
    while let Some((&(motion, way, _), clean)) = made.next() {
        let mut noisy = Vec::new();
        while let Some((_, trial)) = made.next_if(|((_, _, seed), _)| seed.is_some()) {
            noisy.push(trial);
        }
        trials.push(Trials { method: motion.method, way, clean, noisy });
    }
    Ok(Comparison { motions, trials })
}

fn designed(
    arm: &Arm,
    folder: &Path,
    method: Method,
    seed: u64,
    options: &RunOptions<'_>,
) -> Result<DesignedMotion, Error> {
    let (name, text) = match method {
        Method::Logistic => LOGISTIC,
        Method::Fourier => FOURIER,
    };
    let path = folder.join(name);
    write_atomically(&path, text.as_bytes())?;
    let mut study = Study::load(&path)?;
    study.design.get_or_insert_default().search.seed = seed;
    let outcome = design_study(&study, &path, options, |_| ControlFlow::Continue(()))?;
    let reference = Reference::new(RATE_HZ, outcome.sampled(RATE_HZ).1)
        .map_err(|why| failed(&arm.description, IterationError::from(why)))?;
    let paths = match method {
        Method::Logistic => outcome.file.parameters.chunks_exact(3).map(closed_form).collect(),
        Method::Fourier => Vec::new(),
    };
    let forecast = &outcome.file.forecast;
    let bounds = COLUMNS.map(|column| forecast.get(column).and_then(|of| of.std).unwrap_or(f64::NAN));
    Ok(DesignedMotion { method, reference, paths, bounds, feasible: outcome.file.feasible })
}

/// Stroke of a joint from its parameters A, ω, h, with T = 40/ω.
fn closed_form(own: &[f64]) -> LogisticPath {
    LogisticPath { amplitude: own[0], omega: own[1], offset: own[2], period_s: 40.0 / own[1], repetitions: 1 }
}

/// Three runs with both joints moving, starting without a model; without a seed there is no noise.
fn trial(arm: &Arm, motion: &DesignedMotion, way: Differentiation, seed: Option<u64>) -> Result<Trial, IterationError> {
    // The paper's map uses windows around the mid-points, as in the paper; other differentiators use all samples.
    let windows = |path: &LogisticPath| {
        [0.25, 0.75].map(|share| [share * path.period_s - WINDOW_S, share * path.period_s + WINDOW_S]).to_vec()
    };
    let mut leg = match (way, motion.method) {
        (Differentiation::Own, Method::Logistic) => {
            Leg::windowed(motion.reference.clone(), motion.paths.iter().map(windows).collect())?
        }
        (Differentiation::Own, Method::Fourier) | (Differentiation::Deviation | Differentiation::Filter, _) => {
            Leg::whole(motion.reference.clone())?
        }
    };
    let mut settings = IterationSettings::default();
    settings.identification.differentiator = match (way, motion.method) {
        (Differentiation::Filter, _) => filter(),
        (Differentiation::Deviation, _) | (Differentiation::Own, Method::Logistic) => {
            DifferentiatorSettings::Deviation {
                reference: ReferenceSettings::default(),
                smoother: Box::new(filter()),
                max_lag_s: None,
            }
        }
        (Differentiation::Own, Method::Fourier) => {
            DifferentiatorSettings::FourierFit { base_hz: 1.0 / DURATION_S, harmonics: FITTED_HARMONICS, trend: false }
        }
    };
    if way == Differentiation::Own && motion.method == Method::Logistic {
        leg = leg.with_differentiator(Arc::new(LiteralMap { paths: motion.paths.clone() }));
    }
    settings.identification.parallel_filter =
        Some(DecimationSettings { factor: DECIMATION, cutoff_hz: Some(CUTOFF_HZ), ..DecimationSettings::default() });
    // As in the paper, each run is identified separately, the controller uses its estimate for any tracking error, and
    // all runs are computed.
    settings.pool = false;
    let settings = with_all_runs(settings, RUNS);
    let robot = ParametricModel::new(arm.model.clone(), Vec::new())?.with_nominal(prior(false))?;
    let task = IterationTask { robot, legs: vec![leg], known: Vec::new(), torque_limits: None };
    let iteration = Iteration::new(task, settings)?;
    let sensors = seed.map_or_else(SensorSettings::default, |seed| SensorSettings {
        position_std: POSITION_STD_RAD.into(),
        torque_std: TORQUE_STD_NM.into(),
        seed,
        ..SensorSettings::default()
    });
    let integrator = Integrator::Rk4 { steps_per_sample: 1 };
    let loop_settings = LoopSettings { integrator, sensors, ..LoopSettings::default() };
    let mut robot = SimulatedRobot::new(Plant::new(&arm.model, &[], &[])?, loop_settings)?;
    let mut runs = Vec::new();
    let outcome = iterate(&iteration, &mut [&mut robot as &mut dyn Robot], None, &mut |_, made| {
        runs.extend(made.iter().filter_map(|run| run.truth.clone()));
    })?;
    let theta = outcome.runs.iter().map(|run| {
        let values = run.estimate.as_ref().map(|estimate| estimate.values.as_slice()).unwrap_or_default();
        COLUMNS.map(|column| values.get(column).copied().unwrap_or(f64::NAN))
    });
    let theta = theta.collect();
    // Tracking errors are true distances, without sensor noise.
    let tracking = runs.iter().map(|run| [run.max_error[0], run.max_error[1]]).collect();
    if seed.is_some() {
        runs.clear();
    }
    Ok(Trial { theta, tracking, runs })
}

fn filter() -> DifferentiatorSettings {
    DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(CUTOFF_HZ) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_excitation::families::{SplicedLogistic, SplicedLogisticSettings};
    use dynident_excitation::{Family, grid};

    /// The strokes of the map must equal the commanded ones, otherwise the map's errors would be ours.
    #[test]
    fn the_map_uses_the_commanded_motion() {
        let family = SplicedLogistic::new(2, DURATION_S, &SplicedLogisticSettings::default()).unwrap();
        let parameters = [1.9, 1.05, 0.1, 2.0, 1.2, 0.3];
        let (times, mut motion) = (grid(DURATION_S, 401), dynident_excitation::Motion::default());
        family.motion(&parameters, &times, &mut motion);
        for (joint, own) in parameters.chunks_exact(3).enumerate() {
            let path = closed_form(own);
            for (place, time) in motion.of(joint).zip(&times).filter(|(_, time)| **time < 40.0 / own[1]) {
                let at = path.at(*time);
                // Rounding of an exponential of at most e^10.
                let own = [motion.q[place], motion.dq[place], motion.ddq[place]];
                assert!(own.iter().zip(at).all(|(own, at)| (own - at).abs() < 1e-10), "{joint} {time}: {own:?} {at:?}");
            }
        }
    }

    #[test]
    fn a_quotient_is_geometric() {
        assert!((quotient([2.0; 6], [1.0; 6]) - 2.0).abs() < 1e-12);
        assert!((quotient([4.0, 1.0, 1.0, 1.0, 1.0, 0.25], [1.0; 6]) - 1.0).abs() < 1e-12);
    }
}
