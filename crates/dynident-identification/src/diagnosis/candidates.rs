//! Which mistakes are worth trying.

use super::mistake::{Channels, Mistake};
use super::motion_rows::MotionRows;
use super::plausibility::{beyond_limits, is_rate_of_a_recorder};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};
use dynident_dynamics::ParametricModel;

/// Single mistakes, the likelier ones first.
pub(super) fn candidates(robot: &ParametricModel, rows: &MotionRows) -> Vec<Mistake> {
    let model = robot.model();
    let dof = model.dof();
    let mut all = Vec::new();
    let channels = [Channels::Torque, Channels::Position, Channels::Both];

    // Units of all positions.
    if model.joints().iter().any(dynident_model::Joint::turns) {
        all.extend([PI / 180.0, TAU, 180.0 / PI, TAU.recip()].map(|factor| Mistake::PositionUnit { factor }));
    }
    // Units of time, where the rate looks like another one or the robot would be too fast.
    let is_odd = !is_rate_of_a_recorder(model, rows.rate_hz)
        || beyond_limits(model, rows).iter().any(|beyond| beyond.quantity == "velocity");
    for factor in [1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9] {
        // Stamps that are a factor too large make a rate that is as much too low.
        if is_odd && is_rate_of_a_recorder(model, rows.rate_hz / factor) {
            all.push(Mistake::TimeUnit { factor });
        }
    }
    // Signs of single joints and of all.
    for joint in 0..dof {
        all.extend(channels.map(|channels| Mistake::Sign { joints: vec![joint], channels }));
    }
    if dof > 1 {
        all.extend(channels.map(|channels| Mistake::Sign { joints: (0..dof).collect(), channels }));
    }
    // Exchanged joints, columns counted from the wrong end or one off.
    let mut orders = Vec::new();
    for a in 0..dof {
        for b in a + 1..dof {
            let mut order: Vec<usize> = (0..dof).collect();
            order.swap(a, b);
            orders.push(order);
        }
    }
    if dof > 2 {
        orders.push((0..dof).rev().collect());
        orders.push((0..dof).map(|j| (j + 1) % dof).collect());
        orders.push((0..dof).map(|j| (j + dof - 1) % dof).collect());
    }
    for order in orders {
        all.extend(
            [Channels::Both, Channels::Torque, Channels::Position]
                .map(|channels| Mistake::Order { order: order.clone(), channels }),
        );
    }
    // Zeros a quarter or half a turn away, or near where they should be.
    for joint in (0..dof).filter(|&joint| model.joints()[joint].turns()) {
        all.extend(
            [-FRAC_PI_2, FRAC_PI_2, PI, -FRAC_PI_6, FRAC_PI_6].map(|offset_rad| Mistake::Offset { joint, offset_rad }),
        );
    }
    // Mounting.
    let gravity = model.gravity();
    let size = gravity.norm();
    if size > 0.0 {
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let direction = [x, y, z].map(f64::from);
                    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let along = direction.iter().zip(gravity.0).map(|(a, b)| a * b).sum::<f64>();
                    // Not as it is.
                    if length > 0.0 && along < 0.999 * length * size {
                        all.push(Mistake::Gravity { gravity_m_s2: direction.map(|x| x * size / length) });
                    }
                }
            }
        }
    }
    all
}
