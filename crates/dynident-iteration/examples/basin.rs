//! Basin of attraction of the iteration: random planar arms, first controllers and torque limits; from how many starts
//! does it find the arm? Compares the paper's literal scheme with the default scheme.
//!
//! ```text
//! cargo run --release -p dynident-iteration --example basin [ARMS] [FIRST_SEED]
//! ```

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use dynident_dynamics::ParametricModel;
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::families::{SplicedLogisticSettings, Step, StepWiseLogistic};
use dynident_iteration::{
    Iteration, IterationOutcome, IterationSettings, IterationStatus, IterationTask, Leg, iterate,
};
use dynident_iteration::{Robot, SimulatedRobot};
use dynident_model::sample::{Random, planar_2r};
use dynident_model::{InertialParameters, Mat3, Model, Vec3};
use dynident_simulation::controllers::{FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{ControllerSettings, Integrator, LoopSettings, Plant, Reference, RunLimits};
use std::error::Error;

/// The best stroke within the paper's limits (18), and its window.
const STROKE: [f64; 2] = [1.991, 1.046];
const DELTA_S: f64 = 5.74;
const RATE_HZ: f64 = 100.0;
const RUNS: usize = 10;
/// Largest error of a base parameter, as a share of the largest parameter, for which an arm is found.
const FOUND: f64 = 0.01;

struct Start {
    arm: Model,
    model_free: ControllerSettings,
    controller: ControllerSettings,
    torque: Vec<f64>,
    /// Whether a perfect controller can run the trajectory within the torque limits.
    feasible: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    Found,
    Refused,
    Lost,
}

/// Windows of each joint: from, to; s.
type Windows = Vec<Vec<[f64; 2]>>;

type Scheme = fn(&Start) -> Result<(Verdict, usize), Box<dyn Error>>;

fn reference(order: &[usize]) -> Result<(Reference, Windows), Box<dyn Error>> {
    let period_s = 40.0 / STROKE[1];
    let steps: Vec<Step> = order.iter().map(|&joint| Step { joint, period_s }).collect();
    let family = StepWiseLogistic::new(&[0.0; 2], &steps, &SplicedLogisticSettings::default())?;
    let parameters: Vec<f64> = order.iter().flat_map(|_| STROKE).collect();
    let mut windows = vec![Vec::new(); 2];
    for (place, &joint) in order.iter().enumerate() {
        for middle in [0.25, 0.75] {
            let centre = (place as f64 + middle) * period_s;
            windows[joint].push([centre - DELTA_S, centre + DELTA_S]);
        }
    }
    Ok((Reference::of_family(&family, &parameters, RATE_HZ, None)?, windows))
}

fn start(seed: u64) -> Result<Start, Box<dyn Error>> {
    let mut random = Random::new(seed);
    // A rod-like link: mass, centre of mass along it with a small offset, moments of a thick rod.
    let mut body = |length: f64| {
        let mass = random.uniform(0.3, 5.0);
        let com = Vec3([random.uniform(0.2, 0.9) * length, random.uniform(-0.1, 0.1) * length, 0.0]);
        let moment = mass * length * length * random.uniform(0.02, 0.1);
        let inertia = Mat3([[0.2 * moment, 0.0, 0.0], [0.0, moment, 0.0], [0.0, 0.0, moment]]);
        InertialParameters::from_centre_of_mass(mass, com, &inertia)
    };
    let (first, second) = (body(1.0), body(0.8));
    let arm = planar_2r(random.uniform(0.4, 1.2), first, second);
    let mut wide = |low: f64, high: f64| low * (high / low).powf(random.uniform(0.0, 1.0));
    let model_free = JointPdSettings {
        kp: vec![wide(3.0, 300.0), wide(1.0, 100.0)].into(),
        kd: vec![wide(3.0, 100.0), wide(1.0, 30.0)].into(),
    };
    let controller =
        FiniteTimeSettings::with_gains(vec![wide(2.0, 20.0), wide(2.0, 20.0)], vec![wide(4.0, 20.0), wide(4.0, 20.0)]);
    // Torque of the trajectory for the true model, and limits around it.
    let (path, _) = reference(&[1, 0])?;
    let motion = path.motion();
    let mut workspace = Workspace::new(&arm);
    let mut peak = [0.0_f64; 2];
    for sample in 0..motion.samples {
        let at = |values: &[f64]| [values[sample], values[motion.samples + sample]];
        let tau = inverse_dynamics(&arm, &mut workspace, &at(&motion.q), &at(&motion.dq), &at(&motion.ddq));
        peak.iter_mut().zip(tau).for_each(|(peak, tau)| *peak = peak.max(tau.abs()));
    }
    let torque: Vec<f64> = peak.iter().map(|peak| peak * wide(0.9, 4.0)).collect();
    let feasible = peak.iter().zip(&torque).all(|(peak, limit)| peak <= limit);
    Ok(Start {
        arm,
        model_free: ControllerSettings::JointPd(model_free),
        controller: ControllerSettings::FiniteTime(controller),
        torque,
        feasible,
    })
}

fn simulated(start: &Start, locked: Option<usize>) -> Result<SimulatedRobot, Box<dyn Error>> {
    let mut plant = Plant::new(&start.arm, &[], &[])?;
    if let Some(joint) = locked {
        plant = plant.with_locked(&[start.arm.joints()[joint].name.clone()])?;
    }
    let limits = RunLimits { torque: Some(start.torque.clone().into()), ..RunLimits::default() };
    let settings =
        LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 1 }, limits, ..LoopSettings::default() };
    Ok(SimulatedRobot::new(plant, settings)?)
}

fn verdict(start: &Start, outcome: &IterationOutcome, robot: &ParametricModel) -> Verdict {
    if matches!(outcome.status, IterationStatus::Refused { .. }) {
        return Verdict::Refused;
    }
    let truth = robot.base().values(&start.arm.parameter_vector());
    let largest = truth.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let last = outcome.runs.last().and_then(|run| run.estimate.as_ref());
    let found = last.is_some_and(|estimate| {
        estimate.values.iter().zip(&truth).all(|(value, truth)| (value - truth).abs() <= FOUND * largest)
    });
    if found { Verdict::Found } else { Verdict::Lost }
}

fn with_controllers(start: &Start, settings: IterationSettings) -> IterationSettings {
    let (model_free, controller) = (start.model_free.clone(), start.controller.clone());
    IterationSettings { model_free, controller, max_runs: RUNS, ..settings }
}

/// All joints in one trajectory, physically consistent models, rejection.
fn ours(start: &Start) -> Result<(Verdict, usize), Box<dyn Error>> {
    // The bodies are unknown.
    let robot = ParametricModel::new(start.arm.clone(), Vec::new())?.with_nominal(vec![0.0; 20])?;
    let (path, windows) = reference(&[1, 0])?;
    let legs = vec![Leg::windowed(path, windows)?];
    let torque_limits = Some(start.torque.clone());
    let task = IterationTask { robot: robot.clone(), legs, known: Vec::new(), torque_limits };
    let mut settings = with_controllers(start, IterationSettings::default());
    // Torque limits act like noise in the fit; the test is whether the arm is found.
    settings.settled.parameter_tolerance = 1e-3;
    let iteration = Iteration::new(task, settings)?;
    let mut driven = simulated(start, None)?;
    let outcome = iterate(&iteration, &mut [&mut driven], None, &mut |_, _| {})?;
    Ok((verdict(start, &outcome, &robot), outcome.runs.len()))
}

/// Joint 2 with joint 1 locked, joint 1 with joint 2 locked; the map; every estimate directly in the controller.
fn literal(start: &Start) -> Result<(Verdict, usize), Box<dyn Error>> {
    let robot = ParametricModel::new(start.arm.clone(), Vec::new())?.with_nominal(vec![0.0; 20])?;
    let mut legs = Vec::new();
    for joint in [1, 0] {
        let (path, windows) = reference(&[joint])?;
        legs.push(Leg::windowed(path, windows)?);
    }
    let task = IterationTask { robot: robot.clone(), legs, known: Vec::new(), torque_limits: None };
    let mut settings = with_controllers(start, IterationSettings::literal(0.5));
    // It uses all its runs, because its error bars do not include the bias of the map.
    settings.settled.parameter_sigmas = 0.0;
    let iteration = Iteration::new(task, settings)?;
    let (mut second, mut first) = (simulated(start, Some(0))?, simulated(start, Some(1))?);
    let robots: &mut [&mut dyn Robot] = &mut [&mut second, &mut first];
    let outcome = iterate(&iteration, robots, None, &mut |_, _| {})?;
    Ok((verdict(start, &outcome, &robot), outcome.runs.len()))
}

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let (arms, first) = (numbers.first().copied().unwrap_or(1000), numbers.get(1).copied().unwrap_or(1));
    let schemes: [(&str, Scheme); 2] = [("ours", ours), ("literal", literal)];
    // Scheme, start feasible or not: found, refused, lost.
    let mut counts = [[[0_usize; 3]; 2]; 2];
    let mut runs = [0_usize; 2];
    for seed in first..first + arms {
        let start = start(seed)?;
        for (place, (name, scheme)) in schemes.iter().enumerate() {
            let (verdict, made) = scheme(&start)?;
            let outcome = match verdict {
                Verdict::Found => 0,
                Verdict::Refused => 1,
                Verdict::Lost => 2,
            };
            counts[place][usize::from(!start.feasible)][outcome] += 1;
            runs[place] += made;
            if start.feasible && verdict != Verdict::Found && place == 0 {
                println!("{name}: seed {seed} was not found");
            }
        }
    }
    println!("| scheme | torque limits | starts | found | refused | lost | runs on average |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (place, (name, _)) in schemes.iter().enumerate() {
        for (row, [found, refused, lost]) in counts[place].iter().enumerate() {
            let limits = ["suffice", "too low"][row];
            let all = found + refused + lost;
            println!(
                "| {name} | {limits} | {all} | {found} | {refused} | {lost} | {:.1} |",
                runs[place] as f64 / arms as f64
            );
        }
    }
    Ok(())
}
