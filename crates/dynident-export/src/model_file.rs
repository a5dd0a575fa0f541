//! The model as JSON, for other programs.

use crate::error::ExportError;
use crate::exported::Exported;
use crate::robot_model::RobotModel;
use dynident_model::terms::{CoulombShape, TermConstant, TorqueTerm};
use dynident_model::{Body, Joint, Model, Transform};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name and version of the schema of [`ModelFile`].
pub const MODEL_SCHEMA: &str = "dynident/model/1";

/// The whole model: `tau = M(q) ddq + C(q, dq) dq + g(q)` plus the torque of all terms. Prismatic joints have m, N
/// and kg instead of rad, Nm and kg m²; units and the names of constants show this.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelFile {
    /// Name and version of the schema, [`MODEL_SCHEMA`].
    pub schema: String,
    /// Name of the robot.
    pub name: String,
    /// Name and version of the program that wrote the file.
    pub written_by: String,
    /// Origin of the model, and problems of the identification, one sentence each.
    pub notes: Vec<String>,
    /// Gravity in the base frame, m/s².
    pub gravity_m_s2: [f64; 3],
    /// Links that do not move; the frame of the first link is the frame of the base.
    pub base_links: Vec<ModelLink>,
    /// Joints, each with the body that it moves, parents before children. Positions, velocities and torques are
    /// vectors over the independent joints, in this order.
    pub joints: Vec<ModelJoint>,
    /// Inertia and friction of drives that are coupled to two joints.
    pub couplings: Vec<ModelTerm>,
}

/// A joint and its body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelJoint {
    /// Name of the joint.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Joint that moves the parent body; null for the base.
    pub parent: Option<String>,
    /// Pose of the body in the parent's frame at position zero.
    pub placement: ModelPlacement,
    /// Unit vector of the axis in the frame of the body.
    pub axis: [f64; 3],
    /// Limits in the robot description; null if the description has none.
    pub limits: ModelLimits,
    /// Body moved by the joint.
    pub body: ModelBody,
    /// Torque terms of the joint: friction, offset and drive inertia.
    pub terms: Vec<ModelTerm>,
    /// Law by which the joint follows others (mimic law); absent for an independent joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub follows: Option<ModelFollower>,
}

/// Mimic law of a joint: its position is the sum of multipliers times source positions, plus the offset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelFollower {
    /// Independent joints that this joint follows, each with the ratio of this joint's velocity to its velocity.
    pub multipliers: BTreeMap<String, f64>,
    /// Position of this joint while all followed joints are at zero, rad (m).
    pub offset: f64,
}

impl ModelFollower {
    fn of(model: &Model, joint: usize) -> Option<Self> {
        let coupling = model.coupling().filter(|_| model.joint_of(joint).is_none())?;
        let named = |&(source, multiplier): &(usize, f64)| (model.joints()[source].name.clone(), multiplier);
        let multipliers = coupling.row(joint).iter().map(named).collect();
        Some(Self { multipliers, offset: coupling.offset(joint) })
    }
}

/// Limits of a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelLimits {
    /// Lowest position, rad (m).
    pub lower: Option<f64>,
    /// Highest position, rad (m).
    pub upper: Option<f64>,
    /// Highest velocity, rad/s (m/s).
    pub velocity: Option<f64>,
    /// Highest torque, Nm (N).
    pub effort: Option<f64>,
}

/// A body: all links that move together with a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelBody {
    /// Name of the joint's child link; all numbers of the body are in the frame of this link.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m; null for a body without mass.
    pub com_m: Option<[f64; 3]>,
    /// Inertia about the centre of mass, kg m²: xx, xy, xz, yy, yz, zz; null for a body without mass.
    pub inertia_at_com_kgm2: Option<[f64; 6]>,
    /// The ten parameters in which the torque is linear: m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the
    /// origin of the frame.
    pub parameters: [f64; 10],
    /// All links of the body.
    pub links: Vec<ModelLink>,
}

/// A link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelLink {
    /// Name of the link.
    pub name: String,
    /// Pose of the link in the frame of its body.
    pub placement: ModelPlacement,
}

/// Pose of a frame in another one: `p_other = rotation p + translation_m`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelPlacement {
    /// Origin of the frame in the other one, m.
    pub translation_m: [f64; 3],
    /// Rotation matrix, row by row; its columns are the axes of the frame.
    pub rotation: [[f64; 3]; 3],
}

/// A torque term: its torque is the value times the function of its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelTerm {
    /// Symbol of the term, as in `result.json`.
    pub symbol: String,
    /// `viscous`, `coulomb`, `directional-viscous`, `directional-coulomb`, `stribeck`, `sigmoid`, `power`, `load`,
    /// `maxwell-slip`, `temperature-viscous`, `temperature-coulomb`, `offset`, `drive-inertia` or `coupling`; the
    /// functions are listed in the chapter on export of the book.
    pub kind: String,
    /// Joints on which the term acts: one, or two for a coupling.
    pub joints: Vec<String>,
    /// Value of the parameter.
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// Constants of the function, by name; names contain units.
    pub constants: BTreeMap<String, ModelConstant>,
}

/// A constant of a term.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum ModelConstant {
    /// A number.
    Number(f64),
    /// One number per joint.
    Numbers([f64; 2]),
    /// A list of numbers.
    List(Vec<f64>),
    /// A keyword, or an expression.
    Word(String),
}

impl ModelFile {
    /// The model with `notes`.
    pub fn of(robot: &RobotModel, notes: &[String]) -> Self {
        let model = robot.model();
        let joints = model.tree_joints().iter().zip(model.bodies()).zip(model.inertials()).enumerate();
        let joints = joints.map(|(index, ((joint, body), inertial))| ModelJoint {
            name: joint.name.clone(),
            kind: joint.kind.name().to_owned(),
            parent: joint.parent.map(|parent| model.tree_joints()[parent].name.clone()),
            placement: ModelPlacement::of(&joint.placement),
            axis: joint.axis.0,
            limits: ModelLimits {
                lower: joint.limits.lower,
                upper: joint.limits.upper,
                velocity: joint.limits.velocity,
                effort: joint.limits.effort,
            },
            body: ModelBody {
                name: body.name().to_owned(),
                mass_kg: inertial.mass_kg(),
                com_m: inertial.com_m().map(|com| com.0),
                inertia_at_com_kgm2: inertial.inertia_at_com().map(|inertia| upper_triangle(&inertia.0)),
                parameters: inertial.0,
                links: links(body),
            },
            terms: ModelTerm::of(robot, |term| term.own_joint().is_some() && term.own_joint() == model.joint_of(index)),
            follows: ModelFollower::of(model, index),
        });
        Self {
            schema: MODEL_SCHEMA.to_owned(),
            name: model.name().to_owned(),
            written_by: format!("dynident {}", env!("CARGO_PKG_VERSION")),
            notes: notes.to_vec(),
            gravity_m_s2: model.gravity().0,
            base_links: links(model.base()),
            joints: joints.collect(),
            couplings: ModelTerm::of(robot, |term| term.own_joint().is_none()),
        }
    }
}

pub(crate) fn model_json(robot: &RobotModel, notes: Vec<String>) -> Result<Exported, ExportError> {
    let text = dynident_text::json::to_string_pretty(&ModelFile::of(robot, &notes));
    Ok(Exported { text: text.map_err(|error| ExportError::Json { message: error.to_string() })? + "\n", notes })
}

impl ModelPlacement {
    fn of(placement: &Transform) -> Self {
        Self { translation_m: placement.translation.0, rotation: placement.rotation.0 }
    }
}

impl ModelTerm {
    pub(crate) fn of(robot: &RobotModel, wanted: impl Fn(&TorqueTerm) -> bool) -> Vec<Self> {
        let joints = robot.model().joints();
        let terms = robot.terms().filter(|(term, _)| wanted(term));
        terms
            .map(|(term, value)| {
                let felt: Vec<&Joint> = term.joints().into_iter().map(|joint| &joints[joint]).collect();
                // A coupling of a revolute and a prismatic joint has ratios in both units.
                let is_rotary = felt.iter().any(|joint| joint.is_rotary());
                Self {
                    symbol: term.symbol(),
                    kind: term.kind_name().to_owned(),
                    joints: felt.iter().map(|joint| joint.name.clone()).collect(),
                    value,
                    unit: unit(term.unit(), is_rotary),
                    constants: term
                        .constants()
                        .into_iter()
                        .flat_map(|one| constants(one.0, one.1, is_rotary))
                        .collect(),
                }
            })
            .collect()
    }
}

/// Unit of a constant at a revolute joint, or the corresponding unit at a prismatic joint.
fn unit(revolute: &str, is_rotary: bool) -> String {
    if is_rotary {
        return revolute.to_owned();
    }
    revolute.replace("kg m^2", "kg").replace("Nm", "N").replace("rad", "m")
}

/// A constant, with its unit in its name. A sign function becomes two constants, shape and width.
fn constants(name: &'static str, value: TermConstant, is_rotary: bool) -> Vec<(String, ModelConstant)> {
    let with_unit = |name: &str, at_revolute: &str| {
        let unit = if is_rotary { at_revolute.to_owned() } else { at_revolute.replace("rad", "m") };
        format!("{name}{unit}")
    };
    let number = |name: String, value: f64| (name, ModelConstant::Number(value));
    match value {
        TermConstant::Nothing => Vec::new(),
        TermConstant::Word(word) => vec![(name.to_owned(), ModelConstant::Word(word.to_owned()))],
        TermConstant::Numbers(values) => vec![(name.to_owned(), ModelConstant::Numbers(values))],
        TermConstant::Text(text) => vec![(name.to_owned(), ModelConstant::Word(text))],
        TermConstant::Points(points) => {
            let column = |of: usize| ModelConstant::List(points.iter().map(|point| point[of]).collect());
            let position = with_unit(&format!("{name}_position"), "_rad");
            vec![(position, column(0)), (format!("{name}_torque"), column(1))]
        }
        TermConstant::Number(value, "") => vec![number(name.to_owned(), value)],
        TermConstant::Number(value, unit) => vec![number(with_unit(name, &format!("_{unit}")), value)],
        TermConstant::Step(shape) => {
            let (word, width, value) = match shape {
                CoulombShape::Sign { dead_band } => ("sign", "dead_band", dead_band),
                CoulombShape::Smooth { width } => ("smooth", "width", width),
            };
            let word = (name.to_owned(), ModelConstant::Word(word.to_owned()));
            vec![word, number(with_unit(width, "_rad_s"), value)]
        }
    }
}

fn links(body: &Body) -> Vec<ModelLink> {
    let link = |link: &dynident_model::Link| ModelLink {
        name: link.name.clone(),
        placement: ModelPlacement::of(&link.placement),
    };
    body.links.iter().map(link).collect()
}

pub(crate) fn upper_triangle(m: &[[f64; 3]; 3]) -> [f64; 6] {
    [m[0][0], m[0][1], m[0][2], m[1][1], m[1][2], m[2][2]]
}
