//! Which torque terms a form of the model can hold.

use super::{Coulomb, CoulombShape, DriveInertia, JointProperty, TorqueTerm, Viscous};
use crate::Model;
use serde::{Deserialize, Serialize};

/// A class of torque terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TermClass {
    /// `d q̇ + c sign(q̇)` for each joint: URDF and SDF.
    DampingAndFriction,
    /// The same with the drive inertia and the spring of each joint: MJCF.
    DampingFrictionAndInertia,
    /// All terms that are functions of the current position, velocity and acceleration: code.
    FunctionsOfMotion,
}

impl TermClass {
    /// All classes.
    pub const ALL: [Self; 3] = [Self::DampingAndFriction, Self::DampingFrictionAndInertia, Self::FunctionsOfMotion];

    /// The terms of joint `joint`, without its spring, in a form of this class, for a robot with the terms `terms`.
    /// Several lists are alternatives: the one with the smallest residual should be taken.
    pub fn terms_of_joint(self, model: &Model, terms: &[TorqueTerm], joint: usize) -> Vec<Vec<TorqueTerm>> {
        let is_own = move |term: &&TorqueTerm| {
            term.own_joint() == Some(joint) && term.property() != Some(JointProperty::Stiffness)
        };
        let own = || terms.iter().filter(is_own).cloned();
        let simple = || {
            let shape = CoulombShape::Sign { dead_band: 0.0 };
            vec![TorqueTerm::Viscous(Viscous { joint }), TorqueTerm::Coulomb(Coulomb { joint, shape })]
        };
        match self {
            Self::DampingAndFriction => vec![simple()],
            Self::DampingFrictionAndInertia => {
                let drive = TorqueTerm::DriveInertia(DriveInertia { joint });
                vec![simple().into_iter().chain(own().find(|term| *term == drive)).collect()]
            }
            Self::FunctionsOfMotion => {
                let kept: Vec<TorqueTerm> = own().filter(Self::is_function_of_motion).collect();
                let has_step = kept.iter().any(|term| term.is_joint_friction() && term.step().is_some());
                if has_step || own().all(|term| Self::is_function_of_motion(&term)) {
                    return vec![kept];
                }
                // Friction with memory is Coulomb friction until the joint reverses; friction under load has its sign.
                let is_rotary = model.joints()[joint].is_rotary();
                let widths = STEP_WIDTHS.map(|width| model.characteristic_scale().velocity(is_rotary, width));
                let with_step = |width: f64| {
                    let shape = CoulombShape::Smooth { width };
                    kept.iter().cloned().chain([TorqueTerm::Coulomb(Coulomb { joint, shape })]).collect()
                };
                widths.map(with_step).to_vec()
            }
        }
    }

    /// Whether a form of this class holds a friction term of one joint without a loss. A smooth step of any width is
    /// treated as the step of URDF and MJCF.
    pub fn holds_friction(self, term: &TorqueTerm) -> bool {
        match self {
            Self::DampingAndFriction | Self::DampingFrictionAndInertia => {
                matches!(term, TorqueTerm::Viscous(_) | TorqueTerm::Coulomb(_))
            }
            Self::FunctionsOfMotion => Self::is_function_of_motion(&term),
        }
    }

    /// Whether a term depends only on the current motion: not on earlier motion, the load of the gear or a temperature.
    fn is_function_of_motion(term: &TorqueTerm) -> bool {
        !term.has_memory() && !term.needs_load() && !term.needs_temperature()
    }

    /// Whether the class can hold a coupling of two joints or a spring, with its value.
    pub fn holds(self, term: &TorqueTerm) -> bool {
        let is_spring = term.property() == Some(JointProperty::Stiffness);
        match self {
            Self::DampingAndFriction => false,
            Self::DampingFrictionAndInertia => is_spring,
            Self::FunctionsOfMotion => true,
        }
    }
}

/// Candidate widths of the smooth step that replaces friction with memory or under load, rad/s or m/s of a usual arm.
const STEP_WIDTHS: [f64; 4] = [0.005, 0.02, 0.05, 0.1];
