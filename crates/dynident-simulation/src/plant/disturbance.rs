//! External torques and forces on the robot, in addition to gravity.

use crate::error::{SimulationError, require};
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{Model, Vec3};
use serde::{Deserialize, Serialize};

/// Time dependence of a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum TimeCourse {
    /// Constant 1.
    Constant,
    /// 1 from `from_s` to `until_s`, otherwise 0.
    Pulse {
        /// Start, s.
        from_s: f64,
        /// End, s.
        until_s: f64,
    },
    /// `sin(2π f t + φ)`.
    Sine {
        /// Frequency f.
        frequency_hz: f64,
        /// Phase φ; default 0.
        #[serde(default)]
        phase_rad: f64,
    },
}

impl TimeCourse {
    /// Value at a time.
    pub fn at(&self, time_s: f64) -> f64 {
        match *self {
            Self::Constant => 1.0,
            Self::Pulse { from_s, until_s } => f64::from(time_s >= from_s && time_s < until_s),
            Self::Sine { frequency_hz, phase_rad } => {
                (core::f64::consts::TAU * frequency_hz * time_s + phase_rad).sin()
            }
        }
    }

    fn is_finite(&self) -> bool {
        match *self {
            Self::Constant => true,
            Self::Pulse { from_s, until_s } => from_s.is_finite() && until_s.is_finite(),
            Self::Sine { frequency_hz, phase_rad } => frequency_hz.is_finite() && phase_rad.is_finite(),
        }
    }
}

/// A torque on a joint or a force on a body, as a function of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "on", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Disturbance {
    /// A torque (force) on one joint, Nm (N), in addition to the drive torque.
    Joint {
        /// Name of the joint.
        joint: String,
        /// Size, Nm (N).
        torque: f64,
        /// Time dependence.
        time: TimeCourse,
    },
    /// A force on a point of a moving body, in the base frame.
    Body {
        /// Name of the joint that moves the body.
        joint: String,
        /// Point in the frame of the body, m.
        point_m: [f64; 3],
        /// Force in the base frame, N.
        force_n: [f64; 3],
        /// Time dependence.
        time: TimeCourse,
    },
}

#[derive(Clone, Debug)]
pub(super) struct JointDisturbance {
    joint: usize,
    disturbance: Disturbance,
}

impl JointDisturbance {
    pub(super) fn new(model: &Model, disturbance: &Disturbance) -> Result<Self, SimulationError> {
        let (Disturbance::Joint { joint, time, .. } | Disturbance::Body { joint, time, .. }) = disturbance;
        let index = model.joint_index(joint).ok_or_else(|| dynident_model::ModelError::UnknownJoint {
            joint: joint.clone(),
            known: model.joints().iter().map(|joint| joint.name.clone()).collect(),
        })?;
        let numbers: Vec<f64> = match disturbance {
            Disturbance::Joint { torque, .. } => vec![*torque],
            Disturbance::Body { point_m, force_n, .. } => [*point_m, *force_n].concat(),
        };
        for value in numbers {
            require(value.is_finite(), format!("disturbance on {joint}"), value, "give finite numbers")?;
        }
        require(time.is_finite(), format!("time of the disturbance on {joint}"), f64::NAN, "give finite numbers")?;
        Ok(Self { joint: index, disturbance: disturbance.clone() })
    }

    /// Adds the joint torques (forces) of the disturbance at a time. A force f at the point p acts on the joints
    /// between the base and its body: `axis · ((p - o) × f)` on a revolute joint with origin o, `axis · f` on a
    /// prismatic joint.
    pub(super) fn add(&self, model: &Model, workspace: &mut Workspace, time_s: f64, q: &[f64], torque: &mut [f64]) {
        match &self.disturbance {
            Disturbance::Joint { torque: size, time, .. } => torque[self.joint] += size * time.at(time_s),
            Disturbance::Body { point_m, force_n, time, .. } => {
                let share = time.at(time_s);
                if share == 0.0 {
                    return;
                }
                let placements = body_placements(model, workspace, q);
                let force = Vec3(*force_n).scale(share);
                let body = model.body_of(self.joint);
                let point = placements[body].point(Vec3(*point_m));
                let mut at = Some(body);
                while let Some(body) = at {
                    let map = &model.maps()[body];
                    let axis = placements[body].rotation.mul_vec(map.axis);
                    let own = if map.is_rotary {
                        axis.dot((point + -placements[body].translation).cross(force))
                    } else {
                        axis.dot(force)
                    };
                    for (joint, share) in model.drivers(body) {
                        torque[joint] += share * own;
                    }
                    at = map.parent;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::random_tree;

    /// Virtual work: the joint torques of a force do the work of the force when the point moves. Central differences
    /// with a step of 1e-6 have an error of about 1e-9 of the force.
    #[test]
    fn a_force_does_the_work_of_its_joint_torques() {
        for seed in 0..5 {
            let model = random_tree(seed, 6);
            let mut workspace = Workspace::new(&model);
            let name = model.joints()[5].name.clone();
            let point = [0.1, -0.2, 0.3];
            let placed = JointDisturbance::new(
                &model,
                &Disturbance::Body {
                    joint: name,
                    point_m: point,
                    force_n: [1.0, 2.0, -3.0],
                    time: TimeCourse::Constant,
                },
            )
            .unwrap();
            let q: Vec<f64> = (0..6).map(|j| 0.3 * f64::from(j) - 0.5).collect();
            let mut torque = vec![0.0; 6];
            placed.add(&model, &mut workspace, 0.0, &q, &mut torque);
            for joint in 0..6 {
                let mut work = 0.0;
                for side in [1.0, -1.0] {
                    let mut moved = q.clone();
                    moved[joint] += side * 1e-6;
                    let at = body_placements(&model, &mut workspace, &moved)[5].point(Vec3(point));
                    work += side * at.dot(Vec3([1.0, 2.0, -3.0])) / 2e-6;
                }
                assert!((work - torque[joint]).abs() < 1e-7, "{seed} {joint}: {work} {}", torque[joint]);
            }
        }
    }

    #[test]
    fn time_courses() {
        let pulse = TimeCourse::Pulse { from_s: 1.0, until_s: 2.0 };
        assert_eq!([0.5, 1.0, 1.9, 2.0].map(|t| pulse.at(t)), [0.0, 1.0, 1.0, 0.0]);
        let sine = TimeCourse::Sine { frequency_hz: 0.25, phase_rad: 0.0 };
        assert!((sine.at(1.0) - 1.0).abs() < 1e-15);
        let text = "on = \"joint\"\njoint = \"joint1\"\ntorque = 2.0\ntime = { kind = \"constant\" }";
        let read: Disturbance = toml::from_str(text).unwrap();
        assert!(JointDisturbance::new(&random_tree(1, 2), &read).is_ok());
        assert!(
            JointDisturbance::new(&random_tree(1, 2), &toml::from_str(&text.replace("joint1", "elbow")).unwrap())
                .is_err()
        );
        assert!(toml::from_str::<Disturbance>(&text.replace("torque", "tork")).is_err());
    }
}
