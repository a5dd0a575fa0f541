//! The next motion designed with what is known: bars, forecasts, limits, and the same again after a stop.

use crate::simulated_arm::{RATE_HZ, Simulated, described, reference, settings};
use dynident_excitation::criteria::DOptimal;
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{JointLimit, LimitSet, Limits};
use dynident_excitation::{DesignSettings, DesignTask, Family, design};
use dynident_iteration::{
    Iteration, IterationOutcome, IterationSettings, IterationStore, IterationTask, Leg, Redesign, RedesignSettings,
    RunEstimate, SimulatedRobot, iterate,
};
use dynident_model::sample::Random;
use dynident_simulation::controllers::ControllerModel;
use dynident_simulation::{Reference, SensorSettings};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::sync::Arc;

const DURATION_S: f64 = 20.0;

/// The largest torque of each joint, Nm.
const TORQUE_NM: [f64; 2] = [60.0, 25.0];

fn family() -> Box<dyn Family> {
    let settings = FourierSettings { harmonics: 4, ..FourierSettings::default() };
    Box::new(Fourier::new(2, DURATION_S, &settings).unwrap())
}

fn limits() -> Limits {
    let names = described().joint_names();
    let of_joint = |(joint, torque): (&String, f64)| JointLimit {
        joint: joint.clone(),
        position: Some([-2.0, 2.0]),
        speed: Some(2.0),
        acceleration: Some(6.0),
        torque: Some(torque),
        ..JointLimit::default()
    };
    Limits { joints: names.iter().zip(TORQUE_NM).map(of_joint).collect(), ..Limits::default() }
}

fn search() -> DesignSettings {
    DesignSettings { starts: Some(3), rounds: Some(1), evaluations_per_start: Some(300), ..DesignSettings::default() }
}

/// The D-optimal motion by the description: what a study begins with.
fn first_motion() -> Reference {
    let (robot, family, mut limits) = (described(), family(), limits());
    // Room for friction and for what the description does not know.
    limits.joints.iter_mut().for_each(|joint| joint.torque_margin = 0.3);
    let task = DesignTask {
        family: &*family,
        criteria: &[&DOptimal],
        limits: &LimitSet::new(&limits, robot.model()).unwrap(),
        layout: robot.layout(),
        torque_std_nm: &[0.05, 0.05],
        prior: None,
    };
    let found = design(&task, &search(), |_| core::ops::ControlFlow::Continue(())).unwrap();
    Reference::of_family(&*family, &found.parameters, RATE_HZ, None).unwrap()
}

fn iteration(first: &Reference, redesigned: bool, settings: IterationSettings) -> Iteration {
    let task = IterationTask::new(described(), first.clone()).unwrap();
    let leg = Leg::whole(first.clone()).unwrap();
    let iteration = Iteration::new(task, settings).unwrap();
    if !redesigned {
        return iteration;
    }
    let planner = Redesign::new(family(), limits(), search(), RedesignSettings::default(), &leg).unwrap();
    iteration.with_planner(Arc::new(planner))
}

/// So many runs whatever they show.
fn runs(count: usize) -> IterationSettings {
    let mut settings = settings();
    settings.settled.parameter_sigmas = 0.0;
    settings.settled.parameter_tolerance = 0.0;
    settings.max_runs = count;
    settings
}

fn run(iteration: &Iteration, robot: &mut SimulatedRobot, store: Option<&IterationStore>) -> IterationOutcome {
    iterate(iteration, &mut [robot], store, &mut |_, _| {}).unwrap()
}

fn robot(seed: u64) -> SimulatedRobot {
    let sensors = SensorSettings { seed, ..Simulated::default().sensors };
    Simulated { sensors, ..Simulated::default() }.robot()
}

fn covariance(estimate: &RunEstimate) -> DMatrix<f64> {
    let count = estimate.covariance.len();
    DMatrix::from_fn(count, count, |row, column| estimate.covariance[row][column])
}

/// The bars of an estimate along the axes of another's ellipsoid, each parameter in units of the other's bar, worst
/// first: an oracle beside the forecast's own directions, from covariances alone.
fn bars_along(axes: &RunEstimate, of: &RunEstimate) -> Vec<f64> {
    let scaled = |covariance: DMatrix<f64>| {
        let unit = |k: usize| axes.std[k];
        DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| covariance[(i, j)] / (unit(i) * unit(j)))
    };
    let eigen = SymmetricEigen::new(scaled(covariance(axes)));
    let of = scaled(covariance(of));
    let mut order: Vec<usize> = (0..of.nrows()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let bar = |&k: &usize| {
        let axis: DVector<f64> = eigen.eigenvectors.column(k).into_owned();
        (&of * &axis).dot(&axis).sqrt()
    };
    order.iter().take(10).map(bar).collect()
}

fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp()
}

#[test]
fn trial() {
    let first = reference();
    for seed in 1..=3 {
        let mut repeated = Vec::new();
        for redesigned in [false, true] {
            let iteration = iteration(&first, redesigned, runs(3));
            let outcome = run(&iteration, &mut robot(seed), None);
            let one = outcome.runs[0].estimate.as_ref().unwrap();
            for record in &outcome.runs {
                println!(
                    "seed {seed} run {} accepted {} {:?} track {:?}",
                    record.run, record.accepted, record.reason, record.max_tracking_error_rad
                );
                let known = record.knowledge().unwrap();
                let (a, b) = (bars_along(one, one), bars_along(one, known));
                if !redesigned {
                    repeated.push(known.clone());
                } else {
                    let (x, y) = (
                        bars_along(&repeated[record.run - 1], &repeated[record.run - 1]),
                        bars_along(&repeated[record.run - 1], known),
                    );
                    println!(
                        "  against repeated: rms {:.3} gm {:.3}",
                        (y.iter().map(|x| x * x).sum::<f64>() / x.iter().map(|x| x * x).sum::<f64>()).sqrt(),
                        geometric_mean(&y) / geometric_mean(&x)
                    );
                    let s: Vec<f64> = known.std.iter().zip(&repeated[record.run - 1].std).map(|(a, b)| a / b).collect();
                    println!("  std {s:.2?}");
                }
                let q: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b / a).collect();
                let rms = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
                println!("  gm {:.3} rms {:.3} {q:.2?}", geometric_mean(&q), rms(&b) / rms(&a));
                if let Some(f) = &record.forecast {
                    println!(
                        "  forecast {} {:?} gain {:.1} repeat {:.1} reached {:?} torque {:.1?}",
                        f.redesigned,
                        f.reason,
                        f.gain_percent,
                        f.repeat_gain_percent,
                        f.reached_gain_percent(known),
                        f.largest_torque
                    );
                    let r: Vec<f64> = f.std.iter().zip(&known.std).map(|(f, s)| s / f.unwrap()).collect();
                    println!("  std reached/forecast {r:.2?}");
                }
            }
        }
    }
}
