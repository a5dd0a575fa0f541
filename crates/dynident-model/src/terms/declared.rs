//! A torque that the user declares: `τ = k f(q, q̇)` with an identified coefficient `k`, for springs,
//! counterbalances, cables, gas struts, magnets and other position-dependent torques.
//!
//! `f` is an [`Expression`] of positions and velocities, a [`TorqueTable`] over the joint's position, or a function
//! in the caller's code ([`TorqueFunction`]). As for every term, the torque is the one that the drive has to provide.
//! A spring of stiffness `c` that pulls the joint back to `q₀` is `c (q - q₀)`; a spring that helps the drive has the
//! opposite sign.

use super::kind::{JointProperty, StateFunction, TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::law::{Law, VelocityLaw};
use super::{Expression, JointMotion, JointNames, TermInput, TorqueFunction, TorqueTable};
use crate::joint::{Joint, JointSpring};
use crate::tree::Model;
use serde::{Deserialize, Serialize};

/// A declared torque of one joint; its parameter is the coefficient `k`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Declared {
    /// Symbol of the parameter: a letter, then letters, digits and `_`.
    pub name: String,
    /// Index of the joint on which the torque acts.
    pub joint: usize,
    /// Function `f`.
    pub law: DeclaredLaw,
    /// Unit of the coefficient, as the user writes it.
    pub unit: String,
    /// Nominal value of the coefficient.
    #[serde(default)]
    pub nominal: Option<f64>,
    /// True for the spring of this joint in the robot description; the coefficient is its stiffness.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub is_spring: bool,
}

/// Function of a declared torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum DeclaredLaw {
    /// An expression of the positions and velocities of any joints.
    Expression(Expression),
    /// A curve over the position of the torque's joint.
    Table(TorqueTable),
    /// A function in the caller's code.
    Function(TorqueFunction),
}

impl Declared {
    /// Springs of the joints in the robot description, `stiffness (q - reference)`, each named `k_` plus the joint
    /// name. The spring of a mimic joint acts on its source. If the joint has several sources the spring is omitted,
    /// because a declared torque acts on one joint.
    pub fn springs(model: &Model) -> Vec<Self> {
        let spring = |(place, described): (usize, &Joint)| {
            let JointSpring { stiffness, reference } = described.spring?;
            let mut drivers = model.drivers(place);
            let (Some((joint, share)), None) = (drivers.next(), drivers.next()) else { return None };
            let from = reference - model.coupling().map_or(0.0, |coupling| coupling.offset(place));
            let names = JointNames { own: Some(joint), names: &[] };
            let law = match share {
                1.0 => format!("q - ({from:?})"),
                share => format!("({share:?}) * (({share:?}) * q - ({from:?}))"),
            };
            let letters = described.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
            Some(Self {
                name: format!("k_{}", letters.take(50).collect::<String>()),
                joint,
                law: DeclaredLaw::Expression(Expression::parse(&law, &names).ok()?),
                unit: if described.is_rotary() { "Nm/rad" } else { "N/m" }.to_owned(),
                nominal: Some(stiffness),
                is_spring: model.joint_of(place).is_some(),
            })
        };
        model.tree_joints().iter().enumerate().filter_map(spring).collect()
    }

    /// Whether `name` is a valid symbol: an ASCII letter, then letters, digits and `_`, at most 60 characters.
    pub fn is_symbol(name: &str) -> bool {
        name.len() <= 60
            && name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    }

    /// Calls `take(joint, is_velocity, slope)` with the derivatives of the torque per unit of the coefficient at a
    /// sample.
    fn slopes(&self, motion: &JointMotion<'_>, sample: usize, mut take: impl FnMut(usize, bool, f64)) {
        match &self.law {
            DeclaredLaw::Expression(expression) => {
                expression.slopes(|joint| motion.q_of(joint)[sample], |joint| motion.dq_of(joint)[sample], take);
            }
            DeclaredLaw::Table(table) => take(self.joint, false, table.slope(motion.q_of(self.joint)[sample])),
            // This function is differentiated elsewhere, block by block.
            DeclaredLaw::Function(_) => {}
        }
    }
}

impl StateFunction for Declared {
    fn value(&self, motion: &JointMotion<'_>, sample: usize) -> Option<f64> {
        match &self.law {
            DeclaredLaw::Expression(expression) => {
                expression.value(|joint| motion.q_of(joint)[sample], |joint| motion.dq_of(joint)[sample])
            }
            DeclaredLaw::Table(table) => Some(table.value(motion.q_of(self.joint)[sample])).filter(|x| x.is_finite()),
            DeclaredLaw::Function(function) => function.value(motion, sample),
        }
    }

    fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]) {
        if let DeclaredLaw::Function(function) = &self.law {
            return function.fill(motion, out);
        }
        for (sample, to) in out.iter_mut().enumerate() {
            *to = self.value(motion, sample).unwrap_or(f64::NAN);
        }
    }

    fn first_outside(&self, motion: &JointMotion<'_>) -> Option<usize> {
        if let DeclaredLaw::Function(function) = &self.law {
            let mut values = vec![0.0; motion.samples];
            function.fill(motion, &mut values);
            return values.iter().position(|value| value.is_nan());
        }
        (0..motion.samples).find(|&sample| !self.is_inside(motion, sample))
    }

    fn is_inside(&self, motion: &JointMotion<'_>, sample: usize) -> bool {
        match &self.law {
            DeclaredLaw::Expression(_) | DeclaredLaw::Function(_) => self.value(motion, sample).is_some(),
            DeclaredLaw::Table(table) => {
                let [first, last] = table.range();
                (first..=last).contains(&motion.q_of(self.joint)[sample])
            }
        }
    }

    fn follows(&self) -> Vec<usize> {
        match &self.law {
            DeclaredLaw::Expression(expression) => expression.joints(),
            DeclaredLaw::Table(_) => vec![self.joint],
            DeclaredLaw::Function(function) => function.follows.clone(),
        }
    }

    fn description(&self) -> String {
        match &self.law {
            DeclaredLaw::Expression(expression) => expression.to_string(),
            DeclaredLaw::Table(table) => {
                let points = table.points();
                let [[first, begin], [last, end]] = [points[0], points[points.len() - 1]];
                let (joint, count) = (self.joint + 1, points.len());
                format!("table of q{joint}, {count} points from ({first}, {begin}) to ({last}, {end})")
            }
            DeclaredLaw::Function(function) => format!("function {}", function.name),
        }
    }
}

impl VelocityLaw for Declared {}

impl Law for Declared {}

impl TermKind for Declared {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "declared", symbol: self.name.clone(), unit: &self.unit }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        false
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::State(self)
    }

    fn property(&self) -> Option<JointProperty> {
        self.is_spring.then_some(JointProperty::Stiffness)
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        match &self.law {
            DeclaredLaw::Expression(expression) => vec![("expression", TermConstant::Text(expression.to_string()))],
            DeclaredLaw::Table(table) => vec![("table", TermConstant::Points(table.points().to_vec()))],
            DeclaredLaw::Function(function) => vec![("function", TermConstant::Text(function.name.clone()))],
        }
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        self.fill(motion, out);
        out.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = 0.0);
    }

    fn apply_adjoint(&self, _: usize, motion: &JointMotion<'_>, weights: &[f64], adjoints: [&mut [f64]; 3]) {
        let [by_q, by_dq, _] = adjoints;
        if let DeclaredLaw::Function(function) = &self.law {
            return function.apply_adjoint(motion, weights, [by_q, by_dq]);
        }
        for (sample, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            self.slopes(motion, sample, |joint, is_velocity, slope| {
                let to = if is_velocity { &mut *by_dq } else { &mut *by_q };
                to[joint * motion.samples + sample] += weight * slope;
            });
        }
    }
}
