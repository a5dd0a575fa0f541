//! Free parameters of a fit, and the robot for given values of these parameters.

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

/// How the coordinate of an unknown changes a value of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The value is the robot's nominal value times `exp(coordinate)`.
    Factor,
    /// The value is the robot's nominal value plus the coordinate.
    Sum,
}

/// One unknown of a fit. Several unknowns may change the same value: one that is common to all joints, and one for each
/// joint.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// Quantity that the unknown changes.
    pub quantity: Quantity,
    /// Joints whose value it changes; for a mass or a centre of mass, bodies.
    pub members: Vec<usize>,
    /// How the coordinate changes these values.
    pub change: Change,
    /// Standard deviation of the coordinate before the fit; infinite without a prior.
    pub prior_sd: f64,
}

/// Effect of one coordinate on one value: the derivative of the value of joint or body `index` by the coordinate.
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

/// A robot at given coordinates, with the derivatives of its values by the coordinates.
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
    /// The coordinates give bodies with values that are not finite.
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

/// The robot at given coordinates of the free parameters. The measured motion determines only the difference of command
/// delay and read delay; here the mean of the read delays is zero, and no delay is negative.
///
/// # Errors
/// The coordinates give bodies with values that are not finite.
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
    // A negative command delay is replaced by a later measurement: only the difference of both delays changes the
    // motion.
    for drive in &mut robot.drives {
        drive.delay_s -= earliest;
        drive.read_delay_s -= earliest;
    }
    Ok(robot)
}

/// The body with mass and inertia multiplied by a factor and the centre of mass moved by a shift.
fn changed(body: &InertialParameters, (factor, shift): &(f64, Vec3)) -> InertialParameters {
    let (Some(centre), Some(inertia)) = (body.com_m(), body.inertia_at_com()) else { return *body };
    if *factor == 1.0 && shift.0 == [0.0; 3] {
        return *body;
    }
    let centre = Vec3(std::array::from_fn(|k| centre.0[k] + shift.0[k]));
    let inertia = Mat3(inertia.0.map(|row| row.map(|value| value * factor)));
    InertialParameters::from_centre_of_mass(body.mass_kg() * factor, centre, &inertia)
}

/// Derivative of the inertial parameters by the coordinate of the centre of mass along `axis`, for constant mass and
/// constant inertia about the centre of mass: `∂I/∂c_k = m (2 c_k 1 - c e_kᵀ - e_k cᵀ)`.
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

/// The value of `quantity` for a joint, body or floor of the robot.
pub(crate) fn robot_value(robot: &ServoRobot, quantity: Quantity, index: usize) -> f64 {
    let body = || robot.model.inertials()[index];
    match quantity {
        Quantity::Mass => body().mass_kg(),
        Quantity::Centre(axis) => body().com_m().map_or(0.0, |centre| centre.0[axis as usize]),
        Quantity::FloorHeight => robot.floor.as_ref().map_or(0.0, |floor| floor.height_m),
        _ => *value_mut(&mut robot.drives[index].clone(), quantity),
    }
}

/// The value of a drive that `quantity` names.
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
