//! `[design.prior]`: what is known before the motion, so that the next one looks for what is not.

use crate::error::Error;
use crate::result::identification::{BaseParameterResult, RESULT_SCHEMA};
use crate::study::Folders;
use crate::study::StudyRobot;
use dynident_dynamics::Column;
use dynident_model::laws::Law;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A value below this share of the largest of its kind in its body is known no better than one of this size.
const FLOOR: f64 = 0.1;

/// Standard deviation (SI) of a law's parameter that the description says nothing about: as good as unknown beside any
/// measurement.
const UNKNOWN: f64 = 1e3;

/// `[design.prior]`. What several sources say adds up.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PriorSection {
    /// `result.json` of an earlier identification of the same machine: its covariance says how well each base parameter
    /// is known. Found as the study's logs are.
    pub result: Option<PathBuf>,
    /// The description's own inertial parameters, good to so many percent each (one standard deviation, independent of
    /// each other). A parameter that is smaller than a tenth of the largest of its kind (first moments, moments of
    /// inertia) in its body counts as if it were of that tenth; of a kind that the body has nothing of, the largest of
    /// the robot counts. Friction is taken from the description where it says something, else it is unknown.
    pub cad_std_percent: Option<f64>,
}

impl PriorSection {
    /// Whether it says anything.
    pub(crate) fn is_empty(&self) -> bool {
        self.result.is_none() && self.cad_std_percent.is_none()
    }

    pub(crate) fn validate(&self) -> Result<(), String> {
        match self.cad_std_percent {
            Some(percent) if !(1e-3..=1e6).contains(&percent) => {
                Err(format!("prior.cad_std_percent = {percent}: give 0.001 to 1000000"))
            }
            _ => Ok(()),
        }
    }

    /// The information about the machine's base parameters, inverse covariance, and a sentence on each source. None if
    /// nothing is said.
    pub(crate) fn information(
        &self,
        machine: &StudyRobot,
        study_path: &Path,
        folders: &Folders,
        notes: &mut Vec<String>,
    ) -> Result<Option<DMatrix<f64>>, Error> {
        let mut total: Option<DMatrix<f64>> = None;
        let mut add = |information: DMatrix<f64>| {
            total = Some(total.take().map_or_else(|| information.clone(), |sum| sum + &information));
        };
        if let Some(result) = &self.result {
            let path = folders.find(result, None)?;
            add(of_result(&path, machine)?);
            notes.push(format!("prior: the covariance of {}", result.display()));
        }
        if let Some(percent) = self.cad_std_percent {
            let unknown = machine.model().bodies_without_prior();
            if !unknown.is_empty() {
                let message = format!(
                    "[design.prior]: cad_std_percent, but the inertial parameters of {} are unknown: give them in the description, or leave cad_std_percent out",
                    unknown.join(", ")
                );
                return Err(Error::study(study_path, message));
            }
            let covariance = cad_covariance(machine, percent / 100.0);
            add(inverse(&covariance)
                .ok_or_else(|| Error::study(study_path, "[design.prior]: cad_std_percent is too small".to_owned()))?);
            notes.push(format!("prior: the description's inertial parameters, good to {percent} % each"));
        }
        Ok(total)
    }
}

/// `K diag(σ²) Kᵀ` of the base parameters: the independent ones with their own variance, and what is regrouped into
/// them.
fn cad_covariance(machine: &StudyRobot, share: f64) -> DMatrix<f64> {
    let std = standard_deviations(machine, share);
    let base = machine.base();
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

/// Standard deviation of every standard parameter: bodies, then laws.
fn standard_deviations(machine: &StudyRobot, share: f64) -> Vec<f64> {
    const KINDS: [core::ops::Range<usize>; 3] = [0..1, 1..4, 4..10];
    let values = machine.nominal().to_vec();
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let (bodies, laws) = values.split_at(10 * machine.model().dof());
    let mut std = Vec::with_capacity(values.len());
    for body in bodies.chunks_exact(10) {
        for kind in KINDS {
            let of_robot = bodies.chunks_exact(10).map(|body| largest(&body[kind.clone()])).fold(0.0, f64::max);
            let own = largest(&body[kind.clone()]);
            // A robot without any parameter of the kind: one of its unit.
            let scale = [own, of_robot, 1.0].into_iter().find(|scale| *scale > 0.0).unwrap_or(1.0);
            std.extend(body[kind].iter().map(|value| share * value.abs().max(FLOOR * scale)));
        }
    }
    std.extend(machine.laws().iter().zip(laws).map(|(law, value)| match law {
        Law::Viscous(_) | Law::Coulomb(_) if *value != 0.0 => share * value.abs(),
        _ => UNKNOWN,
    }));
    std
}

/// Inverse of a covariance by way of its correlations, whose entries are of one size; `None` if it is not positive
/// definite.
fn inverse(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.sqrt().recip()).collect();
    let between = |matrix: &DMatrix<f64>| {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| scale[i] * matrix[(i, j)] * scale[j])
    };
    let inverse = between(&between(covariance).cholesky()?.inverse());
    // Symmetric to the last bit, as everything that is made of it expects.
    let symmetric = (&inverse + inverse.transpose()) * 0.5;
    symmetric.iter().all(|x| x.is_finite()).then_some(symmetric)
}

/// The part of `result.json` that says how well the parameters are known.
#[derive(Deserialize)]
struct StoredUncertainty {
    schema: String,
    base_parameters: Vec<BaseParameterResult>,
    base_parameter_covariance: Option<Vec<Vec<f64>>>,
}

/// Inverse covariance of an earlier result in the machine's columns; zero for those that it did not excite.
fn of_result(path: &Path, machine: &StudyRobot) -> Result<DMatrix<f64>, Error> {
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    let bytes = std::fs::read(path).map_err(|source| Error::File { path: path.to_owned(), source })?;
    let stored: StoredUncertainty = serde_json::from_slice(&bytes).map_err(|error| {
        wrong(format!("line {}, column {}: not a result of `identify`: {error}", error.line(), error.column()))
    })?;
    if stored.schema != RESULT_SCHEMA {
        return Err(wrong(format!("schema `{}`, not `{RESULT_SCHEMA}`: identify again", stored.schema)));
    }
    let place = places(&stored.base_parameters, machine).map_err(wrong)?;
    let rows = stored.base_parameter_covariance.ok_or_else(|| {
        wrong("no base_parameter_covariance: made by an earlier version, identify again with this one".to_owned())
    })?;
    let count = place.len();
    if rows.len() != count || rows.iter().any(|row| row.len() != count) {
        return Err(wrong(format!("base_parameter_covariance is not {count} rows of {count} numbers: identify again")));
    }
    // Places of the excited parameters in the file.
    let excited: Vec<usize> = (0..count).filter(|&index| stored.base_parameters[index].excited).collect();
    let covariance = DMatrix::from_fn(excited.len(), excited.len(), |i, j| rows[excited[i]][excited[j]]);
    // NaN compares as false: it is refused too.
    let symmetric = covariance
        .iter()
        .zip(covariance.transpose().iter())
        .all(|(a, b)| (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(f64::MIN_POSITIVE));
    let small = Some(&covariance).filter(|_| symmetric).and_then(inverse).ok_or_else(|| {
        wrong(
            "base_parameter_covariance is not symmetric and positive definite: identify with more logs or segments, or with estimator.covariance = \"white\""
                .to_owned(),
        )
    })?;
    let mut information = DMatrix::zeros(count, count);
    for (i, &row) in excited.iter().enumerate() {
        for (j, &column) in excited.iter().enumerate() {
            information[(place[row], place[column])] = small[(i, j)];
        }
    }
    Ok(information)
}

/// Names shown of a list at most.
const TOLD: usize = 6;

/// For every stored parameter its column in the machine.
fn places(stored: &[BaseParameterResult], machine: &StudyRobot) -> Result<Vec<usize>, String> {
    let symbols: Vec<String> = machine.layout().columns().iter().map(Column::symbol).collect();
    let expressions = machine.base().expressions();
    let listed = |names: &[&str]| {
        let more = if names.len() > TOLD { format!(" and {} more", names.len() - TOLD) } else { String::new() };
        format!("{}{more}", names[..names.len().min(TOLD)].join(", "))
    };
    let strange: Vec<&str> =
        stored.iter().filter(|p| !symbols.contains(&p.symbol)).map(|p| p.symbol.as_str()).collect();
    let absent: Vec<&str> = symbols
        .iter()
        .filter(|symbol| stored.iter().filter(|p| p.symbol == **symbol).count() != 1)
        .map(String::as_str)
        .collect();
    let mend = "use a result of the same robot with the same [drive] and [robot]";
    if !strange.is_empty() {
        return Err(format!("its base parameters {} are none of the study's machine: {mend}", listed(&strange)));
    }
    if !absent.is_empty() {
        return Err(format!("it does not hold the machine's base parameters {} once each: {mend}", listed(&absent)));
    }
    stored
        .iter()
        .map(|parameter| {
            let place = symbols.iter().position(|symbol| *symbol == parameter.symbol).unwrap_or(0);
            if parameter.expression == expressions[place] {
                Ok(place)
            } else {
                Err(format!(
                    "its base parameter `{}` sums `{}`, that of the study's machine `{}`: {mend}",
                    parameter.symbol, parameter.expression, expressions[place]
                ))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::inverse;
    use nalgebra::DMatrix;

    /// Sizes twelve decades apart: each entry of C⁻¹C to 1e-9 in the units of both.
    #[test]
    fn inverse_of_very_unequal_variances() {
        let root = DMatrix::from_row_slice(3, 3, &[1.0, 0.4, 0.1, 0.0, 1.0, -0.3, 0.2, 0.0, 1.0]);
        let scale = [1e-6, 1.0, 1e6];
        let correlated = &root * root.transpose();
        let covariance = DMatrix::from_fn(3, 3, |i, j| scale[i] * correlated[(i, j)] * scale[j]);
        let product = inverse(&covariance).unwrap() * &covariance;
        for i in 0..3 {
            for j in 0..3 {
                let expected = f64::from(u8::from(i == j));
                assert!((product[(i, j)] * scale[i] / scale[j] - expected).abs() < 1e-9);
            }
        }
        assert!(inverse(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_none());
        assert!(inverse(&DMatrix::zeros(1, 1)).is_none());
    }
}
