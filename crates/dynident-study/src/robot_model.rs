//! The robot of a study: robot description and parametric model, with locked joints, gravity and torque terms.

use super::torque::declared_terms;
use super::{CoulombChoice, CouplingSection, DriveSection, Folders, JointDrive, LoopSection, RobotSection, Study};
use crate::error::{StudyError, StudyFileError};
use crate::robot_file::{LoadSettings, load_robot};
use dynident_dynamics::{BaseParameters, PanelLayout, ParametricModel};
use dynident_model::terms::{
    CoulombShape, Coupling, CouplingEffect, Declared, DriveChoice, StatedJoint, TorqueTerm, terms_per_joint,
};
use dynident_model::{JointLimits, LoopClosure, Model, ModelError, Robot, Vec3, has_xacro_macros, loops};
use dynident_system::ProgramPermission;
use std::path::Path;

/// A study's robot: robot description and parametric model.
#[derive(Clone, Debug)]
pub struct StudyRobot {
    /// The robot description as read.
    pub robot: Robot,
    /// Model with locked joints, gravity, base orientation, torque terms, base parameters and nominal values.
    pub parametric: ParametricModel,
    /// Joint names in the order of the log's columns.
    pub log_joints: Vec<String>,
}

impl Study {
    /// The limits of a joint in `[design.limits]`, for a robot description without limits.
    pub fn joint_limits(&self, joint: &str) -> JointLimits {
        let Some(stated) = self.design.as_ref().and_then(|design| design.limits.of(joint)) else {
            return JointLimits::default();
        };
        let [lower, upper] = stated.position.map_or([None, None], |ends| ends.map(Some));
        JointLimits { lower, upper, velocity: stated.speed, effort: stated.torque }
    }

    /// Expands a robot file with xacro macros by the program `xacro` and keeps the result in memory, because jobs do
    /// not start programs. Other robot files are not read here.
    ///
    /// # Errors
    /// Same as for [`load_robot`].
    pub fn expand_robot(
        &mut self,
        study_path: &Path,
        data: Option<&Path>,
        programs: ProgramPermission<'_>,
        is_stopped: Option<&dyn Fn() -> bool>,
    ) -> Result<(), StudyFileError> {
        if self.robot.description.is_some() {
            return Ok(());
        }
        // If a file cannot be read, the job reports the error.
        let Ok(path) = Folders::new(self, study_path, data).find(&self.robot.file, None) else { return Ok(()) };
        if has_xacro_macros(&path).unwrap_or(false) {
            let settings = LoadSettings { xacro: self.robot.xacro_settings(), programs, is_stopped };
            self.robot.description = Some(Box::new(load_robot(&path, &settings)?));
        }
        Ok(())
    }
}

impl RobotSection {
    /// Locked joints with their positions: those of `lock`, and those of `known` that `joints` omits, at zero.
    fn locked_joints(&self, known: &[String]) -> Result<Vec<(String, f64)>, StudyError> {
        let mut locked: Vec<(String, f64)> = self.lock.iter().map(|(name, at)| (name.clone(), *at)).collect();
        let Some(joints) = &self.joints else { return Ok(locked) };
        for (index, joint) in joints.iter().enumerate() {
            if !known.contains(joint) {
                return Err(ModelError::UnknownJoint { joint: joint.clone(), known: known.to_vec() }.into());
            }
            if joints[..index].contains(joint) {
                let what = "robot.joints:".to_owned();
                return Err(StudyError::Twice { what, name: joint.clone(), fix: "name it once" });
            }
            if self.lock.contains_key(joint) {
                let (key, other) = ("robot.joints", "robot.lock");
                return Err(StudyError::JointInBoth { joint: joint.clone(), key, other, state: "locked" });
            }
        }
        let rest = known.iter().filter(|name| !joints.contains(name) && !self.lock.contains_key(*name));
        locked.extend(rest.map(|name| (name.clone(), 0.0)));
        Ok(locked)
    }
}

impl StudyRobot {
    /// Builds the study's robot. It starts no program: [`Study::expand_robot`] must have expanded a file with xacro
    /// macros.
    ///
    /// # Errors
    /// If the robot description cannot be read or contains macros, or the study refers to an unknown link or joint.
    pub fn new(study: &Study, study_path: &Path, folders: &Folders) -> Result<Self, StudyFileError> {
        let robot = if let Some(robot) = &study.robot.description {
            (**robot).clone()
        } else {
            let path = folders.find(&study.robot.file, study.source.as_deref())?;
            load_robot(&path, &LoadSettings { xacro: study.robot.xacro_settings(), ..LoadSettings::default() })?
        };
        let in_study = StudyFileError::study::<ModelError>(study_path);

        // Gravity and base.
        let mut model = robot.model.clone();
        if let Some([x, y, z]) = study.robot.gravity_m_s2 {
            model = model.with_gravity(Vec3([x, y, z])).map_err(&in_study)?;
        }
        let radians = study.robot.base_rpy_deg.map(|rpy| rpy.map(f64::to_radians)).or(study.robot.base_rpy_rad);
        if let Some([roll, pitch, yaw]) = radians {
            model = model.with_base_orientation(roll, pitch, yaw).map_err(&in_study)?;
        }

        // Removed links, followers and closed chains.
        model = model.without_links(&study.robot.drop).map_err(&in_study)?;
        let loops: Vec<LoopClosure> = study.robot.loops.iter().map(LoopSection::closure).collect();
        let passive = loops::followers(&model, &loops).map_err(StudyFileError::study(study_path))?;
        let stated = study.robot.follow.iter().map(|own| (own.joint.clone(), own.mimic()));
        model = model.with_followers(&stated.chain(passive).collect::<Vec<_>>()).map_err(&in_study)?;

        // Moving joints.
        let known: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let unknown =
            |joint: &str| in_study(ModelError::UnknownJoint { joint: joint.to_owned(), known: known.clone() });
        let locked = study.robot.locked_joints(&known).map_err(StudyFileError::study(study_path))?;
        model = model.locked(&locked).map_err(&in_study)?;
        if model.dof() == 0 {
            return Err(StudyFileError::study(study_path)(StudyError::missing(
                "no joint is left to move",
                "unlock one",
            )));
        }
        let log_joints = study
            .robot
            .joints
            .clone()
            .unwrap_or_else(|| model.joints().iter().map(|joint| joint.name.clone()).collect());
        if let Some(joint) = model.joints().iter().find(|joint| !log_joints.contains(&joint.name)) {
            return Err(unknown(&joint.name));
        }
        let mut terms = torque_terms(&study.drive, &study.coupling, &model).map_err(&in_study)?;
        terms.extend(declared_terms(study, study_path, folders, &model)?);
        terms.extend(Declared::springs(&model).into_iter().map(TorqueTerm::Declared));
        let parametric = ParametricModel::new(model, terms).map_err(StudyFileError::study(study_path))?;
        Ok(Self { robot, parametric, log_joints })
    }

    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        self.parametric.model()
    }

    /// Torque terms in addition to the rigid bodies.
    pub fn terms(&self) -> &[TorqueTerm] {
        self.parametric.terms()
    }

    /// Base parameters of bodies and terms.
    pub fn base(&self) -> &BaseParameters {
        self.parametric.base()
    }

    /// Regressor blocks of the base columns.
    pub fn layout(&self) -> &PanelLayout {
        self.parametric.layout()
    }

    /// Nominal values of all parameters.
    pub fn nominal(&self) -> &[f64] {
        self.parametric.nominal()
    }

    /// Nominal base parameters from the inertials, damping and friction of the robot description; `None` if the
    /// inertials of a moving body are unknown.
    pub fn nominal_base(&self) -> Option<&[f64]> {
        self.parametric.nominal_base()
    }
}

/// The torque terms of `[drive]` and `[[coupling]]`: first those of each joint, then those of coupled drives.
///
/// # Errors
/// An unknown joint.
pub(super) fn torque_terms(
    drive: &DriveSection,
    coupling: &[CouplingSection],
    model: &Model,
) -> Result<Vec<TorqueTerm>, ModelError> {
    let unknown = |joint: &str| ModelError::UnknownJoint {
        joint: joint.to_owned(),
        known: model.joints().iter().map(|joint| joint.name.clone()).collect(),
    };
    for joint in drive.joints.keys() {
        model.joint_index(joint).ok_or_else(|| unknown(joint))?;
    }

    let mut terms = terms_per_joint(model, |joint| drive_choice(drive, model, joint));
    for (joint, description) in model.joints().iter().enumerate() {
        let own = drive.joints.get(&description.name);
        let (step, is_rotary) = (friction_step(drive, model, joint), description.is_rotary());
        let stated = StatedJoint { joint, step, is_rotary, scale: model.characteristic_scale() };
        let further = own.and_then(|own| own.terms.as_ref()).unwrap_or(&drive.terms);
        terms.extend(further.iter().flat_map(|term| term.law().terms(&stated)));
    }
    for section in coupling {
        let [first, second] = &section.joints;
        let first = model.joint_index(first).ok_or_else(|| unknown(first))?;
        let second = model.joint_index(second).ok_or_else(|| unknown(second))?;
        let width = width(drive, &JointDrive::default(), model, first);
        let coulomb = shape(section.coulomb.unwrap_or(drive.coulomb), drive, &JointDrive::default(), width);
        let effects = [
            section.inertia.then_some(CouplingEffect::Inertia),
            section.viscous.then_some(CouplingEffect::Viscous),
            coulomb.map(CouplingEffect::Coulomb),
        ];
        let couplings = effects.into_iter().flatten().map(|effect| {
            TorqueTerm::Coupling(Coupling { name: section.name.clone(), first, second, ratios: section.ratios, effect })
        });
        terms.extend(couplings);
    }
    Ok(terms)
}

pub(crate) fn drive_choice(drive: &DriveSection, model: &Model, joint: usize) -> DriveChoice {
    let default = JointDrive::default();
    let name = &model.joints()[joint].name;
    let own = drive.joints.get(name).unwrap_or(&default);
    DriveChoice {
        drive_inertia: drive.drive_inertia_of(name).unwrap_or(false),
        viscous: own.viscous.unwrap_or(drive.viscous),
        coulomb: shape(own.coulomb.unwrap_or(drive.coulomb), drive, own, width(drive, own, model, joint)),
        offset: drive.offset_of(name),
    }
}

/// Sign function for the further friction laws: that of the joint's Coulomb friction, or a smoothed one if the joint
/// has no Coulomb friction.
pub(crate) fn friction_step(drive: &DriveSection, model: &Model, joint: usize) -> CoulombShape {
    let default = JointDrive::default();
    let own = drive.joints.get(&model.joints()[joint].name).unwrap_or(&default);
    let smooth = || CoulombShape::Smooth { width: width(drive, own, model, joint) };
    drive_choice(drive, model, joint).coulomb.unwrap_or_else(smooth)
}

/// Width of a joint's smoothed sign function, rad/s (m/s): the given value, or the default for an arm of 1.2 m scaled
/// to this robot.
fn width(drive: &DriveSection, own: &JointDrive, model: &Model, joint: usize) -> f64 {
    let usual = || model.characteristic_scale().velocity(model.joints()[joint].is_rotary(), CoulombShape::USUAL_WIDTH);
    own.coulomb_width.or(drive.coulomb_width).unwrap_or_else(usual)
}

fn shape(choice: CoulombChoice, drive: &DriveSection, own: &JointDrive, width: f64) -> Option<CoulombShape> {
    match choice {
        CoulombChoice::None => None,
        CoulombChoice::Sign => {
            Some(CoulombShape::Sign { dead_band: own.coulomb_dead_band.unwrap_or(drive.coulomb_dead_band) })
        }
        CoulombChoice::Smooth => Some(CoulombShape::Smooth { width }),
    }
}
