//! Characteristic time and length of a robot, relative to a typical arm.

use crate::tree::{Model, STANDARD_GRAVITY};

/// Length of the typical arm, m, from the first joint to the tip, at which the characteristic time is one second. Most
/// bench arms have 0.9 to 1.7 m.
const TYPICAL_ARM_M: f64 = 9.81 / TIME_SCALE_SQUARED;
/// Square of the characteristic time in units of `length / gravity`.
const TIME_SCALE_SQUARED: f64 = 8.0;

/// Scale factors of time and length relative to a typical arm of 1.2 m.
///
/// Default times, lengths and velocities (such as the largest torque lag, or the velocity range in which Coulomb
/// friction changes its sign) are defined for a typical arm and multiplied by these factors. Geometrically similar
/// robots, from a watch to a crane, therefore give similar results. The characteristic time is that of a pendulum,
/// `√(8 l / g)`: length and gravity are the only data of a robot description that determine a time. The factors also
/// make the result independent of the units of length and time in the description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CharacteristicScale {
    /// Scale of time; 1 for an arm of 1.2 m.
    time: f64,
    /// Scale of length; 1 for an arm of 1.2 m.
    length: f64,
}

impl CharacteristicScale {
    /// Scale of an arm of 1.2 m.
    pub const USUAL: Self = Self { time: 1.0, length: 1.0 };

    /// Scale of a model from its longest chain of joints ([`Model::arm_m`]) and its gravity. Standard gravity is used
    /// if the model has none. A model without any length has the scale of a typical arm.
    pub fn of(model: &Model) -> Self {
        let length_m = Some(model.arm_m()).filter(|length_m| *length_m > 0.0).unwrap_or(TYPICAL_ARM_M);
        let own = model.gravity().norm();
        let gravity_m_s2 = if own > 0.0 { own } else { STANDARD_GRAVITY.norm() };
        let usable = |factor: f64| if factor.is_normal() && factor > 0.0 { factor } else { 1.0 };
        Self {
            time: usable((TIME_SCALE_SQUARED * length_m / gravity_m_s2).sqrt()),
            length: usable(TIME_SCALE_SQUARED * length_m / STANDARD_GRAVITY.norm()),
        }
    }

    /// Scales a time of the typical arm, s.
    pub fn seconds(self, usual_s: f64) -> f64 {
        usual_s * self.time
    }

    /// Scales a frequency of the typical arm, Hz.
    pub fn hertz(self, usual_hz: f64) -> f64 {
        usual_hz / self.time
    }

    /// Scales a sampling rate of the typical arm by the nearest power of two, Hz. For arms of 0.6 to 2.4 m the result
    /// is `usual_hz`.
    pub fn round_hertz(self, usual_hz: f64) -> f64 {
        usual_hz * self.time.log2().round().exp2().recip()
    }

    /// Scales a length of the typical arm, m.
    pub fn metres(self, usual_m: f64) -> f64 {
        usual_m * self.length
    }

    /// Scales a joint position of the typical arm, rad (m for a prismatic joint).
    pub fn position(self, is_rotary: bool, usual: f64) -> f64 {
        if is_rotary { usual } else { self.metres(usual) }
    }

    /// Scales a joint velocity of the typical arm, rad/s (m/s for a prismatic joint).
    pub fn velocity(self, is_rotary: bool, usual: f64) -> f64 {
        self.position(is_rotary, usual) / self.time
    }

    /// Scales a joint acceleration of the typical arm, rad/s² (m/s² for a prismatic joint).
    pub fn acceleration(self, is_rotary: bool, usual: f64) -> f64 {
        self.velocity(is_rotary, usual) / self.time
    }
}

impl Model {
    /// Length of the longest chain from the first joint to a tip, m: the sum of the distances between the joint
    /// frames, and from the last joint to the farthest link fixed to it. The position of the base has no influence.
    pub fn arm_m(&self) -> f64 {
        let mut lengths: Vec<f64> = Vec::with_capacity(self.body_count());
        for joint in self.tree_joints() {
            lengths.push(joint.parent.map_or(0.0, |parent| lengths[parent] + joint.placement.translation.norm()));
        }
        let tip = |(body, length): (usize, f64)| {
            let links = self.bodies()[body].links.iter().map(|link| link.placement.translation.norm());
            length + links.fold(0.0, f64::max)
        };
        lengths.into_iter().enumerate().map(tip).fold(0.0, f64::max)
    }

    /// Characteristic time and length of the robot.
    pub fn characteristic_scale(&self) -> CharacteristicScale {
        CharacteristicScale::of(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Vec3, read_urdf};

    fn arm(length_m: f64) -> Model {
        let text = format!(
            r#"<robot name="a"><link name="b"/><link name="u"/><link name="f"/><link name="t"/>
            <joint name="j1" type="continuous"><parent link="b"/><child link="u"/><origin xyz="0 0 9"/></joint>
            <joint name="j2" type="prismatic"><parent link="u"/><child link="f"/><origin xyz="{} 0 0"/></joint>
            <joint name="j3" type="fixed"><parent link="f"/><child link="t"/><origin xyz="0 {} 0"/></joint></robot>"#,
            0.75 * length_m,
            0.25 * length_m,
        );
        read_urdf(&text).unwrap().model
    }

    #[test]
    fn typical_arm_has_unit_scale() {
        let usual = arm(TYPICAL_ARM_M);
        assert_eq!(usual.arm_m(), TYPICAL_ARM_M);
        assert_eq!(usual.characteristic_scale(), CharacteristicScale::USUAL);
        assert_eq!(usual.with_gravity(Vec3::ZERO).unwrap().characteristic_scale(), CharacteristicScale::USUAL);
    }

    #[test]
    fn defaults_scale_with_length_and_time() {
        let (usual, long) = (arm(1.5).characteristic_scale(), arm(1.5 * 1024.0));
        let gravity =
            |times: f64| long.clone().with_gravity(STANDARD_GRAVITY.scale(times)).unwrap().characteristic_scale();
        // Gravity scaled like the length changes only lengths.
        let same_time = gravity(1024.0);
        assert_eq!(same_time.seconds(0.1), usual.seconds(0.1));
        assert_eq!(same_time.velocity(true, 0.02), usual.velocity(true, 0.02));
        assert_eq!(same_time.velocity(false, 0.02), 1024.0 * usual.velocity(false, 0.02));
        // Half the speed, exact to the last bit.
        let slow = gravity(256.0);
        assert_eq!(slow.seconds(0.1), 2.0 * usual.seconds(0.1));
        assert_eq!(slow.hertz(0.1), 0.5 * usual.hertz(0.1));
        assert_eq!(slow.acceleration(true, 5.0), 0.25 * usual.acceleration(true, 5.0));
        assert_eq!(slow.position(false, 0.1), slow.metres(0.1));
        assert_eq!((usual.round_hertz(100.0), slow.round_hertz(100.0)), (100.0, 50.0));
    }

    #[test]
    fn scale_is_typical_without_lengths_and_always_finite() {
        assert_eq!(arm(0.0).characteristic_scale(), CharacteristicScale::USUAL);
        let heavy = arm(1e-300).with_gravity(STANDARD_GRAVITY.scale(1e200)).unwrap().characteristic_scale();
        assert!(heavy.seconds(1.0).is_normal() && heavy.metres(1.0).is_normal());
    }
}
