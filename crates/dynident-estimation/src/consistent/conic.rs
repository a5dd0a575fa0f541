//! The convex program of both solution methods and its optimality certificate.
//!
//! ```text
//!     minimise  f(x) = ½‖A x − b‖² + Σ_i ½‖C_i x_i − d_i‖² + g·x − Σ_k γ_k ln det S_k(x)
//!     subject to  S_k(x) = mat(M_k x + o_k) ⪰ 0,   a_l·x + o_l ≥ 0
//! ```
//!
//! With multipliers Z_k ⪰ 0 and z_l ≥ 0 the optimum has gradient `Σ M_kᵀ vec(Z_k) + Σ a_l z_l` of the smooth part,
//! `S_k Z_k = γ_k 1` and `s_l z_l = 0` (Boyd and Vandenberghe, Convex Optimization, 5.9.2). A block with γ > 0 is an
//! entropic prior: its own barrier keeps it inside, and it ends on its central path at γ. A program can also limit the
//! squares of the data instead of minimising them, which is another convex constraint.

use super::cone::log_determinant;
use super::coordinates::{Vector10, matrix_of, vector_of};
use super::precise::Precise;
use nalgebra::{DMatrix, DVector, Matrix4};

/// One positive semidefinite 4 × 4 block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Linear part of the entries.
    pub(super) map: BlockMap,
    /// Constant part of the entries.
    pub(super) offset: Vector10,
    /// γ: weight of `−ln det`; zero for a constraint.
    pub(super) entropy: f64,
    /// Index in the caller's list of constraints.
    pub(super) label: usize,
}

/// M of a block.
#[derive(Clone, Debug)]
pub(super) enum BlockMap {
    /// Ten separate variables, starting at this one.
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
    /// Upper limit of `½‖A x − b‖²`. If set, this term is a constraint and not part of f. Its slack and multiplier
    /// follow those of the rows.
    pub(super) data_limit: Option<f64>,
    pub(super) local: Vec<LocalSquares>,
    pub(super) linear: DVector<f64>,
    pub(super) blocks: Vec<Block>,
    pub(super) rows: Vec<Row>,
}

#[derive(Clone, Debug)]
pub(super) struct Multipliers {
    pub(super) blocks: Vec<Matrix4<f64>>,
    pub(super) rows: Vec<f64>,
}

/// Distance of a point x with its multipliers from the optimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Certificate {
    /// `‖∇f − Σ Mᵀ Z − Σ a z‖_∞` divided by one plus its largest term.
    pub(super) stationarity: f64,
    /// Largest entry of `∇f − Σ Mᵀ Z − Σ a z`, without division.
    pub(super) imbalance: f64,
    /// Duality gap divided by `1 + |f|`: upper bound of the possible decrease of the objective at zero `stationarity`.
    pub(super) gap: f64,
    pub(super) objective: f64,
}

impl Certificate {
    pub(super) fn residual(&self) -> f64 {
        self.stationarity.max(self.gap)
    }

    pub(super) fn absolute_gap(&self) -> f64 {
        self.gap * (1.0 + self.objective.abs())
    }
}

impl Block {
    pub(super) fn value(&self, x: &DVector<f64>) -> Matrix4<f64> {
        matrix_of(&(self.offset + self.linear_part(x)))
    }

    pub(super) fn linear_part(&self, x: &DVector<f64>) -> Vector10 {
        match &self.map {
            BlockMap::Own(first) => Vector10::from_column_slice(&x.as_slice()[*first..first + 10]),
            BlockMap::General(map) => Vector10::from_column_slice((map * x).as_slice()),
        }
    }

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
    /// A program without objective and constraints.
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

    /// Gradient of the smooth part (without `−ln det`), and the largest magnitude of its terms.
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

    /// `Aᵀ (b − A x)`: negative gradient of the data's half squares.
    pub(super) fn data_slope(&self, x: &Precise) -> DVector<f64> {
        let mut slope = DVector::zeros(self.variables);
        if self.data.nrows() > 0 {
            slope.gemv_tr(1.0, &self.data, x.data_rest(&self.data, &self.target), 0.0);
        }
        slope
    }

    pub(super) fn data_squares(&self, x: &Precise) -> f64 {
        0.5 * x.data_rest(&self.data, &self.target).norm_squared()
    }

    /// Quadratic and linear terms of f.
    pub(super) fn smooth_objective(&self, x: &Precise) -> f64 {
        let data = if self.data_limit.is_some() { 0.0 } else { self.data_squares(x) };
        let x = &x.high;
        let local = |term: &LocalSquares| {
            0.5 * (&term.matrix * x.rows(term.first, term.matrix.ncols()) - &term.target).norm_squared()
        };
        data + self.local.iter().map(local).sum::<f64>() + self.linear.dot(x)
    }

    pub(super) fn strictly_inside(&self, x: &DVector<f64>) -> bool {
        self.blocks.iter().all(|block| block.value(x).cholesky().is_some())
            && self.rows.iter().all(|row| row.value(x) > 0.0)
    }

    /// Certificate of a strictly interior point with positive multipliers. Slacks are arguments, because solvers know
    /// them more accurately than as the difference of x and its limits.
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
                // Fenchel-Young gap ⟨S, Z⟩ − γ ln det(S Z/γ) − 4γ, zero exactly if S Z = γ 1.
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

#[derive(Clone, Debug)]
pub(super) struct Slacks {
    pub(super) blocks: Vec<Matrix4<f64>>,
    pub(super) rows: Vec<f64>,
}
