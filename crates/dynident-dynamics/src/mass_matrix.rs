//! The joint-space mass matrix: the composite-rigid-body algorithm.

use crate::columns::ColumnScratch;
use crate::composite_moments::{CompositeMoments, gathered, handed_on};
use crate::hinge::{BundledHinges, Hinge, cross_shift, with_hinge};
use crate::joint_matrices::{JointMatrices, MatrixRows};
use crate::sample_lanes::{take, take_lanes};
use crate::tree_scratch::{TreeBatch, TreeScratch, project_matrices};
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch, Scratch, Workspace};
use dynident_lanes::{Kernel, Lane, dispatch, dispatch_single};
use dynident_model::{JointStep, Model, Vec3};

/// The mass matrix `M(q)`, row-major, symmetric, dof × dof: `∂τ/∂q̈` of the inverse dynamics.
///
/// Composite-rigid-body algorithm: Walker and Orin (1982); Featherstone (2008), section 6.2; over the model's inner
/// frames ([`JointStep`](dynident_model::JointStep)). Allocation-free.
///
/// # Panics
/// If `q` does not have one entry per joint, or for a workspace of another tree.
#[doc(alias("crba", "inertia matrix", "joint-space inertia"))]
pub fn mass_matrix<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [f64] {
    workspace.check(model, &[q]);
    workspace.check_tree(model);
    let Workspace { level, scratch, matrices, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        let TreeScratch { q: tree_q, matrices: [out, ..], .. } = tree;
        coupling.positions(q, 1, tree_q);
        dispatch_single(*level, Single { model, scratch, q: tree_q, out });
        coupling.project_symmetric(out, &mut matrices[0]);
    } else {
        dispatch_single(*level, Single { model, scratch, q, out: &mut matrices[0] });
    }
    &matrices[0]
}

/// Computes [`mass_matrix`] of every sample. Entries of joints on different branches stay zero.
///
/// Allocation-free once `out` has grown to the number of samples, except for robots with coupled joints.
///
/// # Panics
/// If `q` does not have joints × samples values, or for a workspace or matrices of another tree.
#[doc(alias("crba"))]
pub fn mass_matrices(
    model: &Model,
    workspace: &mut BatchWorkspace,
    q: &[f64],
    samples: usize,
    out: &mut JointMatrices,
) {
    workspace.check(model, samples, &[q]);
    workspace.check_tree(model);
    fill(model, workspace, q, samples, out.resize(model, samples));
}

/// Writes the entries of all pairs of coupled joints.
fn fill(model: &Model, workspace: &mut BatchWorkspace, q: &[f64], samples: usize, mut out: MatrixRows<'_>) {
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        let TreeBatch { motion: [tree_q, ..], matrices: [tree_out, ..], .. } = tree;
        let joints = coupling.joints();
        tree_q.resize(joints * samples, 0.0);
        coupling.positions(q, samples, tree_q);
        tree_out.resize(joints * joints * samples, 0.0);
        let mut rows = MatrixRows { out: tree_out, stride: samples };
        rows.clear_across_branches(model);
        dispatch(*level, Batch { model, scratch, samples, q: tree_q, out: rows });
        project_matrices(coupling, tree_out, samples, &mut out);
    } else {
        dispatch(*level, Batch { model, scratch, samples, q, out });
    }
}

struct Single<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    q: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Single<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Scratch { core, columns, .. } = self.scratch.of::<T>();
        take(&mut core.q, self.q);
        core.hinges.place(self.model.steps(), &core.q);
        matrix_of_sample(self.model, core, columns, self.out);
    }
}

struct Batch<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    samples: usize,
    q: &'a [f64],
    out: MatrixRows<'a>,
}

impl Kernel for Batch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { model, scratch, samples, q, mut out } = self;
        let Scratch { core, .. } = scratch.of::<T>();
        for at in (0..samples).step_by(T::LANES) {
            take_lanes(&mut core.q, q, samples, at);
            core.hinges.place_below_base(model.steps(), &core.q);
            composite_rigid_bodies(model.steps(), core, &mut out, at);
        }
    }
}

/// Matrix of one sample from placed hinges. Entries of joints on different branches are never written.
#[inline(always)]
pub(crate) fn matrix_of_sample<T: Lane>(
    model: &Model,
    core: &mut CoreScratch<T>,
    columns: &mut ColumnScratch<T>,
    out: &mut [f64],
) {
    if T::PER_BUNDLE == 1 {
        composite_rigid_bodies(model.steps(), core, &mut MatrixRows { out, stride: 1 }, 0);
        return;
    }
    composite_rigid_bodies_in_bundles(model, core, columns);
    for entry in &columns.entries {
        let work = columns.rows[entry.work];
        out[entry.upper] = work;
        out[entry.lower] = work;
    }
}

/// Writes samples `at..` of `out` from placed hinges; each SIMD lane is one sample.
///
/// A joint's subtree is one rigid body with first moment `h` and second moment Σ about the origin of the joint's
/// frame. Unit acceleration along (about) z needs the wrench `f = z × h`, `n = (tr(Σ) 1 - Σ) z`: the column of the
/// joint. Its projection on the axis of every ancestor joint is an entry of the matrix. Columns, and moments along a
/// chain, stay in registers.
#[inline(always)]
fn composite_rigid_bodies<T: Lane>(
    steps: &[JointStep],
    core: &mut CoreScratch<T>,
    out: &mut MatrixRows<'_>,
    at: usize,
) {
    let joints = steps.len();
    let (hinges, kept) = (core.hinges.placed(joints), &mut core.moments[..joints]);
    let mut next = CompositeMoments::ZERO;
    for index in (0..joints).rev() {
        let step = &steps[index];
        let moments = gathered(step, index, kept, &next);
        let CompositeMoments { first: h, second: s } = &moments;
        let diagonal = if step.is_rotary { s[0] + s[3] } else { T::splat(step.subtree_mass) };
        out.put(index * joints + index, at, diagonal);
        let (mut f, mut n) = if step.is_rotary {
            (Vec3([-h[1], h[0], T::ZERO]), Vec3([-s[2], -s[4], diagonal]))
        } else {
            (Vec3([T::ZERO, T::ZERO, diagonal]), Vec3([h[1], -h[0], T::ZERO]))
        };
        let mut link = index;
        while let Some(parent) = steps[link].parent {
            let below = &steps[link];
            let translation = hinges.translation(below, link);
            let (force, moment) = with_hinge!(hinges, *below, link, |hinge| (hinge.up(f), hinge.up(n)));
            let (upper, lower) = (parent * joints + index, index * joints + parent);
            if below.hang.on_resting_axis {
                let work = cross_shift(below.shift, translation, force, moment)[2];
                out.put(upper, at, work);
                out.put(lower, at, work);
                break;
            }
            (f, n) = (force, cross_shift(below.shift, translation, force, moment));
            let work = if steps[parent].is_rotary { n[2] } else { f[2] };
            out.put(upper, at, work);
            out.put(lower, at, work);
            link = parent;
        }
        if step.parent.is_some() {
            handed_on(steps, index, moments.up(step, hinges, index), kept, &mut next);
        } else {
            next = CompositeMoments::ZERO;
        }
    }
}

/// Like [`composite_rigid_bodies`] for one sample, into the rows of `columns`, with several columns per bundle.
#[inline(always)]
fn composite_rigid_bodies_in_bundles<T: Lane>(
    model: &Model,
    core: &mut CoreScratch<T>,
    columns: &mut ColumnScratch<T>,
) {
    let steps = model.steps();
    let joints = steps.len();
    let (hinges, kept) = (core.hinges.placed(joints), &mut core.moments[..joints]);
    let ColumnScratch { place, end, force, moment, rows, .. } = columns;
    let bundles = force.len();
    let (place, end, moment) = (&place[..joints], &end[..joints], &mut moment[..bundles]);
    let lanes = <T::Bundle as Lane>::LANES;
    force.fill(Vec3::ZERO);
    moment.fill(Vec3::ZERO);
    let mut next = CompositeMoments::ZERO;
    for index in (0..joints).rev() {
        let step = &steps[index];
        let moments = gathered(step, index, kept, &next);
        let CompositeMoments { first: h, second: s } = &moments;
        let (own, lane) = place[index];
        let (f, n) = (&mut force[own].0, &mut moment[own].0);
        if step.is_rotary {
            (-h[1]).add_at(&mut f[0], lane);
            h[0].add_at(&mut f[1], lane);
            (-s[2]).add_at(&mut n[0], lane);
            (-s[4]).add_at(&mut n[1], lane);
            (s[0] + s[3]).add_at(&mut n[2], lane);
        } else {
            T::splat(step.subtree_mass).add_at(&mut f[2], lane);
            h[1].add_at(&mut n[0], lane);
            (-h[0]).add_at(&mut n[1], lane);
        }
        let (force, moment) = (&mut force[own..end[index]], &mut moment[own..end[index]]);
        let row = rows[(index * bundles + own) * lanes..].chunks_exact_mut(lanes);
        for (column, to) in (if step.is_rotary { &*moment } else { &*force }).iter().zip(row) {
            column[2].store(to);
        }
        if step.parent.is_none() {
            next = CompositeMoments::ZERO;
            continue;
        }
        let bundled = BundledHinges(hinges);
        let translation = bundled.translation(step, index);
        with_hinge!(bundled, *step, index, |hinge| {
            for (f, n) in force.iter_mut().zip(moment) {
                *f = hinge.up(*f);
                *n = cross_shift(step.shift, translation, *f, hinge.up(*n));
            }
        });
        handed_on(steps, index, moments.up(step, hinges, index), kept, &mut next);
    }
}
