//! Cases of the experiment: robots × motions × friction × noise × lag, one line per case.

use crate::friction_truths::FrictionTruth;
use crate::simulated_logs::{PANDA, PLANAR, SimulatedRobot, UR10};

/// Settings of a designed motion.
#[derive(Clone, Copy, Debug)]
pub struct CaseMotion {
    /// Number of harmonics, 0.1 Hz apart.
    pub harmonics: usize,
    /// Length, s.
    pub duration_s: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
}

/// Sensor noise.
#[derive(Clone, Copy, Debug)]
pub struct CaseNoise {
    /// Standard deviation of the positions' white noise, rad.
    pub position_rad: f64,
    /// Bits of the encoder per turn; `None` for an ideal encoder.
    pub encoder_bits: Option<i32>,
    /// Standard deviation of a torque's noise relative to the RMS of the torque.
    pub torque: f64,
    /// Time in which the correlation of the torque's noise decays to 1/e, s; 0 for white noise.
    pub torque_colour_s: f64,
    /// Share of the torque samples that have an outlier of twenty standard deviations, with either sign.
    pub outlier_share: f64,
}

/// True friction of all joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaseFriction {
    /// The same law at all joints.
    All(FrictionTruth),
    /// A different law at each joint, in the order of [`FrictionTruth::ALL`].
    Mixed,
}

impl CaseFriction {
    /// Friction law of a joint.
    pub fn of(self, joint: usize) -> FrictionTruth {
        match self {
            Self::All(truth) => truth,
            Self::Mixed => FrictionTruth::ALL[joint % FrictionTruth::ALL.len()],
        }
    }

    /// Name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::All(truth) => truth.name(),
            Self::Mixed => "mixed",
        }
    }
}

/// One case: a robot and its recordings.
#[derive(Clone, Copy, Debug)]
pub struct DefaultCase {
    /// The robot.
    pub robot: SimulatedRobot,
    /// Settings of the robot's motion.
    pub motion: CaseMotion,
    /// True friction of the robot.
    pub friction: CaseFriction,
    /// Sensor noise.
    pub noise: CaseNoise,
    /// Delay of the logged torque relative to the motion, s.
    pub lag_s: f64,
}

impl DefaultCase {
    /// All settings of this case in one line: its name in messages. The seeds of its random numbers are computed from
    /// it.
    pub fn label(&self) -> String {
        let Self { robot, motion, friction, noise, lag_s } = self;
        format!(
            "{} {} harmonics {} s {} Hz {} {:e} rad {:?} bits {} torque {} s {} outliers {} s",
            robot.name,
            motion.harmonics,
            motion.duration_s,
            motion.rate_hz,
            friction.name(),
            noise.position_rad,
            noise.encoder_bits,
            noise.torque,
            noise.torque_colour_s,
            noise.outlier_share,
            lag_s
        )
    }
}

const fn motion(harmonics: usize, duration_s: f64, rate_hz: f64) -> CaseMotion {
    CaseMotion { harmonics, duration_s, rate_hz }
}

const fn noise(position_rad: f64, torque: f64, torque_colour_s: f64) -> CaseNoise {
    CaseNoise { position_rad, encoder_bits: None, torque, torque_colour_s, outlier_share: 0.0 }
}

const fn encoder(bits: i32, torque: f64, torque_colour_s: f64) -> CaseNoise {
    CaseNoise { position_rad: 0.0, encoder_bits: Some(bits), torque, torque_colour_s, outlier_share: 0.0 }
}

const fn outliers(position_rad: f64, torque: f64) -> CaseNoise {
    CaseNoise { position_rad, encoder_bits: None, torque, torque_colour_s: 0.0, outlier_share: 0.05 }
}

const fn case(
    robot: SimulatedRobot,
    motion: CaseMotion,
    friction: CaseFriction,
    noise: CaseNoise,
    lag_ms: f64,
) -> DefaultCase {
    DefaultCase { robot, motion, friction, noise, lag_s: 1e-3 * lag_ms }
}

const PLAIN: CaseFriction = CaseFriction::All(FrictionTruth::Plain);
const ASYMMETRIC: CaseFriction = CaseFriction::All(FrictionTruth::Asymmetric);
const STRIBECK: CaseFriction = CaseFriction::All(FrictionTruth::Stribeck);
const SIGMOID: CaseFriction = CaseFriction::All(FrictionTruth::Sigmoid);
const LOAD: CaseFriction = CaseFriction::All(FrictionTruth::Load);
const MIXED: CaseFriction = CaseFriction::Mixed;

/// The registry. Fast cases first, so that a short run covers all kinds.
pub const DEFAULT_CASES: &[DefaultCase] = &[
    case(PLANAR, motion(5, 10.0, 250.0), PLAIN, noise(1e-5, 0.01, 0.0), 0.0),
    case(PLANAR, motion(5, 20.0, 500.0), ASYMMETRIC, noise(1e-4, 0.02, 0.01), 2.0),
    case(PLANAR, motion(10, 30.0, 125.0), STRIBECK, encoder(14, 0.02, 0.0), 8.0),
    case(PLANAR, motion(5, 60.0, 250.0), SIGMOID, noise(1e-5, 0.03, 0.02), 0.0),
    case(PLANAR, motion(20, 10.0, 1000.0), LOAD, noise(1e-3, 0.05, 0.0), 2.0),
    case(UR10, motion(5, 10.0, 125.0), PLAIN, encoder(17, 0.01, 0.0), 0.0),
    case(UR10, motion(5, 10.0, 500.0), PLAIN, noise(1e-3, 0.01, 0.0), 8.0),
    case(UR10, motion(20, 10.0, 1000.0), PLAIN, noise(1e-5, 0.03, 0.0), 0.0),
    case(UR10, motion(10, 20.0, 250.0), PLAIN, outliers(1e-5, 0.01), 2.0),
    case(UR10, motion(5, 30.0, 500.0), ASYMMETRIC, noise(1e-5, 0.02, 0.01), 0.0),
    case(UR10, motion(20, 30.0, 250.0), ASYMMETRIC, noise(1e-4, 0.03, 0.02), 8.0),
    case(UR10, motion(5, 60.0, 125.0), ASYMMETRIC, encoder(13, 0.02, 0.0), 2.0),
    case(UR10, motion(10, 30.0, 500.0), STRIBECK, noise(1e-4, 0.02, 0.01), 2.0),
    case(UR10, motion(5, 20.0, 250.0), STRIBECK, noise(1e-5, 0.01, 0.0), 8.0),
    case(UR10, motion(5, 30.0, 250.0), SIGMOID, noise(1e-5, 0.01, 0.0), 0.0),
    case(UR10, motion(10, 60.0, 250.0), SIGMOID, noise(1e-4, 0.03, 0.02), 2.0),
    case(UR10, motion(10, 30.0, 500.0), LOAD, noise(1e-5, 0.02, 0.01), 0.0),
    case(UR10, motion(20, 60.0, 250.0), LOAD, noise(1e-4, 0.01, 0.0), 2.0),
    case(UR10, motion(10, 30.0, 250.0), MIXED, noise(1e-5, 0.02, 0.01), 8.0),
    case(UR10, motion(10, 60.0, 125.0), MIXED, encoder(17, 0.03, 0.02), 2.0),
    case(PANDA, motion(5, 10.0, 1000.0), PLAIN, noise(1e-5, 0.01, 0.0), 2.0),
    case(PANDA, motion(5, 20.0, 500.0), PLAIN, noise(1e-3, 0.02, 0.01), 0.0),
    case(PANDA, motion(20, 30.0, 250.0), PLAIN, noise(1e-4, 0.03, 0.0), 8.0),
    case(PANDA, motion(5, 30.0, 1000.0), ASYMMETRIC, noise(1e-5, 0.02, 0.01), 8.0),
    case(PANDA, motion(10, 30.0, 250.0), ASYMMETRIC, encoder(15, 0.02, 0.0), 0.0),
    case(PANDA, motion(5, 30.0, 500.0), STRIBECK, noise(1e-5, 0.02, 0.01), 2.0),
    case(PANDA, motion(20, 20.0, 500.0), STRIBECK, noise(1e-4, 0.01, 0.0), 0.0),
    case(PANDA, motion(5, 30.0, 250.0), SIGMOID, noise(1e-5, 0.02, 0.01), 8.0),
    case(PANDA, motion(10, 30.0, 500.0), LOAD, noise(1e-4, 0.02, 0.01), 2.0),
    case(PANDA, motion(10, 20.0, 500.0), LOAD, outliers(1e-5, 0.01), 0.0),
    case(PANDA, motion(10, 60.0, 250.0), MIXED, noise(1e-5, 0.03, 0.02), 2.0),
    case(PANDA, motion(5, 30.0, 500.0), MIXED, noise(3e-4, 0.02, 0.01), 8.0),
];
