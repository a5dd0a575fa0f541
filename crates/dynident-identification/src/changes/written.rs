//! The exported model if few bodies differ from the description, and its torque error after single bodies are edited.

use super::average::BodyUncertainty;
use super::differences::Differences;
use super::parts::effects;
use crate::consistent::{ConsistencySettings, consistent_body};
use crate::thresholds::DescriptionThresholds;
use dynident_dynamics::ParametricModel;
use dynident_estimation::changes::Explanation;
use dynident_estimation::{HALF_WIDTH_95, LinearProblem};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Expected torque error if a body gets the values of the description again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RestoredBody {
    /// Name of its main link.
    pub name: String,
    /// Probability that the body differs from the description.
    pub probability: f64,
    /// Expected torque error if this body gets the values of the description and the others keep their exported values,
    /// percent of the torque of that robot on the training motion (root mean square); null without torque.
    pub error_percent: Option<f64>,
    /// Upper end of the 95 % interval of this error, percent.
    pub error_95_percent: Option<f64>,
}

/// Prior knowledge for the exported model according to `explanation`. The changed bodies get the mean of the change;
/// the others keep the values of the description, with the uncertainty of the explanation.
pub(crate) fn knowledge_of(
    differences: &Differences,
    explanation: &Explanation,
    robot: &ParametricModel,
    knowledge: &ConsistencySettings,
    limits: &DescriptionThresholds,
) -> ConsistencySettings {
    let (mut found, named) = (knowledge.clone(), differences.bodies_of(explanation));
    for (index, body) in robot.model().bodies().iter().enumerate() {
        let own = &robot.nominal()[10 * index..10 * index + 10];
        let settings = found.bodies.entry(body.name().to_owned()).or_default();
        if named.contains(&index) {
            settings.prior =
                Some(changed_body(own, &differences.change_of(explanation, index).0, limits.min_mass_ratio));
        } else if differences.body_probability(index, limits) < limits.max_unchanged_probability {
            settings.prior_std = Some(differences.sizes[explanation.covariance].largest());
        }
    }
    found
}

/// A physically consistent body with the mass and first moment of `nominal + change`; it also has the inertia of this
/// sum if that is consistent.
fn changed_body(nominal: &[f64], change: &DVector<f64>, min_mass_ratio: f64) -> [f64; 10] {
    let sum: [f64; 10] = core::array::from_fn(|k| nominal[k] + change[k]);
    if consistent_body(&sum).0 {
        return sum;
    }
    let mass = sum[0].max(min_mass_ratio * nominal[0]);
    let ratio = mass / nominal[0];
    let [from, to] =
        [[nominal[1], nominal[2], nominal[3]].map(|h| h / nominal[0]), [sum[1], sum[2], sum[3]].map(|h| h / mass)];
    // Inertia of a point mass about the origin.
    let of_point = |[x, y, z]: [f64; 3]| {
        [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y].map(|value| mass * value)
    };
    let (before, after) = (of_point(from), of_point(to));
    core::array::from_fn(|k| match k {
        0 => mass,
        1..=3 => sum[k],
        _ => ratio * nominal[k] - before[k - 4] + after[k - 4],
    })
}

/// Expected torque errors after each body is restored: the mean of `‖W E e‖²` over all explanations, where e is the
/// error of the other bodies, E the effect on the base parameters and W the regressor. The 95 % quantile of a quadratic
/// form of normal variables is at most 1.96² times its mean (Szekely and Bakirov, Probability Theory and Related Fields
/// 126 (2003) 184).
pub(crate) fn restored_errors(
    differences: &Differences,
    uncertainty: &BodyUncertainty,
    robot: &ParametricModel,
    problem: &LinearProblem,
    written: &[f64],
    limits: &DescriptionThresholds,
) -> Vec<RestoredBody> {
    let count = robot.base().count();
    let mut squares = DMatrix::<f64>::zeros(count, count);
    for equation in problem.equations() {
        let triangle = equation.factor.total().regressor_triangle();
        let own = triangle.tr_mul(&triangle);
        for (a, &row) in equation.columns.iter().enumerate().filter(|(_, row)| **row < count) {
            for (b, &column) in equation.columns.iter().enumerate().filter(|(_, column)| **column < count) {
                squares[(row, column)] += own[(a, b)];
            }
        }
    }
    let inertial = robot.model().inertial_count();
    let effects = effects(robot.base());
    let of_bodies = effects.columns(0, inertial);
    let metric = of_bodies.tr_mul(&(&squares * of_bodies));
    let of = |index: usize, name: &str| {
        let is_own = |k: usize| k / 10 == index;
        let others: Vec<usize> = (0..inertial).filter(|&k| !is_own(k)).collect();
        let pairs = others.iter().flat_map(|&a| others.iter().map(move |&b| (a, b)));
        let error: f64 = pairs.map(|(a, b)| metric[(a, b)] * uncertainty.mean_square[(a, b)]).sum();
        let values = DVector::from_fn(written.len(), |k, _| if is_own(k) { robot.nominal()[k] } else { written[k] });
        let theta = &effects * values;
        let torque = theta.dot(&(&squares * &theta));
        let percent =
            (torque > 0.0).then(|| 100.0 * (error.max(0.0) / torque).sqrt()).filter(|value| value.is_finite());
        RestoredBody {
            name: name.to_owned(),
            probability: differences.body_probability(index, limits),
            error_percent: percent,
            error_95_percent: percent.map(|value| HALF_WIDTH_95 * value),
        }
    };
    robot.model().bodies().iter().enumerate().map(|(index, body)| of(index, body.name())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_body_is_consistent() {
        let nominal = [2.0, 0.2, 0.0, 0.4, 0.15, 0.0, -0.04, 0.17, 0.0, 0.1];
        assert!(consistent_body(&nominal).0);
        // A physically consistent load is added unchanged. A change that gives no possible body keeps only mass and
        // first moment.
        let load = DVector::from_vec(vec![1.0, 0.1, 0.0, 0.0, 0.01, 0.0, 0.0, 0.02, 0.0, 0.02]);
        let sum = changed_body(&nominal, &load, 0.1);
        assert!((0..10).all(|k| (sum[k] - nominal[k] - load[k]).abs() < 1e-12), "{sum:?}");
        let impossible = DVector::from_vec(vec![1.0, 0.5, 0.0, 0.3, -0.2, 0.0, 0.0, -0.2, 0.0, -0.1]);
        let found = changed_body(&nominal, &impossible, 0.1);
        assert!(consistent_body(&found).0 && found[0] == 3.0, "{found:?}");
        assert!((1..4).all(|k| (found[k] - nominal[k] - impossible[k]).abs() < 1e-12));
        let removed = changed_body(&nominal, &DVector::from_vec(vec![-5.0; 10]), 0.1);
        assert!(consistent_body(&removed).0, "{removed:?}");
    }
}
