//! Sums over the samples of each time period, which a step of the search needs.

use crate::parameters::VariedRobot;
use crate::rollout::Rollout;
use crate::run::Run;
use crate::step_state::Stepping;
use dynident_lanes::{Kernel, Lane, Level, dispatch_single};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Division of all runs into time periods, numbered run after run.
#[derive(Clone, Debug)]
pub(crate) struct Periods {
    length_s: f64,
    /// Index of the first period of each run; the last entry is the number of all periods.
    firsts: Vec<usize>,
}

impl Periods {
    pub(crate) fn new(runs: &[Run], length_s: f64) -> Self {
        let own = |run: &Run| ((run.times_s[run.times_s.len() - 1] - run.times_s[0]) / length_s) as usize + 1;
        let mut firsts = vec![0];
        for run in runs {
            firsts.push(firsts[firsts.len() - 1] + own(run));
        }
        Self { length_s, firsts }
    }

    /// Length of a period, s.
    pub(crate) fn length_s(&self) -> f64 {
        self.length_s
    }

    /// Number of periods of a run.
    fn of_run(&self, run: usize) -> usize {
        self.firsts[run + 1] - self.firsts[run]
    }

    /// Index of the period of a sample, counted from the first period of its run.
    fn at(&self, run: &Run, sample: usize) -> usize {
        ((run.times_s[sample] - run.times_s[0]) / self.length_s) as usize
    }

    /// Run of a period, and the start of the period, s after the first time stamp of the run.
    pub(crate) fn place(&self, period: usize) -> (usize, f64) {
        let run = self.firsts.partition_point(|first| *first <= period) - 1;
        (run, (period - self.firsts[run]) as f64 * self.length_s)
    }
}

/// Position error of one joint in one period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PeriodError {
    /// `Σ e²`, where `e` is the measured position minus the simulated one.
    pub(crate) squares: f64,
    /// Number of samples.
    pub(crate) count: f64,
}

/// Errors of each joint in each period; `None` if the simulation of a run fails.
pub(crate) fn period_errors(
    varied: &VariedRobot,
    runs: &[Run],
    stepping: Stepping,
    periods: &Periods,
) -> Option<Vec<Vec<PeriodError>>> {
    let joints = varied.robot.model.dof();
    let of_run = |(index, run): (usize, &Run)| {
        let mut errors = vec![vec![PeriodError::default(); periods.of_run(index)]; joints];
        let ended = Rollout::new(varied, run, stepping, false)?.simulate(|predicted| {
            let error = run.positions[predicted.joint][predicted.sample] - predicted.position;
            let own = &mut errors[predicted.joint][periods.at(run, predicted.sample)];
            own.squares += error * error;
            own.count += 1.0;
        });
        let finite = errors.iter().flatten().all(|own| own.squares.is_finite());
        (ended && finite).then_some(errors)
    };
    let all: Vec<Vec<Vec<PeriodError>>> = runs.par_iter().enumerate().map(of_run).collect::<Option<_>>()?;
    Some((0..joints).map(|joint| all.iter().flat_map(|run| run[joint].iter().copied()).collect()).collect())
}

/// Sums over one period. `w` are the weights of the joints, `g` the derivatives of a simulated position by the
/// coordinates, `e` the position error.
#[derive(Clone, Debug)]
pub(crate) struct PeriodSums {
    /// `Σ w g gᵀ` over all joints, lower triangle, row by row.
    pub(crate) gram: Vec<f64>,
    /// `Σ w g e` of each joint.
    pub(crate) moments: Vec<DVector<f64>>,
    /// Diagonal of `Σ w g gᵀ` of each joint.
    pub(crate) diagonals: Vec<DVector<f64>>,
}

impl PeriodSums {
    /// `Σ w g e` over all joints.
    pub(crate) fn moment(&self) -> DVector<f64> {
        self.moments.iter().sum()
    }
}

/// Sums of each period. `weights` are the weights of each joint in each period. `None` if the simulation of a run
/// fails.
pub(crate) fn period_sums(
    varied: &VariedRobot,
    runs: &[Run],
    (stepping, periods): (Stepping, &Periods),
    weights: &[Vec<f64>],
) -> Option<Vec<PeriodSums>> {
    let (columns, joints) = (varied.columns, weights.len());
    let of_run = |(index, run): (usize, &Run)| {
        let zeros = vec![DVector::zeros(columns); joints];
        let empty =
            PeriodSums { gram: vec![0.0; columns * (columns + 1) / 2], moments: zeros.clone(), diagonals: zeros };
        let mut sums = vec![empty; periods.of_run(index)];
        let ended = Rollout::new(varied, run, stepping, true)?.simulate(|predicted| {
            let joint = predicted.joint;
            let period = periods.at(run, predicted.sample);
            let weight = weights[joint][periods.firsts[index] + period];
            let error = run.positions[joint][predicted.sample] - predicted.position;
            let own = &mut sums[period];
            add_gram(&mut own.gram, predicted.derivatives, weight);
            let (moment, diagonal) = (&mut own.moments[joint], &mut own.diagonals[joint]);
            for ((moment, diagonal), g) in moment.iter_mut().zip(diagonal.iter_mut()).zip(predicted.derivatives) {
                *moment += weight * g * error;
                *diagonal += weight * g * g;
            }
        });
        ended.then_some(sums)
    };
    let all: Option<Vec<Vec<PeriodSums>>> = runs.par_iter().enumerate().map(of_run).collect();
    Some(all?.into_iter().flatten().collect())
}

/// Adds `weight g gᵀ` to a lower triangle.
pub(crate) fn add_gram(gram: &mut [f64], derivatives: &[f64], weight: f64) {
    dispatch_single(Level::detect(), AddGram { gram, derivatives, weight });
}

struct AddGram<'a> {
    gram: &'a mut [f64],
    derivatives: &'a [f64],
    weight: f64,
}

impl Kernel for AddGram<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let mut at = 0;
        for (row, &g) in self.derivatives.iter().enumerate() {
            if g != 0.0 {
                let own = self.weight * g;
                for (sum, other) in self.gram[at..=at + row].iter_mut().zip(self.derivatives) {
                    *sum += own * other;
                }
            }
            at += row + 1;
        }
    }
}

/// The symmetric matrix whose lower triangle is given row by row.
pub(crate) fn symmetric(triangle: &[f64], columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(columns, columns, |row, column| {
        let (low, high) = (row.min(column), row.max(column));
        triangle[high * (high + 1) / 2 + low]
    })
}

/// `Σ w g gᵀ` over all periods.
pub(crate) fn total_gram(periods: &[PeriodSums], columns: usize) -> DMatrix<f64> {
    let mut gram = vec![0.0; columns * (columns + 1) / 2];
    for own in periods {
        gram.iter_mut().zip(&own.gram).for_each(|(total, part)| *total += part);
    }
    symmetric(&gram, columns)
}
