//! Resting joints with encoder noise: noise is not treated as excitation.

use crate::common::{Job, Motion, Random, Truth, header, repository};
use dynident::IdentificationOutcome;
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::{Model, load_robot, read_urdf};
use dynident::result::BaseParameterResult;
use std::fmt::Write;
use std::path::Path;

/// Sample rate, Hz, and duration, s.
const CLOCK: (f64, f64) = (125.0, 20.0);
const DOF: usize = 6;
/// Torque noise of every joint, Nm.
const TORQUE_NOISE: f64 = 0.2;
/// Excited base parameters per number of moving joints (in the order of [`moving`]): the rank of the regressor without
/// noise, and gravity at one posture without motion.
const EXCITED: [usize; DOF + 1] = [6, 26, 46, 48, 50, 52, 54];
/// Posture of the resting joints.
const POSTURE: [f64; DOF] = [0.4, -0.9, 1.1, 0.3, -0.7, 0.2];

/// A log in which only the joints `moving` move.
fn log(path: &Path, truth: &Truth, moving: &[usize], position_noise: f64, seed: u64) {
    let (mut workspace, mut random) = (Workspace::new(&truth.model), Random(seed));
    let (motion, mut text) = (Motion::new(DOF, seed), format!("{}\n", header(DOF)));
    for k in 0..(CLOCK.0 * CLOCK.1) as usize {
        let t = k as f64 / CLOCK.0;
        let [mut q, mut dq, mut ddq] = motion.at(t);
        for joint in (0..DOF).filter(|joint| !moving.contains(joint)) {
            (q[joint], dq[joint], ddq[joint]) = (POSTURE[joint], 0.0, 0.0);
        }
        let tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        write!(text, "{t}").unwrap();
        for q in &q {
            write!(text, ",{}", q + position_noise * random.normal()).unwrap();
        }
        for tau in &tau {
            write!(text, ",{}", tau + TORQUE_NOISE * random.normal()).unwrap();
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

fn job(folder: &Path) -> Job {
    let robot = repository("robots/ur10.urdf").display().to_string();
    let text = format!(
        "robot.file = {robot:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\n[format]\ntime = {{ column = \"t\" }}\n\
         position = {{ columns = \"q{{1..{DOF}}}\" }}\ntorque = {{ columns = \"tau{{1..{DOF}}}\" }}\n"
    );
    Job::new(folder, &text)
}

/// Root mean square torque error of a URDF on a motion of all joints, relative to the torque noise.
fn held_out(model: &Model, truth: &Truth) -> f64 {
    let (mut workspace, mut of_truth) = (Workspace::new(model), Workspace::new(&truth.model));
    let motion = Motion::new(DOF, 99);
    let mut squares = 0.0;
    let samples = 500;
    for k in 0..samples {
        let [q, dq, ddq] = motion.at(0.04 * k as f64);
        let tau = truth.torque(&mut of_truth, &q, &dq, &ddq);
        let bodies = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq).to_vec();
        for joint in 0..DOF {
            let own = &model.joints()[joint];
            let drag = own.damping.unwrap_or(0.0) * dq[joint] + own.friction.unwrap_or(0.0) * (dq[joint] / 0.02).tanh();
            squares += (tau[joint] - bodies[joint] - drag).powi(2);
        }
    }
    (squares / (samples * DOF) as f64).sqrt()
}

/// Result of one log with the truth.
struct Cell {
    found: IdentificationOutcome,
    expected: Vec<f64>,
    /// Torque error of the nominal and written URDF on a motion of all joints, Nm.
    held_out: [f64; 2],
}

impl Cell {
    /// A UR10 with moving joints `moving` and this encoder noise; masses up to 30 % from the description.
    fn new(noise: f64, moving: &[usize]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let description = repository("robots/ur10.urdf");
        let truth = Truth::other(&description, &mut Random(3));
        log(&folder.path().join("log.csv"), &truth, moving, noise, 11);
        let job = job(folder.path());
        let found = job.identify();
        let expected = truth.base_values(&job.robot());
        let nominal = load_robot(&description).unwrap().model;
        let written = read_urdf(found.urdf.as_ref().unwrap()).unwrap().model;
        let held_out = [&nominal, &written].map(|model| held_out(model, &truth));
        Self { found, expected, held_out }
    }

    fn excited(&self) -> usize {
        self.found.result.base_parameters.iter().filter(|parameter| parameter.excited).count()
    }

    /// Excess distance of each estimate from the truth over that of the nominal value, in half-widths of its 99 %
    /// interval.
    fn harm(&self) -> Vec<f64> {
        let of = |(parameter, truth): (&BaseParameterResult, &f64)| {
            let [now, then] = [parameter.value, parameter.prior.unwrap()].map(|value| (value - truth).abs());
            let half_width = parameter.bar_95() * 2.576 / 1.96;
            if now <= then { 0.0 } else { (now - then) / half_width }
        };
        self.found.result.base_parameters.iter().zip(&self.expected).map(of).collect()
    }
}

/// Indices of `count` moving joints, distributed over the arm.
fn moving(count: usize) -> Vec<usize> {
    (0..count).map(|place| (place * 5 + 1) % DOF).collect()
}

#[test]
fn noise_at_rest_is_no_excitation() {
    // Without noise the count is the rank from exact dependence.
    let cells: Vec<(f64, usize)> = if dynident_testing::count(1, 2) == 1 {
        vec![(1e-5, 0), (1e-4, 1), (1e-5, 6)]
    } else {
        [0.0, 1e-6, 1e-5, 1e-4, 1e-3].into_iter().flat_map(|noise| (0..=DOF).map(move |count| (noise, count))).collect()
    };
    for (noise, count) in cells {
        let cell = Cell::new(noise, &moving(count));
        let place = format!("noise {noise:e}, {count} joints moving");
        let result = &cell.found.result;
        let status = if count == DOF { "complete" } else { "not-all-excited" };
        assert_eq!(result.method.status, status, "{place}");
        assert_eq!(cell.excited(), EXCITED[count], "{place}: {:?}", result.method.not_excited);
        // At most 1 % is outside of a 99 % interval: one of 54, and none far outside.
        let harm = cell.harm();
        let outside = harm.iter().filter(|harm| **harm > 1.0).count();
        assert!(outside <= 1 && harm.iter().all(|harm| *harm < 2.0), "{place}: {harm:?}");
        let [nominal, written] = cell.held_out;
        assert!(written <= nominal.hypot(TORQUE_NOISE), "{place}: {written} instead of {nominal} Nm");
        let hanging = result.base_parameters.iter().filter(|parameter| !parameter.conditional_on.is_empty()).count();
        assert_eq!(hanging == 0, count == DOF, "{place}: {hanging} estimates depend on nominal values");
        let rests = result.method.resting_joints.len();
        assert_eq!(rests, DOF - count, "{place}: {:?}", result.method.resting_joints);
    }
}
