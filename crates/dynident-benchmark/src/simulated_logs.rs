//! Recordings with known truth: a random Fourier motion, exact torque with friction, white noise on both.

use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_estimation::{EstimationError, TriangularFactor};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::{Family, Motion};
use dynident_identification::RegressorModel;
use dynident_identification::rows::predicted_torque;
use dynident_model::sample::Random;
use dynident_model::terms::{TermAction, TorqueTerm};
use dynident_model::{Model, read_urdf};
use dynident_recording::{JointSamples, Log, filter::cutoff};

/// Period of the Fourier motion, s.
pub(crate) const PERIOD_S: f64 = 10.0;
/// Limits of position and speed for joints with wider or no limits.
const MAX_POSITION_RAD: f64 = 3.0;
const MAX_SPEED_RAD_S: f64 = 2.0;
/// Viscous and Coulomb friction at RMS velocity, and offsets, relative to the RMS torque of the bodies;
/// load-dependent friction is relative to the transmitted torque.
const VISCOUS_SHARE: f64 = 0.15;
const COULOMB_SHARE: f64 = 0.15;
const OFFSET_SHARE: f64 = 0.03;
/// Smallest value used for that RMS torque, Nm, because joints without torque of the bodies also have friction.
const MIN_TORQUE_NM: f64 = 0.5;

/// A robot of the tables.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedRobot {
    /// Name for tables.
    pub name: &'static str,
    urdf: &'static str,
}

/// Universal Robots UR10.
pub(crate) const UR10: SimulatedRobot = SimulatedRobot { name: "UR10", urdf: include_str!("../robots/ur10.urdf") };
/// Two links in a vertical plane.
pub(crate) const PLANAR: SimulatedRobot =
    SimulatedRobot { name: "planar 2R", urdf: include_str!("../robots/planar2r.urdf") };
/// Franka Panda without its hand.
pub(crate) const PANDA: SimulatedRobot =
    SimulatedRobot { name: "Panda", urdf: include_str!("../robots/panda_arm7.urdf") };

impl SimulatedRobot {
    pub(crate) fn model(&self) -> Result<Model, String> {
        Ok(read_urdf(self.urdf).map_err(|source| source.to_string())?.model)
    }
}

/// Settings of a recording.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedLog {
    /// Number of harmonics, 0.1 Hz apart.
    pub harmonics: usize,
    /// Length, s.
    pub duration_s: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Standard deviation of the positions' white noise, rad.
    pub position_noise_rad: f64,
    /// Standard deviation of a torque's white noise relative to the RMS of the torque.
    pub torque_noise: f64,
}

/// A random Fourier motion with `harmonics` harmonics within the position and speed limits of the robot.
pub(crate) fn excitation(
    model: &Model,
    harmonics: usize,
    duration_s: f64,
    rate_hz: f64,
    seed: u64,
) -> Result<Motion, String> {
    let (family, parameters) = random_series(model, harmonics, &mut Random::new(seed))?;
    Ok(sampled(&family, &parameters, duration_s, rate_hz, 0.0))
}

/// A Fourier series with `harmonics` harmonics, and random parameters with which it keeps the position and speed
/// limits of the robot.
pub(crate) fn random_series(
    model: &Model,
    harmonics: usize,
    random: &mut Random,
) -> Result<(Fourier, Vec<f64>), String> {
    let settings = FourierSettings { harmonics, ..FourierSettings::default() };
    let family = Fourier::new(model.dof(), PERIOD_S, &settings).map_err(|source| source.to_string())?;
    let limits = || model.joints().iter().map(|joint| joint.limits);
    let ranges: Vec<[f64; 2]> = limits()
        .map(|limits| {
            [
                limits.lower.unwrap_or(-MAX_POSITION_RAD).max(-MAX_POSITION_RAD),
                limits.upper.unwrap_or(MAX_POSITION_RAD).min(MAX_POSITION_RAD),
            ]
        })
        .collect();
    let speeds: Vec<f64> =
        limits().map(|limits| limits.velocity.unwrap_or(MAX_SPEED_RAD_S).min(MAX_SPEED_RAD_S)).collect();
    let parameters = family.random(&ranges, &speeds, random);
    Ok((family, parameters))
}

/// A motion at a constant rate, delayed by `late_s`, and repeated before and after its period.
pub(crate) fn sampled(family: &Fourier, parameters: &[f64], duration_s: f64, rate_hz: f64, late_s: f64) -> Motion {
    let samples = 0..=(duration_s * rate_hz) as usize;
    // A trajectory family is at rest outside its duration.
    let phase_s = |sample: usize| (sample as f64 / rate_hz - late_s).rem_euclid(family.duration_s());
    let times: Vec<f64> = samples.map(phase_s).collect();
    let mut motion = Motion::default();
    family.motion(parameters, &times, &mut motion);
    motion
}

/// Parameters of the bodies in the robot description, with friction and offsets relative to the torque of the bodies;
/// `share` scales each term.
pub(crate) fn truth(regressor: &RegressorModel, motion: &Motion, share: impl Fn(&TorqueTerm) -> f64) -> Vec<f64> {
    let mut parameters = regressor.model().parameter_vector();
    let first = parameters.len();
    parameters.resize(first + regressor.terms().len(), 0.0);
    let bodies = torque(regressor, motion, &regressor.base().values(&parameters));
    let value = |term: &TorqueTerm| {
        let own = motion.of(term.joints()[0]);
        let torque = rms(&bodies[own.clone()]).max(MIN_TORQUE_NM);
        let usual = match term.action() {
            _ if term.needs_load() => 1.0,
            TermAction::Damping { .. } => VISCOUS_SHARE * torque / rms(&motion.dq[own]),
            TermAction::Friction(_) => COULOMB_SHARE * torque,
            _ => OFFSET_SHARE * torque,
        };
        usual * share(term)
    };
    for (parameter, term) in parameters[first..].iter_mut().zip(regressor.terms()) {
        *parameter = value(term);
    }
    regressor.base().values(&parameters)
}

/// Simulated encoder and torque signals of a motion with this torque (joint by joint), and the cut-off from the
/// position spectra, Hz.
pub(crate) fn recording(
    made: &SimulatedLog,
    model: &Model,
    motion: &Motion,
    exact: &[f64],
    seed: u64,
) -> Result<(Log, f64), String> {
    let mut random = Random::new(seed);
    let mut noisy = |values: &[f64], sigma: f64| -> Vec<f64> {
        values.iter().map(|value| value + sigma * random.normal()).collect()
    };
    let joints = 0..model.dof();
    let q: Vec<Vec<f64>> =
        joints.clone().map(|joint| noisy(&motion.q[motion.of(joint)], made.position_noise_rad)).collect();
    let tau: Vec<Vec<f64>> = joints
        .map(|joint| {
            let own = &exact[motion.of(joint)];
            noisy(own, made.torque_noise * rms(own))
        })
        .collect();
    let asked_hz = cutoff(&q, made.rate_hz).cutoff_hz;
    let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let log = JointSamples::at_rate(made.rate_hz, q, tau).into_log("run", &names);
    log.map(|log| (log, asked_hz)).map_err(|source| source.to_string())
}

/// Error of a torque, relative to the standard deviation of the exact torque of each joint, RMS over joints. Torques
/// are stored joint by joint.
pub(crate) fn model_error(motion: &Motion, exact: &[f64], found: &[f64]) -> f64 {
    let dof = exact.len() / motion.samples;
    let joints = (0..dof).map(|joint| {
        let own = &exact[motion.of(joint)];
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let spread = rms(&own.iter().map(|tau| tau - mean).collect::<Vec<_>>());
        let error: Vec<f64> = own.iter().zip(&found[motion.of(joint)]).map(|(exact, found)| found - exact).collect();
        (rms(&error) / spread).powi(2)
    });
    (joints.sum::<f64>() / dof as f64).sqrt()
}

/// Torque from base parameters on a motion, stored joint by joint.
pub(crate) fn torque(regressor: &RegressorModel, motion: &Motion, theta: &[f64]) -> Vec<f64> {
    let panels = panels(regressor, motion);
    let layout = regressor.layout();
    let (mut all, mut own) = (Vec::with_capacity(motion.q.len()), Vec::new());
    for joint in 0..regressor.dof() {
        predicted_torque(panels.joint(joint), motion.samples, layout.joint_columns(joint), theta, &mut own);
        all.extend_from_slice(&own);
    }
    all
}

/// Residual norm of the best fit of a model to each joint's exact torque along a motion, Nm.
pub(crate) fn unexplained_torque(
    regressor: &RegressorModel,
    motion: &Motion,
    exact: &[f64],
) -> Result<Vec<f64>, EstimationError> {
    let panels = panels(regressor, motion);
    let of_joint = |joint: usize| {
        let columns = regressor.layout().joint_columns(joint).len();
        let mut factor = TriangularFactor::new(columns);
        let rows = [&panels.joint(joint)[..columns * motion.samples], &exact[motion.of(joint)]].concat();
        factor.absorb(&rows, motion.samples)?;
        Ok(factor.entry(columns, columns).abs())
    };
    (0..regressor.dof()).map(of_joint).collect()
}

pub(crate) fn panels(regressor: &RegressorModel, motion: &Motion) -> Panels {
    let (mut panels, mut workspace) = (Panels::default(), BatchWorkspace::new(regressor.model()));
    let mut history = TermHistory::new(regressor.load_parameters.clone());
    let (model, layout) = (regressor.model(), regressor.layout());
    regressor_panels_following(model, &mut workspace, layout, &motion.view(), &mut history, &mut panels);
    panels
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recordings longer than one period must not be at rest after the first period.
    #[test]
    fn motions_repeat_during_the_recording() {
        let model = PLANAR.model().unwrap();
        let (family, parameters) = random_series(&model, 5, &mut Random::new(1)).unwrap();
        let (rate_hz, late_s) = (100.0, 0.008);
        let long = sampled(&family, &parameters, 3.0 * PERIOD_S, rate_hz, 0.0);
        let late = sampled(&family, &parameters, PERIOD_S, rate_hz, late_s);
        let period = (PERIOD_S * rate_hz) as usize;
        for joint in 0..model.dof() {
            let (dq, late) = (&long.dq[long.of(joint)], &late.dq[late.of(joint)]);
            assert!(rms(&dq[..period]) > 0.1);
            for k in 0..2 * period {
                // Rounding of the time.
                assert!((dq[k] - dq[k + period]).abs() < 1e-9, "joint {joint}, sample {k}");
            }
            // A delayed motion begins in the middle of its period.
            assert!((late[0] - late[period]).abs() < 1e-9 && late[0] != 0.0);
        }
    }
}
