//! Mistakes that studies make, as readings of the same numbers: what the motion would be if one of them was made.

use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use dynident_model::Vec3;

/// Which columns of a log a mistake is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// Positions alone.
    Position,
    /// Torques alone.
    Torque,
    /// Both.
    Both,
}

/// One mistake of a study. Joints are numbers in the model's order.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// The signs of these joints are reversed; of position and torque alike: the joint's axis.
    Sign {
        /// Which joints.
        joints: Vec<usize>,
        /// Which of their columns.
        channels: Channels,
    },
    /// The columns stand in another order: joint `j` should have what joint `order[j]` has.
    Order {
        /// For each joint the one whose columns belong to it.
        order: Vec<usize>,
        /// Which columns.
        channels: Channels,
    },
    /// The zero of a joint's position lies elsewhere: `offset_rad` has to be added.
    Offset {
        /// The joint.
        joint: usize,
        /// What to add, rad.
        offset_rad: f64,
    },
    /// All positions have another unit.
    PositionUnit {
        /// What to multiply positions by.
        factor: f64,
    },
    /// The time stamps have another unit.
    TimeUnit {
        /// What to multiply times by.
        factor: f64,
    },
    /// The base is mounted otherwise: gravity in the base frame, m/s².
    Gravity {
        /// Acceleration in the frame of the base.
        gravity_m_s2: [f64; 3],
    },
}

impl Mistake {
    /// What a mistake of this kind costs as an explanation, in units of the score: of two that explain alike the
    /// commoner one is named first, and a free number has to earn its place.
    pub(super) fn rarity(&self) -> f64 {
        match self {
            Self::Sign { .. } | Self::TimeUnit { .. } | Self::PositionUnit { .. } => 0.0,
            Self::Order { .. } => 0.05,
            Self::Offset { .. } | Self::Gravity { .. } => 0.15,
        }
    }

    /// The joint whose torque column a joint gets if this mistake is corrected.
    pub(super) fn torque_from(&self, joint: usize) -> usize {
        match self {
            Self::Order { order, channels: Channels::Torque | Channels::Both } => order[joint],
            Self::Order { .. }
            | Self::Sign { .. }
            | Self::Offset { .. }
            | Self::PositionUnit { .. }
            | Self::TimeUnit { .. }
            | Self::Gravity { .. } => joint,
        }
    }

    /// The motion as it was if this mistake was made.
    pub fn corrected(&self, rows: &MotionRows) -> MotionRows {
        let mut out = rows.clone();
        let scale = |values: &mut [f64], factor: f64| values.iter_mut().for_each(|value| *value *= factor);
        match self {
            Self::Sign { joints, channels } => {
                for &joint in joints {
                    if *channels != Channels::Torque {
                        for values in [&mut out.q, &mut out.dq, &mut out.ddq] {
                            scale(&mut values[joint], -1.0);
                        }
                    }
                    if *channels != Channels::Position {
                        scale(&mut out.tau[joint], -1.0);
                    }
                }
            }
            Self::Order { order, channels } => {
                for (joint, &from) in order.iter().enumerate() {
                    if *channels != Channels::Torque {
                        out.q[joint].clone_from(&rows.q[from]);
                        out.dq[joint].clone_from(&rows.dq[from]);
                        out.ddq[joint].clone_from(&rows.ddq[from]);
                    }
                    if *channels != Channels::Position {
                        out.tau[joint].clone_from(&rows.tau[from]);
                    }
                }
            }
            Self::Offset { joint, offset_rad } => out.q[*joint].iter_mut().for_each(|q| *q += offset_rad),
            Self::PositionUnit { factor } => {
                for values in out.q.iter_mut().chain(&mut out.dq).chain(&mut out.ddq) {
                    scale(values, *factor);
                }
            }
            Self::TimeUnit { factor } => {
                out.dq.iter_mut().for_each(|values| scale(values, factor.recip()));
                out.ddq.iter_mut().for_each(|values| scale(values, (factor * factor).recip()));
                out.rate_hz /= factor;
            }
            Self::Gravity { .. } => {}
        }
        out
    }

    /// The robot as it stood if this mistake was made; `None` where it is the same.
    pub fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        match self {
            Self::Gravity { gravity_m_s2 } => {
                let model = robot.model().clone().with_gravity(Vec3(*gravity_m_s2)).ok()?;
                let again = ParametricModel::new(model, robot.terms().to_vec()).ok()?;
                again.with_nominal(robot.nominal().to_vec()).ok()
            }
            Self::Sign { .. }
            | Self::Order { .. }
            | Self::Offset { .. }
            | Self::PositionUnit { .. }
            | Self::TimeUnit { .. } => None,
        }
    }
}
