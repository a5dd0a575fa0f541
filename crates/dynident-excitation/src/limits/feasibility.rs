//! Infeasibility that is detected before a search: a start outside the limits, or a duration that is too short for
//! any motion.

use super::description::Limits;
use super::error::LimitError;
use super::numbers::{finite, positive};
use super::set::LimitSet;
use crate::motion::Motion;
use dynident_model::Model;

/// Tolerance for rounding errors of a start exactly on a limit.
const START_TOLERANCE: f64 = 1e-9;

impl Limits {
    /// Checks that the robot can rest at `q` (rad or m) within the limits of position, places, distances, and torque
    /// (gravity).
    ///
    /// # Errors
    /// Errors of [`validate`](Limits::validate); the first limit that the posture violates; a wrong length or a value
    /// that is not finite.
    pub fn check_start(&self, model: &Model, q: &[f64]) -> Result<(), LimitError> {
        let set = LimitSet::new(self, model)?;
        if q.len() != model.dof() {
            return Err(LimitError::Length { what: "start posture", expected: model.dof(), found: q.len() });
        }
        for (joint, &q) in model.joints().iter().zip(q) {
            finite(&format!("start of joint `{}`", joint.name), q)?;
        }
        let mut rest = Motion::default();
        rest.reset(model.dof(), 1);
        rest.q.copy_from_slice(q);
        let mut values = Vec::new();
        set.values(&mut set.workspace(), &rest, &mut values);
        let broken = set.constraints().iter().zip(&values).find(|(_, c)| **c > START_TOLERANCE);
        broken.map_or(Ok(()), |(constraint, &c)| {
            Err(LimitError::StartOutside {
                kind: constraint.kind,
                subject: constraint.subject.clone(),
                amount: super::diagnose::amount(constraint, c),
            })
        })
    }

    /// Checks that every joint can move by `displacement` (rad or m, less if its range is smaller) from rest to rest
    /// within `duration_s`, by its velocity, acceleration and jerk limits.
    ///
    /// # Errors
    /// Errors of [`validate`](Limits::validate); the slowest joint, if it needs longer; a duration or displacement that
    /// is not finite and positive.
    pub fn check_duration(&self, model: &Model, duration_s: f64, displacement: f64) -> Result<(), LimitError> {
        self.validate(model)?;
        positive("duration", duration_s)?;
        positive("displacement", displacement)?;
        let mut slowest: Option<(f64, f64, &str)> = None;
        for limit in &self.joints {
            let reach = limit.position.map_or(f64::INFINITY, |[lower, upper]| upper - lower).min(displacement);
            let shortest_s = shortest_duration_s(reach, limit.speed, limit.acceleration, limit.jerk);
            if slowest.is_none_or(|(worst, _, _)| shortest_s > worst) {
                slowest = Some((shortest_s, reach, &limit.joint));
            }
        }
        match slowest {
            Some((shortest_s, displacement, joint)) if shortest_s > duration_s => {
                Err(LimitError::TooShort { joint: joint.to_owned(), duration_s, displacement, shortest_s })
            }
            _ => Ok(()),
        }
    }
}

/// Shortest duration, s, from rest to rest over `displacement` (rad or m, not negative) within the given velocity,
/// acceleration and jerk limits; `None` means no limit.
///
/// Double-S profile (Biagiotti and Melchiorri, *Trajectory Planning for Automatic Machines and Robots* (2008),
/// section 3.4, rest at both ends); a trapezoidal profile without a jerk limit. Zero if there are no limits.
fn shortest_duration_s(displacement: f64, speed: Option<f64>, acceleration: Option<f64>, jerk: Option<f64>) -> f64 {
    let d = displacement;
    if d <= 0.0 {
        return 0.0;
    }
    // Time from rest to velocity v by acceleration and jerk.
    let ramp = |v: f64| match (acceleration, jerk) {
        (Some(a), Some(j)) if v * j >= a * a => a / j + v / a,
        (_, Some(j)) => 2.0 * (v / j).sqrt(),
        (Some(a), None) => v / a,
        (None, None) => 0.0,
    };
    // Two ramps without constant velocity between them cover v · ramp(v).
    if let Some(v) = speed
        && v * ramp(v) <= d
    {
        return d / v + ramp(v);
    }
    match (acceleration, jerk) {
        (Some(a), Some(j)) if d * j * j >= 2.0 * a * a * a => {
            let jerking = a / j;
            jerking + (jerking * jerking + 4.0 * d / a).sqrt()
        }
        (_, Some(j)) => 4.0 * (d / (2.0 * j)).cbrt(),
        (Some(a), None) => 2.0 * (d / a).sqrt(),
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::shortest_duration_s;

    /// Bang-bang jerk, integrated: distance, peak velocity and peak acceleration of a symmetric profile with these ramp
    /// times.
    fn profile(jerk: f64, jerking: f64, steady: f64, cruise: f64) -> (f64, f64, f64) {
        let phases = [
            (jerk, jerking),
            (0.0, steady),
            (-jerk, jerking),
            (0.0, cruise),
            (-jerk, jerking),
            (0.0, steady),
            (jerk, jerking),
        ];
        let (mut x, mut v, mut a, mut top_v, mut top_a) = (0.0, 0.0, 0.0, 0.0_f64, 0.0_f64);
        for (j, t) in phases {
            x += v * t + a * t * t / 2.0 + j * t * t * t / 6.0;
            v += a * t + j * t * t / 2.0;
            a += j * t;
            (top_v, top_a) = (top_v.max(v), top_a.max(a));
        }
        assert!(v.abs() < 1e-9 && a.abs() < 1e-9);
        (x, top_v, top_a)
    }

    #[test]
    fn each_regime_is_the_integrated_bang_bang_profile() {
        for (jerking, steady, cruise) in [(0.2, 0.3, 0.5), (0.4, 0.0, 0.7), (0.3, 0.6, 0.0), (0.5, 0.0, 0.0)] {
            let (distance, speed, acceleration) = profile(7.0, jerking, steady, cruise);
            let duration = 4.0 * jerking + 2.0 * steady + cruise;
            // A limit that the profile just reaches, or does not reach, must result in its duration.
            let speed_limit = if cruise > 0.0 { speed } else { 2.0 * speed };
            let acceleration_limit = if steady > 0.0 { acceleration } else { 2.0 * acceleration };
            let found = shortest_duration_s(distance, Some(speed_limit), Some(acceleration_limit), Some(7.0));
            assert!((found - duration).abs() < 1e-12, "{found} {duration}");
        }
    }

    #[test]
    fn limits_left_out_do_not_limit() {
        assert_eq!(shortest_duration_s(1.0, None, None, None), 0.0);
        assert_eq!(shortest_duration_s(1.0, Some(2.0), None, None), 0.5);
        assert_eq!(shortest_duration_s(1.0, None, Some(4.0), None), 1.0);
        assert_eq!(shortest_duration_s(4.0, None, None, Some(2.0)), 4.0);
        assert_eq!(shortest_duration_s(1.0, Some(2.0), Some(4.0), None), 1.0);
        assert_eq!(shortest_duration_s(1.0, Some(1.0), Some(4.0), None), 1.25);
    }
}
