//! Finite-time controller of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* ("the
//! paper" below): computed torque with fractional powers of the errors.

use super::{Controller, ControllerModel, FrictionCompensation, Measured, Target};
use crate::error::{SimulationError, require};
use crate::per_joint::PerJoint;
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "finite-time";
pub(super) const LITERAL_NAME: &str = "finite-time-literal";

/// Gains of [`FiniteTime`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FiniteTimeSettings {
    /// Gain K_p of the power α₁ of the position error. The paper uses 2 and 4.
    pub kp: PerJoint,
    /// Gain K_d of the power α₂ of the velocity error. The paper uses 20 and 4.
    pub kd: PerJoint,
    /// Exponent α₁, above 0 and at most 1 (1 is computed torque); default 0.7. `α₂ = 2 α₁/(1 + α₁)`.
    #[serde(default = "alpha_1")]
    pub alpha: f64,
    /// Position error below which the power is replaced by a line, rad (m); default 1e-3. Zero disables the line.
    #[serde(default = "blend")]
    pub blend_position: f64,
    /// Velocity error below which the power is replaced by a line, rad/s (m/s); default 1e-2.
    #[serde(default = "blend_speed")]
    pub blend_speed: f64,
    /// Velocity at which the friction of the model is compensated; default the velocity of the reference.
    #[serde(default)]
    pub friction: FrictionCompensation,
}

fn alpha_1() -> f64 {
    0.7
}

fn blend() -> f64 {
    1e-3
}

fn blend_speed() -> f64 {
    1e-2
}

impl FiniteTimeSettings {
    /// Creates settings with these gains and default values otherwise.
    pub fn with_gains(kp: impl Into<PerJoint>, kd: impl Into<PerJoint>) -> Self {
        Self {
            kp: kp.into(),
            kd: kd.into(),
            alpha: alpha_1(),
            blend_position: blend(),
            blend_speed: blend_speed(),
            friction: FrictionCompensation::default(),
        }
    }

    /// Checks the settings for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length, α₁ outside (0, 1], a linear range that is
    /// negative or not finite.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.kp.gains("kp", joints)?;
        self.kd.gains("kd", joints)?;
        require(self.alpha > 0.0 && self.alpha <= 1.0, "alpha", self.alpha, "give more than 0, at most 1")?;
        for (what, value) in [("blend_position", self.blend_position), ("blend_speed", self.blend_speed)] {
            require(value >= 0.0 && value.is_finite(), what, value, "give zero or a finite positive number")?;
        }
        Ok(())
    }
}

/// `τ = M̂(q)(q̈_d + K_p Sig(e)^α₁ + K_d Sig(ė)^α₂) + Ĉ q̇ + ĝ`, `Sig(x)^α = |x|^α sign(x)`, `e = q_d - q`.
///
/// This is Eq. 23 of the paper (*Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*)
/// with two corrected signs and `α₂ = 2 α₁/(1 + α₁)`, which is misprinted there. With the printed signs and `e =
/// q_d - q` the feedback is positive (see [`literal`](Self::literal)). With an exact model in continuous time the
/// errors vanish in finite time (Su and Zheng, RCIM 27 (2011) 550; Bhat and Bernstein 2000).
///
/// The gain `K_p |e|^(α-1)` is infinite at zero error, so that a sampled controller ends in a limit cycle of about
/// `(K_p dt²)^(1/(1-α₁))`. Inside `|x| < ε` the power is therefore replaced by the line `ε^(α-1) x`, which is
/// continuous at ε and as stiff as the power there.
#[derive(Clone, Debug)]
pub struct FiniteTime {
    model: ControllerModel,
    gains: [Vec<f64>; 2],
    powers: [Power; 2],
    sign: f64,
    friction: FrictionCompensation,
    acceleration: Vec<f64>,
}

/// `Sig(x)^α`, with a line near zero.
#[derive(Clone, Copy, Debug)]
struct Power {
    alpha: f64,
    blend: f64,
    slope: f64,
}

impl Power {
    fn new(alpha: f64, blend: f64) -> Self {
        // At α = 1 the line equals the power; a linear range of zero is never used.
        Self { alpha, blend, slope: if blend > 0.0 { blend.powf(alpha - 1.0) } else { 0.0 } }
    }

    fn of(self, x: f64) -> f64 {
        if x.abs() < self.blend { self.slope * x } else { x.signum() * x.abs().powf(self.alpha) }
    }
}

impl FiniteTime {
    /// Creates the controller with a model.
    ///
    /// # Errors
    /// Errors of [`FiniteTimeSettings::validate`].
    pub fn new(model: ControllerModel, settings: &FiniteTimeSettings) -> Result<Self, SimulationError> {
        let joints = model.dof();
        settings.validate(joints)?;
        let alpha_2 = 2.0 * settings.alpha / (1.0 + settings.alpha);
        Ok(Self {
            gains: [settings.kp.gains("kp", joints)?, settings.kd.gains("kd", joints)?],
            powers: [Power::new(settings.alpha, settings.blend_position), Power::new(alpha_2, settings.blend_speed)],
            sign: 1.0,
            friction: settings.friction,
            acceleration: vec![0.0; joints],
            model,
        })
    }

    /// Creates the controller with the minus signs printed in Eq. 23, which is unstable; for demonstration.
    ///
    /// # Errors
    /// Errors of [`FiniteTimeSettings::validate`].
    pub fn literal(model: ControllerModel, settings: &FiniteTimeSettings) -> Result<Self, SimulationError> {
        Ok(Self { sign: -1.0, ..Self::new(model, settings)? })
    }
}

impl Controller for FiniteTime {
    fn name(&self) -> &'static str {
        if self.sign > 0.0 { NAME } else { LITERAL_NAME }
    }

    fn joints(&self) -> usize {
        self.acceleration.len()
    }

    fn reset(&mut self) {
        self.model.restart();
    }

    fn torque(&mut self, _time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        let ([kp, kd], [position, speed]) = (&self.gains, self.powers);
        for joint in 0..kp.len() {
            let pull = kp[joint] * position.of(target.q[joint] - measured.q[joint])
                + kd[joint] * speed.of(target.dq[joint] - measured.dq[joint]);
            self.acceleration[joint] = target.ddq[joint] + self.sign * pull;
        }
        self.model.torque(measured, target, &self.acceleration, self.friction, tau);
    }

    fn set_model(&mut self, model: &ControllerModel) -> Result<(), SimulationError> {
        model.check_joints(self.joints())?;
        self.model = model.clone();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_odd_continuous_and_linear_inside() {
        let power = Power::new(0.7, 1e-3);
        assert!((power.of(0.5) - 0.5_f64.powf(0.7)).abs() < 1e-15);
        assert_eq!(power.of(-0.5), -power.of(0.5));
        // Continuous at ε: the step is one ulp of x times the slope.
        assert!((power.of(1e-3) - power.of(1e-3 * (1.0 - 1e-15))).abs() < 1e-15);
        assert!((power.of(1e-4) - 0.1 * power.of(1e-3)).abs() < 1e-15);
        assert_eq!(Power::new(0.7, 0.0).of(0.0), 0.0);
        assert!((Power::new(1.0, 1e-3).of(2e-4) - 2e-4).abs() < 1e-18);
    }
}
