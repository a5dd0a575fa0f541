//! Identifiable parameter combinations from the robot's structure.
//!
//! The torques are zero for all motions if and only if every entry `M_jk(q)` of the mass matrix and every gravity
//! torque is zero for all `q` (velocity torques follow from the mass matrix). Let `C_j(q)` be the composite inertia
//! of the subtree of joint `j` and `w` a twist at its frame. Then `M_jk = Φ_jᵀ C_j w` for `w = X Φ_k` with the joint
//! axes Φ; the gravity torque is the same with `w = X a_g`. Both are linear in the parameters. The number of
//! conditions is finite for three reasons:
//!
//! 1. One outward recursion computes the space of the twists `w` that can arrive at a joint. Each joint transforms it
//!    by `X(q) = X_0 + X_1 cos q + X_2 sin q` (prismatic: `X_0 + X_1 q`), where `cos`, `sin` and 1 are independent
//!    functions.
//! 2. Ten parameters move from a child's frame to its parent's by a 10 × 10 matrix `T(q)` with harmonics up to `2 q`
//!    (prismatic: up to `q²`). A condition on a composite splits into one condition on the constant part, shared with
//!    all bodies farther out, and one for every other harmonic, on the child alone.
//! 3. So each body has a small space of functionals of its ten composite parameters, and each functional is one row of
//!    conditions on all parameters.
//!
//! The rows span the identifiable directions. The recursion over such spaces follows Wensing, Niemeyer and Slotine, *A
//! geometric characterization of observability in inertial parameter identification* (2024); drive inertias, couplings
//! and offsets are added as constants in single entries.

use super::own_units::OwnUnits;
use crate::body_frames::inertial_wrench;
use crate::independent_columns::{Columns, IndependentColumns, split_columns};
use dynident_model::terms::{MotionFunction, TorqueTerm};
use dynident_model::{InertialParameters, Joint, Model, Transform, Vec3};
use nalgebra::{DVector, Matrix6, SMatrix, SVector};
use std::collections::HashMap;

type Matrix10 = SMatrix<f64, 10, 10>;
type Vector10 = SVector<f64, 10>;

/// Rows over all columns (bodies, then terms) that span the identifiable directions: rows of each body, base to tip,
/// then rows of friction. A body's rows have entries for the body, its subtree and the terms. They are stored at the
/// body and transformed outward column by column. All are in the robot's [`OwnUnits`].
pub(super) struct IdentifiableDirections<'a> {
    model: &'a Model,
    terms: &'a [TorqueTerm],
    units: OwnUnits,
    /// For each body: functionals of its ten composite parameters, followed by the constants of the terms.
    functionals: Vec<Vec<DVector<f64>>>,
    /// For each body: row of its first functional; then the first row of friction.
    first_row: Vec<usize>,
    /// For each body: constant part of the transformation of a composite to the parent, transposed.
    carry: Vec<Matrix10>,
    friction: Vec<DVector<f64>>,
}

/// Identifiable directions of `model` and `terms`; shares below `tolerance` are treated as zero.
pub(super) fn identifiable_directions<'a>(
    model: &'a Model,
    terms: &'a [TorqueTerm],
    tolerance: f64,
) -> IdentifiableDirections<'a> {
    let (dof, slots, units) = (model.dof(), source_slots(model, terms), OwnUnits::of(model));
    let mut twists: Vec<Vec<ArrivingTwist>> = Vec::with_capacity(dof);
    let mut composites: Vec<Vec<Vector10>> = Vec::with_capacity(dof);
    let (mut functionals, mut first_row, mut carry) = (Vec::new(), vec![0], Vec::new());
    for (j, joint) in model.joints().iter().enumerate() {
        let motion = Harmonics::of(joint, &units);
        let arriving =
            arriving_twists(model, &units, j, &motion, joint.parent.map(|p| &twists[p][..]), slots, tolerance);
        // Conditions on this body's composite from its own joint, followed by the constants of the terms.
        let own = arriving.iter().map(|w| (power(model, j, w), term_constants(model, &units, terms, j, w, slots)));
        // Conditions inherited from inner joints: every harmonic except the constant one constrains this composite
        // alone.
        let inherited: &[Vector10] = joint.parent.map_or(&[], |p| &composites[p]);
        let through = inherited
            .iter()
            .flat_map(|f| motion.inertia[1..].iter().map(move |t| (t.transpose() * f, DVector::zeros(terms.len()))));
        let stacked: Vec<DVector<f64>> = own
            .chain(through)
            .map(|(f, constants)| DVector::from_iterator(10 + terms.len(), f.iter().chain(constants.iter()).copied()))
            .collect();
        let bound = basis(&stacked, tolerance);
        let carried = inherited.iter().map(|f| motion.inertia[0].transpose() * f);
        let here = bound.iter().map(|v| Vector10::from_iterator(v.iter().copied().take(10)));
        let all: Vec<DVector<f64>> = here.chain(carried).map(|f| DVector::from_column_slice(f.as_slice())).collect();
        composites.push(basis(&all, tolerance).iter().map(|v| Vector10::from_column_slice(v.as_slice())).collect());
        twists.push(arriving);
        first_row.push(first_row[j] + bound.len());
        functionals.push(bound);
        carry.push(motion.inertia[0].transpose());
    }
    let friction = friction_conditions(terms);
    IdentifiableDirections { model, terms, units, functionals, first_row, carry, friction }
}

impl IdentifiableDirections<'_> {
    /// Split of all columns, with the regrouping in SI units.
    pub(super) fn split(&self, tolerance: f64) -> IndependentColumns {
        let mut split = split_columns(self, tolerance);
        let of_bodies = (0..10 * self.model.dof()).map(|column| self.units.of_body(column % 10));
        let of_terms = self.terms.iter().map(|term| self.units.of_term(self.model, term));
        let units: Vec<f64> = of_bodies.chain(of_terms).collect();
        for (mut factors, &column) in split.regrouping.column_iter_mut().zip(&split.dependent) {
            for (factor, &base) in factors.iter_mut().zip(&split.independent) {
                *factor *= units[base] / units[column];
            }
        }
        split
    }
}

impl Columns for IdentifiableDirections<'_> {
    fn rows(&self) -> usize {
        self.first_row[self.functionals.len()] + self.friction.len()
    }

    fn for_each(&self, take: &mut dyn FnMut(&[f64])) {
        let joints = self.model.joints();
        let mut children = vec![0_usize; joints.len()];
        for parent in joints.iter().filter_map(|joint| joint.parent) {
            children[parent] += 1;
        }
        // For each body with remaining children: row, and its ten entries for the body.
        let mut blocks: Vec<Vec<(usize, Vector10)>> = vec![Vec::new(); joints.len()];
        for (j, joint) in joints.iter().enumerate() {
            let mut block = Vec::new();
            if let Some(parent) = joint.parent {
                block.extend(blocks[parent].iter().map(|(row, f)| (*row, self.carry[j] * f)));
                children[parent] -= 1;
                if children[parent] == 0 {
                    blocks[parent] = Vec::new();
                }
            }
            let own = self.functionals[j].iter().map(|v| Vector10::from_iterator(v.iter().copied().take(10)));
            block.extend((self.first_row[j]..).zip(own));
            let mut column = vec![0.0; self.first_row[j + 1]];
            for k in 0..10 {
                for (row, f) in &block {
                    // Avoid negative zeros: a reflection depends on the sign of a zero.
                    column[*row] = f[k] + 0.0;
                }
                take(&column);
            }
            blocks[j] = block;
        }
        for term in 0..self.terms.len() {
            let constants = self.functionals.iter().flatten().map(|v| v[10 + term]);
            take(&constants.chain(self.friction.iter().map(|row| row[term])).collect::<Vec<f64>>());
        }
    }
}

/// Minimum number of joints for which the source of a twist (joint axis or gravity) is stored; only couplings need
/// more.
const MIN_SOURCE_SLOTS: usize = 48;

/// Number of slots for the sources of twists: joint `k` has slot `k` modulo this number, so that a source is stored as
/// long as a coupling may need it.
fn source_slots(model: &Model, terms: &[TorqueTerm]) -> usize {
    let reach = terms.iter().map(|term| {
        let joints = term.joints();
        joints.iter().max().zip(joints.iter().min()).map_or(0, |(most, least)| most - least)
    });
    MIN_SOURCE_SLOTS.max(reach.max().unwrap_or(0) + 1).min(model.dof())
}

/// A twist that can arrive at a joint, and the joint axis (or gravity, last) of its constant part.
struct ArrivingTwist {
    twist: nalgebra::Vector6<f64>,
    source: DVector<f64>,
}

/// Effect of one joint on twists and inertial parameters, by harmonic; the constant one first.
struct Harmonics {
    twist: Vec<Matrix6<f64>>,
    inertia: Vec<Matrix10>,
}

impl Harmonics {
    fn of(joint: &Joint, units: &OwnUnits) -> Self {
        let placement = |q: f64| units.placement(joint.transform(units.reach(joint.is_rotary()) * q));
        if joint.is_rotary() {
            // Five equidistant angles resolve the harmonics 1, cos, sin, cos 2q, sin 2q exactly.
            let angles: [f64; 5] = core::array::from_fn(|k| core::f64::consts::TAU * k as f64 / 5.0);
            let twists = angles.map(|q| twist_to_child(&placement(q)));
            let inertias = angles.map(|q| inertia_to_parent(&placement(q)));
            let weight = |k: usize, harmonic: usize| {
                let phase = angles[k] * harmonic.div_ceil(2) as f64;
                match harmonic {
                    0 => 0.2,
                    _ if harmonic % 2 == 1 => 0.4 * phase.cos(),
                    _ => 0.4 * phase.sin(),
                }
            };
            Self {
                twist: (0..3).map(|h| (0..5).map(|k| twists[k] * weight(k, h)).sum()).collect(),
                inertia: (0..5).map(|h| (0..5).map(|k| inertias[k] * weight(k, h)).sum()).collect(),
            }
        } else {
            let [back, rest, forth] = [-1.0, 0.0, 1.0].map(placement);
            let (b, r, f) = (inertia_to_parent(&back), inertia_to_parent(&rest), inertia_to_parent(&forth));
            Self {
                twist: vec![twist_to_child(&rest), (twist_to_child(&forth) - twist_to_child(&back)) * 0.5],
                inertia: vec![r, (f - b) * 0.5, (f + b) * 0.5 - r],
            }
        }
    }
}

/// 6 × 6 matrix that transforms a twist (angular, linear at the origin) from the parent's frame to the child's.
fn twist_to_child(parent_from_child: &Transform) -> Matrix6<f64> {
    let Transform { rotation, translation } = parent_from_child;
    let mut matrix = Matrix6::zeros();
    for k in 0..6 {
        let unit = |offset: usize| Vec3(core::array::from_fn(|i| f64::from(i + offset == k)));
        let (angular, linear) = (unit(0), unit(3));
        let a = rotation.transpose_mul_vec(angular);
        let l = rotation.transpose_mul_vec(linear + angular.cross(*translation));
        matrix.column_mut(k).copy_from_slice(&[a[0], a[1], a[2], l[0], l[1], l[2]]);
    }
    matrix
}

/// 10 × 10 matrix that transforms inertial parameters from the child's frame to the parent's.
fn inertia_to_parent(parent_from_child: &Transform) -> Matrix10 {
    Matrix10::from_columns(&core::array::from_fn::<_, 10, _>(|k| {
        let unit = InertialParameters(core::array::from_fn(|i| f64::from(i == k)));
        Vector10::from(unit.expressed_in(parent_from_child).0)
    }))
}

/// Spanning set of the twists that arrive at joint `j`.
fn arriving_twists(
    model: &Model,
    units: &OwnUnits,
    j: usize,
    motion: &Harmonics,
    parent: Option<&[ArrivingTwist]>,
    slots: usize,
    tolerance: f64,
) -> Vec<ArrivingTwist> {
    let joint = &model.joints()[j];
    let mut stacked = Vec::new();
    let mut push = |twist: &nalgebra::Vector6<f64>, source: DVector<f64>| {
        stacked.push(DVector::from_iterator(7 + slots, twist.iter().copied().chain(source.iter().copied())));
    };
    let axis = joint.axis;
    let own = if joint.is_rotary() {
        [axis[0], axis[1], axis[2], 0.0, 0.0, 0.0]
    } else {
        [0.0, 0.0, 0.0, axis[0], axis[1], axis[2]]
    };
    let mark = |place: usize| DVector::from_fn(slots + 1, |i, _| f64::from(i == place));
    push(&own.into(), mark(j % slots));
    let gravity = model.gravity();
    // Scaled to a length of about one, like the axes.
    let size = gravity.norm().max(f64::MIN_POSITIVE);
    let at_base = [ArrivingTwist {
        twist: [0.0, 0.0, 0.0, -gravity[0] / size, -gravity[1] / size, -gravity[2] / size].into(),
        source: mark(slots) / units.gravity(size),
    }];
    let from: &[ArrivingTwist] = match parent {
        Some(parent) => parent,
        None if gravity.norm() > 0.0 => &at_base,
        None => &[],
    };
    for w in from {
        let mut source = w.source.clone();
        // From here on, this slot stores the source of this joint.
        source[j % slots] = 0.0;
        push(&(motion.twist[0] * w.twist), source);
        for matrix in &motion.twist[1..] {
            push(&(matrix * w.twist), DVector::zeros(slots + 1));
        }
    }
    basis(&stacked, tolerance)
        .iter()
        .map(|v| ArrivingTwist {
            twist: nalgebra::Vector6::from_column_slice(&v.as_slice()[..6]),
            source: v.rows(6, slots + 1).into_owned(),
        })
        .collect()
}

/// `Φ_jᵀ I(π) w` as a functional of the ten parameters.
fn power(model: &Model, j: usize, w: &ArrivingTwist) -> Vector10 {
    let joint = &model.joints()[j];
    let (alpha, acceleration) =
        (Vec3([w.twist[0], w.twist[1], w.twist[2]]), Vec3([w.twist[3], w.twist[4], w.twist[5]]));
    Vector10::from_fn(|k, _| {
        let unit = InertialParameters(core::array::from_fn(|i| f64::from(i == k)));
        let (force, moment) = inertial_wrench(&unit, Vec3::ZERO, alpha, acceleration);
        joint.axis.dot(if joint.is_rotary() { moment } else { force })
    })
}

/// Constants of the terms in the entry of joint `j` for the source of `w`.
fn term_constants(
    model: &Model,
    units: &OwnUnits,
    terms: &[TorqueTerm],
    j: usize,
    w: &ArrivingTwist,
    slots: usize,
) -> DVector<f64> {
    DVector::from_fn(terms.len(), |x, _| {
        let term = &terms[x];
        if !term.acts_on(j) {
            return 0.0;
        }
        let inward = term.joints().into_iter().filter(|k| *k <= j);
        let inertia: f64 = inward.map(|k| w.source[k % slots] * term.mass_matrix_entry(j, k)).sum();
        let constant = term.constant_torque(j);
        if constant == 0.0 { inertia } else { inertia + w.source[slots] * constant * units.constant(model, term, j) }
    })
}

/// Friction depends on velocities only, so it does not combine with other columns. Each distinct function of the
/// motion in each joint's row is one condition; duplicate terms share it.
pub(super) fn friction_conditions(terms: &[TorqueTerm]) -> Vec<DVector<f64>> {
    let mut places: HashMap<(usize, String), usize> = HashMap::new();
    let mut conditions: Vec<DVector<f64>> = Vec::new();
    for (x, term) in terms.iter().enumerate() {
        for MotionFunction { row, function, factor } in term.functions() {
            let place = *places.entry((row, function)).or_insert(conditions.len());
            if place == conditions.len() {
                conditions.push(DVector::zeros(terms.len()));
            }
            conditions[place][x] += factor;
        }
    }
    conditions
}

/// Orthonormal basis of the span, without directions below `tolerance` times the longest vector: pivoted Gram-Schmidt
/// with reorthogonalisation. (The available SVD returned 5e-5 for an exact zero on a matrix of rank three.)
fn basis(vectors: &[DVector<f64>], tolerance: f64) -> Vec<DVector<f64>> {
    let longest = vectors.iter().map(DVector::norm).fold(0.0, f64::max);
    let mut rest = vectors.to_vec();
    let mut found: Vec<DVector<f64>> = Vec::new();
    loop {
        // The remainder of a vector can only shrink.
        rest.retain(|vector| vector.norm() > tolerance * longest);
        // The first of equally long vectors, so that the choice is the same on every processor.
        let norms: Vec<f64> = rest.iter().map(DVector::norm).collect();
        let norm = norms.iter().copied().fold(0.0, f64::max);
        let Some(next) = norms.iter().position(|other| *other == norm).map(|place| &rest[place]) else { return found };
        let direction = next / norm;
        for vector in &mut rest {
            for _ in 0..2 {
                let share = direction.dot(vector);
                vector.axpy(-share, &direction, 1.0);
            }
        }
        found.push(direction);
    }
}
