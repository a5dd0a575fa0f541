//! Operations on one cone of positive definite 4 × 4 matrices for an interior-point method.

use super::coordinates::{Matrix10, PAIRS, Vector10, matrix_of, vector_of};
use nalgebra::{Matrix4, Vector4};

/// The scaling of Nesterov and Todd for a pair `S, Z ≻ 0`: R with `R⁻¹ S R⁻ᵀ = Rᵀ Z R = diag(λ)`.
///
/// Nesterov and Todd, SIAM J. Optimization 8 (1998) 324; computed as in Vandenberghe's CVXOPT notes (2010), section
/// 5.3: with `S = L Lᵀ`, `Z = M Mᵀ` and `MᵀL = U diag(λ) Vᵀ`, `R = L V diag(λ)^{-1/2}` and `R⁻¹ = diag(λ)^{-1/2} Uᵀ
/// Mᵀ`.
///
/// L is lower and M upper triangular. Both are updated in each step by triangular factors near one, so that small
/// eigenvalues keep their digits. R mixes them (its columns are not unique for nearly equal λ), so variables are
/// represented in the frame of L.
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
    /// `None` unless both are positive definite in double precision.
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
        // In the frames of L and M: the unit matrix plus the change.
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

    /// The 10 × 10 matrix of `X ↦ L X Lᵀ` on vectors: from the frame to the body's variables.
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

    /// Like [`scaled_frame`](Self::scaled_frame), but starts from the frame of another pair.
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

/// Smallest eigenvalue of a symmetric matrix, to rounding of the largest one; NaN for a matrix that is not finite.
///
/// Two reflections make the matrix tridiagonal. Laguerre's iteration then finds the smallest root of the
/// characteristic polynomial from a lower bound: for real roots it converges monotonically and cubically (Wilkinson,
/// The Algebraic Eigenvalue Problem (1965), 7.8). This is faster than computing all four eigenvalues.
pub(super) fn least_eigenvalue(matrix: &Matrix4<f64>) -> f64 {
    let size = matrix.amax();
    if !size.is_finite() || matrix.iter().any(|value| value.is_nan()) {
        return f64::NAN;
    }
    if size == 0.0 {
        return 0.0;
    }
    let (a, b) = tridiagonal(&(matrix / size));
    // Gershgorin's bound, slightly lower, so that rounding does not put it beyond the root.
    let radius = [b[0].abs(), b[0].abs() + b[1].abs(), b[1].abs() + b[2].abs(), b[2].abs()];
    let mut x = a.iter().zip(&radius).map(|(a, radius)| a - radius).fold(f64::INFINITY, f64::min) - 4.0 * f64::EPSILON;
    for _ in 0..MAX_STEPS {
        // The polynomial and its first two derivatives by its three-term recurrence.
        let (mut p, mut d, mut s) = ([1.0, a[0] - x], [0.0, -1.0], [0.0, 0.0]);
        for k in 1..4 {
            let (e, square) = (a[k] - x, b[k - 1] * b[k - 1]);
            p = [p[1], e * p[1] - square * p[0]];
            s = [s[1], e * s[1] - 2.0 * d[1] - square * s[0]];
            d = [d[1], e * d[1] - p[0] - square * d[0]];
        }
        if p[1] <= 0.0 {
            // At the root, or beyond it by rounding.
            return x * size;
        }
        let (g, curvature) = (d[1] / p[1], s[1] / p[1]);
        let h = g * g - curvature;
        let step = 4.0 / (-g + (3.0 * (4.0 * h - g * g)).max(0.0).sqrt());
        if step.is_nan() || step <= 4.0 * f64::EPSILON * x.abs().max(1.0) {
            return (if step.is_nan() { x } else { x + step }) * size;
        }
        x += step;
    }
    matrix.symmetric_eigenvalues().min()
}

/// Maximum number of steps; three to six are usual, more for clustered eigenvalues.
const MAX_STEPS: usize = 40;

/// Diagonal and subdiagonal of a tridiagonal matrix with the eigenvalues of a symmetric matrix (Golub and Van Loan,
/// 8.3.1).
fn tridiagonal(matrix: &Matrix4<f64>) -> ([f64; 4], [f64; 3]) {
    let mut m = *matrix;
    let mut b = [0.0; 3];
    for k in 0..2 {
        let below: f64 = (k + 2..4).map(|i| m[(i, k)] * m[(i, k)]).sum();
        b[k] = m[(k + 1, k)];
        if below == 0.0 {
            continue;
        }
        let first = m[(k + 1, k)];
        let norm = (first * first + below).sqrt();
        let head = first + norm.copysign(first);
        // I - β v vᵀ with v = (head, remaining column).
        let mut v = [0.0; 4];
        v[k + 1] = head;
        for i in k + 2..4 {
            v[i] = m[(i, k)];
        }
        let beta = 2.0 / (head * head + below);
        b[k] = -norm.copysign(first);
        let mut w = [0.0; 4];
        for i in k + 1..4 {
            for j in k + 1..4 {
                w[i] += beta * m[(i, j)] * v[j];
            }
        }
        let half = 0.5 * beta * (k + 1..4).map(|i| v[i] * w[i]).sum::<f64>();
        for i in k + 1..4 {
            w[i] -= half * v[i];
        }
        for i in k + 1..4 {
            for j in k + 1..4 {
                m[(i, j)] -= v[i] * w[j] + w[i] * v[j];
            }
        }
    }
    b[2] = m[(3, 2)];
    ([m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(3, 3)]], b)
}

/// `ln det` of a positive definite matrix, else `None`.
pub(super) fn log_determinant(matrix: &Matrix4<f64>) -> Option<f64> {
    let factor = matrix.cholesky()?;
    let l = factor.l_dirty();
    Some(2.0 * (0..4).map(|k| l[(k, k)].ln()).sum::<f64>())
}

/// Inverse of a positive definite matrix, exactly symmetric, else `None`.
pub(super) fn inverse(matrix: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let inverse = matrix.cholesky()?.inverse();
    Some(matrix_of(&vector_of(&inverse)))
}

/// Upper triangular U with `U Uᵀ = S`, or `None`.
pub(super) fn upper_factor(s: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    // The Cholesky factor of the matrix with reversed rows and columns.
    let flipped = Matrix4::from_fn(|i, j| s[(3 - i, 3 - j)]);
    let l = flipped.cholesky()?.l();
    Some(Matrix4::from_fn(|i, j| l[(3 - i, 3 - j)]))
}

/// Singular values and vectors of `A = U diag(σ) Vᵀ` by one-sided Jacobi rotations (Golub and Van Loan 8.6.3), with
/// full relative accuracy of small values, unlike bidiagonal methods.
fn singular_values(a: &Matrix4<f64>) -> (Vector4<f64>, Matrix4<f64>, Matrix4<f64>) {
    let (mut b, mut v) = (*a, Matrix4::identity());
    // Six to eight sweeps are usual.
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
                // If the square of ζ overflows, t is zero; |t| is at most one.
                let t = zeta.signum() / (zeta.abs() + (zeta * zeta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
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
    fn scaling_maps_the_pair_to_one_diagonal() {
        // S and Z need not be on the central path.
        for small in [1.0, 1e-6] {
            let (s, z) = (definite(0.3, small), definite(1.1, 0.5));
            let scaling = Scaling::new(&s, &z).unwrap();
            let diagonal = Matrix4::from_diagonal(&scaling.lambda);
            // Condition number of S times rounding, with margin.
            assert!((scaling.scaled_primal(&s) - diagonal).amax() < 1e-9);
            assert!((scaling.unscaled_dual(&diagonal) - z).amax() < 1e-9);
            assert!((scaling.primal() - s).amax() < 1e-9 && (scaling.dual() - z).amax() < 1e-9);
            // A step in scaled coordinates equals a step of the matrices.
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
    fn least_eigenvalue_is_the_minimum_of_all_four() {
        let turned = |values: [f64; 4], seed: f64| {
            let q = definite(seed, 0.7).qr().q();
            q * Matrix4::from_diagonal(&Vector4::from(values)) * q.transpose()
        };
        let mut tried = vec![Matrix4::zeros(), Matrix4::identity(), Matrix4::identity() * -3.0];
        tried.push(Matrix4::from_diagonal(&Vector4::new(2.0, -1.0, 5.0, -1.0)));
        for seed in 0..40 {
            let seed = f64::from(seed);
            tried.push(definite(seed, 1e-3) - Matrix4::identity() * (0.3 * seed));
            // Equal, nearly equal and very different eigenvalues.
            tried.push(turned([-2.0, -2.0, 1.0, 1.0], seed));
            tried.push(turned([0.5, 0.5 + 1e-9, 0.5 + 2e-9, 3.0], seed));
            tried.push(turned([1e-14, 1e-7, 1.0, 1e7], seed));
            tried.push(turned([-1e150, 1.0, 1.0, 1e150], seed));
        }
        for matrix in tried {
            let (own, all) = (least_eigenvalue(&matrix), matrix.symmetric_eigenvalues().min());
            // Both are accurate to a few roundings of the largest entry; for multiple eigenvalues the polynomial is
            // flat and the iteration stops at rounding.
            assert!((own - all).abs() <= 1e-13 * matrix.amax(), "{own} {all}");
        }
        assert!(least_eigenvalue(&Matrix4::from_element(f64::NAN)).is_nan());
        assert!(least_eigenvalue(&Matrix4::from_element(f64::INFINITY)).is_nan());
    }

    #[test]
    fn congruence_equals_the_matrix_product() {
        let (v, x) = (definite(0.2, 2.0), definite(0.9, 1.0));
        assert!((congruence(&v) * vector_of(&x) - vector_of(&(v * x * v))).amax() < 1e-12);
    }
}
