//! Settings of a fit.

use crate::error::ServoError;
use serde::{Deserialize, Serialize};

/// Settings of a fit to commands and positions. Standard deviations describe the knowledge before the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ServoSettings {
    /// Time step of the simulation, s. The search begins with a time step that is four times longer. Default 0.0025.
    pub step_s: f64,
    /// Physics step of the simulator for which `export` estimates the error of its files, s. Default 0.005, the step of
    /// many tasks of Isaac Lab.
    pub physics_step_s: f64,
    /// Maximum number of steps of the search. Default 60; fits of an SO-101 need about 10.
    pub iterations: usize,
    /// Decrease of the cost in one step below which the search ends. The cost is minus twice the log-likelihood, so
    /// random errors change it by about 1 for each parameter. Default 0.1.
    pub tolerance: f64,
    /// Length of the time periods whose errors are treated as independent for the error bars, s. Default 2: model
    /// errors of an SO-101 are correlated for up to 1 s.
    pub period_s: f64,
    /// Degrees of freedom ν of the error variance of a period. It controls how strongly periods with large errors are
    /// down-weighted: with large values, all periods have the same weight. Default 30: a period with ten times the
    /// usual error has about 3 % of the weight of others, so a contact or an unmodelled effect hardly changes the fit.
    /// With 4 to 10, fits of an SO-101 ignored one joint in a complete log. With 30, the first quarter of each training
    /// log gave the same values for this joint as the complete logs.
    pub period_freedom: f64,
    /// Minimum standard deviation of a measured position, rad (m). Default 0.00044: an encoder with 4,096 counts.
    pub least_error: f64,
    /// Whether all joints have the same type of servo. If true, the joints share common values, and each joint may
    /// deviate from them. If false (default), each joint has separate values.
    pub alike: bool,
    /// Relative standard deviation of each joint's stiffness, damping and armature from the common value. Default 0.1:
    /// servos of one type differ by a few per cent in gain and motor constant.
    pub deviation: f64,
    /// Relative standard deviation of each joint's friction (Coulomb friction, friction per load, additional friction
    /// at rest) from the common value. Default 1: gears of one type differ by their wear and by the preload of their
    /// bearings.
    pub friction_deviation: f64,
    /// Relative standard deviation of each joint's torque limit from the common value. Default 1: firmware limits the
    /// torque of some joints, for example of a gripper.
    pub torque_limit_deviation: f64,
    /// Relative standard deviation of a stated acceleration or speed limit of the set point. Default 0.1: the register
    /// values are known, but their unit is often not exact.
    pub profile: f64,
    /// Whether load-dependent friction and additional friction at rest are unknowns of the fit. Default true; a value
    /// that the motion does not require becomes small.
    pub load_friction: bool,
    /// Relative standard deviation of each mass. Default 0.3, as for logs with torque.
    pub mass: f64,
    /// Standard deviation of each coordinate of a centre of mass, relative to the reach of the robot. Default 0.05.
    pub centre: f64,
    /// Standard deviation of each joint's zero position, rad (m). Default 0: the zeros are known. A wrong zero has
    /// almost the same effect as a moved centre of mass.
    pub zero: f64,
    /// Standard deviation of the delay from a command to its effect, s. Default 0.03.
    pub delay_s: f64,
    /// Standard deviation of the differences between the times at which the joints' positions are read, s. Default
    /// 0.005: servos on one bus are read one after another.
    pub read_delay_s: f64,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            step_s: 0.0025,
            physics_step_s: 0.005,
            iterations: 60,
            tolerance: 0.1,
            period_s: 2.0,
            period_freedom: 30.0,
            least_error: 4.4e-4,
            alike: false,
            deviation: 0.1,
            friction_deviation: 1.0,
            torque_limit_deviation: 1.0,
            profile: 0.1,
            load_friction: true,
            mass: 0.3,
            centre: 0.05,
            zero: 0.0,
            delay_s: 0.03,
            read_delay_s: 0.005,
        }
    }
}

/// Minimum time step, s: with shorter steps, a simulation takes minutes.
const LEAST_STEP_S: f64 = 1e-4;
/// Maximum time step, s: the response time of a servo.
const LONGEST_STEP_S: f64 = 0.05;

impl ServoSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// A value that is not positive or not a number, or a time step outside the range of 0.1 to 50 ms.
    pub fn validate(&self) -> Result<(), ServoError> {
        for (setting, value) in [("step_s", self.step_s), ("physics_step_s", self.physics_step_s)] {
            if !(LEAST_STEP_S..=LONGEST_STEP_S).contains(&value) {
                return Err(ServoError::Setting { setting, value });
            }
        }
        let positive = [
            ("tolerance", self.tolerance),
            ("period_s", self.period_s),
            ("period_freedom", self.period_freedom),
            ("least_error", self.least_error),
            ("deviation", self.deviation),
            ("friction_deviation", self.friction_deviation),
            ("torque_limit_deviation", self.torque_limit_deviation),
            ("profile", self.profile),
            ("mass", self.mass),
            ("centre", self.centre),
            ("delay_s", self.delay_s),
            ("read_delay_s", self.read_delay_s),
        ];
        if !self.zero.is_finite() || self.zero < 0.0 {
            return Err(ServoError::Setting { setting: "zero", value: self.zero });
        }
        match positive.into_iter().find(|(_, value)| !value.is_finite() || *value <= 0.0) {
            Some((setting, value)) => Err(ServoError::Setting { setting, value }),
            None => Ok(()),
        }
    }
}
