//! Reverse sweep of the torque regressor: converts derivatives of a cost with respect to every regressor entry into
//! derivatives with respect to the motion.
//!
//! With the derivatives `V` with respect to the entries of `Y`, the cost varies as `Σ V_ji · Y_ji`, and `Y_ji = e_jᵀ
//! N_i + l_jᵀ F_i` for each body `i` and each joint `j` that moves it (see `regressor.rs`). In reverse, every pair
//! contributes to the axis `(e_j, l_j)` and to the body's motion `(ω, α, a)`. The contributions are then transformed
//! inward from frame to frame; the contribution to each joint's motion gives the derivative with respect to its
//! position. One sweep gives all derivatives at about twice the cost of the regressor.

use crate::body_frames::outward;
use crate::regressor_panels::{Column, PanelLayout, Panels};
use crate::sample_lanes::{put_lanes, take_lanes};
use crate::states::{AdjointScratch, BodyAdjoint, BodyState};
use crate::tree_scratch::{TreeBatch, expanded};
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch};
use dynident_model::terms::JointMotion;
use dynident_model::{JointMap, Mat3, Model, Transform, Vec3};

/// Derivatives of a cost with respect to the motion of a block of samples, joint-major.
#[derive(Debug)]
pub struct MotionGradient<'a> {
    /// Derivatives with respect to positions.
    pub by_q: &'a mut [f64],
    /// Derivatives with respect to velocities.
    pub by_dq: &'a mut [f64],
    /// Derivatives with respect to accelerations.
    pub by_ddq: &'a mut [f64],
}

/// Adds the derivatives of a cost with respect to the motion to `gradient`. `adjoint` contains the derivatives with
/// respect to every regressor entry in the shape of [`regressor_panels`](crate::regressor_panels()) (torque columns
/// are not read). The result is exact and includes the terms.
///
/// Allocation-free.
///
/// # Panics
/// If an array's length is not joints × samples, the panels have another shape, or layout or workspace belong to
/// another tree.
pub fn regressor_panels_adjoint(
    model: &Model,
    workspace: &mut BatchWorkspace,
    layout: &PanelLayout,
    motion: &JointMotion<'_>,
    adjoint: &Panels,
    gradient: &mut MotionGradient<'_>,
) {
    let MotionGradient { by_q, by_dq, by_ddq } = gradient;
    workspace.check(model, motion.samples, &[motion.q, motion.dq, motion.ddq, by_q, by_dq, by_ddq]);
    workspace.check_tree(model);
    layout.check_tree(model);
    assert_eq!(adjoint.samples(), motion.samples, "one row of derivatives per sample");
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    let samples = motion.samples;
    let TreeBatch { motion: tree_motion, results, panels: buffers, .. } = tree;
    let mut tree_adjoint = Panels::in_buffers(core::mem::take(buffers));
    if let (Some(coupling), Some(layout)) = (model.coupling(), layout.scattered(adjoint, &mut tree_adjoint)) {
        let motion = &expanded(coupling, motion, tree_motion);
        for derivatives in results.iter_mut() {
            derivatives.clear();
            derivatives.resize(motion.q.len(), 0.0);
        }
        let [tree_q, tree_dq, tree_ddq] = results;
        let adjoint = &tree_adjoint;
        dispatch(
            *level,
            AdjointKernel { model, scratch, layout, motion, adjoint, by_q: tree_q, by_dq: tree_dq, by_ddq: tree_ddq },
        );
        for (to, from) in [&mut *by_q, &mut *by_dq, &mut *by_ddq].into_iter().zip(results) {
            coupling.add_projected(from, samples, to);
        }
    } else {
        dispatch(*level, AdjointKernel { model, scratch, layout, motion, adjoint, by_q, by_dq, by_ddq });
    }
    *buffers = tree_adjoint.into_buffers();
    for joint in 0..model.dof() {
        for (place, &global) in layout.joint_columns(joint).iter().enumerate() {
            if let Column::Term(term) = &layout.columns()[global] {
                let weights = &adjoint.joint(joint)[place * samples..(place + 1) * samples];
                term.apply_adjoint(joint, motion, weights, [&mut **by_q, &mut **by_dq, &mut **by_ddq]);
            }
        }
    }
}

struct AdjointKernel<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    layout: &'a PanelLayout,
    motion: &'a JointMotion<'a>,
    adjoint: &'a Panels,
    by_q: &'a mut [f64],
    by_dq: &'a mut [f64],
    by_ddq: &'a mut [f64],
}

impl Kernel for AdjointKernel<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let scratch = self.scratch.of::<T>();
        let samples = self.motion.samples;
        for at in (0..samples).step_by(T::LANES) {
            take_lanes(&mut scratch.core.q, self.motion.q, samples, at);
            take_lanes(&mut scratch.core.dq, self.motion.dq, samples, at);
            take_lanes(&mut scratch.core.ddq, self.motion.ddq, samples, at);
            let source = Source { layout: self.layout, adjoint: self.adjoint, at };
            reverse_sweep(self.model, &mut scratch.core, &mut scratch.adjoint, &source);
            for (joint, state) in scratch.adjoint.joints.iter().enumerate() {
                let range = joint * samples..(joint + 1) * samples;
                add_lanes(state.q, &mut self.by_q[range.clone()], at);
                add_lanes(state.dq, &mut self.by_dq[range.clone()], at);
                add_lanes(state.ddq, &mut self.by_ddq[range], at);
            }
        }
    }
}

#[inline(always)]
fn add_lanes<T: Lane>(value: T, row: &mut [f64], at: usize) {
    if at + T::LANES <= row.len() {
        (T::load(&row[at..]) + value).store(&mut row[at..]);
    } else {
        let mut lanes = [0.0; 8];
        put_lanes(value, &mut lanes[..T::LANES], 0);
        for (to, lane) in row[at..].iter_mut().zip(lanes) {
            *to += lane;
        }
    }
}

/// Derivatives of the cost with respect to the regressor.
struct Source<'a> {
    layout: &'a PanelLayout,
    adjoint: &'a Panels,
    at: usize,
}

impl Source<'_> {
    /// Derivatives with respect to the ten entries of body `body` in the row of the `k`-th joint on its path; zero
    /// for columns outside the layout and for lanes past the end.
    #[inline(always)]
    fn block<T: Lane>(&self, body: usize, k: usize, joint: usize) -> [T; 10] {
        let samples = self.adjoint.samples();
        let (present, place) = self.layout.body_columns(body, k);
        let panel = self.adjoint.joint(joint);
        let mut start = place * samples + self.at;
        let mut block = [T::ZERO; 10];
        for (parameter, to) in block.iter_mut().enumerate() {
            if present & (1 << parameter) == 0 {
                continue;
            }
            if self.at + T::LANES <= samples {
                *to = T::load(&panel[start..start + T::LANES]);
            } else {
                let values = &panel[start..start + samples - self.at];
                let mut lanes = [0.0; 8];
                lanes[..values.len()].copy_from_slice(values);
                *to = T::load(&lanes);
            }
            start += samples;
        }
        block
    }
}

/// Computes the derivatives in `adjoint.joints` from `q`, `dq`, `ddq` of the core scratch and the source.
#[inline(always)]
fn reverse_sweep<T: Lane>(
    model: &Model,
    core: &mut CoreScratch<T>,
    adjoint: &mut AdjointScratch<T>,
    source: &Source<'_>,
) {
    let maps = model.maps();
    core.place(maps);
    outward(model, core);
    let AdjointScratch { path, path_start, axes, by_axes, by_motion, joints } = adjoint;
    place_axes(maps, &core.bodies, path_start, axes);
    for own in &mut by_motion[..maps.len()] {
        *own = BodyAdjoint { omega: Vec3::ZERO, alpha: Vec3::ZERO, acceleration: Vec3::ZERO };
    }
    for pair in by_axes.iter_mut() {
        *pair = (Vec3::ZERO, Vec3::ZERO);
    }
    for index in (0..maps.len()).rev() {
        let map = &maps[index];
        let body = &core.bodies[index];
        let (start, own) = (path_start[index], path_start[index + 1] - 1);
        let mut share = by_motion[index];
        for (k, &joint) in path[start..=own].iter().enumerate() {
            let weights = source.block::<T>(index, k, joint as usize);
            pair_share(
                &weights,
                axes[start + k],
                (body.omega, body.alpha, body.acceleration),
                &mut by_axes[start + k],
                &mut share,
            );
        }
        // Inward: contributions to the joint's position, velocity and acceleration.
        let axis = map.axis.splat::<T>();
        let rate = axis.scale(core.dq[index]);
        let Transform { rotation, translation } = &body.parent_from_body;
        let mut turned = Vec3::ZERO;
        let mut slid = T::ZERO;
        if let Some(parent) = map.parent {
            let to = path_start[parent];
            for k in 0..own - start {
                let (angular, linear) = axes[start + k];
                let (by_angular, by_linear) = by_axes[start + k];
                turned = by_angular.cross_add(angular, by_linear.cross_add(linear, turned));
                let (outer_angular, outer_linear) = (rotation.mul_vec(by_angular), rotation.mul_vec(by_linear));
                if !map.is_rotary {
                    slid += axes[to + k].0.cross(map.slide.splat()).dot(outer_linear);
                }
                let target = &mut by_axes[to + k];
                target.0 += translation.cross_add(outer_linear, outer_angular);
                target.1 += outer_linear;
            }
        }
        let joint = &mut joints[index];
        let arriving_omega = if map.is_rotary { body.omega - rate } else { body.omega };
        if map.is_rotary {
            let arriving_alpha = body.alpha - axis.scale_add(core.ddq[index], arriving_omega.cross(rate));
            joint.dq = axis.dot(share.omega + share.alpha.cross(arriving_omega));
            joint.ddq = axis.dot(share.alpha);
            share.omega = rate.cross_add(share.alpha, share.omega);
            turned = share.omega.cross_add(
                arriving_omega,
                share.alpha.cross_add(arriving_alpha, share.acceleration.cross_add(body.acceleration, turned)),
            );
            joint.q = axis.dot(turned);
        } else {
            let coriolis = share.acceleration.cross(arriving_omega);
            joint.dq = axis.dot(coriolis + coriolis);
            joint.ddq = axis.dot(share.acceleration);
            let revolute = rate.cross(share.acceleration);
            share.omega += revolute + revolute;
            joint.q = slid;
        }
        let Some(parent) = map.parent else { continue };
        let outer = &core.bodies[parent];
        let (by_omega, by_alpha, by_swing) =
            (rotation.mul_vec(share.omega), rotation.mul_vec(share.alpha), rotation.mul_vec(share.acceleration));
        if !map.is_rotary {
            let slide = map.slide.splat::<T>();
            let swing = outer.omega.cross_add(outer.omega.cross(slide), outer.alpha.cross(slide));
            joints[index].q += swing.dot(by_swing);
        }
        let target = &mut by_motion[parent];
        target.acceleration += by_swing;
        target.alpha += translation.cross_add(by_swing, by_alpha);
        target.omega += outer
            .omega
            .cross(*translation)
            .cross_add(by_swing, translation.cross_add(by_swing.cross(outer.omega), by_omega));
    }
}

/// Axes of the joints on the path to each body, angular and linear, in the body's frame.
#[inline(always)]
fn place_axes<T: Lane>(
    maps: &[JointMap],
    bodies: &[BodyState<T>],
    path_start: &[usize],
    axes: &mut [(Vec3<T>, Vec3<T>)],
) {
    for (index, map) in maps.iter().enumerate() {
        let Transform { rotation, translation } = &bodies[index].parent_from_body;
        let start = path_start[index];
        let own = path_start[index + 1] - 1;
        if let Some(parent) = map.parent {
            let from = path_start[parent];
            for k in 0..own - start {
                let (angular, linear) = axes[from + k];
                axes[start + k] = (
                    rotation.transpose_mul_vec(angular),
                    rotation.transpose_mul_vec(angular.cross_add(*translation, linear)),
                );
            }
        }
        let axis = map.axis.splat::<T>();
        axes[own] = if map.is_rotary { (axis, Vec3::ZERO) } else { (Vec3::ZERO, axis) };
    }
}

/// Contribution of one body and one axis. With the weights as the body's ten parameters, the axis receives their
/// wrench; the body's motion receives the derivative of this wrench's power along the axis.
#[inline(always)]
fn pair_share<T: Scalar>(
    weights: &[T; 10],
    (angular, linear): (Vec3<T>, Vec3<T>),
    (omega, alpha, acceleration): (Vec3<T>, Vec3<T>, Vec3<T>),
    by_axis: &mut (Vec3<T>, Vec3<T>),
    by_motion: &mut BodyAdjoint<T>,
) {
    let w = weights;
    let h = Vec3([w[1], w[2], w[3]]);
    let inertia = Mat3([[w[4], w[5], w[6]], [w[5], w[7], w[8]], [w[6], w[8], w[9]]]);
    let spin = inertia.mul_vec(omega);
    let swing = omega.cross(h);
    by_axis.0 += omega.cross_add(spin, inertia.mul_vec_add(alpha, h.cross(acceleration)));
    by_axis.1 += omega.cross_add(swing, alpha.cross_add(h, acceleration.scale(w[0])));
    by_motion.acceleration += angular.cross_add(h, linear.scale(w[0]));
    by_motion.alpha += inertia.mul_vec_add(angular, h.cross(linear));
    // e·(ω × I ω) varies by δω·(I ω × e + I (e × ω)); l·(ω × (ω × h)) by δω·((ω × h) × l + h × (l × ω)).
    by_motion.omega += spin.cross_add(
        angular,
        inertia.mul_vec_add(angular.cross(omega), swing.cross_add(linear, h.cross(linear.cross(omega)))),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regressor_panels::all_columns;
    use dynident_lanes::{Dual, Level};
    use dynident_model::InertialParameters;
    use dynident_model::sample::{Random, random_tree};

    /// Oracle: the cost `Σ V_j · Y_j` of one sample is `Σ τ_j` with the weights of row `j` as inertial parameters,
    /// differentiated by dual numbers through the inverse dynamics.
    fn oracle(model: &Model, weights: &[Vec<f64>], state: [&[f64]; 3], which: usize, variable: usize) -> f64 {
        let mut scratch = CoreScratch::<Dual>::new(model.dof());
        let mut sum = 0.0;
        for (row, weights) in weights.iter().enumerate() {
            let bodies: Vec<InertialParameters> = (0..model.dof())
                .map(|body| InertialParameters(core::array::from_fn(|k| weights[10 * body + k])))
                .collect();
            let model = model.with_inertials(&bodies).unwrap();
            for (slot, values) in state.into_iter().enumerate() {
                let to = match slot {
                    0 => &mut scratch.q,
                    1 => &mut scratch.dq,
                    _ => &mut scratch.ddq,
                };
                for (index, (to, &value)) in to.iter_mut().zip(values).enumerate() {
                    let varied = slot == which && index == variable;
                    *to = if varied { Dual::variable(value) } else { Dual::constant(value) };
                }
            }
            crate::body_frames::newton_euler(&model, &mut scratch);
            sum += scratch.tau[row].derivative;
        }
        sum
    }

    #[test]
    fn equals_dual_numbers_at_every_level() {
        let mut random = Random::new(5);
        for seed in 0..24 {
            let dof = 1 + seed as usize % 8;
            let model = random_tree(seed, dof);
            let samples = 11;
            let mut array = |size: usize| (0..size).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
            let (q, dq, ddq) = (array(dof * samples), array(dof * samples), array(dof * samples));
            let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
            let layout = PanelLayout::new(&model, all_columns(&model, &[]));
            let mut adjoint = Panels::default();
            adjoint.resize(&layout, samples);
            for joint in 0..dof {
                let values = array(adjoint.joint(joint).len());
                adjoint.joint_mut(joint).copy_from_slice(&values);
            }
            for level in Level::available() {
                let mut gradient = [vec![0.0; dof * samples], vec![0.0; dof * samples], vec![0.0; dof * samples]];
                let [by_q, by_dq, by_ddq] = &mut gradient;
                regressor_panels_adjoint(
                    &model,
                    &mut BatchWorkspace::with_level(&model, level),
                    &layout,
                    &motion,
                    &adjoint,
                    &mut MotionGradient { by_q, by_dq, by_ddq },
                );
                for s in [0, 5, samples - 1] {
                    let at = |a: &[f64]| (0..dof).map(|j| a[j * samples + s]).collect::<Vec<f64>>();
                    let weights: Vec<Vec<f64>> = (0..dof)
                        .map(|joint| {
                            let mut row = vec![0.0; 10 * dof];
                            for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
                                row[column] = adjoint.joint(joint)[place * samples + s];
                            }
                            row
                        })
                        .collect();
                    let state = [at(&q), at(&dq), at(&ddq)];
                    for which in 0..3 {
                        for variable in 0..dof {
                            let expected = oracle(&model, &weights, [&state[0], &state[1], &state[2]], which, variable);
                            let found = gradient[which][variable * samples + s];
                            // Required: 1e-9; rounding of several thousand products of order ten is far smaller.
                            assert!(
                                (found - expected).abs() <= 1e-11 * (1.0 + expected.abs().max(100.0)),
                                "seed {seed}, {}, derivative {which} of joint {variable}: {found} against {expected}",
                                level.name()
                            );
                        }
                    }
                }
            }
        }
    }
}
