//! Information of planned commands about the unknowns of a fit, from a simulation of the motion.

use crate::fit::Search;
use crate::normal::{add_gram, symmetric};
use crate::parameters::VariedRobot;
use crate::rollout::Rollout;
use crate::run::Run;
use crate::step_state::Stepping;
use nalgebra::DMatrix;

/// The simulated motion of some commands, and its information.
#[derive(Clone, Debug)]
pub(super) struct Simulated {
    /// Positions of each joint, rad (m).
    pub(super) positions: Vec<Vec<f64>>,
    /// Information matrix `Σ g gᵀ / (σ² c)` over samples and joints: g is the derivative of a position by the unknowns,
    /// σ the standard deviation of its error, c the number of samples with correlated errors.
    pub(super) information: DMatrix<f64>,
}

/// Simulates `commands` at `rate_hz`, starting at rest in `start`. `None` if the simulation diverges.
pub(super) fn simulated(
    varied: &VariedRobot,
    start: &[f64],
    commands: &[Vec<f64>],
    (rate_hz, step_s, weight): (f64, f64, f64),
) -> Option<Simulated> {
    let run = run_of(start, commands, rate_hz);
    let samples = run.times_s.len();
    let mut positions = vec![vec![0.0; samples]; start.len()];
    let columns = varied.columns;
    let mut sums = vec![0.0; columns * (columns + 1) / 2];
    let ended = Rollout::new(varied, &run, Stepping::accurate(step_s), true)?.simulate(|predicted| {
        positions[predicted.joint][predicted.sample] = predicted.position;
        add_gram(&mut sums, predicted.derivatives, weight);
    });
    let information = symmetric(&sums, columns);
    (ended && sums.iter().all(|sum| sum.is_finite())).then_some(Simulated { positions, information })
}

/// A run with these commands, which begins at rest in `start`.
fn run_of(start: &[f64], commands: &[Vec<f64>], rate_hz: f64) -> Run {
    let samples = commands.first().map_or(0, Vec::len);
    Run {
        name: "designed commands".to_owned(),
        times_s: (0..samples).map(|sample| sample as f64 / rate_hz).collect(),
        commands: commands.to_vec(),
        positions: start.iter().map(|q| vec![*q; samples]).collect(),
        payloads: Vec::new(),
        gains: Vec::new(),
    }
}

/// Logarithm of the determinant; `None` if the matrix is not positive definite.
pub(super) fn log_det(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = matrix.clone().cholesky()?;
    Some(2.0 * factor.l_dirty().diagonal().iter().map(|value| value.ln()).sum::<f64>())
}

/// Expected result of a fit to a log with this information, if the values of the robot are correct.
pub(super) fn forecast(information: &DMatrix<f64>, prior: &DMatrix<f64>) -> Option<Search> {
    let covariance = (information + prior).cholesky()?.inverse();
    Some(Search {
        coordinates: vec![0.0; covariance.nrows()],
        covariance,
        information: information.clone(),
        cost: 0.0,
        errors: Vec::new(),
        unexplained: Vec::new(),
        iterations: 0,
        settled: true,
    })
}
