//! Prior information from `[design.prior]`.

use crate::error::{Error, StudyError};
use crate::result::BaseParameterResult;
use crate::result::read_part;
use crate::study::{Folders, PriorSection, Study, StudyRobot};
use dynident_dynamics::Column;
use dynident_excitation::limits::KnownTorque;
use dynident_identification::DriveInertiaChoice;
use dynident_model::terms::TorqueTerm;
use nalgebra::DMatrix;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
struct EarlierEstimate {
    #[serde(rename = "base_parameters")]
    parameters: Vec<BaseParameterResult>,
    #[serde(rename = "base_parameter_covariance", default)]
    covariance: Vec<Vec<f64>>,
    #[serde(rename = "base_parameter_joint_covariance", default)]
    joint_covariance: Vec<Vec<f64>>,
    #[serde(default)]
    drive_inertia_choice: Option<DriveInertiaChoice>,
}

/// Smallest size to which a relative uncertainty is applied, relative to the largest value of the same kind in the
/// body.
const MIN_RELATIVE_SIZE: f64 = 0.1;

/// Standard deviation of an unknown term parameter, SI units: practically no information compared with any
/// measurement.
const UNKNOWN_STD: f64 = 1e3;

/// Prior information (inverse covariance) about the robot's base parameters, with a note about each source. `None`
/// without a prior.
pub(super) fn information(
    section: &PriorSection,
    robot: &StudyRobot,
    study_path: &Path,
    folders: &Folders,
    notes: &mut Vec<String>,
) -> Result<Option<DMatrix<f64>>, Error> {
    let wrong = Error::section(study_path, "design.prior");
    let mut total: Option<DMatrix<f64>> = None;
    let mut add = |information: DMatrix<f64>| {
        total = Some(total.take().map_or_else(|| information.clone(), |sum| sum + &information));
    };
    if let Some(result) = &section.result {
        let path = folders.find(result, None)?;
        add(information_of_result(&path, robot)?);
        notes.push(format!("prior: the covariance of {}", result.display()));
    }
    if let Some(percent) = section.cad_std_percent {
        let unknown = robot.model().bodies_without_prior();
        if !unknown.is_empty() {
            let fix = "add them to the robot description, or remove cad_std_percent";
            return Err(wrong(StudyError::NoInertials {
                bodies: unknown.into_iter().map(str::to_owned).collect(),
                fix,
            }));
        }
        let covariance = cad_covariance(robot, percent / 100.0);
        let too_small =
            || wrong(StudyError::conflict("cad_std_percent", "give a larger value: the covariance is singular"));
        add(inverse(&covariance).ok_or_else(too_small)?);
        notes.push(format!("prior: inertial parameters of the robot description, standard deviation {percent} % each"));
    }
    Ok(total)
}

/// The study with the drive inertia that the earlier result selected, for joints whose drive inertia the study does not
/// state.
pub(super) fn with_earlier_drives(section: &PriorSection, study: &Study, folders: &Folders) -> Result<Study, Error> {
    let mut study = study.clone();
    let Some(result) = &section.result else { return Ok(study) };
    let found: EarlierEstimate = read_part(&folders.find(result, None)?)?;
    if let Some(choice) = &found.drive_inertia_choice {
        for joint in &choice.joints {
            let of_all = study.drive.drive_inertia;
            let own = study.drive.joints.entry(joint.clone()).or_default();
            own.drive_inertia = own.drive_inertia.or(of_all).or(Some(choice.seen));
        }
    }
    Ok(study)
}

/// Adds friction and drive inertia of an earlier result: every term that is a base parameter by itself. They replace
/// the joint's friction in the robot description.
pub(super) fn with_earlier_torque(
    section: &PriorSection,
    robot: &StudyRobot,
    folders: &Folders,
    known: KnownTorque,
) -> Result<KnownTorque, Error> {
    let Some(result) = &section.result else { return Ok(known) };
    let path = folders.find(result, None)?;
    let found: EarlierEstimate = read_part(&path)?;
    let of = |symbol: &str| {
        found.parameters.iter().find(|own| own.symbol == symbol && own.expression == symbol).map(|own| own.value)
    };
    let found: Vec<(&TorqueTerm, f64)> = robot
        .terms()
        .iter()
        .filter_map(|term| Some((term, of(&term.symbol())?)))
        .filter(|(_, value)| value.is_finite())
        .collect();
    let joints = found.iter().filter(|(term, _)| term.is_joint_friction()).filter_map(|(term, _)| term.own_joint());
    let known = joints.fold(known, KnownTorque::without_friction_of);
    Ok(found.into_iter().fold(known, |known, (term, value)| known.with(term.clone(), value)))
}

/// Covariance `K diag(σ²) Kᵀ` of the base parameters: variances of the independent parameters, plus those of the
/// regrouped parameters.
fn cad_covariance(robot: &StudyRobot, share: f64) -> DMatrix<f64> {
    let std = standard_deviations(robot, share);
    let base = robot.base();
    let mut spread = base.regrouping().clone();
    for (mut column, index) in spread.column_iter_mut().zip(base.dependent()) {
        column *= std[*index];
    }
    let mut covariance = &spread * spread.transpose();
    for (place, index) in base.independent().iter().enumerate() {
        covariance[(place, place)] += std[*index] * std[*index];
    }
    covariance
}

/// Standard deviation of every standard parameter: bodies, then terms.
fn standard_deviations(robot: &StudyRobot, share: f64) -> Vec<f64> {
    const KINDS: [core::ops::Range<usize>; 3] = [0..1, 1..4, 4..10];
    let values = robot.nominal().to_vec();
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let (bodies, terms) = values.split_at(robot.model().inertial_count());
    let mut std = Vec::with_capacity(values.len());
    for body in bodies.chunks_exact(10) {
        for kind in KINDS {
            let of_robot = bodies.chunks_exact(10).map(|body| largest(&body[kind.clone()])).fold(0.0, f64::max);
            let own = largest(&body[kind.clone()]);
            // The scale is 1 SI unit if all parameters of this kind are zero.
            let scale = [own, of_robot, 1.0].into_iter().find(|scale| *scale > 0.0).unwrap_or(1.0);
            std.extend(body[kind].iter().map(|value| share * value.abs().max(MIN_RELATIVE_SIZE * scale)));
        }
    }
    std.extend(robot.terms().iter().zip(terms).map(|(term, value)| {
        let is_stated = term.property().is_some() || term.is_declared();
        if is_stated && *value != 0.0 { share * value.abs() } else { UNKNOWN_STD }
    }));
    std
}

/// Inverse of a covariance, scaled by its correlation matrix for accuracy; `None` if it is not positive definite.
fn inverse(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.sqrt().recip()).collect();
    let between = |matrix: &DMatrix<f64>| {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| scale[i] * matrix[(i, j)] * scale[j])
    };
    let inverse = between(&between(covariance).cholesky()?.inverse());
    // Later steps need an exactly symmetric matrix.
    let symmetric = (&inverse + inverse.transpose()) * 0.5;
    symmetric.iter().all(|x| x.is_finite()).then_some(symmetric)
}

/// Inverse covariance of an earlier result in the order of the robot's columns; zero for unexcited columns, and for
/// friction that the earlier result does not contain. Friction of the earlier result that the study's robot does not
/// have is left out of the covariance.
fn information_of_result(path: &Path, robot: &StudyRobot) -> Result<DMatrix<f64>, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let stored: EarlierEstimate = read_part(path)?;
    let place = places(&stored.parameters, robot).map_err(wrong)?;
    let rows = &stored.covariance;
    if rows.is_empty() {
        let message = "base_parameter_covariance is missing because an earlier version wrote the file: identify again";
        return Err(wrong(message.to_owned()));
    }
    let count = place.len();
    let joint = Some(&stored.joint_covariance).filter(|joint| !joint.is_empty()).unwrap_or(rows);
    for (name, rows) in [("base_parameter_covariance", rows), ("base_parameter_joint_covariance", joint)] {
        if rows.len() != count || rows.iter().any(|row| row.len() != count) {
            return Err(wrong(format!("{name} is not {count} rows of {count} numbers: identify again")));
        }
    }
    let used: Vec<(usize, usize)> = (0..count)
        .filter(|&index| stored.parameters[index].excited)
        .filter_map(|index| Some((index, place[index]?)))
        .collect();
    // With few time segments, the covariance is singular: its variances are right, its correlations are not.
    let scale = |index: usize| (rows[index][index] / joint[index][index]).sqrt();
    let covariance = DMatrix::from_fn(used.len(), used.len(), |i, j| {
        let (i, j) = (used[i].0, used[j].0);
        joint[i][j] * scale(i) * scale(j)
    });
    // The comparison is false for NaN, so NaN is rejected.
    let symmetric = covariance
        .iter()
        .zip(covariance.transpose().iter())
        .all(|(a, b)| (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(f64::MIN_POSITIVE));
    let small = Some(&covariance).filter(|_| symmetric).and_then(inverse).ok_or_else(|| {
        wrong(
            "the covariance of the base parameters is not symmetric and positive definite: identify again, or with \
             more logs"
                .to_owned(),
        )
    })?;
    let columns = robot.layout().columns().len();
    let mut information = DMatrix::zeros(columns, columns);
    for (i, &(_, row)) in used.iter().enumerate() {
        for (j, &(_, column)) in used.iter().enumerate() {
            information[(row, column)] = small[(i, j)];
        }
    }
    Ok(information)
}

const MAX_LISTED: usize = 6;

/// Column of the robot for each stored parameter; `None` for friction that the robot does not have. The earlier study
/// may have selected other friction, but all other parameters must be the same.
fn places(stored: &[BaseParameterResult], robot: &StudyRobot) -> Result<Vec<Option<usize>>, String> {
    let columns = robot.layout().columns();
    let symbols: Vec<String> = columns.iter().map(Column::symbol).collect();
    let expressions = robot.base().expressions();
    let listed = |names: &[&str]| {
        let more =
            if names.len() > MAX_LISTED { format!(" and {} more", names.len() - MAX_LISTED) } else { String::new() };
        format!("{}{more}", names[..names.len().min(MAX_LISTED)].join(", "))
    };
    let times = |symbol: &String| stored.iter().filter(|p| p.symbol == *symbol).count();
    let is_friction = |column: &Column| matches!(column, Column::Term(term) if term.is_joint_friction());
    let is_wrong = |(column, symbol): &(&Column, &String)| {
        let found = times(symbol);
        found > 1 || found == 0 && !is_friction(column)
    };
    let missing: Vec<&str> = columns.iter().zip(&symbols).filter(is_wrong).map(|(_, symbol)| symbol.as_str()).collect();
    let fix = "use a result of the same robot with the same [robot] and the same drive inertia \
               (drive_inertia = true or false under [drive])";
    if !missing.is_empty() {
        let unknown: Vec<&str> =
            stored.iter().filter(|p| !symbols.contains(&p.symbol)).map(|p| p.symbol.as_str()).collect();
        let others = if unknown.is_empty() {
            String::new()
        } else {
            format!(", and its base parameters {} do not belong to the robot", listed(&unknown))
        };
        return Err(format!(
            "base parameters {} of the robot are missing or duplicate{others}: {fix}",
            listed(&missing)
        ));
    }
    let of = |parameter: &BaseParameterResult| match symbols.iter().position(|symbol| *symbol == parameter.symbol) {
        Some(place) if parameter.expression != expressions[place] => Err(format!(
            "its base parameter `{}` is `{}`, but `{}` for the study's robot: {fix}",
            parameter.symbol, parameter.expression, expressions[place]
        )),
        place => Ok(place),
    };
    stored.iter().map(of).collect()
}
