//! Piecewise quintic polynomials through waypoints.

use super::error::{FamilyError, MAX_COUNT, require, require_frame};
use super::linear::{Basis, LinearFamily};
use super::polynomials::quintic_hermite;
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

const NAME: &str = "quintic";

/// Settings of a [`Quintic`] family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct QuinticSettings {
    /// Number of waypoints, equally spaced in time, including both ends. Default 6.
    pub way_points: usize,
    /// Whether velocity and acceleration at the inner waypoints are free parameters. Default false: the motion rests at
    /// every waypoint.
    pub free_rates: bool,
    /// Whether the last waypoint equals the first. Default true.
    pub returns: bool,
}

impl Default for QuinticSettings {
    fn default() -> Self {
        Self { way_points: 6, free_rates: false, returns: true }
    }
}

impl QuinticSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// Too few waypoints (2, or 3 if the motion returns), or more than 1000.
    pub fn validate(&self) -> Result<(), FamilyError> {
        let least = if self.returns { 3 } else { 2 };
        let fix = "give 2 to 1000, and at least 3 if the motion returns to its start";
        require((least..=MAX_COUNT).contains(&self.way_points), NAME, "way_points", self.way_points as f64, fix)
    }
}

/// Quintic polynomials between waypoints at equal times, with continuous velocity and acceleration, at rest at both
/// ends.
///
/// Parameters per joint: positions of the waypoints (without the last one if the motion returns). With free rates
/// also q̇ of the inner waypoints in rad/s and q̈ in rad/s². The jerk can be discontinuous at waypoints.
///
/// # Source
/// Fifth-order polynomials between waypoints: Atkeson, An and Hollerbach, Estimation of inertial parameters of
/// manipulator loads and links, IJRR 5(3), 1986. Armstrong, IJRR 8(6), 1989, optimises the accelerations.
pub type Quintic = LinearFamily<QuinticBasis>;

/// Basis functions of a [`Quintic`] family.
#[derive(Clone, Debug)]
pub struct QuinticBasis {
    settings: QuinticSettings,
    span_s: f64,
}

impl Quintic {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; see [`QuinticSettings::validate`].
    pub fn new(joints: usize, duration_s: f64, settings: &QuinticSettings) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        settings.validate()?;
        let span_s = duration_s / (settings.way_points - 1) as f64;
        Ok(Self::of(QuinticBasis { settings: settings.clone(), span_s }, joints, duration_s))
    }
}

impl QuinticBasis {
    fn positions(&self) -> usize {
        self.settings.way_points - usize::from(self.settings.returns)
    }
}

impl Basis for QuinticBasis {
    const NAME: &'static str = NAME;

    fn columns(&self) -> usize {
        self.positions() + if self.settings.free_rates { 2 * (self.settings.way_points - 2) } else { 0 }
    }

    fn row(&self, _joint: usize, time_s: f64, out: &mut [[f64; 4]]) {
        let (points, positions) = (self.settings.way_points, self.positions());
        let piece = ((time_s / self.span_s) as usize).min(points - 2);
        let functions = quintic_hermite(time_s - piece as f64 * self.span_s, self.span_s);
        for end in 0..2 {
            let point = piece + end;
            let inner = point > 0 && point + 1 < points;
            for kind in 0..3 {
                let column = match kind {
                    0 => point % positions,
                    _ if inner && self.settings.free_rates => positions + (kind - 1) * (points - 2) + point - 1,
                    _ => continue,
                };
                for (sum, value) in out[column].iter_mut().zip(functions[3 * end + kind]) {
                    *sum += value;
                }
            }
        }
    }

    fn standing(&self) -> Vec<f64> {
        (0..self.columns()).map(|column| f64::from(u8::from(column < self.positions()))).collect()
    }

    /// Random velocities and accelerations have the size of unit moves within one span.
    fn shape(&self, random: &mut Random) -> Vec<f64> {
        let (positions, inner) = (self.positions(), self.settings.way_points - 2);
        (0..self.columns())
            .map(|column| {
                let order = if column < positions { 0 } else { 1 + (column - positions) / inner.max(1) };
                random.normal() / self.span_s.powi(order as i32)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Motion;
    use crate::families::check;
    use crate::family::Family;
    use proptest::prelude::*;

    #[test]
    fn parameter_counts_and_waypoints() {
        for (free_rates, returns, numbers) in [(false, true, 5), (false, false, 6), (true, true, 13), (true, false, 14)]
        {
            let settings = QuinticSettings { way_points: 6, free_rates, returns };
            let family = Quintic::new(2, 5.0, &settings).unwrap();
            assert_eq!(family.parameters(), 2 * numbers);
            let parameters = check::start(&family, 3);
            let times: Vec<f64> = (0..6).map(f64::from).collect();
            let mut motion = Motion::default();
            family.motion(&parameters, &times, &mut motion);
            for point in 0..6 {
                let own = &parameters[numbers..];
                let expected = own[if returns { point % 5 } else { point }];
                assert!((motion.q[6 + point] - expected).abs() < 1e-14);
                let inner = point > 0 && point < 5;
                let first_rate = if returns { 5 } else { 6 };
                let rate = |kind: usize| if free_rates && inner { own[first_rate + 4 * kind + point - 1] } else { 0.0 };
                assert!((motion.dq[6 + point] - rate(0)).abs() < 1e-14);
                assert!((motion.ddq[6 + point] - rate(1)).abs() < 1e-13);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn exact(seed in any::<u64>(), way_points in 3_usize..9, free_rates in any::<bool>(), returns in any::<bool>()) {
            let family = Quintic::new(2, 6.0, &QuinticSettings { way_points, free_rates, returns }).unwrap();
            check::derivatives(&family, seed);
            check::gradient(&family, seed);
            check::rest(&family, seed);
        }
    }
}
