//! A robot from its [`ModelFile`], which contains all data that an export format needs without the robot description.

use crate::error::ExportError;
use crate::model_file::{ModelFile, ModelLink, ModelPlacement};
use crate::robot_model::RobotModel;
use dynident_model::terms::TorqueTerm;
use dynident_model::{
    Body, InertialParameters, Joint, JointKind, JointLimits, Link, Mat3, Mimic, MimicSource, Model, Transform, Vec3,
};

impl ModelFile {
    /// Returns the robot with these torque terms and a value for each, instead of the terms of the file. Joints of
    /// the terms are the degrees of freedom, base to tip.
    ///
    /// # Errors
    /// A parent that is not in the file, numbers that are not finite, and as [`RobotModel::new`].
    pub fn robot(&self, terms: Vec<TorqueTerm>, values: Vec<f64>) -> Result<RobotModel, ExportError> {
        let joints = self.joints.iter().map(|own| self.joint(own)).collect::<Result<Vec<_>, _>>()?;
        let bodies = self.joints.iter().map(|own| body(&own.body.links)).collect();
        let model = Model::new(&self.name, body(&self.base_links), joints, bodies)?;
        let inertials: Vec<_> = self.joints.iter().map(|own| InertialParameters(own.body.parameters)).collect();
        let model = model.with_inertials(&inertials)?.with_gravity(Vec3(self.gravity_m_s2))?;
        RobotModel::new(model, terms, values)
    }

    fn joint(&self, own: &crate::model_file::ModelJoint) -> Result<Joint, ExportError> {
        let unknown = |what: String| ExportError::File { what };
        let kinds = [JointKind::Revolute, JointKind::Continuous, JointKind::Prismatic];
        let kind = kinds.into_iter().find(|kind| kind.name() == own.kind);
        let place = |name: &String| {
            let place = self.joints.iter().position(|joint| joint.name == *name);
            place.ok_or_else(|| unknown(format!("joint `{}` has the unknown parent `{name}`", own.name)))
        };
        let mimic = own.follows.as_ref().map(|follower| Mimic {
            sources: follower
                .multipliers
                .iter()
                .map(|(joint, &multiplier)| MimicSource { joint: joint.clone(), multiplier })
                .collect(),
            offset: follower.offset,
        });
        Ok(Joint {
            name: own.name.clone(),
            kind: kind.ok_or_else(|| unknown(format!("joint `{}` has the unknown type `{}`", own.name, own.kind)))?,
            parent: own.parent.as_ref().map(place).transpose()?,
            placement: transform(&own.placement),
            axis: Vec3(own.axis),
            limits: JointLimits {
                lower: own.limits.lower,
                upper: own.limits.upper,
                velocity: own.limits.velocity,
                effort: own.limits.effort,
            },
            damping: None,
            friction: None,
            drive_inertia: None,
            spring: None,
            mimic,
        })
    }
}

fn body(links: &[ModelLink]) -> Body {
    let link = |link: &ModelLink| Link {
        name: link.name.clone(),
        placement: transform(&link.placement),
        inertial: None,
        collision: Vec::new(),
    };
    Body { links: links.iter().map(link).collect() }
}

fn transform(placement: &ModelPlacement) -> Transform {
    Transform { rotation: Mat3(placement.rotation), translation: Vec3(placement.translation_m) }
}
