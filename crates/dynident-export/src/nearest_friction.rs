//! Approximation of a friction law by that of a simulator, `τ = c sign(q̇) + d q̇`.

use crate::drive_torque::{own_friction, own_friction_terms};
use crate::recorded_velocity::RecordedVelocity;
use crate::robot_model::RobotModel;

/// Number of equally spaced velocities for the fit if no motion was recorded; enough to represent the shape of a
/// friction law.
const SPEED_COUNT: u32 = 200;

/// Velocity range of the fit for joints without a velocity limit, rad/s or m/s.
const DEFAULT_MAX_SPEED: f64 = 1.0;

/// Velocities at which the simulator's friction is fitted to the identified friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparedOver {
    /// The velocities of the recorded motion.
    RecordedMotion,
    /// Equally spaced velocities up to the joint's limit, if no motion of the joint was recorded.
    VelocityLimit,
}

/// Coulomb and viscous friction that approximate the law of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestFriction {
    /// Coulomb friction `c`, Nm (N), nonnegative.
    pub coulomb: f64,
    /// Viscous friction `d`, Nm s/rad (N s/m), nonnegative.
    pub viscous: f64,
    /// Which velocities were used for the fit.
    pub over: ComparedOver,
    /// Largest velocity of the fit, rad/s (m/s): that of the recorded motion, otherwise the joint's limit, or 1
    /// without a limit.
    pub most_speed: f64,
    /// Root mean square of the difference of torques over these velocities, Nm (N).
    pub rms_error: f64,
    /// Largest difference of torques over these velocities, Nm (N).
    pub most_error: f64,
}

/// Sensitivity of the fitted friction to the value of a term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TermSensitivity {
    /// Index of the term among the robot's terms.
    pub term: usize,
    /// `∂c/∂value`; zero if c is at its bound zero.
    pub coulomb: f64,
    /// `∂d/∂value`; zero if d is at its bound zero.
    pub viscous: f64,
}

impl NearestFriction {
    /// No friction: for a mimic joint, which has no drive.
    pub(crate) const NONE: Self = Self {
        coulomb: 0.0,
        viscous: 0.0,
        over: ComparedOver::VelocityLimit,
        most_speed: 0.0,
        rms_error: 0.0,
        most_error: 0.0,
    };

    /// Fits the friction by weighted least squares over the joint's recorded velocities. If none were recorded, it
    /// uses equally spaced velocities from minus to plus the joint's limit, except zero. Both values are nonnegative.
    /// The identified law consists of friction and offset of the joint. With symmetric velocities, its even part (an
    /// offset or a difference between directions) does not influence the fit and is included in the error.
    ///
    /// # Panics
    /// If the model does not have the joint.
    pub fn of(robot: &RobotModel, joint: usize) -> Self {
        let (over, samples) = velocities(robot, joint);
        let law: Vec<f64> = samples.iter().map(|one| own_friction(robot, joint, one.velocity)).collect();
        let fit = Fit::of(&samples, &law);
        let (coulomb, viscous) = fit.values(&samples, &law);
        let left = |one: &RecordedVelocity, tau: f64| tau - coulomb * one.velocity.signum() - viscous * one.velocity;
        let errors: Vec<f64> = samples.iter().zip(&law).map(|(one, &tau)| left(one, tau)).collect();
        let square: f64 = samples.iter().zip(&errors).map(|(one, error)| one.samples * error * error).sum();
        let count: f64 = samples.iter().map(|one| one.samples).sum();
        Self {
            coulomb,
            viscous,
            over,
            most_speed: samples.iter().map(|one| one.velocity.abs()).fold(0.0, f64::max),
            rms_error: (square / count).sqrt(),
            most_error: errors.iter().map(|error| error.abs()).fold(0.0, f64::max),
        }
    }

    /// Sensitivities of the fitted friction of a joint to the values of its terms. The dependence is linear as long
    /// as the same bounds are active.
    ///
    /// # Panics
    /// If the model does not have the joint.
    pub fn shares(robot: &RobotModel, joint: usize) -> Vec<TermSensitivity> {
        let (_, samples) = velocities(robot, joint);
        let law: Vec<f64> = samples.iter().map(|one| own_friction(robot, joint, one.velocity)).collect();
        let fit = Fit::of(&samples, &law);
        let share = |term: usize| {
            let unit = samples.iter().map(|one| own_friction_terms(robot, joint, one.velocity, Some(term)));
            let (coulomb, viscous) = fit.values(&samples, &unit.collect::<Vec<_>>());
            TermSensitivity { term, coulomb, viscous }
        };
        let terms = robot.terms().enumerate();
        let own = terms.filter(|(_, (term, _))| term.own_joint() == Some(joint) && !term.is_drive_inertia());
        own.map(|(term, _)| share(term)).collect()
    }
}

fn velocities(robot: &RobotModel, joint: usize) -> (ComparedOver, Vec<RecordedVelocity>) {
    if let Some(recorded) = robot.recorded_velocities(joint) {
        return (ComparedOver::RecordedMotion, recorded.to_vec());
    }
    let limit = robot.model().joints()[joint].limits.velocity;
    let most = limit.filter(|speed| speed.is_finite() && *speed > 0.0).unwrap_or(DEFAULT_MAX_SPEED);
    let speeds = (1..=SPEED_COUNT).map(|k| most * f64::from(k) / f64::from(SPEED_COUNT));
    let even = speeds.flat_map(|dq| [dq, -dq]).map(|velocity| RecordedVelocity { velocity, samples: 1.0 });
    (ComparedOver::VelocityLimit, even.collect())
}

/// Which of the two values are free in the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fit {
    Both,
    CoulombOnly,
    ViscousOnly,
    Neither,
}

/// If the determinant of the normal equations, relative to `Σw Σw q̇²`, is below this, only one speed was recorded.
/// Coulomb and viscous friction cannot be distinguished then.
const MIN_DETERMINANT_RATIO: f64 = 1e-9;

/// The sums `Σw`, `Σw |q̇|`, `Σw q̇²`, `Σw sign(q̇) τ` and `Σw q̇ τ` over samples with weight w.
fn sums(samples: &[RecordedVelocity], tau: &[f64]) -> [f64; 5] {
    let mut sums = [0.0; 5];
    for (one, tau) in samples.iter().zip(tau) {
        let (weight, dq) = (one.samples, one.velocity);
        let added = [weight, weight * dq.abs(), weight * dq * dq, weight * dq.signum() * tau, weight * dq * tau];
        for (sum, added) in sums.iter_mut().zip(added) {
            *sum += added;
        }
    }
    sums
}

impl Fit {
    fn of(samples: &[RecordedVelocity], tau: &[f64]) -> Self {
        let [count, size, square, by_sign, by_speed] = sums(samples, tau);
        if count * square - size * size <= MIN_DETERMINANT_RATIO * count * square {
            return if by_sign > 0.0 { Self::CoulombOnly } else { Self::Neither };
        }
        // On the boundary one value is zero, and the other is the least-squares estimate without the first.
        match Self::Both.values(samples, tau) {
            (coulomb, viscous) if coulomb >= 0.0 && viscous >= 0.0 => Self::Both,
            (coulomb, _) if coulomb < 0.0 && by_speed > 0.0 => Self::ViscousOnly,
            (coulomb, _) if coulomb >= 0.0 && by_sign > 0.0 => Self::CoulombOnly,
            _ => Self::Neither,
        }
    }

    fn values(self, samples: &[RecordedVelocity], tau: &[f64]) -> (f64, f64) {
        let [count, size, square, by_sign, by_speed] = sums(samples, tau);
        match self {
            Self::Both => {
                let determinant = count * square - size * size;
                let coulomb = (by_sign * square - by_speed * size) / determinant;
                (coulomb, (by_speed * count - by_sign * size) / determinant)
            }
            Self::CoulombOnly => (by_sign / count, 0.0),
            Self::ViscousOnly => (0.0, by_speed / square),
            Self::Neither => (0.0, 0.0),
        }
    }
}
