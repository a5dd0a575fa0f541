//! The machine of a study: model, laws, base parameters, in one piece.

use crate::error::Error;
use crate::study::{CoulombChoice, Folders, JointDrive, Study};
use dynident_dynamics::{BaseParameters, Column, PanelLayout, ParametricModel};
use dynident_model::laws::{CoulombShape, Coupling, CouplingEffect, DriveChoice, Law, laws_per_joint};
use dynident_model::{Model, Robot, Vec3, load_robot};
use std::path::Path;

/// A study's machine, ready to make regressors.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The description as read.
    pub robot: Robot,
    /// The model with joints locked, gravity and base in force, its torque terms, base parameters and nominal values.
    pub parametric: ParametricModel,
    /// Joint names in the order of the log's columns.
    pub log_joints: Vec<String>,
    /// For each joint of the model its place among `log_joints`.
    pub log_place: Vec<usize>,
    /// For load-dependent friction: the bodies by an earlier estimate, one value per column of the layout. Without it such friction has a column of zeros.
    pub load_parameters: Option<Vec<f64>>,
    /// What logged torque is multiplied by, joint by joint, where gains were found and not stated; empty otherwise.
    pub torque_gains: Vec<f64>,
    /// Where the study's files are looked for.
    pub(crate) folders: Folders,
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
        for (joint, description) in model.joints().iter().enumerate() {
            let own = study.drive.joints.get(&description.name);
            let step = friction_step(study, &description.name);
            let further = own.and_then(|own| own.laws.as_ref()).unwrap_or(&study.drive.laws);
            laws.extend(further.iter().flat_map(|law| law.laws(joint, step)));
        }
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
        let parametric =
            ParametricModel::new(model, laws).map_err(|error| Error::study(study_path, error.to_string()))?;
        Ok(Self {
            robot,
            parametric,
            log_joints,
            log_place,
            load_parameters: None,
            torque_gains: Vec::new(),
            folders: folders.clone(),
        })
    }

    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        self.parametric.model()
    }

    /// Torque terms beside the rigid bodies.
    pub fn laws(&self) -> &[Law] {
        self.parametric.laws()
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

    /// Base parameters by the description's own inertials, damping and friction; `None` while a moving body's inertial is unknown.
    pub fn nominal_base(&self) -> Option<&[f64]> {
        self.parametric.nominal_base()
    }

    /// The machine with further laws behind its base columns, dependent or not: for choosing among them from one set of factors. `base` and `laws` stay as they are.
    pub(crate) fn with_columns_of(&self, further: impl IntoIterator<Item = Law>) -> Self {
        let mut wide = self.clone();
        wide.parametric = self.parametric.with_further_columns(further);
        let columns = wide.layout().columns().len();
        if let Some(parameters) = &mut wide.load_parameters {
            parameters.resize(columns, 0.0);
        }
        wide
    }

    /// That a log has the temperature, if friction depends on it.
    ///
    /// # Errors
    /// [`Error::NoTemperature`].
    pub(crate) fn check_temperature(&self, study: &Study, log: usize) -> Result<(), Error> {
        let columns = self.layout().columns().iter();
        let needing = columns.filter_map(|column| match column {
            Column::Law(law) if law.needs_temperature() => law.joints().first().copied(),
            _ => None,
        });
        match needing.min() {
            Some(joint) if study.format_of(log).temperature.is_none() => {
                Err(Error::NoTemperature { log: study.log_name(log), joint: self.model().joints()[joint].name.clone() })
            }
            _ => Ok(()),
        }
    }

    /// The machine with the bodies of an estimate of `other`, where load-dependent friction needs them.
    pub(crate) fn with_load_of(mut self, other: &Self, values: &[f64]) -> Self {
        if self.layout().columns().iter().any(|column| matches!(column, Column::Law(Law::Load(_)))) {
            let known = other.layout().columns();
            let value = |column: &Column| known.iter().position(|c| c == column).map_or(0.0, |place| values[place]);
            self.load_parameters = Some(self.layout().columns().iter().map(value).collect());
        }
        self
    }
}

pub(crate) fn drive_choice(study: &Study, joint: &str) -> DriveChoice {
    let default = JointDrive::default();
    let own = study.drive.joints.get(joint).unwrap_or(&default);
    DriveChoice {
        drive_inertia: own.drive_inertia.unwrap_or(study.drive.drive_inertia),
        viscous: own.viscous.unwrap_or(study.drive.viscous),
        coulomb: shape(own.coulomb.unwrap_or(study.drive.coulomb), study, own),
        offset: own.offset.unwrap_or(study.drive.offset),
    }
}

/// The step of friction that is no Coulomb friction: the joint's Coulomb step, or a smooth one where it has none.
pub(crate) fn friction_step(study: &Study, joint: &str) -> CoulombShape {
    let width = study.drive.joints.get(joint).and_then(|own| own.coulomb_width).unwrap_or(study.drive.coulomb_width);
    drive_choice(study, joint).coulomb.unwrap_or(CoulombShape::Smooth { width })
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
