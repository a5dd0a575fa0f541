//! Sums over all samples that a step of the search needs.

use crate::parameters::VariedRobot;
use crate::rollout::Rollout;
use crate::run::Run;
use crate::step_state::Stepping;
use rayon::prelude::*;

/// Sums of one joint over one run. `g` are the derivatives of a simulated position, `e` is the measured position minus
/// it.
#[derive(Clone, Debug)]
pub(crate) struct JointSums {
    /// `Σ g gᵀ`, lower triangle, row by row.
    pub(crate) gram: Vec<f64>,
    /// `Σ g e` of each period.
    pub(crate) moments: Vec<Vec<f64>>,
    /// `Σ e²`.
    pub(crate) squares: f64,
    /// Number of samples.
    pub(crate) count: usize,
}

/// Sums of all joints over one run.
pub(crate) type RunSums = Vec<JointSums>;

/// How to simulate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Simulation {
    pub(crate) stepping: Stepping,
    pub(crate) period_s: f64,
    pub(crate) with_derivatives: bool,
}

/// Sums of each run; `None` if the simulation of one fails.
pub(crate) fn sums(varied: &VariedRobot, runs: &[Run], simulation: Simulation) -> Option<Vec<RunSums>> {
    runs.par_iter().map(|run| run_sums(varied, run, simulation)).collect()
}

fn run_sums(varied: &VariedRobot, run: &Run, simulation: Simulation) -> Option<RunSums> {
    let columns = if simulation.with_derivatives { varied.columns } else { 0 };
    let periods = period(run, simulation, run.times_s.len() - 1) + 1;
    let empty = JointSums {
        gram: vec![0.0; columns * (columns + 1) / 2],
        moments: vec![vec![0.0; columns]; periods],
        squares: 0.0,
        count: 0,
    };
    let mut joints = vec![empty; varied.robot.model.dof()];
    let rollout = Rollout::new(varied, run, simulation.stepping, simulation.with_derivatives)?;
    let ended = rollout.simulate(|predicted| {
        let error = run.positions[predicted.joint][predicted.sample] - predicted.position;
        let sums = &mut joints[predicted.joint];
        sums.squares += error * error;
        sums.count += 1;
        add_gram(&mut sums.gram, predicted.derivatives, 1.0);
        let moment = &mut sums.moments[period(run, simulation, predicted.sample)];
        for (sum, g) in moment.iter_mut().zip(predicted.derivatives) {
            *sum += g * error;
        }
    });
    let finite = joints.iter().all(|sums| sums.squares.is_finite());
    (ended && finite).then_some(joints)
}

/// Sums of one period over all joints, with a weight of each joint.
#[derive(Clone, Debug)]
pub(crate) struct PeriodSums {
    /// `Σ w g gᵀ`, lower triangle, row by row.
    pub(crate) gram: Vec<f64>,
    /// `Σ w g e`.
    pub(crate) moment: Vec<f64>,
}

/// Sums of each period of all runs; `None` if the simulation of one fails.
pub(crate) fn period_sums(
    varied: &VariedRobot,
    runs: &[Run],
    simulation: Simulation,
    weights: &[f64],
) -> Option<Vec<PeriodSums>> {
    let of_run = |run: &Run| {
        let columns = varied.columns;
        let empty = PeriodSums { gram: vec![0.0; columns * (columns + 1) / 2], moment: vec![0.0; columns] };
        let mut periods = vec![empty; period(run, simulation, run.times_s.len() - 1) + 1];
        let rollout = Rollout::new(varied, run, simulation.stepping, true)?;
        let ended = rollout.simulate(|predicted| {
            let weight = weights[predicted.joint];
            let error = run.positions[predicted.joint][predicted.sample] - predicted.position;
            let sums = &mut periods[period(run, simulation, predicted.sample)];
            add_gram(&mut sums.gram, predicted.derivatives, weight);
            for (sum, g) in sums.moment.iter_mut().zip(predicted.derivatives) {
                *sum += weight * g * error;
            }
        });
        ended.then_some(periods)
    };
    let all: Option<Vec<Vec<PeriodSums>>> = runs.par_iter().map(of_run).collect();
    Some(all?.into_iter().flatten().collect())
}

/// Period of a sample.
fn period(run: &Run, simulation: Simulation, sample: usize) -> usize {
    ((run.times_s[sample] - run.times_s[0]) / simulation.period_s) as usize
}

/// Adds `weight g gᵀ` to a lower triangle.
fn add_gram(gram: &mut [f64], derivatives: &[f64], weight: f64) {
    let mut at = 0;
    for (row, &g) in derivatives.iter().enumerate() {
        if g != 0.0 {
            for (sum, other) in gram[at..=at + row].iter_mut().zip(derivatives) {
                *sum += weight * g * other;
            }
        }
        at += row + 1;
    }
}

/// The symmetric matrix of a lower triangle, row by row.
pub(crate) fn symmetric(triangle: &[f64], columns: usize) -> nalgebra::DMatrix<f64> {
    nalgebra::DMatrix::from_fn(columns, columns, |row, column| {
        let (low, high) = (row.min(column), row.max(column));
        triangle[high * (high + 1) / 2 + low]
    })
}

/// Sums of one joint over all runs.
#[derive(Clone, Debug)]
pub(crate) struct JointTotal {
    /// `Σ g gᵀ`.
    pub(crate) gram: nalgebra::DMatrix<f64>,
    /// `Σ g e` of each period of each run.
    pub(crate) moments: Vec<nalgebra::DVector<f64>>,
    /// `Σ e²`.
    pub(crate) squares: f64,
    /// Number of samples.
    pub(crate) count: f64,
}

/// Sums of each joint over all runs.
pub(crate) fn totals(runs: &[RunSums]) -> Vec<JointTotal> {
    let columns = runs[0][0].moments[0].len();
    (0..runs[0].len())
        .map(|joint| {
            let own = || runs.iter().map(move |run| &run[joint]);
            let mut gram = vec![0.0; runs[0][joint].gram.len()];
            for sums in own() {
                gram.iter_mut().zip(&sums.gram).for_each(|(total, part)| *total += part);
            }
            JointTotal {
                gram: symmetric(&gram, columns),
                moments: own()
                    .flat_map(|sums| &sums.moments)
                    .map(|moment| nalgebra::DVector::from_column_slice(moment))
                    .collect(),
                squares: own().map(|sums| sums.squares).sum(),
                count: own().map(|sums| sums.count as f64).sum(),
            }
        })
        .collect()
}
