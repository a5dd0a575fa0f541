//! Scratch memory of the algorithms: one per thread, allocated once.

use crate::columns::ColumnScratch;
use crate::composite::Composite;
use crate::composite_moments::CompositeMoments;
use crate::hinge::Hinges;
use crate::same_tree::{parents, same_tree};
use crate::states::{AdjointScratch, ArticulatedInertia, AxisScratch, BodyState, LinkMotion, LinkWrench};
use crate::tree_scratch::{TreeBatch, TreeScratch};
use crate::varied_body::VariedBody;
use core::any::Any;
use dynident_lanes::{Kernel, Lane, Level, Scalar, dispatch, dispatch_single};
use dynident_model::{JointMap, Mat3, Model, Transform, Vec3};

#[derive(Debug)]
pub(crate) struct Scratch<T: Lane> {
    pub(crate) core: CoreScratch<T>,
    pub(crate) columns: ColumnScratch<T>,
    pub(crate) axes: AxisScratch<T>,
    pub(crate) adjoint: AdjointScratch<T>,
}

/// Scratch memory for any [`Scalar`], including dual numbers.
#[derive(Debug)]
pub(crate) struct CoreScratch<T> {
    pub(crate) q: Vec<T>,
    pub(crate) dq: Vec<T>,
    pub(crate) ddq: Vec<T>,
    pub(crate) tau: Vec<T>,
    pub(crate) sine: Vec<T>,
    pub(crate) cosine: Vec<T>,
    pub(crate) bodies: Vec<BodyState<T>>,
    pub(crate) composites: Vec<Composite<T>>,
    pub(crate) articulated: Vec<ArticulatedInertia<T>>,
    pub(crate) hinges: Hinges<T>,
    /// Motions of bodies with children other than the next body.
    pub(crate) motions: Vec<LinkMotion<T>>,
    pub(crate) wrenches: Vec<LinkWrench<T>>,
    /// Moments of bodies with children other than the next body.
    pub(crate) moments: Vec<CompositeMoments<T>>,
    pub(crate) varied: Vec<VariedBody<T>>,
    /// Square matrix over the joints of the tree, row-major.
    pub(crate) matrix: Vec<T>,
}

impl<T: Scalar> CoreScratch<T> {
    pub(crate) fn new(dof: usize) -> Self {
        let zeros = || vec![T::ZERO; dof];
        Self {
            q: zeros(),
            dq: zeros(),
            ddq: zeros(),
            tau: zeros(),
            sine: zeros(),
            cosine: zeros(),
            bodies: vec![BodyState::REST; dof],
            composites: vec![Composite::ZERO; dof],
            articulated: vec![ArticulatedInertia::ZERO; dof],
            hinges: Hinges::new(dof),
            motions: vec![LinkMotion::REST; dof],
            wrenches: vec![LinkWrench::ZERO; dof],
            moments: vec![CompositeMoments::ZERO; dof],
            varied: vec![VariedBody::REST; dof],
            matrix: vec![T::ZERO; dof * dof],
        }
    }

    /// Computes sines, cosines and all `parent_from_body` from the positions in `self.q`.
    #[inline(always)]
    pub(crate) fn place(&mut self, maps: &[JointMap]) {
        T::sin_cos_all(&self.q, &mut self.sine, &mut self.cosine);
        for (index, (map, body)) in maps.iter().zip(&mut self.bodies).enumerate() {
            body.parent_from_body = joint_transform(map, self.q[index], self.sine[index], self.cosine[index]);
        }
    }
}

/// `parent_from_child` of a joint at position `q` with its sine and cosine.
#[inline(always)]
pub(crate) fn joint_transform<T: Scalar>(map: &JointMap, q: T, sine: T, cosine: T) -> Transform<T> {
    if map.is_rotary {
        // Loops instead of closures: a closure that is not inlined is compiled without vector instructions.
        let mut rotation = [[T::ZERO; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let steady = cosine.mul_add(T::splat(map.cosine.0[i][j]), T::splat(map.constant.0[i][j]));
                rotation[i][j] = sine.mul_add(T::splat(map.sine.0[i][j]), steady);
            }
        }
        Transform { rotation: Mat3(rotation), translation: map.translation.splat() }
    } else {
        let row = |i: usize| Vec3(map.constant.0[i]).splat().0;
        Transform {
            rotation: Mat3([row(0), row(1), row(2)]),
            translation: map.slide.splat().scale_add(q, map.translation.splat()),
        }
    }
}

/// Scratch memory whose lane type was selected at run time.
pub(crate) struct AnyScratch(Box<dyn Any + Send + Sync>);

impl AnyScratch {
    /// The scratch memory with lanes of type `T`, which must be the type of its creation.
    #[inline(always)]
    pub(crate) fn of<T: Lane>(&mut self) -> &mut Scratch<T> {
        self.0.downcast_mut().expect("a workspace keeps the processor level that it was made for")
    }
}

/// Defines `struct Single`, the kernel of an algorithm for one sample: copies joint vectors into the scratch, runs the
/// algorithm and copies the results. A macro, because only code inside a [`Kernel`] is compiled for each processor
/// level.
macro_rules! one_sample_kernel {
    (($($input:ident),*), $algorithm:ident, $($output:ident: $field:ident $([$index:literal])?),*) => {
        struct Single<'a> {
            model: &'a Model,
            scratch: &'a mut $crate::workspace::AnyScratch,
            $($input: &'a [f64],)*
            $($output: &'a mut [f64],)*
        }

        impl dynident_lanes::Kernel for Single<'_> {
            type Output = ();
            #[inline(always)]
            fn run<T: dynident_lanes::Lane>(self) {
                let scratch = &mut self.scratch.of::<T>().core;
                $($crate::sample_lanes::take(&mut scratch.$input, self.$input);)*
                $algorithm(self.model, scratch);
                $(for (to, from) in self.$output.iter_mut().zip(&scratch.$field $([$index])?) {
                    *to = from.lane(0);
                })*
            }
        }
    };
}
pub(crate) use one_sample_kernel;

struct MakeScratch<'a>(&'a Model);

impl Kernel for MakeScratch<'_> {
    type Output = AnyScratch;
    #[inline(always)]
    fn run<T: Lane>(self) -> AnyScratch {
        AnyScratch(Box::new(Scratch::<T> {
            core: CoreScratch::new(self.0.body_count()),
            columns: ColumnScratch::new(self.0),
            axes: AxisScratch::new(self.0),
            adjoint: AdjointScratch::new(self.0),
        }))
    }
}

/// Scratch memory for algorithms on one sample. Every thread has one; all threads share the [`Model`].
///
/// Functions with a workspace do not allocate and return slices into it.
pub struct Workspace {
    pub(crate) level: Level,
    pub(crate) dof: usize,
    pub(crate) parents: Vec<Option<usize>>,
    pub(crate) scratch: AnyScratch,
    pub(crate) vector: Vec<f64>,
    /// Entries of joints on different branches are zero; no algorithm writes them.
    pub(crate) matrices: [Vec<f64>; 3],
    pub(crate) acceleration_derivatives: [Vec<f64>; 3],
    pub(crate) acceleration: Vec<f64>,
    pub(crate) regressor: Vec<f64>,
    pub(crate) placements: Vec<Transform>,
    pub(crate) tree: TreeScratch,
}

impl Workspace {
    /// Creates a workspace for models of this size (for the torque regressor: of this tree), at the best level of this
    /// processor.
    pub fn new(model: &Model) -> Self {
        Self::with_level(model, Level::detect())
    }

    /// Creates a workspace at a chosen processor level.
    pub fn with_level(model: &Model, level: Level) -> Self {
        let (dof, bodies) = (model.dof(), model.body_count());
        Self {
            level,
            dof,
            parents: parents(model),
            scratch: dispatch_single(level, MakeScratch(model)),
            vector: vec![0.0; dof],
            matrices: core::array::from_fn(|_| vec![0.0; dof * dof]),
            acceleration_derivatives: core::array::from_fn(|_| vec![0.0; dof * dof]),
            acceleration: vec![0.0; dof],
            regressor: vec![0.0; dof * bodies * 10],
            placements: vec![Transform::IDENTITY; bodies],
            tree: TreeScratch::new(model),
        }
    }

    /// The processor level in use.
    pub fn level(&self) -> Level {
        self.level
    }

    pub(crate) fn check_tree(&self, model: &Model) {
        assert!(same_tree(&self.parents, model), "the workspace was made for a model with another tree");
    }

    pub(crate) fn check(&self, model: &Model, vectors: &[&[f64]]) {
        let size = (self.dof, self.parents.len());
        assert_eq!(size, (model.dof(), model.body_count()), "the workspace was made for a model of another size");
        for vector in vectors {
            assert_eq!(vector.len(), self.dof, "a joint vector has one entry per joint");
        }
    }
}

impl core::fmt::Debug for Workspace {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Workspace").field("dof", &self.dof).field("level", &self.level).finish_non_exhaustive()
    }
}

/// Scratch memory for algorithms on several samples in SIMD lanes. Every thread has one.
pub struct BatchWorkspace {
    pub(crate) level: Level,
    pub(crate) dof: usize,
    parents: Vec<Option<usize>>,
    pub(crate) scratch: AnyScratch,
    pub(crate) tree: TreeBatch,
}

impl BatchWorkspace {
    /// Creates a workspace for models of this size (for the torque regressor: of this tree), at the best level of this
    /// processor.
    pub fn new(model: &Model) -> Self {
        Self::with_level(model, Level::detect())
    }

    /// Creates a workspace at a chosen processor level.
    pub fn with_level(model: &Model, level: Level) -> Self {
        let scratch = dispatch(level, MakeScratch(model));
        Self { level, dof: model.dof(), parents: parents(model), scratch, tree: TreeBatch::default() }
    }

    pub(crate) fn check_tree(&self, model: &Model) {
        assert!(same_tree(&self.parents, model), "the workspace was made for a model with another tree");
    }

    pub(crate) fn check(&self, model: &Model, samples: usize, arrays: &[&[f64]]) {
        let size = (self.dof, self.parents.len());
        assert_eq!(size, (model.dof(), model.body_count()), "the workspace was made for a model of another size");
        for array in arrays {
            assert_eq!(array.len(), self.dof * samples, "a motion array has one entry per joint and sample");
        }
    }
}

impl core::fmt::Debug for BatchWorkspace {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("BatchWorkspace").field("dof", &self.dof).field("level", &self.level).finish_non_exhaustive()
    }
}
