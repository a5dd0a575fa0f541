//! `iterate`: the same runs, choices and status, with scaled parameters and error bars.

use super::{AS_IT_IS, Differences, Scale, binary_scales};
use crate::common::{Job, Motion, repository};
use core::fmt::Write;
use core::ops::ControlFlow;
use dynident::{IterationWatch, IterationsFile, iterate_study};

const RATE_HZ: f64 = 500.0;
const SECONDS: f64 = 4.0;

/// The commanded motion, as `design` writes it.
fn trajectory(scale: Scale) -> String {
    let motion = Motion::new(2, 3);
    let mut text = "t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned();
    for sample in 0..=(RATE_HZ * SECONDS) as usize {
        let t = sample as f64 / RATE_HZ;
        write!(text, "\n{:e}", t * scale.time).unwrap();
        for (order, values) in motion.at(t).iter().enumerate() {
            for x in values {
                write!(text, ",{:e}", x / scale.time.powi(order as i32)).unwrap();
            }
        }
    }
    text + "\n"
}

/// Three runs of the planar arm with friction, body errors of 20 % and noise in all sensors; the controller uses the
/// model of earlier runs.
fn iterated(scale: Scale) -> IterationsFile {
    let folder = tempfile::tempdir().unwrap();
    let arm = std::fs::read_to_string(repository("robots/planar2r.urdf")).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), scale.urdf(&arm)).unwrap();
    std::fs::write(folder.path().join("trajectory.csv"), trajectory(scale)).unwrap();
    let (torque, damping) = (scale.torque(), scale.torque() * scale.time);
    let list = |values: [f64; 2], unit: f64| format!("[{:e}, {:e}]", values[0] * unit, values[1] * unit);
    let study = format!(
        r#"
        [robot]
        {}
        [drive]
        friction = "stated"
        [controller]
        kind = "computed-torque"
        kp = {:e}
        kd = {:e}
        [simulation]
        rate_hz = {:e}
        integrator = {{ kind = "rk4" }}
        off_percent = 20.0
        effort_limits = false
        viscous = {}
        coulomb = {}
        sensors = {{ position_std = 3e-5, torque_std = {:e}, seed = 5 }}
        [iteration]
        trajectory = "trajectory.csv"
        model_free = {{ kind = "joint-pd", kp = {}, kd = {} }}
        max_runs = 3
        differentiator = {{ method = "butterworth", cutoff_hz = {:e} }}
        "#,
        scale.robot("arm.urdf"),
        100.0 / scale.time.powi(2),
        20.0 / scale.time,
        RATE_HZ / scale.time,
        list([0.5, 0.5], damping),
        list([0.8, 0.5], torque),
        0.1 * torque,
        list([1500.0, 250.0], torque),
        list([100.0, 8.0], damping),
        30.0 / scale.time,
    );
    let job = Job::new(folder.path(), &study);
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    iterate_study(&job.study, &job.path, &folder.path().join("out"), true, &Job::options(2), &mut watch).unwrap()
}

/// Relative tolerance of simulation and solvers.
const TOLERANCE: f64 = 1e-6;

fn compare(scale: Scale, found: &IterationsFile, expected: &IterationsFile) -> Vec<String> {
    let mut differences = Differences::new(scale);
    differences.equal("status", &found.status, &expected.status);
    differences.equal("runs", &found.runs.len(), &expected.runs.len());
    let unmet = |file: &IterationsFile| -> Vec<_> {
        file.unmet.iter().map(|unmet| core::mem::discriminant(&unmet.shortfall)).collect()
    };
    differences.equal("unmet", &unmet(found), &unmet(expected));
    for (found, expected) in found.runs.iter().zip(&expected.runs) {
        let choices = |run: &dynident::result::IterationRun| {
            (run.controller.clone(), run.accepted, run.model_of_run, run.outcome.clone(), run.damping, run.stiffness)
        };
        differences.equal("choices", &choices(found), &choices(expected));
        for (found, expected) in found.max_tracking_error_rad.iter().zip(&expected.max_tracking_error_rad) {
            differences.compare("tracking", *found, *expected, TOLERANCE * expected);
        }
        let parameters = found.parameters.iter().zip(&expected.parameters);
        for (found, expected) in parameters.chain(found.pooled.iter().zip(&expected.pooled)) {
            let factor = scale.of(&expected.unit);
            let (std, of) = (expected.std.unwrap(), &expected.symbol);
            differences.equal("symbol", &found.symbol, of);
            differences.compare(of, found.value / factor, expected.value, TOLERANCE * (expected.value.abs() + std));
            differences.compare(of, found.std.unwrap() / factor, std, TOLERANCE * std);
        }
    }
    let ratio = |file: &IterationsFile| file.error_over_bound.unwrap();
    differences.compare("error over bound", ratio(found), ratio(expected), TOLERANCE * ratio(expected));
    differences.found
}

#[test]
fn a_crane_and_a_watch_learn_alike() {
    let expected = iterated(AS_IT_IS);
    let all: Vec<String> =
        binary_scales().into_iter().flat_map(|scale| compare(scale, &iterated(scale), &expected)).collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}
