//! Values of a joint's drive in a robot description: damping, friction, drive inertia and stiffness.

use dynident_identification::Identification;
use dynident_model::JointChange;
use dynident_model::terms::{JointProperty, TermClass, TorqueTerm};

/// The new values of the joints for an export format of a class.
pub(super) struct JointValues {
    /// New damping, friction, drive inertia and stiffness.
    pub(super) changes: Vec<JointChange>,
    /// Whether the export format cannot represent some terms, and the other terms were fitted again to replace them.
    pub(super) is_refitted: bool,
}

impl JointValues {
    /// Values of the terms that a robot description of this class can contain. If it cannot represent all terms of
    /// the model, they were fitted again for the class. Without such a fit (unknown gains) they are the model's own
    /// values.
    pub(super) fn of(found: &Identification, class: TermClass) -> Self {
        let model = &found.model().parametric;
        let form = found.forms.iter().find(|form| form.class == class);
        let values: Vec<(&TorqueTerm, f64)> = if let Some(form) = form {
            form.terms.iter().zip(form.values.iter().copied()).collect()
        } else {
            let values = &found.consistent.parameters[model.model().inertial_count()..];
            model.terms().iter().zip(values.iter().copied()).collect()
        };
        let mut changes: Vec<JointChange> = Vec::new();
        for (term, value) in values {
            let (Some(joint), Some(property)) = (term.own_joint(), term.property()) else { continue };
            let change = change_of(&mut changes, &model.model().joints()[joint].name);
            *match property {
                JointProperty::Damping => &mut change.damping,
                JointProperty::Friction => &mut change.friction,
                JointProperty::DriveInertia => &mut change.drive_inertia,
                JointProperty::Stiffness => &mut change.stiffness,
            } = Some(value);
        }
        Self { changes, is_refitted: form.is_some_and(|form| form.is_refitted) }
    }
}

/// Returns the change of the joint `name`; creates it if there is none yet.
fn change_of<'a>(changes: &'a mut Vec<JointChange>, name: &str) -> &'a mut JointChange {
    let place = changes.iter().position(|change| change.joint == name).unwrap_or_else(|| {
        let joint = name.to_owned();
        changes.push(JointChange { joint, damping: None, friction: None, drive_inertia: None, stiffness: None });
        changes.len() - 1
    });
    &mut changes[place]
}
