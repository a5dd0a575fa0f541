//! Joint values in a robot description: damping, friction, drive inertia and stiffness.

use crate::jobs::recorded_velocities::recorded_velocities;
use dynident_dynamics::ParametricModel;
use dynident_export::{NearestFriction, RobotModel};
use dynident_identification::Identification;
use dynident_model::terms::JointProperty;
use dynident_model::{InertialParameters, JointChange};

pub(super) struct JointValues {
    pub(super) changes: Vec<JointChange>,
    /// Best approximation by damping and friction for each joint whose friction law the robot description cannot
    /// express.
    pub(super) nearest: Vec<Option<NearestFriction>>,
}

impl JointValues {
    /// Values of the terms that a robot description can express. Joints with other friction laws get the best
    /// approximation by damping and friction over the fitted motion, because the previous values are no longer valid.
    ///
    /// # Errors
    /// Values that are physically inconsistent.
    pub(super) fn of(
        found: &Identification,
        inertials: &[InertialParameters],
        parameters: &[f64],
    ) -> Result<Self, String> {
        let model = &found.model().parametric;
        let values = &parameters[model.model().inertial_count()..];
        let laws = has_other_friction(model);
        let mut nearest = vec![None; laws.len()];
        if laws.contains(&true) {
            let robot = model.model().with_inertials(inertials).map_err(|error| error.to_string())?;
            let logs = found.training.logs.iter().map(|log| &log.statistics.velocities[..]);
            let velocities = recorded_velocities(logs, laws.len());
            let robot = RobotModel::new(robot, model.terms().to_vec(), values.to_vec())
                .and_then(|robot| robot.with_velocities(velocities))
                .map_err(|error| error.to_string())?;
            for (joint, nearest) in nearest.iter_mut().enumerate().filter(|(joint, _)| laws[*joint]) {
                *nearest = Some(NearestFriction::of(&robot, joint));
            }
        }
        let mut changes = changes_of_terms(model, values);
        for (joint, nearest) in nearest.iter().enumerate() {
            if let Some(nearest) = nearest {
                let change = change_of(&mut changes, &model.model().joints()[joint].name);
                (change.damping, change.friction) = (Some(nearest.viscous), Some(nearest.coulomb));
            }
        }
        Ok(Self { changes, nearest })
    }
}

/// Whether each joint has friction other than viscous and Coulomb. Load- and temperature-dependent friction is
/// additional to these two and ignored here.
fn has_other_friction(model: &ParametricModel) -> Vec<bool> {
    let mut joints = vec![false; model.dof()];
    for term in model.terms() {
        let is_other = term.is_friction() && term.property().is_none();
        let is_other = is_other && !term.needs_load() && !term.needs_temperature();
        if let (true, Some(joint)) = (is_other, term.own_joint()) {
            joints[joint] = true;
        }
    }
    joints
}

fn changes_of_terms(model: &ParametricModel, values: &[f64]) -> Vec<JointChange> {
    let mut changes: Vec<JointChange> = Vec::new();
    for (term, &value) in model.terms().iter().zip(values) {
        let (Some(joint), Some(property)) = (term.own_joint(), term.property()) else { continue };
        let change = change_of(&mut changes, &model.model().joints()[joint].name);
        *match property {
            JointProperty::Damping => &mut change.damping,
            JointProperty::Friction => &mut change.friction,
            JointProperty::DriveInertia => &mut change.drive_inertia,
            JointProperty::Stiffness => &mut change.stiffness,
        } = Some(value);
    }
    changes
}

fn change_of<'a>(changes: &'a mut Vec<JointChange>, name: &str) -> &'a mut JointChange {
    let place = changes.iter().position(|change| change.joint == name).unwrap_or_else(|| {
        let joint = name.to_owned();
        changes.push(JointChange { joint, damping: None, friction: None, drive_inertia: None, stiffness: None });
        changes.len() - 1
    });
    &mut changes[place]
}
