//! The ten inertial parameters of a body.

use crate::spatial::{Mat3, Transform, Vec3};
use nalgebra::{Matrix3, Matrix4};

/// Largest length, angle, mass or inertia that is accepted in a robot description. Larger numbers are mistakes, and
/// their products would exceed the range of `f64`.
pub const MAX_MAGNITUDE: f64 = 1e9;

/// Names of the ten inertial parameters of a body, in the order of [`InertialParameters`].
pub const INERTIAL_NAMES: [&str; 10] = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];

/// The ten inertial parameters of one rigid body, `[m, m r_x, m r_y, m r_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz]`:
/// mass in kg, first moment in kg m, inertia **about the origin of the body frame** in kg m². All are in the axes of
/// the body frame. `r` is the centre of mass. The products of inertia are entries of the inertia matrix: `I_xy = -∫ x
/// y dm`.
#[doc(alias("barycentric parameters", "standard parameters", "inertia tensor"))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialParameters(pub [f64; 10]);

impl InertialParameters {
    /// A body without mass.
    pub const ZERO: Self = Self([0.0; 10]);

    /// Inertial parameters from mass, centre of mass, and inertia about the centre of mass, all in the body frame: `I =
    /// I_c + m (rᵀr 1 - r rᵀ)` (parallel-axis theorem).
    pub fn from_centre_of_mass(mass_kg: f64, com_m: Vec3, inertia_at_com: &Mat3) -> Self {
        let r2 = com_m.dot(com_m);
        let inertia = *inertia_at_com + (Mat3::IDENTITY.scale(r2) - Mat3::outer(com_m, com_m)).scale(mass_kg);
        Self::from_moments(mass_kg, com_m.scale(mass_kg), &inertia)
    }

    /// Inertial parameters from mass, first moment `m r`, and inertia about the frame origin.
    pub fn from_moments(mass_kg: f64, first_moment: Vec3, inertia_at_origin: &Mat3) -> Self {
        let (h, i) = (first_moment.0, &inertia_at_origin.0);
        Self([mass_kg, h[0], h[1], h[2], i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]])
    }

    /// Mass, kg.
    pub fn mass_kg(&self) -> f64 {
        self.0[0]
    }

    /// First moment `m r`, kg m.
    pub fn first_moment(&self) -> Vec3 {
        Vec3([self.0[1], self.0[2], self.0[3]])
    }

    /// Inertia about the frame origin, kg m².
    pub fn inertia_at_origin(&self) -> Mat3 {
        let p = &self.0;
        Mat3([[p[4], p[5], p[6]], [p[5], p[7], p[8]], [p[6], p[8], p[9]]])
    }

    /// Centre of mass, m, or `None` for a body without mass.
    pub fn com_m(&self) -> Option<Vec3> {
        (self.0[0] != 0.0).then(|| self.first_moment().scale(1.0 / self.0[0]))
    }

    /// Inertia about the centre of mass, kg m², or `None` for a body without mass.
    pub fn inertia_at_com(&self) -> Option<Mat3> {
        let com = self.com_m()?;
        let shift = (Mat3::IDENTITY.scale(com.dot(com)) - Mat3::outer(com, com)).scale(self.0[0]);
        Some(self.inertia_at_origin() - shift)
    }

    /// Mass, centre of mass and inertia about the centre of mass, if the body is physically consistent and within the
    /// magnitude limit.
    pub(crate) fn consistent_about_com(&self) -> Option<(f64, Vec3, Mat3)> {
        let (com, inertia, [a, b, c]) = (self.com_m()?, self.inertia_at_com()?, self.principal_moments()?);
        let mass = self.mass_kg();
        let is_small = com.0.iter().all(|x| x.abs() <= MAX_MAGNITUDE || x.is_nan());
        (is_small && mass > 0.0 && a > 0.0 && a + b >= c).then_some((mass, com, inertia))
    }

    /// The same body in another frame; `frame_from_body` maps from the current frame to the new one.
    pub fn expressed_in(&self, frame_from_body: &Transform) -> Self {
        // Second moments Σ = ∫ p pᵀ dm transform like outer products, so the centre of mass is not needed.
        let (r, t, m) = (&frame_from_body.rotation, frame_from_body.translation, self.0[0]);
        let h = r.mul_vec(self.first_moment());
        let inertia = self.inertia_at_origin();
        let half_trace = 0.5 * (inertia.0[0][0] + inertia.0[1][1] + inertia.0[2][2]);
        let second = r.mul_mat(&(Mat3::IDENTITY.scale(half_trace) - inertia)).mul_mat(&r.transpose());
        let second = second + Mat3::outer(h, t) + Mat3::outer(t, h) + Mat3::outer(t, t).scale(m);
        let trace = second.0[0][0] + second.0[1][1] + second.0[2][2];
        Self::from_moments(m, h + t.scale(m), &(Mat3::IDENTITY.scale(trace) - second))
    }

    /// Sum of two rigidly connected bodies in the same frame.
    pub fn plus(&self, other: &Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] + other.0[k]))
    }

    /// The pseudo-inertia `P = [Σ h; hᵀ m]` with `Σ = ½ tr(I) 1 - I` and `h = m r`. The body is physically consistent
    /// if and only if `P` is positive (semi-)definite (Traversaro et al. 2016; Wensing, Kim and Slotine 2018).
    pub fn pseudo_inertia(&self) -> Matrix4<f64> {
        let i = self.inertia_at_origin().0;
        let half_trace = 0.5 * (i[0][0] + i[1][1] + i[2][2]);
        Matrix4::from_fn(|a, b| match (a, b) {
            (3, 3) => self.0[0],
            (3, k) | (k, 3) => self.0[1 + k],
            (a, b) => (if a == b { half_trace } else { 0.0 }) - i[a][b],
        })
    }

    /// Principal moments of inertia about the centre of mass, kg m², ascending; `None` for a body without mass.
    pub fn principal_moments(&self) -> Option<[f64; 3]> {
        let i = self.inertia_at_com()?.0;
        let mut moments: [f64; 3] = Matrix3::from_fn(|a, b| i[a][b]).symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        Some(moments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_points(frame: &Transform) -> InertialParameters {
        // Reference: point masses with I = Σ m (pᵀp 1 - p pᵀ).
        let mut total = InertialParameters::ZERO;
        for (mass, p) in [(1.5, Vec3([0.3, -0.2, 0.9])), (0.7, Vec3([-0.4, 0.1, 0.2]))] {
            let p = frame.point(p);
            total = total.plus(&InertialParameters::from_centre_of_mass(mass, p, &Mat3::ZERO));
        }
        total
    }

    #[test]
    fn moving_the_frame_equals_moving_the_points() {
        let frame =
            Transform { rotation: Mat3::from_roll_pitch_yaw(0.3, -1.1, 2.0), translation: Vec3([0.5, -0.7, 0.11]) };
        let moved = two_points(&Transform::IDENTITY).expressed_in(&frame);
        let expected = two_points(&frame);
        for k in 0..10 {
            // Rounding error of about twenty products of order one.
            assert!((moved.0[k] - expected.0[k]).abs() < 1e-14, "{}", INERTIAL_NAMES[k]);
        }
    }

    #[test]
    fn pseudo_inertia_of_points_is_their_second_moment() {
        let p = two_points(&Transform::IDENTITY).pseudo_inertia();
        let mut expected = Matrix4::zeros();
        for (mass, x) in [(1.5, [0.3, -0.2, 0.9, 1.0]), (0.7, [-0.4, 0.1, 0.2, 1.0])] {
            let v = nalgebra::Vector4::from(x);
            expected += mass * v * v.transpose();
        }
        assert!((p - expected).amax() < 1e-14);
    }
}
