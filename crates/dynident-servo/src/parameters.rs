//! Free parameters of a fit, and the robot that belongs to their values.

use crate::drive::Drive;
use crate::floor::Floor;
use crate::quantity::{Axis, Quantity};
use dynident_model::{InertialParameters, Mat3, Model, ModelError, Vec3};

/// A robot with its drives, one for each joint.
#[derive(Clone, Debug)]
pub struct ServoRobot {
    /// The bodies.
    pub model: Model,
    /// One drive for each joint of the model.
    pub drives: Vec<Drive>,
    /// The floor, if points of the robot can touch one.
    pub floor: Option<Floor>,
}

/// How a coordinate changes a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The value is the robot's value times `exp(coordinate)`.
    Factor,
    /// The value is the robot's value plus the coordinate.
    Sum,
}

/// One unknown of a fit. Several parameters may change the same value: one common to all joints and one for each.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// The changed quantity.
    pub quantity: Quantity,
    /// Joints, or bodies for a mass or a centre, that it changes.
    pub members: Vec<usize>,
    /// How it changes them.
    pub change: Change,
    /// Standard deviation of the coordinate before the fit; infinite without a prior.
    pub prior_sd: f64,
}

/// Effect of one coordinate on one value: derivative of the value of `index` by the coordinate.
#[derive(Clone, Debug)]
pub(crate) struct Effect {
    pub(crate) column: usize,
    pub(crate) quantity: Quantity,
    pub(crate) index: usize,
    pub(crate) derivative: f64,
}

/// Effect of one coordinate on the inertial parameters of one body.
#[derive(Clone, Debug)]
pub(crate) struct BodyEffect {
    pub(crate) column: usize,
    pub(crate) body: usize,
    pub(crate) derivative: [f64; 10],
}

/// A robot at certain coordinates, with the derivatives of its values.
#[derive(Clone, Debug)]
pub(crate) struct VariedRobot {
    pub(crate) robot: ServoRobot,
    pub(crate) effects: Vec<Effect>,
    pub(crate) body_effects: Vec<BodyEffect>,
    /// Number of coordinates.
    pub(crate) columns: usize,
    /// Whether friction depends on the load.
    pub(crate) has_load_friction: bool,
}

impl VariedRobot {
    /// # Errors
    /// If the coordinates give bodies that are not numbers.
    pub(crate) fn new(
        nominal: &ServoRobot,
        parameters: &[FreeParameter],
        coordinates: &[f64],
    ) -> Result<Self, ModelError> {
        let mut robot = nominal.clone();
        let mut bodies: Vec<(f64, Vec3)> = vec![(1.0, Vec3([0.0; 3])); robot.model.body_count()];
        for (parameter, &coordinate) in parameters.iter().zip(coordinates) {
            for &member in &parameter.members {
                match parameter.quantity {
                    Quantity::Mass => bodies[member].0 *= coordinate.exp(),
                    Quantity::Centre(axis) => bodies[member].1.0[axis as usize] += coordinate,
                    Quantity::FloorHeight => {
                        if let Some(floor) = &mut robot.floor {
                            floor.height_m += coordinate;
                        }
                    }
                    quantity => {
                        let value = value_mut(&mut robot.drives[member], quantity);
                        match parameter.change {
                            Change::Factor => *value *= coordinate.exp(),
                            Change::Sum => *value += coordinate,
                        }
                    }
                }
            }
        }
        let inertials: Vec<InertialParameters> =
            nominal.model.inertials().iter().zip(&bodies).map(|(body, change)| changed(body, change)).collect();
        robot.model = nominal.model.with_inertials(&inertials)?;
        let mut effects = Vec::new();
        let mut body_effects = Vec::new();
        for (column, parameter) in parameters.iter().enumerate() {
            for &member in &parameter.members {
                match parameter.quantity {
                    Quantity::Mass => {
                        body_effects.push(BodyEffect { column, body: member, derivative: inertials[member].0 });
                    }
                    Quantity::Centre(axis) => {
                        let derivative = by_centre(&inertials[member], axis);
                        body_effects.push(BodyEffect { column, body: member, derivative });
                    }
                    Quantity::FloorHeight => {
                        effects.push(Effect { column, quantity: parameter.quantity, index: 0, derivative: 1.0 });
                    }
                    quantity => {
                        let derivative = match parameter.change {
                            Change::Factor => *value_mut(&mut robot.drives[member], quantity),
                            Change::Sum => 1.0,
                        };
                        effects.push(Effect { column, quantity, index: member, derivative });
                    }
                }
            }
        }
        let has_load_friction = robot.drives.iter().any(|drive| drive.load_friction != 0.0)
            || effects.iter().any(|effect| effect.quantity == Quantity::LoadFriction);
        Ok(Self { robot, effects, body_effects, columns: parameters.len(), has_load_friction })
    }
}

/// The robot at coordinates of the parameters, with read delays that are zero in the mean and delays that are not
/// negative. Only the difference of both delays changes the measured motion.
///
/// # Errors
/// If the coordinates give bodies that are not numbers.
pub fn robot_at(
    nominal: &ServoRobot,
    parameters: &[FreeParameter],
    coordinates: &[f64],
) -> Result<ServoRobot, ModelError> {
    let mut robot = VariedRobot::new(nominal, parameters, coordinates)?.robot;
    let mean = robot.drives.iter().map(|drive| drive.read_delay_s).sum::<f64>() / robot.drives.len().max(1) as f64;
    for drive in &mut robot.drives {
        drive.delay_s -= mean;
        drive.read_delay_s -= mean;
    }
    let earliest = robot.drives.iter().map(|drive| drive.delay_s).fold(0.0, f64::min);
    // An effect before its command is a measurement after its stamp: only their difference matters.
    for drive in &mut robot.drives {
        drive.delay_s -= earliest;
        drive.read_delay_s -= earliest;
    }
    Ok(robot)
}

/// The body with its mass and inertia times a factor and its centre of mass moved.
fn changed(body: &InertialParameters, (factor, shift): &(f64, Vec3)) -> InertialParameters {
    let (Some(centre), Some(inertia)) = (body.com_m(), body.inertia_at_com()) else { return *body };
    if *factor == 1.0 && shift.0 == [0.0; 3] {
        return *body;
    }
    let centre = Vec3(std::array::from_fn(|k| centre.0[k] + shift.0[k]));
    let inertia = Mat3(inertia.0.map(|row| row.map(|value| value * factor)));
    InertialParameters::from_centre_of_mass(body.mass_kg() * factor, centre, &inertia)
}

/// Derivative of the inertial parameters by the centre of mass along `axis`, with constant mass and inertia about it:
/// `∂I/∂c_k = m (2 c_k 1 - c e_kᵀ - e_k cᵀ)`.
fn by_centre(body: &InertialParameters, axis: Axis) -> [f64; 10] {
    let k = axis as usize;
    let moment = body.first_moment().0;
    let mut first = [0.0; 3];
    first[k] = body.mass_kg();
    let mut inertia = [[0.0; 3]; 3];
    for i in 0..3 {
        inertia[i][i] += 2.0 * moment[k];
        inertia[i][k] -= moment[i];
        inertia[k][i] -= moment[i];
    }
    InertialParameters::from_moments(0.0, Vec3(first), &Mat3(inertia)).0
}

/// The value of a robot's joint, body or floor.
pub(crate) fn robot_value(robot: &ServoRobot, quantity: Quantity, index: usize) -> f64 {
    let body = || robot.model.inertials()[index];
    match quantity {
        Quantity::Mass => body().mass_kg(),
        Quantity::Centre(axis) => body().com_m().map_or(0.0, |centre| centre.0[axis as usize]),
        Quantity::FloorHeight => robot.floor.as_ref().map_or(0.0, |floor| floor.height_m),
        _ => *value_mut(&mut robot.drives[index].clone(), quantity),
    }
}

/// The value of a drive that is called `quantity`.
fn value_mut(drive: &mut Drive, quantity: Quantity) -> &mut f64 {
    match quantity {
        Quantity::Stiffness => &mut drive.stiffness,
        Quantity::Damping => &mut drive.damping,
        Quantity::Armature => &mut drive.armature,
        Quantity::Coulomb => &mut drive.coulomb,
        Quantity::LoadFriction => &mut drive.load_friction,
        Quantity::Stribeck => &mut drive.stribeck,
        Quantity::TorqueLimit => &mut drive.torque_limit,
        Quantity::ProfileAcceleration => &mut drive.profile_acceleration,
        Quantity::ProfileSpeed => &mut drive.profile_speed,
        Quantity::Delay => &mut drive.delay_s,
        Quantity::ReadDelay => &mut drive.read_delay_s,
        Quantity::Zero => &mut drive.zero,
        Quantity::Mass | Quantity::Centre(_) | Quantity::FloorHeight => unreachable!("a body's value"),
    }
}
