//! The convex program that both routes solve, and the certificate by which both are judged.
//!
//! ```text
//!     minimise  f(x) = ½‖A x − b‖² + Σ_i ½‖C_i x_i − d_i‖² + g·x − Σ_k γ_k ln det S_k(x)
//!     subject to  S_k(x) = mat(M_k x + o_k) ⪰ 0,   a_l·x + o_l ≥ 0
//! ```
//!
//! With multipliers Z_k ⪰ 0 and z_l ≥ 0 the optimum is where the gradient of the smooth part equals `Σ M_kᵀ vec(Z_k) +
//! Σ a_l z_l`, where `S_k Z_k = γ_k 1`, and `s_l z_l = 0` (Boyd and Vandenberghe, Convex Optimization, 5.9.2). A block
//! with γ > 0 is an entropic prior: its own barrier keeps it inside, and it stops on its central path at γ instead of
//! zero. A program can limit the data's squares in place of minimising them: one more constraint, convex as well.

use super::cone::log_determinant;
use super::coordinates::{Vector10, matrix_of, vector_of};
use super::precise::Precise;
use nalgebra::{DMatrix, DVector, Matrix4};

/// One positive semidefinite 4 × 4 block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Where its entries come from.
    pub(super) map: BlockMap,
    /// Constant part of the entries.
    pub(super) offset: Vector10,
    /// γ: weight of `−ln det`; zero for a plain constraint.
    pub(super) entropy: f64,
    /// What it stands for, an index into the caller's list of constraints.
    pub(super) label: usize,
}

/// M of a block.
#[derive(Clone, Debug)]
pub(super) enum BlockMap {
    /// Ten variables of its own, from this one on.
    Own(usize),
    /// 10 × n.
    General(DMatrix<f64>),
}

/// One linear inequality `a·x + o ≥ 0`.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) entries: Vec<(usize, f64)>,
    pub(super) offset: f64,
    pub(super) label: usize,
}

/// `½‖C x[first..] − d‖²`.
#[derive(Clone, Debug)]
pub(super) struct LocalSquares {
    pub(super) first: usize,
    pub(super) matrix: DMatrix<f64>,
    pub(super) target: DVector<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Program {
    pub(super) variables: usize,
    pub(super) data: DMatrix<f64>,
    pub(super) target: DVector<f64>,
    /// What the data's half squares may be: they are a constraint then, and no part of f. Its pair of slack and
    /// multiplier stands behind those of the rows.
    pub(super) data_limit: Option<f64>,
    pub(super) local: Vec<LocalSquares>,
    pub(super) linear: DVector<f64>,
    pub(super) blocks: Vec<Block>,
    pub(super) rows: Vec<Row>,
}

/// Multipliers of a program.
#[derive(Clone, Debug)]
pub(super) struct Multipliers {
    pub(super) blocks: Vec<Matrix4<f64>>,
    pub(super) rows: Vec<f64>,
}

/// How near a pair of point and multipliers is to the optimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Certificate {
    /// `‖∇f − Σ Mᵀ Z − Σ a z‖_∞` over one plus the largest of its terms.
    pub(super) stationarity: f64,
    /// The same imbalance itself.
    pub(super) imbalance: f64,
    /// The duality gap over `1 + |f|`: what the objective can still fall at most, when `stationarity` is zero.
    pub(super) gap: f64,
    /// f(x).
    pub(super) objective: f64,
}

impl Certificate {
    /// The larger of both.
    pub(super) fn residual(&self) -> f64 {
        self.stationarity.max(self.gap)
    }

    /// The duality gap itself.
    pub(super) fn absolute_gap(&self) -> f64 {
        self.gap * (1.0 + self.objective.abs())
    }
}

impl Block {
    pub(super) fn value(&self, x: &DVector<f64>) -> Matrix4<f64> {
        matrix_of(&(self.offset + self.linear_part(x)))
    }

    /// `M x` as a vector.
    pub(super) fn linear_part(&self, x: &DVector<f64>) -> Vector10 {
        match &self.map {
            BlockMap::Own(first) => Vector10::from_column_slice(&x.as_slice()[*first..first + 10]),
            BlockMap::General(map) => Vector10::from_column_slice((map * x).as_slice()),
        }
    }

    /// Adds `Mᵀ v` times `factor` to `sum`.
    pub(super) fn add_transposed(&self, v: &Vector10, factor: f64, sum: &mut DVector<f64>) {
        match &self.map {
            BlockMap::Own(first) => sum.rows_mut(*first, 10).axpy(factor, v, 1.0),
            BlockMap::General(map) => sum.gemv_tr(factor, map, v, 1.0),
        }
    }
}

impl Row {
    pub(super) fn value(&self, x: &DVector<f64>) -> f64 {
        self.offset + self.linear_part(x)
    }

    pub(super) fn linear_part(&self, x: &DVector<f64>) -> f64 {
        self.entries.iter().map(|&(column, factor)| factor * x[column]).sum()
    }

    pub(super) fn add_to(&self, factor: f64, sum: &mut DVector<f64>) {
        for &(column, value) in &self.entries {
            sum[column] += factor * value;
        }
    }
}

impl Program {
    /// A program of nothing but variables.
    pub(super) fn new(variables: usize) -> Self {
        Self {
            variables,
            data: DMatrix::zeros(0, variables),
            target: DVector::zeros(0),
            data_limit: None,
            local: Vec::new(),
            linear: DVector::zeros(variables),
            blocks: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Gradient of the smooth part (without `−ln det`), and the largest magnitude of the terms that it is a sum of.
    pub(super) fn gradient(&self, x: &Precise) -> (DVector<f64>, f64) {
        let data = if self.data_limit.is_some() { DVector::zeros(self.variables) } else { -self.data_slope(x) };
        let x = &x.high;
        let mut largest = data.amax().max(self.linear.amax());
        let mut gradient = data + &self.linear;
        for term in &self.local {
            let size = term.matrix.ncols();
            let part = term.matrix.tr_mul(&(&term.matrix * x.rows(term.first, size) - &term.target));
            largest = largest.max(part.amax());
            let mut place = gradient.rows_mut(term.first, size);
            place += part;
        }
        (gradient, largest)
    }

    /// `Aᵀ (b − A x)`: how fast the data's half squares fall.
    pub(super) fn data_slope(&self, x: &Precise) -> DVector<f64> {
        let mut slope = DVector::zeros(self.variables);
        if self.data.nrows() > 0 {
            slope.gemv_tr(1.0, &self.data, x.data_rest(&self.data, &self.target), 0.0);
        }
        slope
    }

    /// `½‖A x − b‖²`.
    pub(super) fn data_squares(&self, x: &Precise) -> f64 {
        0.5 * x.data_rest(&self.data, &self.target).norm_squared()
    }

    /// The squares and linear terms of f.
    pub(super) fn smooth_objective(&self, x: &Precise) -> f64 {
        let data = if self.data_limit.is_some() { 0.0 } else { self.data_squares(x) };
        let x = &x.high;
        let local = |term: &LocalSquares| {
            0.5 * (&term.matrix * x.rows(term.first, term.matrix.ncols()) - &term.target).norm_squared()
        };
        data + self.local.iter().map(local).sum::<f64>() + self.linear.dot(x)
    }

    /// Whether x lies strictly inside all constraints.
    pub(super) fn strictly_inside(&self, x: &DVector<f64>) -> bool {
        self.blocks.iter().all(|block| block.value(x).cholesky().is_some())
            && self.rows.iter().all(|row| row.value(x) > 0.0)
    }

    /// Judges a point strictly inside with positive multipliers; the routes share nothing else. Slacks are known better
    /// to a solver than as the difference of x and its limits.
    pub(super) fn certificate_of(
        &self,
        x: &Precise,
        slacks: &Slacks,
        multipliers: &Multipliers,
    ) -> Option<Certificate> {
        let (mut residual, mut largest) = self.gradient(x);
        let mut forces = DVector::zeros(self.variables);
        let mut gap = 0.0;
        let mut objective = self.smooth_objective(x);
        for ((block, s), z) in self.blocks.iter().zip(&slacks.blocks).zip(&multipliers.blocks) {
            block.add_transposed(&vector_of(z), 1.0, &mut forces);
            let product = vector_of(s).dot(&vector_of(z));
            if block.entropy > 0.0 {
                // Fenchel and Young: ⟨S, Z⟩ − γ ln det(S Z/γ) − 4γ, zero exactly where S Z = γ 1.
                let gamma = block.entropy;
                let log_s = log_determinant(s)?;
                let excess = product - gamma * (log_s + log_determinant(&(z / gamma))?) - 4.0 * gamma;
                gap += excess.max(0.0);
                objective -= gamma * log_s;
            } else {
                gap += product;
            }
        }
        for ((row, s), &z) in self.rows.iter().zip(&slacks.rows).zip(&multipliers.rows) {
            row.add_to(z, &mut forces);
            gap += s * z;
        }
        if self.data_limit.is_some() {
            let (s, z) = (slacks.rows.last()?, multipliers.rows.last()?);
            forces.axpy(*z, &self.data_slope(x), 1.0);
            gap += s * z;
        }
        largest = largest.max(forces.amax());
        residual -= forces;
        let certificate = Certificate {
            stationarity: residual.amax() / (1.0 + largest),
            imbalance: residual.amax(),
            gap: gap / (1.0 + objective.abs()),
            objective,
        };
        (certificate.residual().is_finite() && objective.is_finite()).then_some(certificate)
    }
}

/// How far inside a point lies.
#[derive(Clone, Debug)]
pub(super) struct Slacks {
    pub(super) blocks: Vec<Matrix4<f64>>,
    pub(super) rows: Vec<f64>,
}
