//! Constants of chosen friction between and beyond the grid: by a quadratic function through the errors around them.

use super::choice::{cross_validation, further_columns, weights};
use super::constants::{at, coordinates};
use crate::regressor_model::RegressorModel;
use dynident_dynamics::Column;
use dynident_estimation::{Estimate, EstimationError, JointFolds, LinearProblem};
use dynident_model::terms::TorqueTerm;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Furthest that constants go in one turn, in steps of the grid around them.
const FURTHEST: f64 = 1.5;

/// The friction of one joint with its constants moved: every combination of one step down, none and one step up.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhood {
    /// The terms as they are.
    centre: Vec<TorqueTerm>,
    /// Coordinates that terms with the same constants share: the terms, and what of them is moved.
    axes: Vec<Axis>,
    step: f64,
}

/// One constant and the terms that have it.
#[derive(Clone, Debug)]
struct Axis {
    terms: Vec<usize>,
    place: usize,
}

impl Neighbourhood {
    /// Steps by the factor `ratio` around the constants of these terms.
    pub(crate) fn new(centre: Vec<TorqueTerm>, ratio: f64) -> Self {
        let mut axes: Vec<Axis> = Vec::new();
        let mut seen: Vec<(&'static str, Vec<f64>, usize)> = Vec::new();
        for (number, term) in centre.iter().enumerate() {
            let own = coordinates(term);
            // Both directions of a step have one width.
            let same = seen.iter().find(|(kind, coordinates, _)| *kind == term.kind_name() && *coordinates == own);
            if let Some(&(_, _, first)) = same {
                (0..own.len()).for_each(|place| axes[first + place].terms.push(number));
            } else {
                let first = axes.len();
                axes.extend((0..own.len()).map(|place| Axis { terms: vec![number], place }));
                seen.push((term.kind_name(), own, first));
            }
        }
        Self { centre, axes, step: ratio.ln() }
    }

    /// The terms with their constants moved by so many steps, one number for each axis.
    fn moved(&self, steps: &[f64]) -> Vec<TorqueTerm> {
        let of_term = |(number, term): (usize, &TorqueTerm)| {
            let mut own = coordinates(term);
            for (axis, steps) in self.axes.iter().zip(steps).filter(|(axis, _)| axis.terms.contains(&number)) {
                own[axis.place] += steps * self.step;
            }
            if own.is_empty() { term.clone() } else { at(term, &own) }
        };
        self.centre.iter().enumerate().map(of_term).collect()
    }

    /// All combinations, the centre first.
    fn points(&self) -> Vec<Vec<f64>> {
        let mut points = vec![Vec::new()];
        for _ in &self.axes {
            points =
                points.iter().flat_map(|point| [0.0, -1.0, 1.0].map(|step| [&point[..], &[step]].concat())).collect();
        }
        points
    }

    /// Every term that some combination has, each once.
    pub(crate) fn terms(&self) -> Vec<TorqueTerm> {
        let mut terms: Vec<TorqueTerm> = Vec::new();
        for term in self.points().iter().flat_map(|point| self.moved(point)) {
            if !terms.contains(&term) {
                terms.push(term);
            }
        }
        terms
    }

    /// Whether there is a constant to move.
    pub(crate) fn has_constants(&self) -> bool {
        !self.axes.is_empty()
    }

    /// The terms at the least of a quadratic function through the errors of all combinations; `columns` are the terms
    /// of the candidate columns in `folds`.
    pub(crate) fn best(&self, folds: &JointFolds, columns: &[TorqueTerm]) -> Vec<TorqueTerm> {
        let points = self.points();
        let place = |term: &TorqueTerm| columns.iter().position(|column| column == term);
        let places: Option<Vec<Vec<usize>>> =
            points.iter().map(|point| self.moved(point).iter().map(place).collect()).collect();
        let Some(places) = places else { return self.centre.clone() };
        let nonnegative: Vec<bool> = self.centre.iter().map(TorqueTerm::is_nonnegative).collect();
        let models: Vec<(&[usize], &[bool])> = places.iter().map(|places| (&places[..], &nonnegative[..])).collect();
        let errors: Vec<f64> = folds.errors_of_all(&models).iter().map(|errors| errors.rms().powi(2)).collect();
        let least = (0..errors.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        let steps = quadratic_minimum(&points, &errors).unwrap_or_else(|| points[least].clone());
        self.moved(&steps)
    }
}

/// The friction of the joints with better constants: each joint's own with that of the others as it is. `model` has the
/// friction in force and `fit` is its estimate, in which joints count alike if `equal_weights`; `wide_problem` has the
/// columns of `wide`, with all terms of the neighbourhoods among them.
pub(crate) fn refined(
    (model, fit, equal_weights): (&RegressorModel, &Estimate, bool),
    (wide, wide_problem): (&RegressorModel, &LinearProblem),
    around: &[(usize, Neighbourhood)],
) -> Result<Vec<Vec<TorqueTerm>>, EstimationError> {
    let unchanged = || around.iter().map(|(_, own)| own.centre.clone()).collect();
    let Some((validation, _)) = cross_validation(wide_problem)? else { return Ok(unchanged()) };
    let weights = weights(fit, equal_weights);
    let place = |wanted: &Column| wide.layout().columns().iter().position(|column| column == wanted);
    let of_joint = |(joint, own): &(usize, Neighbourhood)| {
        if !own.has_constants() {
            return Ok(own.centre.clone());
        }
        let terms = own.terms();
        let variable: Vec<usize> = terms.iter().filter_map(|term| place(&Column::Term(term.clone()))).collect();
        let is_common = |(index, column): &(usize, &Column)| {
            let is_own = matches!(column, Column::Term(term) if own.centre.contains(term));
            !is_own && fit.rank.fixed.iter().all(|fixed| fixed.column != *index)
        };
        let columns = model.layout().columns().iter().enumerate();
        let of_model = columns.filter(is_common).filter_map(|(_, column)| place(column));
        let common: Vec<usize> = of_model.chain(further_columns((model, fit), (wide, wide_problem))).collect();
        match validation.joint(*joint, &common, &variable, &weights) {
            Ok(folds) => Ok(own.best(&folds, &terms)),
            Err(EstimationError::TooFewRows { .. }) => Ok(own.centre.clone()),
            Err(error) => Err(error),
        }
    };
    around.par_iter().map(of_joint).collect()
}

/// Where the quadratic function that fits the values best has its least, no coordinate beyond [`FURTHEST`]; `None`
/// where it has none.
fn quadratic_minimum(points: &[Vec<f64>], values: &[f64]) -> Option<Vec<f64>> {
    let count = points[0].len();
    let pairs: Vec<(usize, usize)> = (0..count).flat_map(|a| (a..count).map(move |b| (a, b))).collect();
    let row = |point: &Vec<f64>| -> Vec<f64> {
        let products = pairs.iter().map(|&(a, b)| point[a] * point[b]);
        std::iter::once(1.0).chain(point.iter().copied()).chain(products).collect()
    };
    let rows: Vec<f64> = points.iter().flat_map(row).collect();
    let scale = values.iter().fold(0.0_f64, |most, value| most.max(*value));
    let design = DMatrix::from_row_slice(points.len(), 1 + count + pairs.len(), &rows);
    let right = DVector::from_iterator(values.len(), values.iter().map(|value| value / scale));
    let found = design.svd(true, true).solve(&right, 1e-10).ok()?;
    let mut hessian = DMatrix::zeros(count, count);
    for (&(a, b), &coefficient) in pairs.iter().zip(found.iter().skip(1 + count)) {
        hessian[(a, b)] += coefficient;
        hessian[(b, a)] += coefficient;
    }
    let steps = hessian.cholesky()?.solve(&-found.rows(1, count));
    let furthest = steps.amax();
    let steps = if furthest > FURTHEST { steps * (FURTHEST / furthest) } else { steps };
    steps.iter().all(|step| step.is_finite()).then(|| steps.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_a_quadratic_function_is_found() {
        let value = |x: f64, y: f64| 3.0 + 2.0 * (x - 0.4).powi(2) + (y + 0.7).powi(2) + 0.5 * (x - 0.4) * (y + 0.7);
        let steps = [-1.0, 0.0, 1.0];
        let points: Vec<Vec<f64>> = steps.iter().flat_map(|&x| steps.map(|y| vec![x, y])).collect();
        let values: Vec<f64> = points.iter().map(|point| value(point[0], point[1])).collect();
        let found = quadratic_minimum(&points, &values).expect("a minimum");
        assert!((found[0] - 0.4).abs() < 1e-12 && (found[1] + 0.7).abs() < 1e-12, "{found:?}");
        let upside_down: Vec<f64> = values.iter().map(|value| -value).collect();
        assert!(quadratic_minimum(&points, &upside_down).is_none());
    }
}
