//! Drive parameters of a result for simulators.

use super::{reservations, robot_model};
use crate::error::Error;
use crate::result::{BaseParameterResult, ResultFile, TermResult};
use crate::study::Study;
use dynident_export::{DriveKnowledge, ExportError, RobotModel, SimulatorFile, SimulatorValue};
use dynident_identification::examination::{LagKind, TorqueLag};
use std::path::Path;

/// Exports armature, damping, frictionloss, delay and actuator gain of every joint in the conventions of simulators,
/// with error bars. Friction is the best approximation of the identified law over the recorded velocities. Error bars
/// use the covariance of `result.json`. `study` is the study of the result; the robot file is also searched in the
/// folder `data`. `result_path` is the name of the result in messages.
///
/// # Errors
/// If the result does not belong to the study's robot.
pub fn export_simulator(
    stored: &ResultFile,
    result_path: &Path,
    study: &Study,
    study_path: &Path,
    data: Option<&Path>,
) -> Result<SimulatorFile, Error> {
    let robot = robot_model(stored, result_path, study, study_path, data)?;
    let cannot = |source: ExportError| Error::Export { path: result_path.to_owned(), source: Box::new(source) };
    SimulatorFile::of(&robot, &drive_knowledge(stored, &robot), &reservations(stored)).map_err(cannot)
}

/// Covariance, delays and gains of a result, in the order of the robot's terms and joints.
fn drive_knowledge(stored: &ResultFile, robot: &RobotModel) -> DriveKnowledge {
    let known: Vec<Option<&TermResult>> = robot
        .terms()
        .map(|(term, _)| {
            let (symbol, mut all) = (term.symbol(), stored.joints.iter().flat_map(|joint| &joint.terms));
            all.find(|known| known.symbol == symbol)
                .or_else(|| stored.couplings.iter().find(|known| known.symbol == symbol))
        })
        .collect();
    let base: Vec<Option<usize>> = known.iter().map(|term| base_place(stored, (*term)?)).collect();
    let product = |a: Option<usize>, b: Option<usize>| {
        let (a, b) = (a?, b?);
        let covariance = *stored.base_parameter_covariance.get(a)?.get(b)?;
        let product =
            covariance * half_width_ratio(&stored.base_parameters[a]) * half_width_ratio(&stored.base_parameters[b]);
        product.is_finite().then_some(product)
    };
    let joints: Vec<&str> = robot.model().joints().iter().map(|joint| joint.name.as_str()).collect();
    let lag_of = |name: &&str| stored.joints.iter().find(|joint| joint.name == **name)?.torque_lag;
    DriveKnowledge {
        term_products: base.iter().map(|&a| base.iter().map(|&b| product(a, b)).collect()).collect(),
        term_notes: known.iter().map(|term| term.and_then(|term| note(stored, term))).collect(),
        common_delay: common_delay(stored),
        delays: joints.iter().map(|name| lag_of(name).map(|lag| delay(&lag))).collect(),
        actuator_gains: joints
            .iter()
            .zip(robot.model().joints())
            .map(|(name, j)| gain(stored, name, j.is_rotary()))
            .collect(),
    }
}

/// Index of the base parameter that equals a term, if the logs excite it.
fn base_place(stored: &ResultFile, term: &TermResult) -> Option<usize> {
    let place =
        stored.base_parameters.iter().position(|base| Some(&base.expression) == term.base_parameter.as_ref())?;
    (term.std.is_some() && stored.base_parameters[place].excited).then_some(place)
}

/// Ratio of the 95 % half-width to the standard deviation.
fn half_width_ratio(base: &BaseParameterResult) -> f64 {
    if base.std > 0.0 { base.bar_95() / base.std } else { 0.0 }
}

/// Reason why a term has no separate interval.
fn note(stored: &ResultFile, term: &TermResult) -> Option<String> {
    let expression = term.base_parameter.as_ref()?;
    let base = stored.base_parameters.iter().find(|base| base.expression == *expression)?;
    if !base.excited {
        return Some(format!("the logs do not excite {}: it was fixed", base.symbol));
    }
    if term.std.is_none() {
        let (value, bar) = (base.value, base.bar_95());
        return Some(format!(
            "{} is identifiable only in the sum {expression} = {value:.4} ± {bar:.4}; the values are those nearest to the robot description",
            term.symbol
        ));
    }
    None
}

fn milliseconds(seconds: f64, half_width_95_s: Option<f64>, note: Option<String>) -> SimulatorValue {
    let half_width_95 = half_width_95_s.map(|half| 1e3 * half).filter(|half| half.is_finite());
    SimulatorValue { value: 1e3 * seconds, half_width_95, unit: "ms".to_owned(), note }
}

fn delay(lag: &TorqueLag) -> SimulatorValue {
    let compensated =
        (lag.taken_off_s != 0.0).then(|| format!("compensated before the fit: {:.3} ms", 1e3 * lag.taken_off_s));
    milliseconds(lag.lag_s, Some(lag.half_width_95_s), compensated)
}

/// Common delay of all joints; `None` if joints have separate delays.
fn common_delay(stored: &ResultFile) -> Option<SimulatorValue> {
    let choice = &stored.method.torque_lag;
    match choice.kind {
        LagKind::None | LagKind::Common => choice.common.as_ref().map(delay),
        LagKind::Stated => {
            let first = *choice.lag_s.first()?;
            let is_one = choice.lag_s.iter().all(|lag_s| *lag_s == first);
            is_one.then(|| milliseconds(first, None, Some("stated in the study".to_owned())))
        }
        LagKind::Joints => None,
    }
}

fn gain(stored: &ResultFile, joint: &str, is_rotary: bool) -> SimulatorValue {
    let unit = format!("{} per unit logged", if is_rotary { "Nm" } else { "N" });
    let found = stored.drive_gains.iter().flatten().find(|gain| gain.joint == joint);
    match found {
        Some(found) => SimulatorValue {
            value: found.gain,
            half_width_95: found.identified.then_some(found.half_width_95).filter(|half| half.is_finite()),
            unit,
            note: found.reason.clone(),
        },
        None => SimulatorValue {
            value: 1.0,
            half_width_95: None,
            unit,
            note: Some(
                "torque as logged, in Nm (N) by the study's format: a torque gain scales all parameters, so its identification needs logs with a known payload (drive.gains = \"unknown\")".to_owned(),
            ),
        },
    }
}
