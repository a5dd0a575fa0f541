//! The friction of a simulator, `τ = c sign(q̇) + d q̇`, that is nearest to a fitted law.

use crate::drive_torque::own_friction;
use crate::robot_model::RobotModel;

/// Velocities on either side of rest at which laws are compared: even steps, more than a law has bends.
const SPEEDS: u32 = 200;

/// Range of joints whose description has no velocity limit, rad/s or m/s.
const DEFAULT_SPEED: f64 = 1.0;

/// Coulomb and viscous friction of one joint in place of its law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestFriction {
    /// `c`, Nm (N), not negative.
    pub coulomb: f64,
    /// `d`, Nm s/rad (N s/m), not negative.
    pub viscous: f64,
    /// Largest velocity at which the two were compared, rad/s (m/s): the joint's limit, 1 where there is none.
    pub most_speed: f64,
    /// Root mean square of the difference over even velocities within it, Nm (N).
    pub rms_error: f64,
    /// Largest difference, Nm (N).
    pub most_error: f64,
}

impl NearestFriction {
    /// None at all: of a joint that follows others, whose drives are theirs.
    pub(crate) const NONE: Self = Self { coulomb: 0.0, viscous: 0.0, most_speed: 0.0, rms_error: 0.0, most_error: 0.0 };

    /// Least squares over even velocities from `-most_speed` to `most_speed` without rest, neither value negative; the
    /// law is the joint's own friction and offset (at equal velocities of both sides what is even in the velocity, an
    /// offset or a difference of directions, falls out of the fit and stands in the error).
    ///
    /// # Panics
    /// If the model does not have the joint.
    pub fn of(robot: &RobotModel, joint: usize) -> Self {
        let limit = robot.model().joints()[joint].limits.velocity;
        let most_speed = limit.filter(|speed| speed.is_finite() && *speed > 0.0).unwrap_or(DEFAULT_SPEED);
        let speeds = (1..=SPEEDS).map(|k| most_speed * f64::from(k) / f64::from(SPEEDS));
        let samples: Vec<(f64, f64)> =
            speeds.flat_map(|dq| [dq, -dq]).map(|dq| (dq, own_friction(robot, joint, dq))).collect();
        let sum = |value: &dyn Fn(f64, f64) -> f64| samples.iter().map(|&(dq, tau)| value(dq, tau)).sum::<f64>();
        let count = samples.len() as f64;
        let (size, square) = (sum(&|dq, _| dq.abs()), sum(&|dq, _| dq * dq));
        let (by_sign, by_speed) = (sum(&|dq, tau| dq.signum() * tau), sum(&|dq, tau| dq * tau));
        let determinant = count * square - size * size;
        let both =
            ((by_sign * square - by_speed * size) / determinant, (by_speed * count - by_sign * size) / determinant);
        // On the boundary one value is zero and the other its own least squares.
        let (coulomb, viscous) = match both {
            (coulomb, viscous) if coulomb >= 0.0 && viscous >= 0.0 => (coulomb, viscous),
            (coulomb, _) if coulomb < 0.0 => (0.0, (by_speed / square).max(0.0)),
            _ => ((by_sign / count).max(0.0), 0.0),
        };
        let left = |dq: f64, tau: f64| tau - coulomb * dq.signum() - viscous * dq;
        let rms_error = (sum(&|dq, tau| left(dq, tau).powi(2)) / count).sqrt();
        let most_error = samples.iter().map(|&(dq, tau)| left(dq, tau).abs()).fold(0.0, f64::max);
        Self { coulomb, viscous, most_speed, rms_error, most_error }
    }
}
