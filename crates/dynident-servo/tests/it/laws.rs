//! Drives of simulators: one servo that swings a pendulum, next to integrators of a few lines.

use dynident_model::read_urdf;
use dynident_servo::{Drive, DriveLaw, Run, ServoRobot, errors, simulate, simulate_with_law};

const MASS_KG: f64 = 0.4;
const LENGTH_M: f64 = 0.3;
const MOMENT: f64 = 0.002;
const GRAVITY: f64 = 9.81;
const LIMIT: f64 = 1.6;

/// A pendulum about a horizontal axis that hangs at position zero.
fn pendulum(drive: Drive) -> ServoRobot {
    let text = format!(
        r#"<robot name="pendulum"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -{LENGTH_M}"/><mass value="{MASS_KG}"/>
        <inertia ixx="{MOMENT}" iyy="{MOMENT}" izz="{MOMENT}" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="swing" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"#
    );
    let model = read_urdf(&text).unwrap().model;
    ServoRobot { model, drives: vec![drive], floor: None }
}

fn drive() -> Drive {
    Drive {
        stiffness: 10.0,
        damping: 0.6,
        armature: 0.02,
        coulomb: 0.15,
        load_friction: 0.0,
        stribeck: 0.0,
        stribeck_speed: 0.1,
        torque_limit: LIMIT,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: 0.0,
        read_delay_s: 0.0,
        zero: 0.0,
    }
}

/// Steps that reach the torque limit, rests, then a sine.
fn run() -> Run {
    let times_s: Vec<f64> = (0..500).map(|k| 0.02 * f64::from(k)).collect();
    let command = |t: f64| if t < 5.0 { 0.5 * (t * 0.8).floor() - 0.4 } else { 0.4 * (5.0 * (t - 5.0)).sin() + 0.3 };
    let commands: Vec<Vec<f64>> = vec![times_s.iter().map(|&t| command(t)).collect()];
    Run { name: "run".into(), positions: commands.clone(), commands, times_s, payloads: vec![], gains: vec![] }
}

/// Positions at the stamps by explicit steps of `step_s`: the controller sees the state at the beginning of each step
/// and a command that is `late` steps old; `torque` computes its torque from command, position and velocity.
fn integrated(run: &Run, step_s: f64, late: usize, torque: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
    let inertia = MOMENT + MASS_KG * LENGTH_M * LENGTH_M + drive().armature;
    let steps_per_stamp = (0.02 / step_s).round() as usize;
    let (mut q, mut v, mut positions) = (run.positions[0][0], 0.0_f64, Vec::new());
    for step in 0..run.times_s.len() * steps_per_stamp {
        if step % steps_per_stamp == 0 {
            positions.push(q);
        }
        let command = run.commands[0][step.saturating_sub(late) / steps_per_stamp];
        let weight = MASS_KG * GRAVITY * LENGTH_M * q.sin();
        let free = v + step_s * (torque(command, q, v) - weight) / inertia;
        let friction = step_s * drive().coulomb / inertia;
        v = if free.abs() <= friction { 0.0 } else { free - friction * free.signum() };
        q += step_s * v;
    }
    positions
}

fn limited(command: f64, q: f64, v: f64) -> f64 {
    (drive().stiffness * (command - q) - drive().damping * v).clamp(-LIMIT, LIMIT)
}

fn largest_difference(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Isaac Lab's explicit actuator with a delay of two steps: the integrators differ by rounding only. Sums of 2000 steps
/// with a relative error of 1e-16 are far below 1e-9 rad.
#[test]
fn an_explicit_drive_moves_as_an_integrator_with_a_delay_buffer() {
    let (step_s, late) = (0.005, 2);
    let robot = pendulum(Drive { delay_s: step_s * late as f64, ..drive() });
    let found = simulate_with_law(&robot, &run(), step_s, DriveLaw::Explicit).unwrap().unwrap();
    let expected = integrated(&run(), step_s, late, limited);
    assert!(largest_difference(&found[0], &expected) < 1e-9, "{}", largest_difference(&found[0], &expected));
    // The delay and the limit matter for this motion.
    let prompt = integrated(&run(), step_s, 0, limited);
    let unlimited = integrated(&run(), step_s, late, |c, q, v| drive().stiffness * (c - q) - drive().damping * v);
    for other in [prompt, unlimited] {
        assert!(largest_difference(&found[0], &other) > 0.01);
    }
}

/// Steps of 0.1 ms have an error of first order: the spring acts at the end of the step, 1 mrad at 10 rad/s. The
/// integrator has steps of 5 µs.
#[test]
fn an_implicit_drive_converges_to_the_same_law() {
    let found = simulate_with_law(&pendulum(drive()), &run(), 1e-4, DriveLaw::Implicit).unwrap().unwrap();
    let expected = integrated(&run(), 5e-6, 0, limited);
    assert!(largest_difference(&found[0], &expected) < 1e-3, "{}", largest_difference(&found[0], &expected));
    // With the limit on the controller alone the motion is another one.
    let identified = |c: f64, q: f64, v: f64| (drive().stiffness * (c - q)).clamp(-LIMIT, LIMIT) - drive().damping * v;
    let other = integrated(&run(), 5e-6, 0, identified);
    assert!(largest_difference(&found[0], &other) > 0.02);
    let found = simulate(&pendulum(drive()), &run(), 1e-4).unwrap().unwrap();
    assert!(largest_difference(&found[0], &other) < 1e-3, "{}", largest_difference(&found[0], &other));
}

/// One implicit step of 5 ms solved by hand: `(I / h + k h + d) v' = I v / h + k (r - q) - g(q) ∓ F` without a limit.
#[test]
fn an_implicit_step_has_the_spring_and_the_damper_at_its_end() {
    let h = 0.005;
    let free = Drive { torque_limit: f64::INFINITY, ..drive() };
    let found = simulate_with_law(&pendulum(free), &run(), h, DriveLaw::Implicit).unwrap().unwrap();
    let inertia = MOMENT + MASS_KG * LENGTH_M * LENGTH_M + free.armature;
    let (run, mut q, mut v, mut expected) = (run(), run().positions[0][0], 0.0, Vec::new());
    for step in 0..run.times_s.len() * 4 {
        if step % 4 == 0 {
            expected.push(q);
        }
        let pull =
            free.stiffness * (run.commands[0][step / 4] - q) - MASS_KG * GRAVITY * LENGTH_M * q.sin() + inertia * v / h;
        let matrix = inertia / h + free.stiffness * h + free.damping;
        v = if pull.abs() <= free.coulomb { 0.0 } else { (pull - free.coulomb * pull.signum()) / matrix };
        q += h * v;
    }
    assert!(largest_difference(&found[0], &expected) < 1e-9, "{}", largest_difference(&found[0], &expected));
}

#[test]
fn a_controller_that_is_too_stiff_for_its_step_has_no_motion_or_a_large_error() {
    // Explicit damping is unstable above 2 I / h = 24 Nm s/rad.
    let robot = pendulum(Drive { damping: 60.0, torque_limit: f64::INFINITY, ..drive() });
    let stable = simulate(&robot, &run(), 0.005).unwrap().unwrap();
    assert!(errors(&Run { positions: stable, ..run() }, &run().commands)[0] < 1.0);
    let unstable = simulate_with_law(&robot, &run(), 0.005, DriveLaw::Explicit).unwrap();
    assert!(unstable.is_none_or(|positions| errors(&run(), &positions)[0] > 10.0));
}
