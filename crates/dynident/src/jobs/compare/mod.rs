//! `compare`: results side by side, and what changed between them.

use crate::error::Error;
use crate::jobs::differences::explanations_of;
use crate::result::{
    BaseParameterResult, COMPARISON_SCHEMA, ChangesFrom, ComparedBody, ComparedFriction, ComparedParameter,
    ComparedResult, ComparisonFile, ResultFile,
};
use dynident_dynamics::{ParametricModel, ParametricModelError};
use dynident_estimation::HALF_WIDTH_95;
use dynident_estimation::uncertainty::chi_squared_tail;
use dynident_export::RobotModel;
use dynident_identification::changes::Differences;
use dynident_identification::consistent::ConsistencySettings;
use dynident_identification::{DescriptionThresholds, Role};
use dynident_model::terms::TorqueTerm;
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// Results of one type of robot side by side: parameters, bodies, friction, errors, and which parts changed. A single
/// result is compared with its robot description.
///
/// The covariance of a difference is the sum of both covariances, so the results should be of different logs.
///
/// # Errors
/// Results of different robots; a result without model or covariance; no common parameter.
pub fn compare(results: &[(ResultFile, PathBuf)]) -> Result<ComparisonFile, Error> {
    let Some((first, first_path)) = results.first() else { return Ok(ComparisonFile::default()) };
    for (result, path) in results {
        if result.robot.joints != first.robot.joints {
            let joints = |result: &ResultFile| result.robot.joints.join(", ");
            return Err(wrong(
                path,
                format!(
                    "joints {}, but {} has {}: compare results of one type of robot",
                    joints(result),
                    first_path.display(),
                    joints(first)
                ),
            ));
        }
    }
    let (common, not_compared) = common_parameters(results);
    if common.is_empty() {
        return Err(wrong(first_path, "no base parameter is excited in all results".to_owned()));
    }
    let all: Vec<Vec<&BaseParameterResult>> =
        results.iter().map(|(result, _)| common.iter().filter_map(|name| parameter(result, name)).collect()).collect();
    let parameters = (0..common.len()).map(|k| compared(&all.iter().map(|own| own[k]).collect::<Vec<_>>())).collect();
    let mut changes = Vec::new();
    if results.len() == 1 {
        changes.extend(from_description(first, first_path, &common)?);
    }
    for (index, (result, path)) in results.iter().enumerate().skip(1) {
        changes.push(between(first, first_path, result, path, index, &common)?);
    }
    Ok(ComparisonFile {
        schema: COMPARISON_SCHEMA.to_owned(),
        results: results.iter().map(|(result, path)| described(result, path)).collect(),
        parameters,
        not_compared,
        bodies: bodies(results),
        friction: friction(results),
        changes,
        notes: shared_inputs(results),
    })
}

fn wrong(path: &Path, message: String) -> Error {
    Error::Result { path: path.to_owned(), message }
}

fn parameter<'a>(result: &'a ResultFile, expression: &str) -> Option<&'a BaseParameterResult> {
    result.base_parameters.iter().find(|own| own.expression == expression)
}

/// Expressions of the parameters that all results excite, in the order of the first; and the others with the reason.
fn common_parameters(results: &[(ResultFile, PathBuf)]) -> (Vec<&str>, Vec<String>) {
    let (mut common, mut left): (Vec<&str>, Vec<String>) = (Vec::new(), Vec::new());
    for own in results.iter().flat_map(|(result, _)| &result.base_parameters) {
        let expression = own.expression.as_str();
        if common.contains(&expression) || left.iter().any(|text| text.starts_with(&format!("{expression}: "))) {
            continue;
        }
        let found: Vec<_> = results.iter().filter_map(|(result, _)| parameter(result, expression)).collect();
        if found.len() < results.len() {
            left.push(format!("{expression}: in {} of {} results", found.len(), results.len()));
        } else if found.iter().any(|own| !own.excited) {
            left.push(format!("{expression}: not excited in every result"));
        } else {
            common.push(expression);
        }
    }
    (common, left)
}

fn compared(all: &[&BaseParameterResult]) -> ComparedParameter {
    let first = all[0];
    let z = |own: &&BaseParameterResult| (own.value - first.value).abs() / own.std.hypot(first.std);
    ComparedParameter {
        symbol: first.symbol.clone(),
        expression: first.expression.clone(),
        unit: first.unit.clone(),
        values: all.iter().map(|own| own.value).collect(),
        half_widths_95: all.iter().map(|own| own.bar_95()).collect(),
        largest_z: all.iter().skip(1).map(z).filter(|z| z.is_finite()).fold(0.0, f64::max),
    }
}

fn described(result: &ResultFile, path: &Path) -> ComparedResult {
    let error = |log: &dynident_identification::examination::LogValidation| {
        let report = log.physical.as_ref().unwrap_or(&log.model);
        (log.log.clone(), report.relative_error_percent)
    };
    ComparedResult {
        file: path.display().to_string(),
        name: result.name.clone(),
        robot: result.robot.name.clone(),
        held_out: result.validation.iter().map(error).collect(),
    }
}

fn bodies(results: &[(ResultFile, PathBuf)]) -> Vec<ComparedBody> {
    let first = results.first().map(|(result, _)| result.bodies.as_slice()).unwrap_or_default();
    let of = |name: &str| -> Option<ComparedBody> {
        let all: Option<Vec<_>> =
            results.iter().map(|(result, _)| result.bodies.iter().find(|body| body.name == name)).collect();
        let all = all?;
        Some(ComparedBody {
            name: name.to_owned(),
            mass_kg: all.iter().map(|body| body.mass_kg).collect(),
            half_width_95_kg: all.iter().map(|body| body.std.map(|std| HALF_WIDTH_95 * std[0])).collect(),
        })
    };
    first.iter().filter_map(|body| of(&body.name)).collect()
}

fn friction(results: &[(ResultFile, PathBuf)]) -> Vec<ComparedFriction> {
    let joints = results.first().map(|(result, _)| result.robot.joints.as_slice()).unwrap_or_default();
    let law = |result: &ResultFile, joint: &str| {
        let own = result.friction_choice.iter().find(|own| own.joint == joint);
        own.map_or_else(|| "as stated".to_owned(), |own| own.chosen.clone())
    };
    let of = |joint: &String| ComparedFriction {
        joint: joint.clone(),
        laws: results.iter().map(|(result, _)| law(result, joint)).collect(),
    };
    joints.iter().map(of).collect()
}

/// A note on training logs that several results use: their errors are then not independent.
fn shared_inputs(results: &[(ResultFile, PathBuf)]) -> Vec<String> {
    let logs = |result: &ResultFile| -> Vec<(String, String)> {
        let is_training =
            |file: &str| result.logs.iter().any(|log| log.role == Role::Identify && log.import.file == file);
        let inputs = result.provenance.iter().flat_map(|origin| &origin.inputs);
        let training = inputs.filter(|input| input.what == "log" && is_training(&input.file));
        training.map(|input| (input.sha256.clone(), input.file.clone())).collect()
    };
    let mut notes = Vec::new();
    for (place, (result, path)) in results.iter().enumerate() {
        for (other, other_path) in &results[..place] {
            let theirs = logs(other);
            let shared: Vec<String> = logs(result)
                .into_iter()
                .filter(|(hash, _)| theirs.iter().any(|(other, _)| other == hash))
                .map(|(_, file)| file)
                .collect();
            if !shared.is_empty() {
                notes.push(format!(
                    "{} and {} use the same logs ({}): their errors are not independent, and the error bars of the \
                     differences do not hold",
                    other_path.display(),
                    path.display(),
                    shared.join(", ")
                ));
            }
        }
    }
    notes
}

fn stored_robot(result: &ResultFile, path: &Path) -> Result<RobotModel, Error> {
    let missing = || wrong(path, "it contains no complete model: identify again with this version".to_owned());
    let stored = result.model.as_ref().ok_or_else(missing)?;
    stored.robot().map_err(|source| Error::Export { path: path.to_owned(), source: Box::new(source) })
}

/// Values and covariance of some base parameters.
fn estimate(result: &ResultFile, path: &Path, names: &[&str]) -> Result<(DVector<f64>, DMatrix<f64>), Error> {
    let n = result.base_parameters.len();
    let joint = &result.base_parameter_joint_covariance;
    let rows = if joint.is_empty() { &result.base_parameter_covariance } else { joint };
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        return Err(wrong(path, "it contains no covariance: identify again with this version".to_owned()));
    }
    let place = |name: &&str| result.base_parameters.iter().position(|own| own.expression == *name);
    let places: Vec<usize> = names.iter().filter_map(place).collect();
    let values = DVector::from_iterator(places.len(), places.iter().map(|&k| result.base_parameters[k].value));
    Ok((values, DMatrix::from_fn(places.len(), places.len(), |a, b| rows[places[a]][places[b]])))
}

/// The robot of a result with these nominal values of its bodies and none of its terms, and the parameters that it also
/// has: their names and their indices among its base parameters.
fn known_rows<'a>(
    robot: &RobotModel,
    bodies: Vec<f64>,
    names: &[&'a str],
) -> Result<(ParametricModel, Vec<&'a str>, Vec<usize>), ParametricModelError> {
    let terms: Vec<TorqueTerm> = robot.terms().map(|(term, _)| term.clone()).collect();
    let nominal = bodies.into_iter().chain(vec![0.0; terms.len()]).collect();
    let model = ParametricModel::new(robot.model().clone(), terms)?.with_nominal(nominal)?;
    let symbols = model.base().expressions();
    let found = names.iter().filter_map(|name| Some((*name, symbols.iter().position(|own| own == name)?)));
    let (names, rows) = found.unzip();
    Ok((model, names, rows))
}

fn between(
    first: &ResultFile,
    first_path: &Path,
    result: &ResultFile,
    path: &Path,
    index: usize,
    common: &[&str],
) -> Result<ChangesFrom, Error> {
    let robot = stored_robot(first, first_path)?;
    let failed = |reason: String| wrong(path, reason);
    let bodies = robot.model().inertials().iter().flat_map(|body| body.0).collect();
    let (model, names, rows) = known_rows(&robot, bodies, common).map_err(|error| failed(error.to_string()))?;
    let (old, old_covariance) = estimate(first, first_path, &names)?;
    let (new, new_covariance) = estimate(result, path, &names)?;
    let limits = DescriptionThresholds::default();
    let found = Differences::between(&model, &rows, [(&old, &old_covariance), (&new, &new_covariance)], &limits);
    let found = found.map_err(|error| failed(error.to_string()))?;
    Ok(changes_of(&found, &model, index, Some(0), rows.len()))
}

/// Changes of a result from its robot description; `None` if the description has no inertial values.
fn from_description(result: &ResultFile, path: &Path, common: &[&str]) -> Result<Option<ChangesFrom>, Error> {
    let robot = stored_robot(result, path)?;
    let is_described = |name: &&&str| parameter(result, name).is_some_and(|own| own.prior.is_some());
    let described: Vec<&str> = common.iter().filter(is_described).copied().collect();
    let failed = |reason: String| wrong(path, reason);
    let priors: Option<Vec<[f64; 10]>> = result.bodies.iter().map(|body| body.prior).collect();
    let Some(priors) = priors.filter(|priors| !priors.is_empty() && !described.is_empty()) else { return Ok(None) };
    let (model, names, rows) = known_rows(&robot, priors.into_iter().flatten().collect(), &described)
        .map_err(|error| failed(error.to_string()))?;
    let (values, covariance) = estimate(result, path, &names)?;
    let (knowledge, limits) = (ConsistencySettings::default(), DescriptionThresholds::default());
    let found = Differences::from_description(&model, &rows, &values, &covariance, &knowledge, &limits);
    let found = found.map_err(|error| failed(error.to_string()))?;
    Ok(found.map(|found| changes_of(&found, &model, 0, None, rows.len())))
}

fn changes_of(
    found: &Differences,
    model: &ParametricModel,
    result: usize,
    from: Option<usize>,
    degrees_of_freedom: usize,
) -> ChangesFrom {
    let chi_squared = found.chi_squared();
    ChangesFrom {
        result,
        from,
        chi_squared,
        degrees_of_freedom,
        p_value: chi_squared_tail(chi_squared, degrees_of_freedom as f64),
        explanations: explanations_of(found, model.model(), &DescriptionThresholds::default()),
    }
}
