//! Parts of a robot whose change is tested, with their effect on the base parameters.

use dynident_dynamics::{BaseParameters, Column};
use dynident_estimation::changes::ChangeGroup;
use dynident_model::terms::{JointProperty, TorqueTerm};
use dynident_model::{InertialParameters, Model};
use nalgebra::{DMatrix, DVector};

/// Expected change of a body's mass: a share of the mass of the body, and a share of the mass of the robot. A tool has
/// a few percent of the mass of its robot.
const BODY_SHARE: f64 = 0.3;
const ROBOT_SHARE: f64 = 0.03;

/// Expected change of a friction or drive parameter, relative to its value.
const TERM_SHARE: f64 = 0.5;

/// A part of the robot that may have changed: a body, or friction and drive terms of joints.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Body with this index.
    Body(usize),
    /// Friction, offsets and springs of this joint.
    Friction(usize),
    /// Drive inertia of this joint.
    Drive(usize),
    /// Friction, offsets and springs of all joints.
    AllFriction,
}

impl Part {
    /// Index of the body.
    pub fn body(&self) -> Option<usize> {
        if let Self::Body(body) = self { Some(*body) } else { None }
    }

    /// Name of the part in a sentence.
    pub fn words(&self, model: &Model) -> String {
        let joint = |joint: &usize| &model.joints()[*joint].name;
        match self {
            Self::Body(body) => format!("body `{}`", model.bodies()[*body].name()),
            Self::Friction(index) => format!("friction and offset of joint `{}`", joint(index)),
            Self::Drive(index) => format!("drive inertia of joint `{}`", joint(index)),
            Self::AllFriction => "friction and offsets of all joints".to_owned(),
        }
    }
}

/// Parts of a robot, their effects on the base parameters `rows`, and their expected changes.
#[allow(clippy::struct_field_names, reason = "one entry for each part in every list")]
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// The parts with an effect on these base parameters.
    pub parts: Vec<Part>,
    /// Effect of each part on the base parameters.
    pub groups: Vec<ChangeGroup>,
    /// Expected change of the unknowns of each group, in the units of the parameters.
    pub sizes: Vec<DVector<f64>>,
}

/// Matrix E of `θ = E π`: base parameters θ from all parameters π.
pub(super) fn effects(base: &BaseParameters) -> DMatrix<f64> {
    let (independent, dependent, regrouping) = (base.independent(), base.dependent(), base.regrouping());
    let mut all = DMatrix::zeros(independent.len(), base.all_columns().len());
    for (row, &column) in independent.iter().enumerate() {
        all[(row, column)] = 1.0;
    }
    for (k, &column) in dependent.iter().enumerate() {
        all.set_column(column, &regrouping.column(k));
    }
    all
}

/// The parts of a robot, with their effects on the base parameters with the indices `rows`. `values` contains the size
/// of each of these base parameters: its absolute value plus its error bar, and of two compared results the larger one.
/// If a term is only identifiable in a sum with other parameters (such as the drive inertia of the first joint with the
/// inertia of the first link), its size is at most that of this base parameter.
pub fn parts(model: &Model, base: &BaseParameters, rows: &[usize], values: &[f64]) -> Parts {
    let effects = effects(base).select_rows(rows);
    let largest_value = |column: usize| {
        let of_column = effects.column(column);
        let ratios = of_column.iter().zip(values).filter(|(effect, _)| **effect != 0.0);
        ratios.map(|(effect, value)| value / effect.abs()).reduce(f64::min).unwrap_or(0.0)
    };
    let total: f64 = model.inertials().iter().map(InertialParameters::mass_kg).sum();
    let mut found = Parts::default();
    let columns = base.all_columns();
    let of_terms = |wanted: &dyn Fn(&TorqueTerm) -> bool| {
        let is_wanted = |column: &Column| matches!(column, Column::Term(term) if wanted(term));
        (0..columns.len()).filter(|&k| is_wanted(&columns[k])).collect::<Vec<_>>()
    };
    let size = |column: usize| match &columns[column] {
        Column::Term(_) => TERM_SHARE * largest_value(column),
        Column::Body { body, parameter } => {
            let [mass, length] = expected_change(model, *body, total);
            match parameter {
                0 => mass,
                1..=3 => mass * length,
                _ => mass * length * length,
            }
        }
    };
    let mut add = |part: Part, columns: Vec<usize>| {
        let sizes = DVector::from_iterator(columns.len(), columns.iter().map(|&column| size(column)));
        let mut effect = effects.select_columns(&columns);
        for (mut column, size) in effect.column_iter_mut().zip(sizes.iter()) {
            column *= *size;
        }
        // A part without an effect on these parameters cannot be tested.
        if effect.iter().any(|value| *value != 0.0) {
            found.groups.push(ChangeGroup { name: part.words(model), effect });
            found.parts.push(part);
            found.sizes.push(sizes);
        }
    };
    for body in 0..model.body_count() {
        let own = |column: &Column| matches!(column, Column::Body { body: own, .. } if *own == body);
        add(Part::Body(body), (0..columns.len()).filter(|&k| own(&columns[k])).collect());
    }
    let is_drive = |term: &TorqueTerm| term.property() == Some(JointProperty::DriveInertia);
    for joint in 0..model.dof() {
        add(Part::Friction(joint), of_terms(&|term| term.own_joint() == Some(joint) && !is_drive(term)));
        add(Part::Drive(joint), of_terms(&|term| term.own_joint() == Some(joint) && is_drive(term)));
    }
    add(Part::AllFriction, of_terms(&|term| !is_drive(term)));
    found
}

/// Expected change of the mass of a body (kg), and its expected distance from the origin of the body frame (m): the
/// distance of the centre of mass plus the radius of gyration.
fn expected_change(model: &Model, body: usize, total_kg: f64) -> [f64; 2] {
    let inertial = &model.inertials()[body];
    let own = inertial.mass_kg().max(0.0);
    let mass = BODY_SHARE * own + ROBOT_SHARE * total_kg;
    let arm_m = model.arm_m();
    let length = if own > 0.0 {
        let centre = inertial.first_moment().scale(1.0 / own).norm();
        let moments = inertial.principal_moments().unwrap_or_default();
        centre + (0.5 * moments.iter().sum::<f64>().max(0.0) / own).sqrt()
    } else {
        0.0
    };
    // The length of a tool is about a tenth of the length of its arm.
    [mass.max(1e-6), length.max(0.1 * arm_m).max(1e-3)]
}
