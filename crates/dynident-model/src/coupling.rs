//! Joints that follow others: URDF `mimic`, MJCF joint equalities, passive joints of a parallelogram.

use crate::error::ModelError;
use crate::joint::Joint;
use dynident_lanes::Scalar;

/// Source joints with multipliers, and an offset.
type Law = (Vec<(usize, f64)>, f64);

/// Linear map from the degrees of freedom to the joints of the tree: `q_tree = G q + q_0`. Therefore `dq_tree = G
/// dq`, `ddq_tree = G ddq`, and, by virtual power, `tau = Gᵀ tau_tree`.
///
/// `G` has one row per joint of the tree; the row of an independent joint has a single 1. `G` is constant, so a closed
/// chain is represented exactly only if its passive joints follow linearly (parallelograms).
#[derive(Clone, Debug, PartialEq)]
pub struct JointCoupling {
    /// Index of the tree joint that each degree of freedom drives.
    driving: Vec<usize>,
    /// Nonzero entries of `G` by tree joint: degree of freedom, multiplier.
    rows: Vec<Vec<(usize, f64)>>,
    offsets: Vec<f64>,
}

impl JointCoupling {
    /// Builds the coupling from [`Joint::mimic`]; `None` if all joints are independent. A joint that follows a joint
    /// outside the tree is independent.
    ///
    /// # Errors
    /// A cycle of mimic joints, or a multiplier or offset that is not finite.
    pub(crate) fn of(tree: &[Joint]) -> Result<Option<Self>, ModelError> {
        let place = |name: &str| tree.iter().position(|joint| joint.name == name);
        let mut follows: Vec<Option<Law>> = Vec::with_capacity(tree.len());
        for joint in tree {
            let Some(mimic) = &joint.mimic else {
                follows.push(None);
                continue;
            };
            let numbers = mimic.sources.iter().map(|source| source.multiplier).chain([mimic.offset]);
            if numbers.into_iter().any(|number| !number.is_finite()) {
                return Err(ModelError::NotFinite { what: format!("what joint `{}` follows", joint.name) });
            }
            let sources: Option<Vec<(usize, f64)>> =
                mimic.sources.iter().map(|source| Some((place(&source.joint)?, source.multiplier))).collect();
            follows.push(sources.map(|sources| (sources, mimic.offset)));
        }
        if follows.iter().all(Option::is_none) {
            return Ok(None);
        }
        let driving: Vec<usize> = (0..tree.len()).filter(|&joint| follows[joint].is_none()).collect();
        let mut rows: Vec<Option<Vec<(usize, f64)>>> = vec![None; tree.len()];
        let mut offsets = vec![0.0; tree.len()];
        for (dof, &joint) in driving.iter().enumerate() {
            rows[joint] = Some(vec![(dof, 1.0)]);
        }
        // Each round resolves at least one follower whose source joints are known; otherwise there is a cycle.
        while let Some(first) = rows.iter().position(Option::is_none) {
            let mut settled = false;
            for joint in 0..tree.len() {
                let (None, Some((sources, offset))) = (&rows[joint], &follows[joint]) else { continue };
                if sources.iter().any(|(source, _)| rows[*source].is_none()) {
                    continue;
                }
                let mut own = vec![0.0; driving.len()];
                offsets[joint] = *offset;
                for &(source, multiplier) in sources {
                    offsets[joint] += multiplier * offsets[source];
                    for &(dof, share) in rows[source].iter().flatten() {
                        own[dof] += multiplier * share;
                    }
                }
                rows[joint] = Some(own.into_iter().enumerate().filter(|(_, share)| *share != 0.0).collect());
                settled = true;
            }
            if !settled {
                return Err(ModelError::MimicCircle { joint: tree[first].name.clone() });
            }
        }
        Ok(Some(Self { driving, rows: rows.into_iter().flatten().collect(), offsets }))
    }

    /// Number of degrees of freedom (columns of `G`).
    pub fn dof(&self) -> usize {
        self.driving.len()
    }

    /// Number of joints of the tree (rows of `G`).
    pub fn joints(&self) -> usize {
        self.rows.len()
    }

    /// Index of the tree joint that each degree of freedom drives, ascending.
    pub fn driving(&self) -> &[usize] {
        &self.driving
    }

    /// Nonzero entries of `G` in the row of a tree joint: degree of freedom, multiplier.
    pub fn row(&self, tree_joint: usize) -> &[(usize, f64)] {
        &self.rows[tree_joint]
    }

    /// Offset `q_0` of a tree joint, rad or m.
    pub fn offset(&self, tree_joint: usize) -> f64 {
        self.offsets[tree_joint]
    }

    /// Computes `q_tree = G q + q_0` for `samples` samples, joint-major.
    ///
    /// # Panics
    /// If a length is not joints × samples.
    pub fn positions<T: Scalar>(&self, q: &[T], samples: usize, q_tree: &mut [T]) {
        self.expand(q, samples, q_tree, |joint| T::splat(self.offsets[joint]));
    }

    /// Computes `dq_tree = G dq` or `ddq_tree = G ddq` for `samples` samples, joint-major.
    ///
    /// # Panics
    /// If a length is not joints × samples.
    pub fn rates<T: Scalar>(&self, dq: &[T], samples: usize, dq_tree: &mut [T]) {
        self.expand(dq, samples, dq_tree, |_| T::ZERO);
    }

    fn expand<T: Scalar>(&self, from: &[T], samples: usize, to: &mut [T], start: impl Fn(usize) -> T) {
        assert_eq!((from.len(), to.len()), (self.dof() * samples, self.rows.len() * samples), "one value per joint");
        for (joint, row) in self.rows.iter().enumerate() {
            let to = &mut to[joint * samples..(joint + 1) * samples];
            to.fill(start(joint));
            for &(dof, share) in row {
                for (to, from) in to.iter_mut().zip(&from[dof * samples..(dof + 1) * samples]) {
                    *to = from.mul_add(T::splat(share), *to);
                }
            }
        }
    }

    /// Adds `Gᵀ tau_tree` to `tau` for `samples` samples, joint-major: torques, or their derivatives.
    ///
    /// # Panics
    /// If a length is not joints × samples.
    pub fn add_projected<T: Scalar>(&self, tau_tree: &[T], samples: usize, tau: &mut [T]) {
        assert_eq!((tau.len(), tau_tree.len()), (self.dof() * samples, self.rows.len() * samples), "one per joint");
        for (joint, row) in self.rows.iter().enumerate() {
            let from = &tau_tree[joint * samples..(joint + 1) * samples];
            for &(dof, share) in row {
                for (to, from) in tau[dof * samples..(dof + 1) * samples].iter_mut().zip(from) {
                    *to = from.mul_add(T::splat(share), *to);
                }
            }
        }
    }

    /// Computes [`project_matrix`](Self::project_matrix) of a symmetric matrix; the result is exactly symmetric.
    ///
    /// # Panics
    /// If a matrix is not square over its joints.
    pub fn project_symmetric<T: Scalar>(&self, tree: &[T], out: &mut [T]) {
        self.project_matrix(tree, out);
        for row in 0..self.dof() {
            for column in 0..row {
                out[column * self.dof() + row] = out[row * self.dof() + column];
            }
        }
    }

    /// Computes `Gᵀ A G` for a square matrix over the joints of the tree, row-major.
    ///
    /// # Panics
    /// If a matrix is not square over its joints.
    pub fn project_matrix<T: Scalar>(&self, tree: &[T], out: &mut [T]) {
        let (count, dof) = (self.rows.len(), self.dof());
        assert_eq!((tree.len(), out.len()), (count * count, dof * dof), "square matrices");
        out.fill(T::ZERO);
        for (i, row_i) in self.rows.iter().enumerate() {
            for (k, row_k) in self.rows.iter().enumerate() {
                for &(a, share_a) in row_i {
                    for &(b, share_b) in row_k {
                        let entry = &mut out[a * dof + b];
                        *entry = tree[i * count + k].mul_add(T::splat(share_a * share_b), *entry);
                    }
                }
            }
        }
    }
}
