//! The joint-space mass matrix: the composite-rigid-body algorithm.

use crate::columns::ColumnScratch;
use crate::hinge::{BundledHinges, Hinge, with_hinge};
use crate::tree_scratch::{TreeBatch, TreeScratch, project_matrices};
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch, Scratch, Workspace, put_lanes, take, take_lanes};
use dynident_lanes::{Kernel, Lane, dispatch, dispatch_single};
use dynident_model::{JointStep, Model, Vec3};

/// The mass matrix `M(q)`, row-major, symmetric, dof × dof: `∂τ/∂q̈` of the inverse dynamics.
///
/// Composite-rigid-body algorithm: Walker and Orin (1982); Featherstone (2008), section 6.2; over the model's inner
/// frames ([`JointStep`](dynident_model::JointStep)). Allocation-free.
///
/// # Panics
/// If `q` has not one entry per joint, or the workspace was made for another tree.
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

/// [`mass_matrix`] of every sample, from positions that are joint-major: entry `(i, k)` of sample `s` stands at
/// `out[(i * dof + k) * samples + s]`.
///
/// Allocation-free, but for robots whose joints follow others at the first block of a size.
///
/// # Panics If `q` has not joints × samples or `out` not joints × joints × samples numbers, or the workspace was made
/// for another tree.
#[doc(alias("crba"))]
pub fn mass_matrix_batch(model: &Model, workspace: &mut BatchWorkspace, q: &[f64], samples: usize, out: &mut [f64]) {
    workspace.check(model, samples, &[q]);
    workspace.check_tree(model);
    assert_eq!(out.len(), model.dof() * model.dof() * samples, "one entry for two joints and sample");
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        let TreeBatch { motion: [tree_q, ..], matrices: [tree_out, ..], .. } = tree;
        let joints = coupling.joints();
        tree_q.resize(joints * samples, 0.0);
        coupling.positions(q, samples, tree_q);
        tree_out.resize(joints * joints * samples, 0.0);
        dispatch(*level, Batch { model, scratch, samples, q: tree_q, out: tree_out });
        project_matrices(coupling, tree_out, samples, out);
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
        composite_rigid_bodies(self.model, core, columns);
        put_matrix(columns, self.out);
    }
}

struct Batch<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    samples: usize,
    q: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Batch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { model, scratch, samples, q, out } = self;
        let Scratch { core, columns, .. } = scratch.of::<T>();
        if !columns.is_one_run() {
            out.fill(0.0);
        }
        for at in (0..samples).step_by(T::LANES) {
            take_lanes(&mut core.q, q, samples, at);
            core.hinges.place(model.steps(), &core.q);
            composite_rigid_bodies(model, core, columns);
            let is_whole = at + T::LANES <= samples;
            for entry in &columns.entries {
                let work = T::load(&columns.rows[entry.work..]);
                if is_whole {
                    work.store(&mut out[entry.upper * samples + at..]);
                    work.store(&mut out[entry.lower * samples + at..]);
                    continue;
                }
                put_lanes(work, &mut out[entry.upper * samples..(entry.upper + 1) * samples], at);
                put_lanes(work, &mut out[entry.lower * samples..(entry.lower + 1) * samples], at);
            }
        }
    }
}

/// The matrix of one sample from what [`composite_rigid_bodies`] left.
#[inline(always)]
pub(crate) fn put_matrix<T: Lane>(columns: &ColumnScratch<T>, out: &mut [f64]) {
    if !columns.is_one_run() {
        out.fill(0.0);
    }
    for entry in &columns.entries {
        let work = columns.rows[entry.work];
        out[entry.upper] = work;
        out[entry.lower] = work;
    }
}

/// From placed hinges to the rows of `columns`.
///
/// What hangs on a joint is one rigid body: first moment `h`, second moment Σ about the origin of the joint's frame.
/// Along (about) z it needs the wrench `f = z × h`, `n = (tr(Σ) 1 - Σ) z`, the joint's column; carried inward, its part
/// along (about) the axis of every joint on the way is an entry of the matrix. Columns of one sample travel together,
/// several in a bundle.
#[inline(always)]
pub(crate) fn composite_rigid_bodies<T: Lane>(
    model: &Model,
    core: &mut CoreScratch<T>,
    columns: &mut ColumnScratch<T>,
) {
    let steps = model.steps();
    let joints = steps.len();
    let (hinges, moments) = (core.hinges.placed(joints), &mut core.moments[..joints]);
    let ColumnScratch { place, end, force, moment, rows, .. } = columns;
    let bundles = force.len();
    let (place, end, moment) = (&place[..joints], &end[..joints], &mut moment[..bundles]);
    let lanes = <T::Bundle as Lane>::LANES;
    if T::PER_BUNDLE > 1 {
        force.fill(Vec3::ZERO);
        moment.fill(Vec3::ZERO);
    }
    for index in (0..joints).rev() {
        let step = &steps[index];
        let (inner, outer) = moments.split_at_mut(index);
        if step.is_tip {
            outer[0] = own_moments(step);
        }
        let (h, s) = &outer[0];
        let (own, lane) = place[index];
        if T::PER_BUNDLE == 1 {
            // Lanes are samples: a column goes all the way to the base in registers.
            let (mut f, mut n) = if step.turns {
                (Vec3([-h[1], h[0], T::ZERO]), Vec3([-s[2], -s[4], s[0] + s[3]]))
            } else {
                (Vec3([T::ZERO, T::ZERO, T::splat(step.subtree_mass)]), Vec3([h[1], -h[0], T::ZERO]))
            };
            let mut at = index;
            loop {
                let work = if steps[at].turns { n[2] } else { f[2] };
                work.store(&mut rows[(at * bundles + own) * lanes..]);
                let Some(parent) = steps[at].parent else { break };
                (f, n) = with_hinge!(hinges, steps[at], at, |hinge| (hinge.up(f), hinge.up(n)));
                n = hinges.translation(&steps[at], at).cross_add(f, n);
                at = parent;
            }
        } else {
            let (f, n) = (&mut force[own].0, &mut moment[own].0);
            if step.turns {
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
            for (column, to) in (if step.turns { &*moment } else { &*force }).iter().zip(row) {
                column[2].store(to);
            }
            if step.parent.is_some() {
                let bundled = BundledHinges(hinges);
                let translation = bundled.translation(step, index);
                with_hinge!(bundled, *step, index, |hinge| {
                    for (f, n) in force.iter_mut().zip(moment) {
                        *f = hinge.up(*f);
                        *n = translation.cross_add(*f, hinge.up(*n));
                    }
                });
            }
        }
        let Some(parent) = step.parent else { continue };
        let (h, s) = with_hinge!(hinges, *step, index, |hinge| (hinge.up(*h), hinge.up_symmetric(s)));
        let t = hinges.translation(step, index);
        // A body takes its own moments when the first of its children comes.
        if T::PER_BUNDLE == 1 {
            // Stores of wide lanes are dear: one for each number.
            let mut sum = if step.is_last_child { own_moments(&steps[parent]) } else { inner[parent] };
            add(&mut sum, h, &s, step.subtree_mass, t);
            inner[parent] = sum;
        } else {
            if step.is_last_child {
                inner[parent] = own_moments(&steps[parent]);
            }
            add(&mut inner[parent], h, &s, step.subtree_mass, t);
        }
    }
}

#[inline(always)]
fn own_moments<T: Lane>(step: &JointStep) -> (Vec3<T>, [T; 6]) {
    (step.first.splat(), step.second.map(T::splat))
}

/// Adds moments `(m, h, Σ)` about the point `t` to moments `(h, Σ)` about the origin: `h + m t` and, with `g = h + m
/// t/2`, `Σ + t gᵀ + g tᵀ`.
#[inline(always)]
fn add<T: Lane>(sum: &mut (Vec3<T>, [T; 6]), h: Vec3<T>, s: &[T; 6], mass: f64, t: Vec3<T>) {
    let (first, second) = sum;
    let mut g = h;
    *first += h;
    if mass != 0.0 {
        *first += t.scale(T::splat(mass));
        g = t.scale_add(T::splat(0.5 * mass), h);
    }
    macro_rules! entry {
        ($k:literal, $a:literal, $b:literal) => {
            second[$k] += t[$a].mul_add(g[$b], t[$b].mul_add(g[$a], s[$k]));
        };
    }
    entry!(0, 0, 0);
    entry!(1, 0, 1);
    entry!(2, 0, 2);
    entry!(3, 1, 1);
    entry!(4, 1, 2);
    entry!(5, 2, 2);
}
