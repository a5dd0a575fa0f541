//! A machine's own time and length: what a second and a metre of a usual arm are to it.

use crate::tree::{Model, STANDARD_GRAVITY};

/// Length of the usual arm, m, with which an arm's own second is a second: from the first joint to the tip, about that
/// of the arms on most benches (0.9 to 1.7 m).
const USUAL_ARM_M: f64 = 9.81 / PER_SECOND;
/// Squares of `√(length / gravity)` in the square of an own second.
const PER_SECOND: f64 = 8.0;

/// How much longer and slower a machine is than a usual arm of 1.2 m.
///
/// Seconds, metres and velocities that nobody states (how late a drive's torque may be, how wide the step of dry
/// friction is) are those of a usual arm times these factors, so that a watch, an arm and a crane that are copies of
/// each other give copies of the same result. The time of a machine is that of its pendulum, `√(8 l / g)`: with length
/// and gravity it is all that a description tells of time, and what drives, controllers and motions have to be faster
/// than. Units are the robot's: a description in other units of length or time, with its gravity, is the same machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnScale {
    /// Of an arm of 1.2 m: 1.
    time: f64,
    /// Of an arm of 1.2 m: 1.
    length: f64,
}

impl OwnScale {
    /// An arm's of 1.2 m.
    pub const USUAL: Self = Self { time: 1.0, length: 1.0 };

    /// A model's, from its longest chain of joints ([`Model::arm_m`]) and its gravity; without gravity, that of the
    /// earth: torques without it are of machines that stand there. A model without any length is a usual arm.
    pub fn of(model: &Model) -> Self {
        let length_m = Some(model.arm_m()).filter(|length_m| *length_m > 0.0).unwrap_or(USUAL_ARM_M);
        let own = model.gravity().norm();
        let gravity_m_s2 = if own > 0.0 { own } else { STANDARD_GRAVITY.norm() };
        let usable = |factor: f64| if factor.is_normal() && factor > 0.0 { factor } else { 1.0 };
        Self {
            time: usable((PER_SECOND * length_m / gravity_m_s2).sqrt()),
            length: usable(PER_SECOND * length_m / STANDARD_GRAVITY.norm()),
        }
    }

    /// A time, s, that is `usual_s` of a usual arm.
    pub fn seconds(self, usual_s: f64) -> f64 {
        usual_s * self.time
    }

    /// A frequency, Hz, that is `usual_hz` of a usual arm.
    pub fn hertz(self, usual_hz: f64) -> f64 {
        usual_hz / self.time
    }

    /// About such a frequency: twice, four times, half, .. of `usual_hz`, whichever is nearest, for rates of samples,
    /// whose exact number does not matter. Of an arm of 0.6 to 2.4 m it is `usual_hz`.
    pub fn round_hertz(self, usual_hz: f64) -> f64 {
        usual_hz * self.time.log2().round().exp2().recip()
    }

    /// A length, m, that is `usual_m` of a usual arm.
    pub fn metres(self, usual_m: f64) -> f64 {
        usual_m * self.length
    }

    /// A position of a joint, rad (m where it slides), that is `usual` of a usual arm.
    pub fn position(self, turns: bool, usual: f64) -> f64 {
        if turns { usual } else { self.metres(usual) }
    }

    /// A velocity of a joint, rad/s (m/s where it slides), that is `usual` of a usual arm.
    pub fn velocity(self, turns: bool, usual: f64) -> f64 {
        self.position(turns, usual) / self.time
    }

    /// An acceleration of a joint, rad/s² (m/s² where it slides), that is `usual` of a usual arm.
    pub fn acceleration(self, turns: bool, usual: f64) -> f64 {
        self.velocity(turns, usual) / self.time
    }
}

impl Model {
    /// The longest chain of joints from the first joint to a tip, m: the distances between their frames, and to the
    /// farthest link that is fixed to the last one. Where the base stands does not count.
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

    /// The machine's own time and length.
    pub fn own_scale(&self) -> OwnScale {
        OwnScale::of(self)
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
    fn an_arm_of_usual_length_on_earth_has_seconds_and_metres() {
        let usual = arm(USUAL_ARM_M);
        assert_eq!(usual.arm_m(), USUAL_ARM_M);
        assert_eq!(usual.own_scale(), OwnScale::USUAL);
        assert_eq!(usual.with_gravity(Vec3::ZERO).unwrap().own_scale(), OwnScale::USUAL);
    }

    #[test]
    fn what_nobody_states_scales_with_length_and_time() {
        let (usual, long) = (arm(1.5).own_scale(), arm(1.5 * 1024.0));
        let gravity = |times: f64| long.clone().with_gravity(STANDARD_GRAVITY.scale(times)).unwrap().own_scale();
        // With gravity longer by as much, only lengths are.
        let same_time = gravity(1024.0);
        assert_eq!(same_time.seconds(0.1), usual.seconds(0.1));
        assert_eq!(same_time.velocity(true, 0.02), usual.velocity(true, 0.02));
        assert_eq!(same_time.velocity(false, 0.02), 1024.0 * usual.velocity(false, 0.02));
        // Everything at half the speed, to the last bit.
        let slow = gravity(256.0);
        assert_eq!(slow.seconds(0.1), 2.0 * usual.seconds(0.1));
        assert_eq!(slow.hertz(0.1), 0.5 * usual.hertz(0.1));
        assert_eq!(slow.acceleration(true, 5.0), 0.25 * usual.acceleration(true, 5.0));
        assert_eq!(slow.position(false, 0.1), slow.metres(0.1));
        assert_eq!((usual.round_hertz(100.0), slow.round_hertz(100.0)), (100.0, 50.0));
    }

    #[test]
    fn a_model_without_lengths_is_usual_and_none_gives_numbers_that_are_none() {
        assert_eq!(arm(0.0).own_scale(), OwnScale::USUAL);
        let heavy = arm(1e-300).with_gravity(STANDARD_GRAVITY.scale(1e200)).unwrap().own_scale();
        assert!(heavy.seconds(1.0).is_normal() && heavy.metres(1.0).is_normal());
    }
}
