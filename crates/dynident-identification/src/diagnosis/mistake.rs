//! Mistakes that studies make, as readings of the same numbers: what the motion would be if one of them was made.

use super::motion_rows::MotionRows;
use super::nominal::gravity_torque;
use super::units::is_unit_of_time;
use dynident_dynamics::ParametricModel;
use dynident_model::{DhConvention, Vec3};

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
    /// The positions of these joints have another unit, or are those of the motors' side.
    PositionUnit {
        /// Which joints.
        joints: Vec<usize>,
        /// What to multiply positions by.
        factor: f64,
    },
    /// The torque of one joint has another unit than that of the others.
    TorqueUnit {
        /// The joint.
        joint: usize,
        /// What to multiply its torque by.
        factor: f64,
    },
    /// The column of a joint turns with another joint as well: it holds `q_joint + sign q_with`, as the motor of a
    /// parallelogram's arm or of a coupled wrist does; where torque is the motor's, `τ_with` lacks `sign τ_joint`.
    Coupled {
        /// The joint.
        joint: usize,
        /// The one that its column turns with.
        with: usize,
        /// 1 or -1.
        sign: f64,
        /// Positions alone, or torques as well.
        channels: Channels,
    },
    /// The time stamps have another unit, or the recorder another rate.
    TimeUnit {
        /// What to multiply times by.
        factor: f64,
    },
    /// The torques of these joints, or a joint's position, were logged later (earlier, if negative) than all else, by
    /// more than the lag of the torque that a fit takes off by itself.
    Lag {
        /// Which joints.
        joints: Vec<usize>,
        /// Torques or positions; never both, which would be another recorder's clock.
        channels: Channels,
        /// The whole lag, of torques with what the study states or a fit took off, seconds.
        lag_s: f64,
    },
    /// The torques lack the gravity of the description's bodies: a controller that compensates it logs what it adds to
    /// that.
    Compensated,
    /// The description is a Denavit-Hartenberg table in the other convention than the one that it states.
    Convention {
        /// The one that it is in.
        convention: DhConvention,
    },
    /// The description has a joint at another distance from the one before it.
    Length {
        /// The joint.
        joint: usize,
        /// What to multiply the distance by; negative: the other way.
        factor: f64,
    },
    /// Gravity is another: the base is mounted otherwise, or the torque is without gravity (zero).
    Gravity {
        /// Acceleration in the frame of the base, m/s².
        gravity_m_s2: [f64; 3],
    },
}

impl Mistake {
    /// What a mistake of this kind costs as an explanation, in units of the score: of two that explain alike the
    /// commoner one is named first, and a free number has to earn its place.
    pub(super) fn rarity(&self) -> f64 {
        match self {
            // A unit of one joint alone is rarer than one of all, or than another rate.
            Self::PositionUnit { joints, .. } if joints.len() == 1 => 0.15,
            Self::Sign { .. } | Self::TimeUnit { .. } | Self::PositionUnit { .. } | Self::Convention { .. } => 0.0,
            Self::Order { .. } => 0.05,
            Self::Offset { .. }
            | Self::Gravity { .. }
            | Self::TorqueUnit { .. }
            | Self::Coupled { .. }
            | Self::Lag { .. } => 0.15,
            // Descriptions are wrong in their bodies far more often than in their joints.
            Self::Length { .. } | Self::Compensated => 0.3,
        }
    }

    /// Whether its factor is free and moves torque against motion, as another robot's bodies do.
    pub(super) fn is_free_factor(&self) -> bool {
        match self {
            Self::TorqueUnit { .. } => true,
            Self::TimeUnit { .. } => self.is_other_rate(),
            Self::Sign { .. }
            | Self::Order { .. }
            | Self::Offset { .. }
            | Self::PositionUnit { .. }
            | Self::Coupled { .. }
            | Self::Lag { .. }
            | Self::Convention { .. }
            | Self::Length { .. }
            | Self::Compensated
            | Self::Gravity { .. } => false,
        }
    }

    /// Whether it is another rate of the recorder, and no unit of time.
    pub(super) fn is_other_rate(&self) -> bool {
        matches!(self, Self::TimeUnit { factor } if !is_unit_of_time(*factor))
    }

    /// What a mistake is about, its numbers aside: of several with other numbers one is enough to go on from.
    pub(super) fn is_alike(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::TorqueUnit { joint: a, .. }, Self::TorqueUnit { joint: b, .. })
            | (Self::Offset { joint: a, .. }, Self::Offset { joint: b, .. })
            | (Self::Length { joint: a, .. }, Self::Length { joint: b, .. }) => a == b,
            (Self::PositionUnit { joints: a, .. }, Self::PositionUnit { joints: b, .. }) => a == b,
            (Self::TimeUnit { .. }, Self::TimeUnit { .. }) | (Self::Gravity { .. }, Self::Gravity { .. }) => true,
            _ => self == other,
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
            | Self::TorqueUnit { .. }
            | Self::Coupled { .. }
            | Self::TimeUnit { .. }
            | Self::Lag { .. }
            | Self::Convention { .. }
            | Self::Length { .. }
            | Self::Compensated
            | Self::Gravity { .. } => joint,
        }
    }

    /// Where a mistake is of nothing but single torques of `joints` joints: for each joint the one whose torque it gets
    /// if the mistake is corrected, and times what.
    pub(super) fn torques(&self, joints: usize) -> Option<Vec<(usize, f64)>> {
        let mut torques: Vec<(usize, f64)> = (0..joints).map(|joint| (joint, 1.0)).collect();
        match self {
            Self::Sign { joints, channels: Channels::Torque } => {
                for &joint in joints {
                    torques[joint].1 = -1.0;
                }
            }
            Self::Order { order, channels: Channels::Torque } => {
                torques.iter_mut().zip(order).for_each(|(torque, &from)| torque.0 = from);
            }
            Self::TorqueUnit { joint, factor } => torques[*joint].1 = *factor,
            Self::Sign { .. }
            | Self::Order { .. }
            | Self::Offset { .. }
            | Self::PositionUnit { .. }
            | Self::Coupled { .. }
            | Self::TimeUnit { .. }
            | Self::Lag { .. }
            | Self::Convention { .. }
            | Self::Length { .. }
            | Self::Compensated
            | Self::Gravity { .. } => return None,
        }
        Some(torques)
    }

    /// The motion of a robot as it was if this mistake was made. What the torque was at another moment is not among the
    /// instants: of a lag they are chosen anew.
    pub fn corrected(&self, robot: &ParametricModel, rows: &MotionRows) -> MotionRows {
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
            Self::PositionUnit { joints, factor } => {
                for &joint in joints {
                    for values in [&mut out.q, &mut out.dq, &mut out.ddq] {
                        scale(&mut values[joint], *factor);
                    }
                }
            }
            Self::TorqueUnit { joint, factor } => scale(&mut out.tau[*joint], *factor),
            Self::Coupled { joint, with, sign, channels } => {
                let add = |to: &mut [f64], from: &[f64], factor: f64| {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
                };
                if *channels != Channels::Torque {
                    let from = [&rows.q, &rows.dq, &rows.ddq];
                    for (values, from) in [&mut out.q, &mut out.dq, &mut out.ddq].into_iter().zip(from) {
                        add(&mut values[*joint], &from[*with], -sign);
                    }
                }
                if *channels != Channels::Position {
                    add(&mut out.tau[*with], &rows.tau[*joint], *sign);
                }
            }
            Self::TimeUnit { factor } => {
                out.dq.iter_mut().for_each(|values| scale(values, factor.recip()));
                out.ddq.iter_mut().for_each(|values| scale(values, (factor * factor).recip()));
                out.rate_hz /= factor;
            }
            Self::Compensated => {
                let gravity = gravity_torque(robot, rows);
                for (tau, gravity) in out.tau.iter_mut().zip(gravity) {
                    tau.iter_mut().zip(gravity).for_each(|(tau, gravity)| *tau += gravity);
                }
            }
            Self::Lag { .. } | Self::Convention { .. } | Self::Length { .. } | Self::Gravity { .. } => {}
        }
        out
    }

    /// The robot as it stood if this mistake was made; `None` where it is the same.
    pub fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        let model = robot.model().clone();
        let model = match self {
            // Its bodies are described in frames of their own.
            Self::Convention { convention } => {
                let (_, meant) = model.other_convention().filter(|(other, _)| other == convention)?;
                return ParametricModel::new(meant.clone(), robot.terms().to_vec()).ok();
            }
            Self::Gravity { gravity_m_s2 } => model.with_gravity(Vec3(*gravity_m_s2)),
            Self::Length { joint, factor } => model.with_joint_distances(&[*joint], *factor),
            Self::Sign { .. }
            | Self::Order { .. }
            | Self::Offset { .. }
            | Self::PositionUnit { .. }
            | Self::TorqueUnit { .. }
            | Self::Coupled { .. }
            | Self::Lag { .. }
            | Self::Compensated
            | Self::TimeUnit { .. } => return None,
        };
        let again = ParametricModel::new(model.ok()?, robot.terms().to_vec()).ok()?;
        // Bodies that nobody described stay unknown.
        if robot.nominal_base().is_none() { Some(again) } else { again.with_nominal(robot.nominal().to_vec()).ok() }
    }
}

/// Robot and rows with these mistakes corrected, one after the other.
pub(super) fn without_mistakes(
    mistakes: &[Mistake],
    robot: &ParametricModel,
    rows: &MotionRows,
) -> (ParametricModel, MotionRows) {
    let (mut robot, mut rows) = (robot.clone(), rows.clone());
    for mistake in mistakes {
        rows = mistake.corrected(&robot, &rows);
        robot = mistake.corrected_robot(&robot).unwrap_or(robot);
    }
    (robot, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::read_urdf;

    /// Bodies that nobody described had those of nothing in a reading with another gravity.
    #[test]
    fn bodies_that_nobody_described_stay_unknown() {
        let urdf = include_str!("../../../../robots/planar2r.urdf");
        let bare = urdf.split("<inertial>").map(|part| part.split_once("</inertial>").map_or(part, |(_, rest)| rest));
        let model = read_urdf(&bare.collect::<String>()).unwrap().model;
        let bare = ParametricModel::new(model, Vec::new()).unwrap();
        assert!(bare.nominal_base().is_none());
        let gravity = Mistake::Gravity { gravity_m_s2: [0.0, 0.0, 9.81] };
        assert!(gravity.corrected_robot(&bare).unwrap().nominal_base().is_none());
        let described = ParametricModel::new(read_urdf(urdf).unwrap().model, Vec::new()).unwrap();
        assert!(gravity.corrected_robot(&described).unwrap().nominal_base().is_some());
    }
}
