//! The project's order of torque terms.

use super::Law;

/// Sorts terms into the project's order: joint by joint drive inertia, viscous, Coulomb and offset; then, joint by joint, further friction as it stands; then couplings.
pub fn sort_terms(laws: &mut [Law]) {
    let place = |law: &Law| {
        let joint = law.joints().first().copied().unwrap_or(0);
        match law {
            Law::DriveInertia(_) => (0, joint, 0),
            Law::Viscous(_) => (0, joint, 1),
            Law::Coulomb(_) => (0, joint, 2),
            Law::Offset(_) => (0, joint, 3),
            Law::DirectionalViscous(_)
            | Law::DirectionalCoulomb(_)
            | Law::Stribeck(_)
            | Law::Sigmoid(_)
            | Law::Power(_)
            | Law::Load(_)
            | Law::MaxwellSlip(_)
            | Law::TemperatureViscous(_)
            | Law::TemperatureCoulomb(_) => (1, joint, 0),
            Law::Coupling(_) => (2, 0, 0),
        }
    };
    laws.sort_by_key(place);
}
