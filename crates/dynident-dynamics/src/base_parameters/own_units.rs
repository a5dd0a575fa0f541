//! Units scaled to the robot, so that the threshold for rounding does not depend on its size.

use super::numerical::longest_link_m;
use dynident_model::terms::TorqueTerm;
use dynident_model::{Model, Transform};

/// Units that are powers of two near the robot's longest link and its gravity. Products with powers of two are exact:
/// the base parameters of a robot of twice the size have bit-identical structure.
pub(super) struct OwnUnits {
    length_m: f64,
    gravity_m_s2: f64,
}

impl OwnUnits {
    pub(super) fn of(model: &Model) -> Self {
        Self {
            length_m: power_of_two_below(longest_link_m(model)),
            gravity_m_s2: power_of_two_below(model.gravity().norm()),
        }
    }

    pub(super) fn gravity(&self, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 / self.gravity_m_s2
    }

    /// Unit of a joint's position, m (rad); also the lever arm of its torque row.
    pub(super) fn reach(&self, is_rotary: bool) -> f64 {
        if is_rotary { 1.0 } else { self.length_m }
    }

    pub(super) fn placement(&self, Transform { rotation, translation }: Transform) -> Transform {
        Transform { rotation, translation: translation.scale(1.0 / self.length_m) }
    }

    /// Unit of one of the ten parameters of a body: mass, first moments, moments of inertia.
    pub(super) fn of_body(&self, parameter: usize) -> f64 {
        match parameter {
            0 => 1.0,
            1..=3 => self.length_m,
            _ => self.length_m * self.length_m,
        }
    }

    /// Unit of a term's parameter; 1 for terms that do not combine with bodies.
    pub(super) fn of_term(&self, model: &Model, term: &TorqueTerm) -> f64 {
        let joints = term.joints();
        let levers = || joints.iter().map(|&joint| self.lever(model, joint));
        if joints.iter().any(|&joint| term.constant_torque(joint) != 0.0) {
            self.gravity_m_s2 * levers().fold(1.0, f64::max)
        } else if joints.iter().any(|&j| joints.iter().any(|&k| term.mass_matrix_entry(j, k) != 0.0)) {
            let product: f64 = levers().product();
            if joints.len() == 1 { product * product } else { product }
        } else {
            1.0
        }
    }

    /// Unit of a term relative to that of a constant torque of joint `joint`.
    pub(super) fn constant(&self, model: &Model, term: &TorqueTerm, joint: usize) -> f64 {
        self.of_term(model, term) / (self.gravity_m_s2 * self.lever(model, joint))
    }

    /// Torques have one more length factor than forces.
    fn lever(&self, model: &Model, joint: usize) -> f64 {
        if model.joints()[joint].is_rotary() { self.length_m } else { 1.0 }
    }
}

/// Largest power of two that is not above a positive number; 1 for other numbers.
fn power_of_two_below(number: f64) -> f64 {
    if number.is_normal() && number > 0.0 { f64::from_bits(number.to_bits() & (0x7ff << 52)) } else { 1.0 }
}
