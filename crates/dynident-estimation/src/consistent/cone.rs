//! What an interior-point method needs of one cone of positive definite 4 × 4 matrices.

use super::coordinates::{Matrix10, PAIRS, Vector10, matrix_of, vector_of};
use nalgebra::{Matrix4, Vector4};

/// The scaling of Nesterov and Todd for a pair `S, Z ≻ 0`: R with `R⁻¹ S R⁻ᵀ = Rᵀ Z R = diag(λ)`.
///
/// Nesterov and Todd, SIAM J. Optimization 8 (1998) 324; computed as in Vandenberghe's CVXOPT notes (2010), section
/// 5.3: with `S = L Lᵀ`, `Z = M Mᵀ` and `MᵀL = U diag(λ) Vᵀ`, `R = L V diag(λ)^{-1/2}` and `R⁻¹ = diag(λ)^{-1/2} Uᵀ
/// Mᵀ`.
///
/// L is lower and M upper triangular, and both are carried from step to step by triangular factors near one: small
/// eigenvalues beside large ones keep their digits. R itself mixes them (its columns may turn freely where the λ are
/// alike), so that variables are seen in the frame of L.
#[derive(Clone, Debug)]
pub(super) struct Scaling {
    pub(super) lambda: Vector4<f64>,
    l: Matrix4<f64>,
    m: Matrix4<f64>,
    /// `MᵀL`.
    product: Matrix4<f64>,
    u: Matrix4<f64>,
    v: Matrix4<f64>,
    r_inverse: Matrix4<f64>,
}

impl Scaling {
    /// None when one of the two is not positive definite in double precision.
    pub(super) fn new(s: &Matrix4<f64>, z: &Matrix4<f64>) -> Option<Self> {
        let l = s.cholesky()?.l();
        let m = upper_factor(z)?;
        Self::of(l, m, m.transpose() * l)
    }

    fn of(l: Matrix4<f64>, m: Matrix4<f64>, product: Matrix4<f64>) -> Option<Self> {
        let (lambda, u, v) = singular_values(&product);
        let usable = lambda.iter().all(|&value| value > 0.0 && value.is_finite());
        let inverse_root = lambda.map(|value| 1.0 / value.sqrt());
        let r_inverse = Matrix4::from_diagonal(&inverse_root) * u.transpose() * m.transpose();
        let finite = l.iter().chain(r_inverse.iter()).all(|value| value.is_finite());
        (usable && finite).then_some(Self { lambda, l, m, product, u, v, r_inverse })
    }

    /// The scaling of the pair after a step, given in scaled coordinates: `S = R (diag(λ) + ΔS) Rᵀ`, `Z = R⁻ᵀ (diag(λ)
    /// + ΔZ) R⁻¹`. The pair itself is never formed.
    pub(super) fn moved(&self, ds: &Matrix4<f64>, dz: &Matrix4<f64>) -> Option<Self> {
        let inverse_root = Matrix4::from_diagonal(&self.lambda.map(|value| 1.0 / value.sqrt()));
        // Seen from L and M: one, and the change.
        let (of_s, of_z) = (self.v * inverse_root, self.u * inverse_root);
        let l = (Matrix4::identity() + of_s * ds * of_s.transpose()).cholesky()?.l();
        let m = upper_factor(&(Matrix4::identity() + of_z * dz * of_z.transpose()))?;
        Self::of(self.l * l, self.m * m, m.transpose() * self.product * l)
    }

    /// `S = L Lᵀ`.
    pub(super) fn primal(&self) -> Matrix4<f64> {
        self.l * self.l.transpose()
    }

    /// `Z = M Mᵀ`.
    pub(super) fn dual(&self) -> Matrix4<f64> {
        self.m * self.m.transpose()
    }

    /// The 10 × 10 matrix of `X ↦ L X Lᵀ` on vectors: from the frame to the body's own variables.
    pub(super) fn frame(&self) -> Matrix10 {
        congruence(&self.l)
    }

    /// The 10 × 10 matrix from the frame to scaled coordinates, `X ↦ (R⁻¹L) X (R⁻¹L)ᵀ` with `R⁻¹L = diag(λ)^{1/2} Vᵀ`.
    pub(super) fn scaled_frame(&self) -> Matrix10 {
        congruence(&(Matrix4::from_diagonal(&self.lambda.map(f64::sqrt)) * self.v.transpose()))
    }

    /// The 10 × 10 matrix of `X ↦ R⁻¹ X R⁻ᵀ` on vectors.
    pub(super) fn inverse_frame(&self) -> Matrix10 {
        congruence(&self.r_inverse)
    }

    /// The same from another pair's frame, whose L it is.
    pub(super) fn scaled_frame_of(&self, other: &Self) -> Matrix10 {
        congruence(&(self.r_inverse * other.l))
    }

    /// `R⁻¹ X R⁻ᵀ`: a primal direction, scaled.
    pub(super) fn scaled_primal(&self, x: &Matrix4<f64>) -> Matrix4<f64> {
        self.r_inverse * x * self.r_inverse.transpose()
    }

    /// `R⁻ᵀ X R⁻¹`: from a scaled dual direction to the direction itself.
    pub(super) fn unscaled_dual(&self, x: &Matrix4<f64>) -> Matrix4<f64> {
        self.r_inverse.transpose() * x * self.r_inverse
    }

    /// D with `½ (diag(λ) D + D diag(λ)) = C`.
    pub(super) fn divided(&self, c: &Matrix4<f64>) -> Matrix4<f64> {
        Matrix4::from_fn(|i, j| 2.0 * c[(i, j)] / (self.lambda[i] + self.lambda[j]))
    }

    /// The largest α for which `diag(λ) + α D` stays positive semidefinite (infinite if it always does).
    pub(super) fn largest_step(&self, d: &Matrix4<f64>) -> f64 {
        let scaled = Matrix4::from_fn(|i, j| 0.5 * (d[(i, j)] + d[(j, i)]) / (self.lambda[i] * self.lambda[j]).sqrt());
        let least = least_eigenvalue(&scaled);
        if least < 0.0 { -1.0 / least } else { f64::INFINITY }
    }
}

/// The 10 × 10 matrix of `X ↦ V X Vᵀ` on vectors.
pub(super) fn congruence(v: &Matrix4<f64>) -> Matrix10 {
    let columns = PAIRS.map(|(a, b)| -> Vector10 {
        let (va, vb) = (v.column(a), v.column(b));
        if a == b {
            vector_of(&(va * va.transpose()))
        } else {
            vector_of(&((va * vb.transpose() + vb * va.transpose()) * core::f64::consts::FRAC_1_SQRT_2))
        }
    });
    Matrix10::from_columns(&columns)
}

/// The smallest eigenvalue of a symmetric matrix; NaN for one that is not finite.
pub(super) fn least_eigenvalue(matrix: &Matrix4<f64>) -> f64 {
    if matrix.iter().all(|value| value.is_finite()) { matrix.symmetric_eigenvalues().min() } else { f64::NAN }
}

/// `ln det` of a positive definite matrix, or none.
pub(super) fn log_determinant(matrix: &Matrix4<f64>) -> Option<f64> {
    let factor = matrix.cholesky()?;
    let l = factor.l_dirty();
    Some(2.0 * (0..4).map(|k| l[(k, k)].ln()).sum::<f64>())
}

/// The inverse of a positive definite matrix, symmetric to the last bit, or none.
pub(super) fn inverse(matrix: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let inverse = matrix.cholesky()?.inverse();
    Some(matrix_of(&vector_of(&inverse)))
}

/// Upper triangular U with `U Uᵀ = S`, or none.
pub(super) fn upper_factor(s: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    // The Cholesky factor of the matrix read backwards.
    let flipped = Matrix4::from_fn(|i, j| s[(3 - i, 3 - j)]);
    let l = flipped.cholesky()?.l();
    Some(Matrix4::from_fn(|i, j| l[(3 - i, 3 - j)]))
}

/// Singular values and both sets of vectors of `A = U diag(σ) Vᵀ` by one-sided Jacobi rotations (Golub and Van Loan
/// 8.6.3): small values come out with as many digits as large ones, which a bidiagonal method does not give.
fn singular_values(a: &Matrix4<f64>) -> (Vector4<f64>, Matrix4<f64>, Matrix4<f64>) {
    let (mut b, mut v) = (*a, Matrix4::identity());
    // Six to eight sweeps settle a 4 × 4 matrix; the limit only guards the loop.
    for _ in 0..30 {
        let mut turned = false;
        for p in 0..3 {
            for q in p + 1..4 {
                let (alpha, beta) = (b.column(p).norm_squared(), b.column(q).norm_squared());
                let gamma = b.column(p).dot(&b.column(q));
                if gamma.abs() <= 1.0e-16 * (alpha * beta).sqrt() || !gamma.is_finite() {
                    continue;
                }
                turned = true;
                let zeta = (beta - alpha) / (2.0 * gamma);
                let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = c * t;
                for revolute in [&mut b, &mut v] {
                    for row in 0..4 {
                        let (x, y) = (revolute[(row, p)], revolute[(row, q)]);
                        revolute[(row, p)] = c * x - s * y;
                        revolute[(row, q)] = s * x + c * y;
                    }
                }
            }
        }
        if !turned {
            break;
        }
    }
    let sigma = Vector4::from_fn(|k, _| b.column(k).norm());
    let u = Matrix4::from_fn(|i, k| b[(i, k)] / sigma[k]);
    (sigma, u, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn definite(seed: f64, small: f64) -> Matrix4<f64> {
        let a = Matrix4::from_fn(|i, j| ((i * i * 5 + j * 3 + i * j * j * 2) as f64 * 0.7 + seed).sin());
        a * Matrix4::from_diagonal(&Vector4::new(1.0, 3.0, small, 0.4)) * a.transpose()
    }

    #[test]
    fn the_scaling_makes_both_sides_one_diagonal() {
        // On the central path S and Z are far from the unit matrix but their product is μ; here they are not even that.
        for small in [1.0, 1e-6] {
            let (s, z) = (definite(0.3, small), definite(1.1, 0.5));
            let scaling = Scaling::new(&s, &z).unwrap();
            let diagonal = Matrix4::from_diagonal(&scaling.lambda);
            // The condition of S times rounding, with room.
            assert!((scaling.scaled_primal(&s) - diagonal).amax() < 1e-9);
            assert!((scaling.unscaled_dual(&diagonal) - z).amax() < 1e-9);
            assert!((scaling.primal() - s).amax() < 1e-9 && (scaling.dual() - z).amax() < 1e-9);
            // A step in scaled coordinates is the same as one of the matrices.
            let ds = Matrix4::from_fn(|i, j| {
                0.1 * (scaling.lambda[i] * scaling.lambda[j]).sqrt() * f64::from(u8::from(i != j))
            });
            let after = scaling.moved(&ds, &(ds * -1.0)).unwrap();
            let in_frame = scaling.scaled_frame().try_inverse().unwrap() * vector_of(&ds);
            let moved = s + matrix_of(&(scaling.frame() * in_frame));
            assert!((after.primal() - moved).amax() < 1e-9);
            assert!((after.dual() - (z - scaling.unscaled_dual(&ds))).amax() < 1e-9);
        }
    }

    #[test]
    fn the_step_ends_on_the_boundary() {
        let (s, d) = (definite(0.3, 1.0), Matrix4::from_fn(|i, j| if i == j { -1.0 } else { 0.1 }));
        let scaling = Scaling::new(&s, &Matrix4::identity()).unwrap();
        let step = scaling.largest_step(&scaling.scaled_primal(&d));
        assert!(least_eigenvalue(&(s + d * step)).abs() < 1e-10);
        assert_eq!(scaling.largest_step(&scaling.scaled_primal(&Matrix4::identity())), f64::INFINITY);
    }

    #[test]
    fn congruence_is_the_product() {
        let (v, x) = (definite(0.2, 2.0), definite(0.9, 1.0));
        assert!((congruence(&v) * vector_of(&x) - vector_of(&(v * x * v))).amax() < 1e-12);
    }
}
