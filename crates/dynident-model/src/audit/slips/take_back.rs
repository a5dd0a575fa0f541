//! Undoes corrections that do not lead to a plausible body.

use super::{Search, StatedInertial};
use crate::audit::inertials::findings_of_link;
use crate::inertial::InertialParameters;
use crate::spatial::Vec3;

/// Restores the original numbers of a link whose corrected inertial has a finding of the audit that the original does
/// not have: the hypothesis does not explain the numbers. Exception: the original has a worse finding. A mistake
/// without remaining corrections is removed.
pub(super) fn implausible(search: &mut Search, stated: &[StatedInertial]) {
    for (place, original) in stated.iter().enumerate() {
        let corrected = &search.now[place];
        if corrected == original {
            continue;
        }
        // The size of the base is not known.
        let lengths = search.lengths.as_ref().filter(|_| search.moves[place]);
        let length = lengths.map_or(f64::INFINITY, |lengths| lengths[place]);
        let before = findings_of_link(&original.link, &inertial(original), length);
        let after = findings_of_link(&original.link, &inertial(corrected), length);
        let worst = before.iter().map(|(level, _)| *level).max();
        if after.iter().all(|check| before.contains(check) || worst > Some(check.0)) {
            continue;
        }
        search.now[place] = original.clone();
        search.found.retain_mut(|slip| {
            let had = slip.corrections.len();
            slip.corrections.retain(|correction| correction.link != original.link);
            if slip.corrections.len() < had {
                slip.links.retain(|link| *link != original.link);
            }
            had == 0 || !slip.corrections.is_empty()
        });
    }
}

/// Inertial in the axes of `<origin>`; the plausibility of a body does not depend on the axes.
fn inertial(stated: &StatedInertial) -> InertialParameters {
    let com = stated.axes.transpose_mul_vec(Vec3(stated.com_m));
    InertialParameters::from_centre_of_mass(stated.mass_kg, com, &stated.inertia())
}
