use super::term_description::describe;
use super::{RobotFault, RunRequest};
use core::fmt::Write as _;
use dynident_model::INERTIAL_NAMES;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings, FrictionCompensation, Measured, Target};
use dynident_simulation::{Reference, ReferenceSample};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name and version of the schema of `controller.json`.
pub const CONTROLLER_SCHEMA: &str = "dynident/controller/1";

/// Returns the reference as a table `t_s, q1.., dq1.., ddq1..`. If there is a model, the table also has the model
/// torques `tau1..` along the reference: a feed-forward for controllers without a model.
pub fn trajectory_csv(reference: &Reference, model: Option<&ControllerModel>) -> String {
    let joints = reference.joints();
    let mut text = String::from("t_s");
    let prefixes: &[&str] = if model.is_some() { &["q", "dq", "ddq", "tau"] } else { &["q", "dq", "ddq"] };
    for prefix in prefixes {
        for joint in 1..=joints {
            // Writing to a string cannot fail.
            let _ = write!(text, ",{prefix}{joint}");
        }
    }
    text.push('\n');
    let mut torques = model.map(|model| model_torques(reference, model));
    let mut sample = ReferenceSample::new(joints);
    for k in 0..reference.samples() {
        sample.take(reference, k);
        let Target { q, dq, ddq } = sample.target();
        let _ = write!(text, "{}", k as f64 / reference.rate_hz());
        let tau = torques.as_mut().and_then(Iterator::next).unwrap_or_default();
        for value in [q, dq, ddq].into_iter().flatten().chain(&tau) {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}

/// The model torques along a reference, sample by sample, Nm (N).
pub(super) fn model_torques<'a>(
    reference: &'a Reference,
    model: &ControllerModel,
) -> impl Iterator<Item = Vec<f64>> + use<'a> {
    let (mut model, mut sample) = (model.clone(), ReferenceSample::new(reference.joints()));
    (0..reference.samples()).map(move |k| {
        sample.take(reference, k);
        let Target { q, dq, ddq } = sample.target();
        let mut tau = vec![0.0; reference.joints()];
        model.torque(Measured { q, dq }, sample.target(), ddq, FrictionCompensation::Reference, &mut tau);
        tau
    })
}

/// Returns the controller's settings, the order of joints, the envelope and the model parameters as JSON. This is
/// sufficient to compute the controller's torque in another program.
pub fn controller_json(request: &RunRequest<'_>, joints: &[String]) -> Value {
    let mut file = json!({
        "schema": CONTROLLER_SCHEMA,
        "run": request.run,
        "rate_hz": request.reference.rate_hz(),
        "duration_s": request.reference.duration_s(),
        "joints": joints,
        "controller": request.controller,
        "envelope": request.envelope,
        "model": request.model.map(model_json),
    });
    if let Some(ways) = request.ways {
        file["home"] = json!({ "approach_s": ways.approach.duration_s(), "return_s": ways.back.duration_s() });
    }
    file
}

fn model_json(model: &ControllerModel) -> Value {
    let robot = model.model();
    let joints: Vec<Value> = robot
        .tree_joints()
        .iter()
        .zip(robot.inertials())
        .enumerate()
        .map(|(place, (joint, inertial))| {
            let mut out = json!({
                "name": joint.name,
                "turns": joint.is_rotary(),
                "parent": joint.parent.map(|parent| &robot.tree_joints()[parent].name),
                "rotation": joint.placement.rotation.0,
                "translation_m": joint.placement.translation.0,
                "axis": joint.axis.0,
                "inertial": inertial.0,
            });
            // Only for a joint that follows others: `q = Σ multiplier q_joint + offset`.
            if let Some(coupling) = robot.coupling()
                && !coupling.driving().contains(&place)
            {
                let source = |&(dof, multiplier): &(usize, f64)| {
                    json!({ "joint": robot.joints()[dof].name, "multiplier": multiplier })
                };
                let sources: Vec<Value> = coupling.row(place).iter().map(source).collect();
                out["follows"] = json!({ "joints": sources, "offset": coupling.offset(place) });
            }
            out
        })
        .collect();
    let terms: Vec<Value> = model.terms().iter().map(|(term, value)| describe(robot, term, *value)).collect();
    json!({
        "gravity_m_s2": robot.gravity().0,
        "inertial_order": INERTIAL_NAMES,
        "joints": joints,
        "laws": terms,
    })
}

/// The model for the torques in the tables. It is `None` if the drives' position loop receives only the path, because
/// a program adds the torques of a table as feed-forward.
fn fed_forward<'a>(request: &RunRequest<'a>) -> Option<&'a ControllerModel> {
    let path_alone = matches!(request.controller, ControllerSettings::PositionLoop(own) if !own.feed_forward);
    request.model.filter(|_| !path_alone)
}

fn files(request: &RunRequest<'_>, joints: &[String], folder: &Path) -> Result<[(PathBuf, String); 2], RobotFault> {
    let [trajectory, controller] = ["trajectory.csv", "controller.json"].map(|name| folder.join(name));
    let mut text = dynident_text::json::to_string_pretty(&controller_json(request, joints))
        .map_err(|error| RobotFault::File { path: controller.clone(), reason: error.to_string() })?;
    text.push('\n');
    Ok([(trajectory, trajectory_csv(request.reference, fed_forward(request))), (controller, text)])
}

pub(super) fn write(request: &RunRequest<'_>, joints: &[String], folder: &Path) -> Result<[PathBuf; 2], RobotFault> {
    let [trajectory, controller] = files(request, joints, folder)?;
    write_atomically(&trajectory.0, &trajectory.1)?;
    write_atomically(&controller.0, &controller.1)?;
    Ok([trajectory.0, controller.0])
}

/// Writes `approach.csv` and `return.csv` into a folder, if the request has paths from and to the home posture.
pub(super) fn write_ways(request: &RunRequest<'_>, folder: &Path) -> Result<Option<[PathBuf; 2]>, RobotFault> {
    let Some(ways) = request.ways else { return Ok(None) };
    let paths = ["approach.csv", "return.csv"].map(|name| folder.join(name));
    for (path, way) in paths.iter().zip([&ways.approach, &ways.back]) {
        write_atomically(path, &trajectory_csv(way, fed_forward(request)))?;
    }
    Ok(Some(paths))
}

/// Returns the first existing file whose content differs from this request. Differences in the envelope and in the
/// paths from and to the home posture are ignored.
pub(super) fn other(request: &RunRequest<'_>, joints: &[String], folder: &Path) -> Result<Option<PathBuf>, RobotFault> {
    let same = |there: &str, text: &str| there == text || of_the_run(there) == of_the_run(text);
    let differs = |(path, text): &(PathBuf, String)| {
        path.exists() && !dynident_files::read_text(path, MAX_FILE_BYTES).is_ok_and(|there| same(&there, text))
    };
    Ok(files(request, joints, folder)?.into_iter().find(differs).map(|(path, _)| path))
}

/// Content of a controller file without envelope and paths; `Err` with the text if it is not a JSON object.
fn of_the_run(text: &str) -> Result<Value, &str> {
    let Ok(Value::Object(mut file)) = serde_json::from_str(text) else { return Err(text) };
    file.remove("envelope");
    file.remove("home");
    Ok(Value::Object(file))
}

const MAX_FILE_BYTES: u64 = 1 << 30;

pub(super) fn write_atomically(path: &Path, text: &str) -> Result<(), RobotFault> {
    if dynident_files::read_text(path, MAX_FILE_BYTES).is_ok_and(|there| there == text) {
        return Ok(());
    }
    dynident_system::write_atomically(path, text.as_bytes())
        .map_err(|error| RobotFault::File { path: path.to_owned(), reason: error.to_string() })
}
