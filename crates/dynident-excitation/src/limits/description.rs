//! What a user says about limits: plain numbers by joint and link name.

use super::known_torque::KnownTorque;
use super::link_points::LinkPoint;
use super::self_collision_shapes::{LinkShape, SelfCollision};
use dynident_model::Model;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Every limit of an experiment. What is absent does not limit.
///
/// In a study file:
///
/// ```
/// # use dynident_excitation::limits::Limits;
/// let limits: Limits = toml::from_str(
///     r#"
///     joints = [{ joint = "elbow", position = [-2.0, 2.0], acceleration = 10.0, torque = 150.0, torque_margin = 0.1 }]
///     floor = { height_m = 0.1, points = [{ link = "tool0" }] }
///     column = { radius_m = 0.2, points = [{ link = "tool0" }] }
///     self_collision = { radius_m = 0.05 }
///     "#,
/// )?;
/// assert_eq!(limits.joints[0].acceleration, Some(10.0));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Limits of single joints, at most one entry a joint.
    pub joints: Vec<JointLimit>,
    /// Boxes that points of the arm must not leave (the paper's workspace S).
    pub boxes: Vec<BoxLimit>,
    /// A floor that points of the arm must stay above.
    pub floor: Option<FloorLimit>,
    /// A vertical column, such as the robot's own pedestal, that points of the arm must stay out of.
    pub column: Option<ColumnLimit>,
    /// Distances between the arm's own links.
    pub self_collision: Option<SelfCollision>,
    /// Torque beyond the rigid bodies' that torque and power limits include. Not in files: it comes from the robot
    /// description and from what else is known of the drives.
    #[serde(skip)]
    pub known_torque: KnownTorque,
}

/// Limits of one joint; rad (m), seconds, Nm (N), W. Rates and torques are largest magnitudes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JointLimit {
    /// Name of the joint.
    pub joint: String,
    /// Lowest and highest position, rad or m.
    #[serde(default)]
    pub position: Option<[f64; 2]>,
    /// Highest velocity, rad/s or m/s.
    #[serde(default)]
    pub speed: Option<f64>,
    /// Highest acceleration, rad/s² or m/s².
    #[serde(default)]
    pub acceleration: Option<f64>,
    /// Highest jerk, rad/s³ or m/s³.
    #[serde(default)]
    pub jerk: Option<f64>,
    /// Highest torque by the model's prior inertial parameters and the known torque of friction, drives and springs, Nm
    /// or N.
    #[serde(default)]
    pub torque: Option<f64>,
    /// Part of the torque limit kept free for what the prior does not know, 0 (nothing) to below 1.
    #[serde(default)]
    pub torque_margin: f64,
    /// Highest mechanical power `|τ q̇|`, W.
    #[serde(default)]
    pub power_w: Option<f64>,
}

/// A box in the base frame that points (with their radius) must not leave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BoxLimit {
    /// Range along the base frame's x, m; absent: free.
    #[serde(default)]
    pub x_m: Option<[f64; 2]>,
    /// Range along y, m.
    #[serde(default)]
    pub y_m: Option<[f64; 2]>,
    /// Range along z, m.
    #[serde(default)]
    pub z_m: Option<[f64; 2]>,
    /// The points; none: the origins of all moving bodies.
    #[serde(default)]
    pub points: Vec<LinkPoint>,
}

/// The plane `z = height_m` of the base frame that points (with their radius) must stay above.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FloorLimit {
    /// Height of the floor in the base frame, m.
    pub height_m: f64,
    /// The points; none: the shapes below, and without these the origins of all moving bodies.
    #[serde(default)]
    pub points: Vec<LinkPoint>,
    /// Shapes of links that must stay above it.
    #[serde(default)]
    pub shapes: Vec<LinkShape>,
    /// By how much the floor is lower for the shapes of single links, m: what stands lower in every posture.
    #[serde(default)]
    pub lowered_m: BTreeMap<String, f64>,
}

/// A cylinder about a line parallel to the base frame's z that points (with their radius) must stay out of: from far
/// below up to `height_m`, endless without it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ColumnLimit {
    /// Radius of the cylinder, m.
    pub radius_m: f64,
    /// Where it ends, z in the base frame, m; by default nowhere: it is endlessly high.
    #[serde(default)]
    pub height_m: Option<f64>,
    /// Where its axis stands: x and y in the base frame, m.
    #[serde(default)]
    pub axis_xy_m: [f64; 2],
    /// The points that must stay out. To be chosen: points near the base are inside by construction.
    pub points: Vec<LinkPoint>,
}

impl Limits {
    /// The description's own limits: position where both ends are given, velocity, torque from `effort`, which includes
    /// the description's friction, drive inertia and springs. Acceleration, jerk, power and space stay free.
    pub fn from_model(model: &Model) -> Self {
        let joints = model.joints().iter().map(|joint| JointLimit {
            joint: joint.name.clone(),
            position: joint.limits.lower.zip(joint.limits.upper).map(|(lower, upper)| [lower, upper]),
            speed: joint.limits.velocity,
            torque: joint.limits.effort,
            ..JointLimit::default()
        });
        let known_torque = KnownTorque::of_description(model);
        Self { joints: joints.collect(), known_torque, ..Self::default() }
    }

    /// These limits with `other` laid over them: what `other` says wins, joint by joint and value by value; its boxes
    /// are added. Its known torque wins where it has any.
    pub fn overlaid(mut self, other: &Self) -> Self {
        for over in &other.joints {
            let Some(under) = self.joints.iter_mut().find(|under| under.joint == over.joint) else {
                self.joints.push(over.clone());
                continue;
            };
            under.position = over.position.or(under.position);
            under.speed = over.speed.or(under.speed);
            under.acceleration = over.acceleration.or(under.acceleration);
            under.jerk = over.jerk.or(under.jerk);
            under.torque = over.torque.or(under.torque);
            under.power_w = over.power_w.or(under.power_w);
            if over.torque_margin != 0.0 {
                under.torque_margin = over.torque_margin;
            }
        }
        self.boxes.extend(other.boxes.iter().cloned());
        self.floor = other.floor.clone().or(self.floor);
        self.column = other.column.clone().or(self.column);
        self.self_collision = other.self_collision.clone().or(self.self_collision);
        if !other.known_torque.is_empty() {
            self.known_torque = other.known_torque.clone();
        }
        self
    }

    /// The entry of one joint, if there is one.
    pub fn of(&self, joint: &str) -> Option<&JointLimit> {
        self.joints.iter().find(|limit| limit.joint == joint)
    }
}
