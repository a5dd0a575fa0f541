//! Which mistakes are worth trying.

use super::mistake::{Channels, Mistake};
use super::motion_rows::MotionRows;
use super::plausibility::{beyond_limits, is_rate_of_a_recorder};
use super::units::{
    OTHER_LENGTHS, OTHER_RATES, UNITS_OF_ONE_LENGTH, UNITS_OF_ONE_POSITION, UNITS_OF_ONE_TORQUE, UNITS_OF_POSITIONS,
    UNITS_OF_TIME,
};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};
use dynident_dynamics::ParametricModel;
use dynident_model::Model;

/// Gravity on earth as studies have it where they say nothing, m/s².
const EARTH_M_S2: f64 = 9.81;
/// Share by which gravity differs over the earth, and with how many digits people write it.
const NEAR_EARTH: f64 = 0.03;

/// A zero that is a little off, rad: what lies between it and larger ones is found from there.
const NEAR: f64 = FRAC_PI_6 / 3.0;

/// Times its range that a joint travels where its unit is far too small.
pub(super) const FAR: f64 = 2.0;

/// How far the search goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Breadth {
    /// Mistakes that people often make, without free numbers but those of zeros and mountings.
    Usual,
    /// Rarer ones too: units of single joints, other rates, columns that turn with a neighbour, gravity's size.
    All,
}

/// Single mistakes, the likelier ones first.
pub(super) fn candidates(robot: &ParametricModel, rows: &MotionRows, breadth: Breadth) -> Vec<Mistake> {
    let model = robot.model();
    let mut all =
        [units(model, rows), signs(model.dof()), orders(model.dof()), zeros(model), mountings(model)].concat();
    // No key of tables is mistaken more often.
    all.extend(model.other_convention().map(|(convention, _)| Mistake::Convention { convention }));
    if breadth == Breadth::All {
        all.extend(
            [units_of_one(model, rows), other_rates(model, rows), couplings(model), gravities(model), lengths(model)]
                .concat(),
        );
        // What no description's bodies say no controller took off by them.
        if robot.nominal_base().is_some() && model.gravity().norm() > 0.0 {
            all.push(Mistake::Compensated);
        }
    }
    all
}

/// Units of all positions, and of time.
fn units(model: &Model, rows: &MotionRows) -> Vec<Mistake> {
    let mut all = Vec::new();
    if model.joints().iter().any(dynident_model::Joint::turns) {
        let joints: Vec<usize> = (0..model.dof()).collect();
        all.extend(UNITS_OF_POSITIONS.map(|factor| Mistake::PositionUnit { joints: joints.clone(), factor }));
    }
    // Units of time, where the rate looks like another one or the robot would be too fast.
    let is_odd = !is_rate_of_a_recorder(model, rows.rate_hz)
        || beyond_limits(model, rows).iter().any(|beyond| beyond.quantity == "velocity");
    if is_odd {
        all.extend(times(model, rows, &UNITS_OF_TIME));
    }
    all
}

/// Another rate of the recorder.
fn other_rates(model: &Model, rows: &MotionRows) -> Vec<Mistake> {
    times(model, rows, &OTHER_RATES)
}

/// Factors of time that a recorder may have; stamps that are a factor too large make a rate that is as much too low.
fn times(model: &Model, rows: &MotionRows, factors: &[f64]) -> Vec<Mistake> {
    let is_possible = |factor: &&f64| is_rate_of_a_recorder(model, rows.rate_hz / **factor);
    factors.iter().filter(is_possible).map(|&factor| Mistake::TimeUnit { factor }).collect()
}

/// Units of the position or the torque of one joint.
fn units_of_one(model: &Model, rows: &MotionRows) -> Vec<Mistake> {
    let dof = if model.dof() > 1 { model.dof() } else { 0 };
    let position = |joint: usize| {
        let description = &model.joints()[joint];
        let units: &[f64] = if description.turns() { &UNITS_OF_ONE_POSITION } else { &UNITS_OF_ONE_LENGTH };
        // A unit that is far too small shows: the joint would travel far more than it can.
        let range = description.limits.lower.zip(description.limits.upper).map_or(0.0, |(lower, upper)| upper - lower);
        let range = if range > 0.0 || !description.turns() { range } else { 2.0 * TAU };
        let travel = rows.q[joint].iter().fold(f64::NEG_INFINITY, |most, q| most.max(*q))
            - rows.q[joint].iter().fold(f64::INFINITY, |least, q| least.min(*q));
        let travels_far = travel > FAR * range;
        let is_possible = move |factor: &&f64| **factor >= FAR.recip() || travels_far;
        units.iter().filter(is_possible).map(move |&factor| Mistake::PositionUnit { joints: vec![joint], factor })
    };
    let torque = |joint: usize| UNITS_OF_ONE_TORQUE.map(|factor| Mistake::TorqueUnit { joint, factor });
    (0..dof).flat_map(position).chain((0..dof).flat_map(torque)).collect()
}

/// Signs of single joints and of all.
fn signs(dof: usize) -> Vec<Mistake> {
    let channels = [Channels::Torque, Channels::Position, Channels::Both];
    let single = (0..dof).map(|joint| vec![joint]);
    let of_all = (dof > 1).then(|| (0..dof).collect());
    single
        .chain(of_all)
        .flat_map(|joints| channels.map(|channels| Mistake::Sign { joints: joints.clone(), channels }))
        .collect()
}

/// Exchanged joints, columns counted from the wrong end or one off.
fn orders(dof: usize) -> Vec<Mistake> {
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
    let channels = [Channels::Both, Channels::Torque, Channels::Position];
    orders
        .into_iter()
        .flat_map(|order| channels.map(|channels| Mistake::Order { order: order.clone(), channels }))
        .collect()
}

/// Zeros a quarter or half a turn away, or near where they should be.
fn zeros(model: &Model) -> Vec<Mistake> {
    let offsets = [-FRAC_PI_2, FRAC_PI_2, PI, -FRAC_PI_6, FRAC_PI_6, -NEAR, NEAR];
    let turning = (0..model.dof()).filter(|&joint| model.joints()[joint].turns());
    turning.flat_map(|joint| offsets.map(|offset_rad| Mistake::Offset { joint, offset_rad })).collect()
}

/// Neighbours of which one's column turns with the other.
fn couplings(model: &Model) -> Vec<Mistake> {
    let turns = |joint: usize| model.joints()[joint].turns();
    let neighbours = (1..model.dof()).flat_map(|joint| [(joint, joint - 1), (joint - 1, joint)]);
    let turning = neighbours.filter(|&(joint, with)| turns(joint) && turns(with));
    let ways = [Channels::Position, Channels::Both].map(|channels| [1.0, -1.0].map(|sign| (channels, sign))).concat();
    turning
        .flat_map(|(joint, with)| {
            ways.clone().into_iter().map(move |(channels, sign)| Mistake::Coupled { joint, with, sign, channels })
        })
        .collect()
}

/// Joints that are nearer to the one before them, farther from it, or on its other side. Where joints follow others the
/// tree has more of them than the log.
fn lengths(model: &Model) -> Vec<Mistake> {
    if model.coupling().is_some() {
        return Vec::new();
    }
    // Where the first joint stands in the base moves no torque.
    let is_apart = |joint: &usize| {
        let description = &model.joints()[*joint];
        description.parent.is_some() && description.placement.translation.norm() > 0.0
    };
    let joints = (0..model.dof()).filter(is_apart);
    joints.flat_map(|joint| OTHER_LENGTHS.map(|factor| Mistake::Length { joint, factor })).collect()
}

/// Gravity in another unit, none (torques from which a controller took it off), and some where the study has none.
fn gravities(model: &Model) -> Vec<Mistake> {
    let gravity = model.gravity();
    let size = gravity.norm();
    let mut all = Vec::new();
    if size > 0.0 {
        all.push([0.0; 3]);
        if (size / EARTH_M_S2 - 1.0).abs() > NEAR_EARTH {
            all.push(gravity.0.map(|g| g * EARTH_M_S2 / size));
        }
    } else {
        all.extend(directions().map(|direction| direction.map(|x| x * EARTH_M_S2)));
    }
    all.into_iter().map(|gravity_m_s2| Mistake::Gravity { gravity_m_s2 }).collect()
}

/// The same gravity in other directions.
fn mountings(model: &Model) -> Vec<Mistake> {
    let gravity = model.gravity();
    let size = gravity.norm();
    // Not as it is.
    let is_other = |direction: &[f64; 3]| {
        let along = direction.iter().zip(gravity.0).map(|(a, b)| a * b).sum::<f64>();
        size > 0.0 && along < 0.999 * size
    };
    directions().filter(is_other).map(|d| Mistake::Gravity { gravity_m_s2: d.map(|x| x * size) }).collect()
}

/// 26 directions: along axes, and between two or three of them.
fn directions() -> impl Iterator<Item = [f64; 3]> {
    let steps = |k: i32| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1].map(f64::from);
    (0..27).filter(|&k| k != 13).map(move |k| {
        let direction = steps(k);
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        direction.map(|x| x / length)
    })
}
