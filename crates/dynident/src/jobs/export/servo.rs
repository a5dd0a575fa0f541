//! `export` of drives from commands and positions.

use crate::error::Error;
use crate::jobs::servo::model_files;
use crate::result::{ServoFile, ServoForm};
use crate::study::{Folders, Study, StudyRobot};
use dynident_export::{Actuator, Exported, isaac_lab};
use dynident_model::InertialParameters;
use std::path::Path;

/// An export format for drives with a position controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoTarget {
    /// Actuators of Isaac Lab: a Python module.
    IsaacLab,
    /// The MJCF of the study with the identified values.
    Mjcf,
    /// The URDF of the study with the identified values.
    Urdf,
}

/// An exported file, and the formats whose errors it contains.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoExport {
    /// Text and notes.
    pub exported: Exported,
    /// Parts of the drives that the file cannot represent, and the error of the motion simulated with the file. Empty
    /// for URDF, which contains no position controller, and for results of earlier versions.
    pub forms: Vec<ServoForm>,
}

/// Physics step of a module from a result without motion errors, s: the value of many Isaac Lab tasks.
const PHYSICS_STEP_S: f64 = 0.005;

/// Exports the drives of a result that was identified from commands and positions. The robot descriptions need the
/// `study` of the result with its path, and `data`, a further folder for its files.
///
/// # Errors
/// A robot description without the study, or one that does not match the result or cannot be written.
pub fn export_servos(
    file: &ServoFile,
    result_path: &Path,
    target: ServoTarget,
    study: Option<(&Study, &Path)>,
    data: Option<&Path>,
) -> Result<ServoExport, Error> {
    let names: &[(&str, &str)] = match target {
        ServoTarget::IsaacLab => &[("isaac-lab-implicit", "implicit()"), ("isaac-lab-delayed", "delayed()")],
        ServoTarget::Mjcf => &[("mjcf", "this file")],
        ServoTarget::Urdf => &[],
    };
    let mut forms = Vec::new();
    let mut notes = reservations(file);
    for (name, what) in names {
        match file.forms.iter().find(|form| form.form == *name) {
            Some(form) => {
                notes.extend(form.sentences(what, &file.joints, &file.rotary));
                forms.push(form.clone());
            }
            None => notes.push(format!("{what}: error unknown; identify again with this version of Dynident.")),
        }
    }
    if target == ServoTarget::Urdf {
        let note = "URDF holds no position controller: stiffness, delay and torque limit are not in this file. Its \
                    friction is the mean over the training logs.";
        notes.push(note.to_owned());
    }
    let exported = match target {
        ServoTarget::IsaacLab => {
            let step_s = forms.first().map_or(PHYSICS_STEP_S, |form: &ServoForm| form.step_s);
            isaac_lab(&file.robot, &actuators(file), step_s, notes)
        }
        ServoTarget::Mjcf | ServoTarget::Urdf => {
            Exported { text: description(file, result_path, target, study, data)?, notes }
        }
    };
    Ok(ServoExport { exported, forms })
}

fn reservations(file: &ServoFile) -> Vec<String> {
    let mut notes: Vec<String> =
        file.problems.iter().map(|problem| format!("The result has a PROBLEM: {problem}")).collect();
    if let Some(provenance) = &file.provenance {
        notes.insert(0, format!("From the result {} of study {}.", provenance.identity, file.study));
    }
    if !file.scale.determined {
        notes.push(file.scale.anchor.clone());
    }
    notes
}

fn actuators(file: &ServoFile) -> Vec<Actuator> {
    let of_joint = |(joint, drive): (&String, &crate::result::ServoDrive)| Actuator {
        joint: joint.clone(),
        stiffness: drive.stiffness,
        damping: drive.damping,
        armature: drive.armature,
        friction: drive.mean_friction,
        effort_limit: drive.torque_limit,
        velocity_limit: drive.velocity_limit,
        delay_s: (drive.delay_s - drive.read_delay_s).max(0.0),
    };
    file.joints.iter().zip(&file.drives).map(of_joint).collect()
}

/// The robot description of the study with the identified values.
fn description(
    file: &ServoFile,
    result_path: &Path,
    target: ServoTarget,
    study: Option<(&Study, &Path)>,
    data: Option<&Path>,
) -> Result<String, Error> {
    let wrong = |message: String| Error::Result { path: result_path.to_owned(), message };
    let Some((study, study_path)) = study else {
        return Err(wrong(
            "does not contain the robot description: name the study that the result was made with (--study STUDY.toml)"
                .to_owned(),
        ));
    };
    let robot = StudyRobot::new(study, study_path, &Folders::new(study, study_path, data))?;
    let model = robot.model();
    let of_robot = model.joints().iter().map(|joint| &joint.name);
    let bodies = model.bodies().iter().map(dynident_model::Body::name);
    if !of_robot.eq(&file.joints) || !bodies.eq(file.bodies.iter().map(|body| body.body.as_str())) {
        return Err(wrong("its joints or bodies are not those of the study's robot: name its study".to_owned()));
    }
    let inertials: Vec<InertialParameters> =
        file.bodies.iter().map(|body| InertialParameters(body.parameters)).collect();
    let model = model.with_inertials(&inertials).map_err(|error| wrong(error.to_string()))?;
    let files = model_files(&robot, &model, file);
    let (text, other) = match target {
        ServoTarget::Mjcf => (files.mjcf, "--to urdf"),
        ServoTarget::IsaacLab | ServoTarget::Urdf => (files.urdf, "--to mjcf"),
    };
    let reason = || files.missing.unwrap_or_else(|| format!("the study's robot has another format: use {other}"));
    text.ok_or_else(|| wrong(reason()))
}
