//! Square matrices over the joints for several samples.

use crate::same_tree::{parents, same_tree};
use crate::sample_lanes::put_lanes;
use dynident_lanes::{AlignedBuffer, Lane};
use dynident_model::Model;

/// A square matrix over the joints for each of several samples, for example the mass matrix. It is stored by entry:
/// every entry is a row of samples that begins on a cache line.
///
/// Entries of joints on different branches are always zero (704 of 1024 for a humanoid of 32 joints). They are zeroed
/// once, when the array is created, and never written again.
///
/// ```
/// # use dynident_dynamics::{BatchWorkspace, JointMatrices, mass_matrices};
/// # let text = r#"<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0 0 0.2"/>
/// #   <mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
/// #   </robot>"#;
/// # let model = dynident_model::read_urdf(text)?.model;
/// let mut workspace = BatchWorkspace::new(&model);
/// let mut matrices = JointMatrices::new(&model);
/// mass_matrices(&model, &mut workspace, &[0.1, 0.2, 0.3], 3, &mut matrices);
/// assert!(matrices.entry(0, 0).iter().all(|inertia| (inertia - 0.1).abs() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct JointMatrices {
    dof: usize,
    parents: Vec<Option<usize>>,
    is_coupled: bool,
    samples: usize,
    stride: usize,
    values: AlignedBuffer,
}

impl JointMatrices {
    /// Creates matrices for robots with this model's tree, without samples.
    pub fn new(model: &Model) -> Self {
        Self {
            dof: model.dof(),
            parents: parents(model),
            is_coupled: model.coupling().is_some(),
            samples: 0,
            stride: 0,
            values: AlignedBuffer::new(),
        }
    }

    /// Number of joints: rows and columns.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Number of samples of the last computation.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Entry `(row, column)` of every sample.
    ///
    /// # Panics
    /// If row or column is not below [`dof`](Self::dof).
    pub fn entry(&self, row: usize, column: usize) -> &[f64] {
        assert!(row < self.dof && column < self.dof, "an entry has two joints");
        &self.values.as_slice()[(row * self.dof + column) * self.stride..][..self.samples]
    }

    /// Prepares the array for `samples` samples. Memory is reused if the number does not change; entries that are not
    /// written are zero.
    pub(crate) fn resize(&mut self, model: &Model, samples: usize) -> MatrixRows<'_> {
        let same = same_tree(&self.parents, model) && self.is_coupled == model.coupling().is_some();
        assert!(same && self.dof == model.dof(), "the matrices were made for a model with another tree");
        // A whole number of lanes, and an odd number of cache lines, so that entries do not map to the same cache
        // sets.
        let stride = 8 * (samples.div_ceil(8) | 1);
        if stride != self.stride {
            self.stride = stride;
            self.values.resize(self.dof * self.dof * stride);
            self.values.as_mut_slice().fill(0.0);
        }
        self.samples = samples;
        MatrixRows { out: self.values.as_mut_slice(), stride }
    }
}

/// One row of samples per entry: entry `k` of sample `s` is at `out[k * stride + s]`.
#[derive(Debug)]
pub(crate) struct MatrixRows<'a> {
    pub(crate) out: &'a mut [f64],
    pub(crate) stride: usize,
}

impl MatrixRows<'_> {
    /// Zeroes the entries of joints on different branches.
    pub(crate) fn clear_across_branches(&mut self, model: &Model) {
        let joints = model.body_count();
        let steps = model.steps();
        for joint in 0..joints {
            let mut ancestor = steps[joint].parent;
            for at in (0..joint).rev() {
                if ancestor == Some(at) {
                    ancestor = steps[at].parent;
                    continue;
                }
                for entry in [joint * joints + at, at * joints + joint] {
                    self.out[entry * self.stride..(entry + 1) * self.stride].fill(0.0);
                }
            }
        }
    }

    /// Writes the lanes, samples `at..`, of an entry; a type with one lane has one sample.
    #[inline(always)]
    pub(crate) fn put<T: Lane>(&mut self, entry: usize, at: usize, value: T) {
        if T::LANES == 1 {
            self.out[entry] = value.lane(0);
            return;
        }
        let start = entry * self.stride;
        if at + T::LANES <= self.stride {
            value.store(&mut self.out[start + at..]);
        } else {
            put_lanes(value, &mut self.out[start..start + self.stride], at);
        }
    }
}
