//! Classes of torque terms that the formats of exported models can represent.

use super::{Coulomb, CoulombShape, DriveInertia, JointProperty, TorqueTerm, Viscous};
use crate::Model;
use serde::{Deserialize, Serialize};

/// A class of torque terms, with the formats that represent it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TermClass {
    /// `d q̇ + c sign(q̇)` for each joint: URDF and SDF.
    DampingAndFriction,
    /// Damping and friction as above, drive inertia and the spring of each joint: MJCF.
    DampingFrictionAndInertia,
    /// All terms that are functions of the current position, velocity and acceleration, with smoothed sign functions:
    /// exported code.
    FunctionsOfMotion,
    /// All terms of the previous class and friction with hysteresis: exported functions with state.
    WithState,
}

impl TermClass {
    /// All classes.
    pub const ALL: [Self; 4] =
        [Self::DampingAndFriction, Self::DampingFrictionAndInertia, Self::FunctionsOfMotion, Self::WithState];

    /// Minimum width of smoothed sign functions in exported code, rad/s or m/s of a typical arm
    /// ([`CharacteristicScale::velocity`](crate::CharacteristicScale::velocity)). An unsmoothed sign function or a
    /// narrower one gets this width. So equal joints have equal functions, and no code is discontinuous at zero
    /// velocity.
    pub const CODE_STEP_WIDTH: f64 = 0.002;

    /// Terms of joint `joint` that a format of this class can represent. They replace the joint's terms in `terms`
    /// (all terms of the robot), except its spring. If the class can represent all of them, there is one list.
    /// Otherwise each list is an alternative: the caller should fit all of them and use the one with the smallest
    /// residual.
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
            Self::FunctionsOfMotion | Self::WithState => {
                let is_held =
                    |term: &TorqueTerm| !term.needs_temperature() && (self == Self::WithState || !term.has_memory());
                let kept: Vec<TorqueTerm> = own().filter(is_held).map(|term| self.in_form(model, &term)).collect();
                if own().all(|term| is_held(&term)) {
                    return vec![kept];
                }
                let is_rotary = model.joints()[joint].is_rotary();
                let widths = STEP_WIDTHS.map(|width| model.characteristic_scale().velocity(is_rotary, width));
                let mut lists: Vec<_> = widths.iter().map(|&width| without_memory(&kept, joint, Some(width))).collect();
                if kept.iter().any(is_coulomb) {
                    lists.push(without_memory(&kept, joint, None));
                }
                lists
            }
        }
    }

    /// Whether a format of this class represents a friction term of one joint without loss. A smoothed sign function
    /// of any width is treated as equal to the friction of URDF and MJCF.
    pub fn holds_friction(self, term: &TorqueTerm) -> bool {
        match self {
            Self::DampingAndFriction | Self::DampingFrictionAndInertia => {
                matches!(term, TorqueTerm::Viscous(_) | TorqueTerm::Coulomb(_))
            }
            Self::FunctionsOfMotion => !term.has_memory() && !term.needs_temperature(),
            Self::WithState => !term.needs_temperature(),
        }
    }

    /// The term as formats of this class represent it: in code with a smoothed sign function whose width is at least
    /// [`CODE_STEP_WIDTH`](Self::CODE_STEP_WIDTH).
    #[must_use]
    pub fn in_form(self, model: &Model, term: &TorqueTerm) -> TorqueTerm {
        match self {
            Self::DampingAndFriction | Self::DampingFrictionAndInertia => term.clone(),
            Self::FunctionsOfMotion | Self::WithState => {
                let is_rotary = term.joints().first().is_none_or(|&joint| model.joints()[joint].is_rotary());
                let least = model.characteristic_scale().velocity(is_rotary, Self::CODE_STEP_WIDTH);
                term.clone().with_step(|step| match step {
                    CoulombShape::Sign { .. } => CoulombShape::Smooth { width: least },
                    CoulombShape::Smooth { width } => CoulombShape::Smooth { width: width.max(least) },
                })
            }
        }
    }

    /// Whether a format of this class can represent a coupling of two joints, or a spring, with its value.
    pub fn holds(self, term: &TorqueTerm) -> bool {
        let is_spring = term.property() == Some(JointProperty::Stiffness);
        match self {
            Self::DampingAndFriction => false,
            Self::DampingFrictionAndInertia => is_spring,
            Self::FunctionsOfMotion | Self::WithState => true,
        }
    }
}

/// The terms that replace the terms of a joint whose hysteresis friction cannot be represented. Such friction equals
/// Coulomb friction until the joint reverses, and resembles viscous friction directly after a reversal. `kept`
/// contains the other terms; Coulomb terms get smoothed sign functions of this width.
fn without_memory(kept: &[TorqueTerm], joint: usize, width: Option<f64>) -> Vec<TorqueTerm> {
    let shape = |step| width.map_or(step, |width| CoulombShape::Smooth { width });
    let one = |term: &TorqueTerm| if is_coulomb(term) { term.clone().with_step(shape) } else { term.clone() };
    let mut terms: Vec<TorqueTerm> = kept.iter().map(one).collect();
    if !terms.iter().any(is_coulomb) {
        terms.push(TorqueTerm::Coulomb(Coulomb { joint, shape: shape(CoulombShape::Sign { dead_band: 0.0 }) }));
    }
    if !terms.iter().any(|term| matches!(term, TorqueTerm::Viscous(_) | TorqueTerm::DirectionalViscous(_))) {
        terms.push(TorqueTerm::Viscous(Viscous { joint }));
    }
    terms
}

fn is_coulomb(term: &TorqueTerm) -> bool {
    matches!(term, TorqueTerm::Coulomb(_) | TorqueTerm::DirectionalCoulomb(_))
}

/// Candidate widths of the smoothed sign function that replaces hysteresis friction, rad/s or m/s of an arm of usual
/// size.
const STEP_WIDTHS: [f64; 4] = [0.005, 0.02, 0.05, 0.1];
