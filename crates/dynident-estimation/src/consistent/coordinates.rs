//! A body's ten parameters as a symmetric 4 × 4 matrix, whitened by a reference body.
//!
//! The pseudo-inertia `P = [Σ h; hᵀ m]`, `Σ = ½ tr(I) 1 − I`, `h = m r` is linear in the ten parameters, and a body is
//! physically consistent if and only if P is positive definite (Traversaro et al. 2016; Wensing, Kim and Slotine, RA-L
//! 3 (2018) 60, eq. 12). With a reference body `P0 = L Lᵀ` the solver works on `Q = L⁻¹ P L⁻ᵀ`, which has no units and
//! is independent of the size of the body; Q of the reference is the unit matrix.

use nalgebra::{Matrix4, SMatrix, SVector};

pub(super) type Vector10 = SVector<f64, 10>;
pub(super) type Matrix10 = SMatrix<f64, 10, 10>;

/// Rows and columns of the upper triangle, in the order of [`vector_of`].
pub(super) const PAIRS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2), (0, 3), (1, 3), (2, 3), (3, 3)];

/// The ten free entries of a symmetric matrix, off-diagonal ones times √2, so that `⟨A, B⟩ = tr(A B)`.
pub(super) fn vector_of(matrix: &Matrix4<f64>) -> Vector10 {
    Vector10::from_fn(|k, _| {
        let (i, j) = PAIRS[k];
        if i == j { matrix[(i, i)] } else { core::f64::consts::FRAC_1_SQRT_2 * (matrix[(i, j)] + matrix[(j, i)]) }
    })
}

/// The inverse of [`vector_of`].
pub(super) fn matrix_of(vector: &Vector10) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        let value = if i == j { vector[k] } else { core::f64::consts::FRAC_1_SQRT_2 * vector[k] };
        matrix[(i, j)] = value;
        matrix[(j, i)] = value;
    }
    matrix
}

/// The pseudo-inertia of `[m, m rx, m ry, m rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]` about the frame's origin.
pub(super) fn pseudo_inertia(p: &[f64]) -> Matrix4<f64> {
    let half = 0.5 * (p[4] + p[7] + p[9]);
    Matrix4::new(
        half - p[4],
        -p[5],
        -p[6],
        p[1], //
        -p[5],
        half - p[7],
        -p[8],
        p[2], //
        -p[6],
        -p[8],
        half - p[9],
        p[3], //
        p[1],
        p[2],
        p[3],
        p[0],
    )
}

pub(super) fn parameters_of(p: &Matrix4<f64>) -> Vector10 {
    Vector10::from([
        p[(3, 3)],
        p[(0, 3)],
        p[(1, 3)],
        p[(2, 3)],
        p[(1, 1)] + p[(2, 2)],
        -p[(0, 1)],
        -p[(0, 2)],
        p[(0, 0)] + p[(2, 2)],
        -p[(1, 2)],
        p[(0, 0)] + p[(1, 1)],
    ])
}

/// Map between a body's parameters and its whitened coordinates `x = vec(Q)`.
#[derive(Clone, Debug)]
pub(super) struct Whitening {
    /// T of `π = T x`.
    pub(super) to_parameters: Matrix10,
    inverse_factor: Matrix4<f64>,
    pub(super) mass_kg: f64,
    /// `√(tr Σ / m)` of the reference body: the unit of length.
    pub(super) length_m: f64,
}

impl Whitening {
    /// `None` unless the reference is positive definite.
    pub(super) fn new(reference: &[f64; 10]) -> Option<Self> {
        let p0 = pseudo_inertia(reference);
        let factor = p0.cholesky()?.l();
        let inverse_factor = factor.try_inverse()?;
        let to_parameters = Matrix10::from_columns(&core::array::from_fn::<_, 10, _>(|k| {
            let basis = matrix_of(&Vector10::from_fn(|i, _| f64::from(i == k)));
            parameters_of(&(factor * basis * factor.transpose()))
        }));
        let mass_kg = reference[0];
        let length_m = ((p0.trace() - mass_kg) / mass_kg).sqrt();
        let finite = to_parameters.iter().chain(inverse_factor.iter()).all(|v| v.is_finite()) && length_m.is_finite();
        finite.then_some(Self { to_parameters, inverse_factor, mass_kg, length_m })
    }

    pub(super) fn whitened(&self, parameters: &[f64]) -> Matrix4<f64> {
        self.inverse_factor * pseudo_inertia(parameters) * self.inverse_factor.transpose()
    }

    /// Units of the ten parameters from the reference: m, m ℓ (three times), m ℓ² (six times).
    pub(super) fn units(&self) -> [f64; 10] {
        let (m, l) = (self.mass_kg, self.length_m);
        core::array::from_fn(|k| {
            m * [1.0, l, l * l][if k == 0 {
                0
            } else if k < 4 {
                1
            } else {
                2
            }]
        })
    }

    /// Coefficients c with `c·x = w·π`.
    pub(super) fn functional(&self, w: &[f64; 10]) -> Vector10 {
        self.to_parameters.tr_mul(&Vector10::from(*w))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::InertialParameters;

    const BODY: [f64; 10] = [2.5, 0.3, -0.2, 0.7, 0.9, 0.02, -0.05, 0.8, 0.1, 0.4];

    #[test]
    fn coordinates_agree_with_the_model_and_invert() {
        // Sums and products of a few numbers of order one.
        let p = pseudo_inertia(&BODY);
        assert!((p - InertialParameters(BODY).pseudo_inertia()).amax() < 1e-15);
        assert!((parameters_of(&p) - Vector10::from(BODY)).amax() < 1e-15);
        assert!((matrix_of(&vector_of(&p)) - p).amax() < 1e-15);
        assert!((vector_of(&p).dot(&vector_of(&p)) - (p * p).trace()).abs() < 1e-14);
    }

    #[test]
    fn whitening_makes_the_reference_the_unit_matrix() {
        let whitening = Whitening::new(&BODY).unwrap();
        assert!((whitening.whitened(&BODY) - Matrix4::identity()).amax() < 1e-13);
        let other = [1.0, 0.1, 0.0, -0.2, 0.3, 0.0, 0.01, 0.35, 0.0, 0.3];
        let x = vector_of(&whitening.whitened(&other));
        assert!((whitening.to_parameters * x - Vector10::from(other)).amax() < 1e-13);
        // A point mass has no inverse.
        assert!(Whitening::new(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).is_none());
    }
}
