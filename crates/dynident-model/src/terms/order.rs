//! The order of torque terms in all lists.

use super::{JointProperty, TermAction, TorqueTerm};

/// Sorts terms into the usual order: first drive inertia, viscous friction, Coulomb friction and offset, joint by
/// joint; then further friction, joint by joint in the given order; then couplings; then declared torques in the
/// given order.
pub fn sort_terms(terms: &mut [TorqueTerm]) {
    terms.sort_by_key(|term| match (term.own_joint(), term.property(), term.action()) {
        (_, _, TermAction::State(_)) => (3, 0, 0),
        (None, _, _) => (2, 0, 0),
        (Some(joint), _, TermAction::Inertia { .. }) => (0, joint, 0),
        (Some(joint), Some(JointProperty::Damping), _) => (0, joint, 1),
        (Some(joint), Some(JointProperty::Friction), _) => (0, joint, 2),
        (Some(joint), _, TermAction::Constant) => (0, joint, 3),
        (Some(joint), _, _) => (1, joint, 0),
    });
}
