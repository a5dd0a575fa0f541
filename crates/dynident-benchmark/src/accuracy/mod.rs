//! Accuracy of estimators: estimators × noise levels × robots, Monte Carlo after the protocol of BIRDy (Leboutet et
//! al., Applied Sciences 11 (2021) 4303).
//!
//! To extend the benchmark, add a line to a registry: [`ESTIMATORS`], [`NOISE_LEVELS`] or [`ROBOTS`].

mod answers;
mod bound_with_motion;
mod estimators;
mod figures;
mod noise;
mod pipeline;
mod robots;
mod rows;
mod scenario;
mod thread_time;
mod trial;

pub use estimators::{BenchmarkEstimator, ESTIMATORS};
pub use figures::{CellFigures, ParameterFigures, cells_csv};
pub use noise::{NOISE_LEVELS, NoiseLevel};
pub use robots::{BenchmarkRobot, ROBOTS};
pub use rows::Rows;
pub use scenario::{DURATION_S, HARMONICS, RATE_HZ, Record, Scenario};
pub use trial::{Answer, Trial};

use bound_with_motion::BoundWithMotion;
use thread_time::thread_seconds;
use trial::TrialData;

use dynident_identification::{IdentificationError, Progress};
use dynident_model::UrdfError;
use dynident_model::sample::Random;
use dynident_recording::FilterError;
use fnv::FnvHasher;
use rayon::prelude::*;
use serde::Serialize;
use std::hash::Hasher;
use thiserror::Error as ThisError;

/// Name and version of the schema of [`BenchmarkFile`].
pub const BENCHMARK_SCHEMA: &str = "dynident/benchmark/1";

/// Relative standard deviation of the start values about the true values, as in BIRDy.
const START_SPREAD: f64 = 0.15;

/// Errors of the benchmark.
#[derive(Debug, ThisError)]
#[non_exhaustive]
pub enum BenchmarkError {
    /// The option names a robot, estimator or other entry that the benchmark does not have. Use one of the listed
    /// names.
    #[error("unknown --{option} {name}: use one of {}", known.join(", "))]
    Unknown {
        /// The command-line option.
        option: &'static str,
        /// The name.
        name: String,
        /// Names that the benchmark has.
        known: Vec<&'static str>,
    },
    /// Error bars need at least two runs. Write a number within the range.
    #[error("--runs {runs} is out of range: use 2 to 100000")]
    Runs {
        /// The number given.
        runs: usize,
    },
    /// The robot description of the benchmark cannot be read. The text after the name has the cause.
    #[error("robot {robot}: {source}")]
    Robot {
        /// The robot.
        robot: String,
        /// The cause.
        source: Box<UrdfError>,
    },
    /// No motion was found that keeps the limits of this robot. Use another seed.
    #[error("robot {robot}: no excitation: {reason}")]
    Excitation {
        /// The robot.
        robot: String,
        /// The cause.
        reason: String,
    },
    /// With this motion some parameters have no effect, so that the best possible accuracy is not defined. Use another
    /// seed.
    #[error("robot {robot}: the excitation does not determine all base parameters; use another seed")]
    NoBound {
        /// The robot.
        robot: String,
    },
    /// The filter of the benchmark is impossible at the sampling rate. The text after the name has the cause.
    #[error("robot {robot}: {source}")]
    Filter {
        /// The robot.
        robot: String,
        /// The cause.
        source: FilterError,
    },
    /// An error of the pipeline.
    #[error("{0}")]
    Pipeline(#[source] Box<IdentificationError>),
}

impl From<IdentificationError> for BenchmarkError {
    fn from(source: IdentificationError) -> Self {
        Self::Pipeline(Box::new(source))
    }
}

/// Selection for the benchmark.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BenchmarkSettings {
    /// Names of entries of [`ROBOTS`].
    pub robots: Vec<String>,
    /// Names of entries of [`NOISE_LEVELS`].
    pub noise: Vec<String>,
    /// Names of entries of [`ESTIMATORS`].
    pub estimators: Vec<String>,
    /// Runs per robot and noise level, the same for all estimators. Default 100.
    pub runs: usize,
    /// Seed of the excitation, the noise and the start values. Default 1.
    pub seed: u64,
}

impl Default for BenchmarkSettings {
    fn default() -> Self {
        Self {
            robots: ROBOTS.iter().map(|robot| robot.name.to_owned()).collect(),
            noise: NOISE_LEVELS.iter().map(|level| level.name.to_owned()).collect(),
            estimators: ESTIMATORS.iter().map(|estimator| estimator.name.to_owned()).collect(),
            runs: 100,
            seed: 1,
        }
    }
}

/// Output of `benchmark`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BenchmarkFile {
    /// Name and version of the schema: [`BENCHMARK_SCHEMA`].
    pub schema: &'static str,
    /// The settings.
    pub settings: BenchmarkSettings,
    /// Parameters of the noise levels.
    pub noise_levels: Vec<NoiseLevel>,
    /// Samples per second of a recording.
    pub rate_hz: f64,
    /// Length of a recording, s.
    pub duration_s: f64,
    /// Number of harmonics of the excitation.
    pub harmonics: usize,
    /// Description of the data.
    pub note: &'static str,
    /// Every estimator on every robot at every noise level.
    pub cells: Vec<CellFigures>,
}

impl BenchmarkSettings {
    /// Checks names and numbers.
    ///
    /// # Errors
    /// [`BenchmarkError::Unknown`] with the known names, [`BenchmarkError::Runs`].
    pub fn validate(&self) -> Result<(), BenchmarkError> {
        if !(2..=100_000).contains(&self.runs) {
            return Err(BenchmarkError::Runs { runs: self.runs });
        }
        chosen("robots", ROBOTS, |robot| robot.name, &self.robots)?;
        chosen("noise", NOISE_LEVELS, |level| level.name, &self.noise)?;
        chosen("estimators", ESTIMATORS, |estimator| estimator.name, &self.estimators).map(|_| ())
    }
}

fn chosen<T: Copy>(
    option: &'static str,
    registry: &[T],
    name_of: impl Fn(&T) -> &'static str,
    names: &[String],
) -> Result<Vec<T>, BenchmarkError> {
    names
        .iter()
        .map(|name| {
            registry.iter().find(|entry| name_of(entry) == name).copied().ok_or_else(|| BenchmarkError::Unknown {
                option,
                name: name.clone(),
                known: registry.iter().map(&name_of).collect(),
            })
        })
        .collect()
}

/// Results of one run: per estimator an answer (`None` for a failure) and its time.
type Run = Vec<(Option<Answer>, f64)>;

/// Runs the benchmark with runs in parallel; all results but times are the same for any number of threads.
///
/// # Errors
/// [`BenchmarkError`]; a failing estimator is counted as a failure, not an error.
pub fn benchmark(settings: &BenchmarkSettings, progress: &dyn Progress) -> Result<BenchmarkFile, BenchmarkError> {
    settings.validate()?;
    let robots = chosen("robots", ROBOTS, |robot| robot.name, &settings.robots)?;
    let levels = chosen("noise", NOISE_LEVELS, |level| level.name, &settings.noise)?;
    let estimators = chosen("estimators", ESTIMATORS, |estimator| estimator.name, &settings.estimators)?;
    let mut cells = Vec::new();
    progress.begin("runs", Some((robots.len() * levels.len() * settings.runs) as u64));
    for robot in &robots {
        let scenario = Scenario::new(robot, settings.seed)?;
        let symbols: Vec<String> =
            scenario.model.layout().columns().iter().map(dynident_dynamics::Column::symbol).collect();
        let bounds = BoundWithMotion::new(&scenario, &symbols)
            .map_err(|_| BenchmarkError::NoBound { robot: robot.name.to_owned() })?;
        for level in &levels {
            let no_bound = || BenchmarkError::NoBound { robot: robot.name.to_owned() };
            let bound = scenario.bound(level).ok_or_else(no_bound)?;
            let bound_with_motion = bounds.of(level).map_err(|_| no_bound())?;
            let runs: Vec<Run> = (0..settings.runs)
                .into_par_iter()
                .map(|run| {
                    // One random number generator per run, so that the order of threads does not matter.
                    let place = format!("{} {} {run}", robot.name, level.name);
                    let mut random = Random::new(settings.seed ^ hash(place.as_bytes()));
                    let mut of_prior = Random::new(settings.seed ^ hash(format!("{place} prior").as_bytes()));
                    let prior = scenario.prior(&mut of_prior, START_SPREAD);
                    let done = one_run(&scenario, level, &estimators, &bound, &prior, &mut random);
                    progress.advance(1);
                    done
                })
                .collect::<Result<_, _>>()?;
            for (place, estimator) in estimators.iter().enumerate() {
                let answers: Vec<Option<Answer>> = runs.iter().map(|run| run[place].0.clone()).collect();
                let time_ms = 1e3 * runs.iter().map(|run| run[place].1).sum::<f64>() / settings.runs as f64;
                let cell = figures::Cell {
                    robot: robot.name,
                    noise: level.name,
                    estimator: estimator.name,
                    symbols: &symbols,
                    truth: &scenario.truth,
                    bound: &bound,
                    bound_with_motion: &bound_with_motion,
                };
                cells.push(figures::figures(&cell, &answers, time_ms));
            }
        }
    }
    progress.end();
    Ok(BenchmarkFile {
        schema: BENCHMARK_SCHEMA,
        settings: settings.clone(),
        noise_levels: levels,
        rate_hz: RATE_HZ,
        duration_s: DURATION_S,
        harmonics: HARMONICS,
        note: "a random Fourier excitation followed with a small smooth error, exact inverse dynamics with friction, added noise; no closed loop",
        cells,
    })
}

fn one_run(
    scenario: &Scenario,
    level: &NoiseLevel,
    estimators: &[BenchmarkEstimator],
    bound: &[f64],
    prior: &[f64],
    random: &mut Random,
) -> Result<Run, BenchmarkError> {
    let start: Vec<f64> = scenario.truth.iter().map(|value| value * (1.0 + START_SPREAD * random.normal())).collect();
    let record = scenario.record(level, random);
    let (motion, cutoff_hz) = pipeline::motion(&record)
        .map_err(|source| BenchmarkError::Filter { robot: scenario.robot.to_owned(), source })?;
    let rows = Rows::new(scenario, &motion, Some(cutoff_hz))?;
    let shared = TrialData::default();
    let trial = Trial {
        scenario,
        record: &record,
        motion: &motion,
        cutoff_hz,
        rows: &rows,
        start: &start,
        prior,
        shared: &shared,
    };
    Ok(estimators
        .iter()
        .map(|estimator| {
            let (started_s, before_s) = (thread_seconds(), shared.spent_s());
            let answer = (estimator.answer)(&trial).ok();
            let time_s = thread_seconds() - started_s - (shared.spent_s() - before_s);
            (answer.filter(|answer| figures::usable(answer, &scenario.truth, &start, bound)), time_s)
        })
        .collect())
}

/// FNV-1a hash: a seed from text, the same on every computer.
fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    hasher.finish()
}
