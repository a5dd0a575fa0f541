//! Generates the stored example log: a simulated UR10 with known parameters follows two motions.
//!
//! ```sh
//! cargo run --release -p dynident --example simulate_ur10 -- examples/ur10_simulated
//! ```
//!
//! The true robot is `robots/ur10.urdf` with masses, centres of mass and inertias changed by 10 to 15 %, and with drive
//! inertia, viscous and Coulomb friction and a torque offset in every joint. `train.csv` and `test.csv` contain 20 s at
//! 125 Hz each: encoder positions, and torque with slightly coloured noise. `truth.json` contains the parameters. Equal
//! seeds give equal files.

use dynident_dynamics::{BatchWorkspace, all_columns, inverse_dynamics_batch};
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, JointMotion, TorqueTerm, terms_per_joint};
use dynident_model::{InertialParameters, JointLimits, Model, read_urdf};
use serde_json::json;
use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write;

const SEED: u64 = 20_261_121;
const RATE_HZ: f64 = 125.0;
const DURATION_S: f64 = 20.0;
/// The motion fades in and out over this time, so that it starts and ends at rest.
const RAMP_S: f64 = 2.0;
/// Harmonics of 0.1 Hz in every joint's motion.
const HARMONICS: usize = 6;
/// Centre of the motion, rad: upper arm raised, elbow bent.
const HOME_RAD: [f64; 6] = [0.0, -1.2, 1.1, -0.6, 0.8, 0.0];
/// Largest distance from the centre, rad, and largest fraction of the velocity limit.
const REACH_RAD: [f64; 6] = [2.4, 0.9, 1.3, 2.0, 2.0, 2.4];
const SPEED_SHARE: f64 = 0.8;
/// Velocity at which the true Coulomb friction has reached 76 %, rad/s.
const FRICTION_WIDTH: f64 = 0.01;
const ENCODER_STEP_RAD: f64 = TAU / 131_072.0;
const ENCODER_NOISE_RAD: f64 = 1e-5;
const TORQUE_NOISE_NM: [f64; 6] = [1.2, 1.5, 0.8, 0.25, 0.25, 0.2];
/// Correlation of the torque noise from sample to sample.
const TORQUE_NOISE_CORRELATION: f64 = 0.6;

/// Per joint: drive inertia (kg m²), viscous friction (Nm s/rad), Coulomb friction (Nm), offset (Nm).
const DRIVES: [[f64; 4]; 6] = [
    [2.40, 9.0, 11.0, 0.60],
    [2.50, 11.0, 13.0, -0.90],
    [1.20, 7.0, 8.0, 0.50],
    [0.35, 1.6, 2.3, 0.20],
    [0.34, 1.7, 2.4, -0.15],
    [0.30, 1.5, 2.2, 0.10],
];

/// The example's files: name and content.
///
/// # Errors
/// If the robot description in the repository cannot be read.
pub fn files() -> Result<Vec<(&'static str, String)>, Box<dyn Error>> {
    let mut random = Random::new(SEED);
    let robot = read_urdf(include_str!("../../../robots/ur10.urdf"))?.model;
    let truth = changed(&robot, &mut random)?;
    let terms = terms_per_joint(&truth, |_| DriveChoice {
        drive_inertia: true,
        viscous: true,
        coulomb: Some(CoulombShape::Smooth { width: FRICTION_WIDTH }),
        offset: true,
    });
    let drives: Vec<f64> = DRIVES.concat();
    let mut log = || csv(&truth, &terms, &drives, &mut random);
    let (train, test) = (log(), log());
    Ok(vec![("train.csv", train), ("test.csv", test), ("truth.json", truth_json(&truth, &terms, &drives)?)])
}

/// The robot with other inertials. One factor for all moments of a body keeps it physically consistent.
fn changed(robot: &Model, random: &mut Random) -> Result<Model, Box<dyn Error>> {
    let mut factor = || {
        let change = random.uniform(0.10, 0.15);
        if random.uniform(0.0, 1.0) < 0.5 { 1.0 - change } else { 1.0 + change }
    };
    let mut inertials = Vec::new();
    for body in robot.inertials() {
        let (com, inertia) = (body.com_m(), body.inertia_at_com());
        let (com, inertia) = com.zip(inertia).ok_or("a body of the UR10 has no mass")?;
        let mass_kg = body.mass_kg() * factor();
        inertials.push(InertialParameters::from_centre_of_mass(mass_kg, com.scale(factor()), &inertia.scale(factor())));
    }
    Ok(robot.with_inertials(&inertials)?)
}

/// One log: a random motion with encoder and torque sensor errors.
fn csv(truth: &Model, terms: &[TorqueTerm], drives: &[f64], random: &mut Random) -> String {
    let (dof, samples) = (truth.dof(), (DURATION_S * RATE_HZ) as usize + 1);
    let [q, dq, ddq] = motion(truth, samples, random);
    let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
    let mut tau = vec![0.0; dof * samples];
    inverse_dynamics_batch(truth, &mut BatchWorkspace::new(truth), &motion, &mut tau);
    let mut column = vec![0.0; samples];
    for (term, value) in terms.iter().zip(drives) {
        for joint in term.joints() {
            term.column(joint, &motion, &mut column);
            for (tau, column) in tau[joint * samples..].iter_mut().zip(&column) {
                *tau += value * column;
            }
        }
    }
    for (joint, std_nm) in TORQUE_NOISE_NM.iter().enumerate() {
        let mut noise = std_nm * random.normal();
        for tau in &mut tau[joint * samples..(joint + 1) * samples] {
            *tau += noise;
            let fresh = (1.0 - TORQUE_NOISE_CORRELATION.powi(2)).sqrt() * std_nm * random.normal();
            noise = TORQUE_NOISE_CORRELATION * noise + fresh;
        }
    }
    let names = |what: &str, unit: &str| -> Vec<String> { (1..=dof).map(|j| format!("{what}{j}_{unit}")).collect() };
    let mut text = format!("t_s,{},{}\n", names("q", "rad").join(","), names("tau", "Nm").join(","));
    for s in 0..samples {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", seven_digits(s as f64 / RATE_HZ));
        for joint in 0..dof {
            let seen = q[joint * samples + s] + ENCODER_NOISE_RAD * random.normal();
            let _ = write!(text, ",{}", seven_digits((seen / ENCODER_STEP_RAD).round() * ENCODER_STEP_RAD));
        }
        for joint in 0..dof {
            let _ = write!(text, ",{}", seven_digits(tau[joint * samples + s]));
        }
        text.push('\n');
    }
    text
}

/// Positions, velocities and accelerations, joint-major: a finite Fourier series about the home position with fade-in
/// and fade-out, scaled to range and velocity limit.
fn motion(model: &Model, samples: usize, random: &mut Random) -> [Vec<f64>; 3] {
    let mut out: [Vec<f64>; 3] = Default::default();
    for (joint, home) in HOME_RAD.iter().enumerate() {
        // Decreasing with frequency, so that every harmonic has the same share of the velocity.
        let coefficients: Vec<[f64; 2]> =
            (1..=HARMONICS).map(|k| [(); 2].map(|()| random.uniform(-1.0, 1.0) / k as f64)).collect();
        let shape: Vec<[f64; 3]> = (0..samples).map(|s| faded_series(&coefficients, s as f64 / RATE_HZ)).collect();
        let peak = |order: usize| shape.iter().fold(0.0_f64, |peak, values| peak.max(values[order].abs()));
        let JointLimits { velocity, .. } = model.joints()[joint].limits;
        let scale = (REACH_RAD[joint] / peak(0)).min(SPEED_SHARE * velocity.unwrap_or(f64::INFINITY) / peak(1));
        for (order, out) in out.iter_mut().enumerate() {
            let start = if order == 0 { *home } else { 0.0 };
            out.extend(shape.iter().map(|values| start + scale * values[order]));
        }
    }
    out
}

/// Value, first and second derivative of `e(t) Σ a_k sin(k ω t) + b_k cos(k ω t)`, with two periods of `ω` in the
/// duration.
fn faded_series(coefficients: &[[f64; 2]], t: f64) -> [f64; 3] {
    let mut f = [0.0; 3];
    for (k, [a, b]) in coefficients.iter().enumerate() {
        let w = (k + 1) as f64 * 2.0 * TAU / DURATION_S;
        let (sin, cos) = (w * t).sin_cos();
        f[0] += a * sin + b * cos;
        f[1] += w * (a * cos - b * sin);
        f[2] -= w * w * (a * sin + b * cos);
    }
    let e = envelope(t);
    [e[0] * f[0], e[1] * f[0] + e[0] * f[1], e[2] * f[0] + 2.0 * e[1] * f[1] + e[0] * f[2]]
}

/// From 0 to 1 and back by `10 u³ - 15 u⁴ + 6 u⁵`, with two derivatives by time.
fn envelope(t: f64) -> [f64; 3] {
    let (u, direction) = if 2.0 * t < DURATION_S { (t / RAMP_S, 1.0) } else { ((DURATION_S - t) / RAMP_S, -1.0) };
    let u = u.clamp(0.0, 1.0);
    [
        u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
        direction * 30.0 * u * u * (1.0 - u) * (1.0 - u) / RAMP_S,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (RAMP_S * RAMP_S),
    ]
}

fn truth_json(truth: &Model, terms: &[TorqueTerm], drives: &[f64]) -> Result<String, Box<dyn Error>> {
    let values = truth.parameter_vector().into_iter().chain(drives.iter().copied());
    let parameters: Vec<_> = all_columns(truth, terms)
        .iter()
        .zip(values)
        .map(|(column, value)| json!({ "symbol": column.symbol(), "value": value, "unit": column.unit() }))
        .collect();
    let truth = json!({
        "robot": "robots/ur10.urdf",
        "joints": truth.joints().iter().map(|joint| &joint.name).collect::<Vec<_>>(),
        "seed": SEED,
        "rate_hz": RATE_HZ,
        "coulomb": { "shape": "tanh(dq / width)", "width_rad_s": FRICTION_WIDTH },
        "encoder": { "step_rad": ENCODER_STEP_RAD, "noise_std_rad": ENCODER_NOISE_RAD },
        "torque_noise": { "std_nm": TORQUE_NOISE_NM, "lag_1_correlation": TORQUE_NOISE_CORRELATION },
        "parameters": parameters,
    });
    Ok(serde_json::to_string_pretty(&truth)? + "\n")
}

/// `value` rounded to seven significant digits; zero without a sign.
fn seven_digits(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value) + 0.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder to write to, as in: examples/ur10_simulated")?;
    std::fs::create_dir_all(&folder)?;
    for (name, content) in files()? {
        std::fs::write(std::path::Path::new(&folder).join(name), content)?;
    }
    Ok(())
}
