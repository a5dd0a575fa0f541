//! The machine of a study: model, laws, base parameters, in one piece.

use crate::error::Error;
use crate::study::{CoulombChoice, Folders, JointDrive, Study};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_model::laws::{Coulomb, CoulombShape, Coupling, CouplingEffect, DriveChoice, Law, laws_per_joint};
use dynident_model::{Model, Robot, Vec3, load_robot};
use std::path::Path;

/// A study's machine, ready to make regressors.
#[derive(Debug)]
pub struct Machine {
    /// The description as read.
    pub robot: Robot,
    /// The model with joints locked, gravity and base in force.
    pub model: Model,
    /// Joint names in the order of the log's columns.
    pub log_joints: Vec<String>,
    /// For each joint of the model its place among `log_joints`.
    pub log_place: Vec<usize>,
    /// Friction, drive and coupling laws.
    pub laws: Vec<Law>,
    /// Base parameters of bodies and laws.
    pub base: BaseParameters,
    /// Panels of base columns.
    pub layout: PanelLayout,
    /// Base parameters by the description's own inertials, damping and friction; `None` while a moving body's inertial is unknown.
    pub prior: Option<Vec<f64>>,
}

impl Machine {
    /// Builds the machine that a study describes.
    ///
    /// # Errors
    /// If the description cannot be read, or names in the study are not in it.
    pub fn new(study: &Study, study_path: &Path, folders: &Folders) -> Result<Self, Error> {
        let robot = load_robot(folders.find(&study.robot.file, study.source.as_deref())?)?;
        let in_study = |source| Error::Model { path: study_path.to_owned(), source };
        let mut model = robot.model.clone();
        if let Some([x, y, z]) = study.robot.gravity_m_s2 {
            model = model.with_gravity(Vec3([x, y, z])).map_err(in_study)?;
        }
        let radians = study.robot.base_rpy_deg.map(|rpy| rpy.map(f64::to_radians)).or(study.robot.base_rpy_rad);
        if let Some([roll, pitch, yaw]) = radians {
            model = model.with_base_orientation(roll, pitch, yaw).map_err(in_study)?;
        }
        let known: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let unknown = |joint: &str| {
            in_study(dynident_model::ModelError::UnknownJoint { joint: joint.to_owned(), known: known.clone() })
        };
        let mut locked: Vec<(String, f64)> = study.robot.lock.iter().map(|(name, at)| (name.clone(), *at)).collect();
        if let Some(joints) = &study.robot.joints {
            for (index, joint) in joints.iter().enumerate() {
                if !known.contains(joint) {
                    return Err(unknown(joint));
                }
                if joints[..index].contains(joint) || study.robot.lock.contains_key(joint) {
                    let message = format!("robot.joints: `{joint}` stands twice, or is locked as well: name it once");
                    return Err(Error::study(study_path, message));
                }
            }
            let rest = known.iter().filter(|name| !joints.contains(name) && !study.robot.lock.contains_key(*name));
            locked.extend(rest.map(|name| (name.clone(), 0.0)));
        }
        model = model.locked(&locked).map_err(in_study)?;
        if model.dof() == 0 {
            return Err(Error::study(study_path, "no joint is left to move: unlock one".to_owned()));
        }
        let log_joints = study
            .robot
            .joints
            .clone()
            .unwrap_or_else(|| model.joints().iter().map(|joint| joint.name.clone()).collect());
        let log_place = model
            .joints()
            .iter()
            .map(|joint| log_joints.iter().position(|name| *name == joint.name).ok_or_else(|| unknown(&joint.name)))
            .collect::<Result<Vec<_>, _>>()?;
        for joint in study.drive.joints.keys() {
            model.joint_index(joint).ok_or_else(|| unknown(joint))?;
        }
        let mut laws = laws_per_joint(&model, |joint| drive_choice(study, &model.joints()[joint].name));
        for section in &study.coupling {
            let [first, second] = &section.joints;
            let first = model.joint_index(first).ok_or_else(|| unknown(first))?;
            let second = model.joint_index(second).ok_or_else(|| unknown(second))?;
            let coulomb = shape(section.coulomb.unwrap_or(study.drive.coulomb), study, &JointDrive::default());
            let effects = [
                section.inertia.then_some(CouplingEffect::Inertia),
                section.viscous.then_some(CouplingEffect::Viscous),
                coulomb.map(CouplingEffect::Coulomb),
            ];
            let couplings = effects.into_iter().flatten().map(|effect| {
                Law::Coupling(Coupling { name: section.name.clone(), first, second, ratios: section.ratios, effect })
            });
            laws.extend(couplings);
        }
        let base = BaseParameters::new(&model, &laws, &BaseParameterSettings::default());
        let layout = PanelLayout::new(&model, base.base_columns());
        let prior = model.bodies_without_prior().is_empty().then(|| base.values(&prior_parameters(&model, &laws)));
        Ok(Self { robot, model, log_joints, log_place, laws, base, layout, prior })
    }
}

/// All parameters by the description: inertials, and what it says of damping and friction.
pub(crate) fn prior_parameters(model: &Model, laws: &[Law]) -> Vec<f64> {
    let mut parameters = model.parameter_vector();
    parameters.extend(laws.iter().map(|law| match law {
        Law::Viscous(law) => model.joints()[law.joint].damping.unwrap_or(0.0),
        Law::Coulomb(Coulomb { joint, .. }) => model.joints()[*joint].friction.unwrap_or(0.0),
        _ => 0.0,
    }));
    parameters
}

fn drive_choice(study: &Study, joint: &str) -> DriveChoice {
    let default = JointDrive::default();
    let own = study.drive.joints.get(joint).unwrap_or(&default);
    DriveChoice {
        drive_inertia: own.drive_inertia.unwrap_or(study.drive.drive_inertia),
        viscous: own.viscous.unwrap_or(study.drive.viscous),
        coulomb: shape(own.coulomb.unwrap_or(study.drive.coulomb), study, own),
        offset: own.offset.unwrap_or(study.drive.offset),
    }
}

fn shape(choice: CoulombChoice, study: &Study, own: &JointDrive) -> Option<CoulombShape> {
    match choice {
        CoulombChoice::None => None,
        CoulombChoice::Sign => {
            Some(CoulombShape::Sign { dead_band: own.coulomb_dead_band.unwrap_or(study.drive.coulomb_dead_band) })
        }
        CoulombChoice::Smooth => {
            Some(CoulombShape::Smooth { width: own.coulomb_width.unwrap_or(study.drive.coulomb_width) })
        }
    }
}
