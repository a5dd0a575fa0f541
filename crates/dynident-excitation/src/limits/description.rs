//! Limits as a user states them: numbers for joints and links, identified by name.

use super::known_torque::KnownTorque;
use super::link_points::LinkPoint;
use super::scale::LimitScale;
use super::self_collision_shapes::{LinkShape, SelfCollision};
use dynident_model::Model;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All limits of an experiment. A missing entry means no limit.
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
    /// Factors on the limits of all joints, for a slower or weaker motion: one number for velocity, acceleration and
    /// torque, or a table with one number for each. Limits that are given in `joints` are not scaled. Default 1.
    #[serde(skip_serializing_if = "LimitScale::is_one")]
    pub scale: LimitScale,
    /// Limits of single joints, at most one entry per joint.
    pub joints: Vec<JointLimit>,
    /// Boxes that points of the arm must not leave.
    pub boxes: Vec<BoxLimit>,
    /// Floor that points of the arm must stay above.
    pub floor: Option<FloorLimit>,
    /// Vertical column, such as the robot's pedestal, that points of the arm must not enter.
    pub column: Option<ColumnLimit>,
    /// Minimum distances between the arm's own links.
    pub self_collision: Option<SelfCollision>,
    /// Torque in addition to that of the rigid bodies that torque and power limits include. Not part of study files:
    /// it comes from the robot description and from other knowledge about the drives.
    #[serde(skip)]
    pub known_torque: KnownTorque,
}

/// Limits of one joint; rad (m), seconds, Nm (N), W. Velocity, acceleration, jerk and torque limits are maximum
/// magnitudes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JointLimit {
    /// Name of the joint.
    pub joint: String,
    /// Minimum and maximum position, rad or m.
    #[serde(default)]
    pub position: Option<[f64; 2]>,
    /// Maximum velocity, rad/s or m/s.
    #[serde(default)]
    pub speed: Option<f64>,
    /// Maximum acceleration, rad/s² or m/s².
    #[serde(default)]
    pub acceleration: Option<f64>,
    /// Maximum jerk, rad/s³ or m/s³.
    #[serde(default)]
    pub jerk: Option<f64>,
    /// Maximum torque, computed with the prior inertial parameters of the model and the known torque of friction,
    /// drives and springs, Nm or N.
    #[serde(default)]
    pub torque: Option<f64>,
    /// Margin for torque that the prior does not include, as a share of the torque limit, from 0 to below 1.
    #[serde(default)]
    pub torque_margin: f64,
    /// Maximum mechanical power `|τ q̇|`, W.
    #[serde(default)]
    pub power_w: Option<f64>,
}

/// A box in the base frame that points of the arm (with their radius) must not leave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BoxLimit {
    /// Range along the base frame's x axis, m; unlimited if missing.
    #[serde(default)]
    pub x_m: Option<[f64; 2]>,
    /// Range along the base frame's y axis, m; unlimited if missing.
    #[serde(default)]
    pub y_m: Option<[f64; 2]>,
    /// Range along the base frame's z axis, m; unlimited if missing.
    #[serde(default)]
    pub z_m: Option<[f64; 2]>,
    /// The points that must stay in the box; if empty, the origins of all moving bodies.
    #[serde(default)]
    pub points: Vec<LinkPoint>,
}

/// The plane `z = height_m` of the base frame that points of the arm (with their radius) must stay above.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FloorLimit {
    /// Height of the floor in the base frame, m.
    pub height_m: f64,
    /// The points that must stay above the floor. If empty, `shapes` are used; if these are empty, too, the origins
    /// of all moving bodies.
    #[serde(default)]
    pub points: Vec<LinkPoint>,
    /// Shapes of links that must stay above the floor.
    #[serde(default)]
    pub shapes: Vec<LinkShape>,
    /// Amount by which the floor is lowered for the shapes of single links, m: for links that are below the floor in
    /// every posture.
    #[serde(default)]
    pub lowered_m: BTreeMap<String, f64>,
}

/// A vertical cylinder in the base frame (axis parallel to z) that points of the arm (with their radius) must not
/// enter. It extends from far below up to `height_m`, or without limit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ColumnLimit {
    /// Radius of the cylinder, m.
    pub radius_m: f64,
    /// Height of the upper end of the cylinder, z in the base frame, m; unlimited by default.
    #[serde(default)]
    pub height_m: Option<f64>,
    /// Position of the axis of the cylinder: x and y in the base frame, m.
    #[serde(default)]
    pub axis_xy_m: [f64; 2],
    /// The points that must stay outside; no default, because points near the base are always inside.
    pub points: Vec<LinkPoint>,
}

impl Limits {
    /// Multiplies the limits of all joints.
    pub(super) fn scale_joints(&mut self, factors: LimitScale) {
        for joint in &mut self.joints {
            let pairs = [
                (&mut joint.speed, factors.speed),
                (&mut joint.acceleration, factors.acceleration),
                (&mut joint.torque, factors.torque),
            ];
            for (limit, factor) in pairs {
                *limit = limit.map(|limit| limit * factor);
            }
        }
    }

    /// Limits of the robot description: position (if both ends are given), velocity, and torque from `effort`, which
    /// must include the description's friction, drive inertia and springs. Acceleration, jerk, power and space are
    /// unlimited.
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

    /// These limits, with values of `other` replacing them joint by joint and value by value. The boxes of `other`
    /// are added. Its known torque replaces this one unless it is empty.
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

    /// Limits of one joint, if any.
    pub fn of(&self, joint: &str) -> Option<&JointLimit> {
        self.joints.iter().find(|limit| limit.joint == joint)
    }
}
