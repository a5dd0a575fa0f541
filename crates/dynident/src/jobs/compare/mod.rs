//! `compare`: several results next to each other, and what changed between them.

use crate::error::Error;
use crate::jobs::differences::{MIN_LISTED_PROBABILITY, changed_body, explanations_of};
use crate::result::{
    BaseParameterResult, COMPARISON_SCHEMA, ChangeExplanation, ChangedPart, ChangesFrom, ComparedBody,
    ComparedFriction, ComparedParameter, ComparedResult, ComparisonFile, ResultFile,
};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, ParametricModel};
use dynident_estimation::HALF_WIDTH_95;
use dynident_estimation::changes::{ChangeSettings, Explanation, explanations};
use dynident_estimation::uncertainty::chi_squared_tail;
use dynident_export::RobotModel;
use dynident_identification::changes::{DescriptionDifferences, Part, Parts, parts};
use dynident_identification::consistent::ConsistencySettings;
use dynident_identification::{DescriptionThresholds, Role};
use dynident_model::terms::TorqueTerm;
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// Compares results of one type of robot: parameters, bodies, friction, errors, and which parts changed. A single
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
        changes.push(between((first, first_path), (result, path, index), &common)?);
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

/// Expressions of the parameters that the logs of all results excite, in the order of the first result; and the other
/// parameters, each with the reason why it is not compared.
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

/// The names that are also base parameters of the robot's structure, with their indices there.
fn known_rows<'a>(robot: &RobotModel, names: &[&'a str]) -> (Vec<&'a str>, Vec<usize>, BaseParameters) {
    let terms: Vec<TorqueTerm> = robot.terms().map(|(term, _)| term.clone()).collect();
    let base = BaseParameters::new(robot.model(), &terms, &BaseParameterSettings::default());
    let symbols = base.expressions();
    let found = names.iter().filter_map(|name| Some((*name, symbols.iter().position(|own| own == name)?)));
    let (names, rows) = found.unzip();
    (names, rows, base)
}

fn between(
    (first, first_path): (&ResultFile, &Path),
    (result, path, index): (&ResultFile, &Path, usize),
    common: &[&str],
) -> Result<ChangesFrom, Error> {
    let robot = stored_robot(first, first_path)?;
    let (names, rows, base) = known_rows(&robot, common);
    let (old, old_covariance) = estimate(first, first_path, &names)?;
    let (new, new_covariance) = estimate(result, path, &names)?;
    let value = |result: &ResultFile, term: &TorqueTerm| {
        let own = result.base_parameters.iter().find(|own| own.symbol == term.symbol());
        own.map_or(0.0, |own| own.value.abs() + own.std)
    };
    let size = |term: &TorqueTerm| value(first, term).max(value(result, term));
    let parts = parts(robot.model(), &base, &rows, &size);
    let covariance = old_covariance + new_covariance;
    changes_of((new - old, covariance), &robot, &parts, (index, Some(0)), path)
}

/// Changes between a robot description and a result; `None` if the description has no inertial values.
fn from_description(result: &ResultFile, path: &Path, common: &[&str]) -> Result<Option<ChangesFrom>, Error> {
    let robot = stored_robot(result, path)?;
    let described: Vec<&str> =
        common.iter().copied().filter(|name| parameter(result, name).is_some_and(|own| own.prior.is_some())).collect();
    let (names, rows, _) = known_rows(&robot, &described);
    let priors: Option<Vec<[f64; 10]>> = result.bodies.iter().map(|body| body.prior).collect();
    let Some(priors) = priors.filter(|_| !names.is_empty()) else { return Ok(None) };
    let failed = |reason: String| wrong(path, reason);
    let terms: Vec<TorqueTerm> = robot.terms().map(|(term, _)| term.clone()).collect();
    let nominal = priors.into_iter().flatten().chain(vec![0.0; terms.len()]).collect();
    let model = ParametricModel::new(robot.model().clone(), terms).map_err(|error| failed(error.to_string()))?;
    let model = model.with_nominal(nominal).map_err(|error| failed(error.to_string()))?;
    let (values, covariance) = estimate(result, path, &names)?;
    let knowledge = ConsistencySettings::default();
    let found = DescriptionDifferences::new(&model, &rows, &values, &covariance, &knowledge);
    let Some(found) = found.map_err(|error| failed(error.to_string()))? else { return Ok(None) };
    let (chi_squared, count) = (found.chi_squared(), rows.len());
    Ok(Some(ChangesFrom {
        result: 0,
        from: None,
        chi_squared,
        degrees_of_freedom: count,
        p_value: chi_squared_tail(chi_squared, count as f64),
        explanations: explanations_of(&found, model.model(), &DescriptionThresholds::default()),
    }))
}

fn changes_of(
    (difference, covariance): (DVector<f64>, DMatrix<f64>),
    robot: &RobotModel,
    parts: &Parts,
    (result, from): (usize, Option<usize>),
    path: &Path,
) -> Result<ChangesFrom, Error> {
    let failed = |source: dynident_estimation::EstimationError| wrong(path, source.to_string());
    let found =
        explanations(&difference, core::slice::from_ref(&covariance), &parts.groups, &ChangeSettings::default())
            .map_err(failed)?;
    let count = difference.len();
    let none = found.iter().find(|own| own.groups.is_empty());
    let chi_squared = none.map_or(0.0, |own| own.remaining * count as f64);
    let likely = found.iter().filter(|own| own.probability >= MIN_LISTED_PROBABILITY);
    Ok(ChangesFrom {
        result,
        from,
        chi_squared,
        degrees_of_freedom: count,
        p_value: chi_squared_tail(chi_squared, count as f64),
        explanations: likely.map(|own| explained(own, robot, parts)).collect(),
    })
}

fn explained(explanation: &Explanation, robot: &RobotModel, parts: &Parts) -> ChangeExplanation {
    let everything = explanation.groups.len() == parts.parts.len() && parts.parts.len() > 2;
    let changed = |(&group, change): (&usize, &(DVector<f64>, DMatrix<f64>))| {
        let part = &parts.parts[group];
        let words = part.words(robot.model());
        match part {
            Part::Body(_) => {
                let (values, covariance) = change;
                let sizes = &parts.sizes[group];
                let std = covariance[(0, 0)].max(0.0).sqrt() * sizes[0];
                changed_body(words, values.component_mul(sizes).as_slice(), std)
            }
            _ => ChangedPart { part: words, ..ChangedPart::default() },
        }
    };
    let listed = explanation.groups.iter().zip(&explanation.changes);
    ChangeExplanation {
        parts: if everything { Vec::new() } else { listed.map(changed).collect() },
        everything,
        probability: explanation.probability,
        remaining: explanation.remaining,
    }
}
