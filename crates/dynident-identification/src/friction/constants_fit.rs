//! Estimation of nonlinear friction constants (width of the smoothed sign, Stribeck velocity and exponent, ..) together
//! with all parameters.
//!
//! A constant c changes the torque τ only through the regressor column of its term. Near the current constants,
//! `τ = Y(c) θ + Σ_k ∂(Y θ)/∂c_k δ_k` with the regressor Y, the parameters θ and the changes δ_k of the constants. With
//! one additional column per constant, least squares determines the step δ together with the parameters (Gauss-Newton;
//! for separable problems: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). The derivative is computed as the
//! difference of the term's columns for a larger and a smaller constant, which one pass over the logs adds to the
//! triangular factors. The iteration ends when the steps are small compared with their standard deviations. The
//! covariance of the last step is the covariance of the constants. The parameters depend on the constants with the
//! sensitivity `∂θ/∂c = Cov(θ, c) Cov(c, c)⁻¹`, and the error bars of the parameters include this effect.

use super::candidates::JointScale;
use super::constants::step_of;
use super::joint_friction::{FrictionConstant, JointFriction};
use super::weak_terms::{TermTest, Weak};
use crate::thresholds::FrictionThresholds;
use dynident_dynamics::Column;
use dynident_estimation::{Estimate, EstimationError, HALF_WIDTH_95, JointRows, LinearProblem, SegmentedFactor};
use dynident_model::terms::{CoulombShape, TorqueTerm};
use dynident_rows::RegressorModel;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Distance of the two points of a central difference from the current constant, as the change of the constant's
/// logarithm.
const HALF_DIFFERENCE: f64 = 0.1;
/// Maximum change of a constant's logarithm in one pass: one step of the grid.
const MAX_STEP: f64 = 0.7;
/// Prior standard deviation of a constant's logarithm. The grid spans a factor of 40 to 100, and a uniform distribution
/// over it has a standard deviation of 1.1 to 1.3. The prior bounds constants that the rows do not determine.
const PRIOR_STD: f64 = 1.2;
/// Convergence criterion: every step is below this ratio of its standard deviation, or below this absolute value.
const CONVERGENCE: (f64, f64) = (0.1, 2.0e-3);
/// Assumed maximum ratio of the reported standard deviation to that for white noise. A step that is long compared with
/// this multiple of the white-noise standard deviation has certainly not converged.
const MAX_STD_INFLATION: f64 = 10.0;

#[derive(Clone, Debug)]
pub(crate) struct FrictionConstants {
    joints: Vec<(usize, Vec<TorqueTerm>)>,
    scales: Vec<JointScale>,
    axes: Vec<Axis>,
}

/// One free constant, and the terms of a joint that share it: all smoothed signs of a joint have the same width.
#[derive(Clone, Debug)]
struct Axis {
    joint: usize,
    terms: Vec<usize>,
    place: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct ConstantsStep {
    /// Steps of the constants' logarithms, one for each constant.
    pub(crate) steps: Vec<f64>,
    std: Vec<f64>,
    error: ConstantsError,
    /// Estimate with free constants; parameters of the model first, then the constants.
    estimate: Estimate,
}

#[derive(Clone, Debug)]
pub(crate) struct ConstantsError {
    symbols: Vec<String>,
    /// Covariance `S Σ_c Sᵀ` that the error of the constants causes in the parameters, by symbol: sensitivity S and
    /// covariance Σ_c of the constants.
    covariance: DMatrix<f64>,
}

impl ConstantsError {
    /// Covariance that the error of the constants adds to an estimate of the parameters `symbols`; zero for fixed
    /// parameters.
    pub(crate) fn covariance_of(&self, symbols: &[String], estimate: &Estimate) -> DMatrix<f64> {
        let is_fixed = |column: usize| estimate.rank.fixed.iter().any(|fixed| fixed.column == column);
        let place = |column: usize| self.symbols.iter().position(|own| *own == symbols[column]);
        let places: Vec<Option<usize>> =
            (0..symbols.len()).map(|column| place(column).filter(|_| !is_fixed(column))).collect();
        DMatrix::from_fn(symbols.len(), symbols.len(), |row, column| match (places[row], places[column]) {
            (Some(row), Some(column)) => self.covariance[(row, column)],
            _ => 0.0,
        })
    }
}

impl ConstantsStep {
    pub(crate) fn error(&self) -> &ConstantsError {
        &self.error
    }

    pub(crate) fn has_converged(&self) -> bool {
        self.is_below(1.0)
    }

    /// Whether a step, whose error bars assume white noise, may have converged according to the reported error bars.
    pub(crate) fn may_have_converged(&self) -> bool {
        self.is_below(MAX_STD_INFLATION)
    }

    /// Whether all steps are small compared with their error bars, multiplied by `inflation`.
    fn is_below(&self, inflation: f64) -> bool {
        let small = |(step, std): (&f64, &f64)| step.abs() <= (CONVERGENCE.0 * inflation * std).max(CONVERGENCE.1);
        self.steps.iter().zip(&self.std).all(small)
    }
}

impl FrictionConstants {
    pub(crate) fn new(model: &RegressorModel, chosen: &[JointFriction]) -> Self {
        let of_joint = |own: &JointFriction| Some((model.model().joint_index(&own.joint)?, own.terms.clone()?));
        let joints: Vec<(usize, Vec<TorqueTerm>)> = chosen.iter().filter_map(of_joint).collect();
        let axes = joints.iter().enumerate().flat_map(|(joint, (_, terms))| axes_of(joint, terms)).collect();
        let scales = joints.iter().map(|(joint, _)| JointScale::of(model.model(), *joint)).collect();
        Self { joints, scales, axes }
    }

    pub(crate) fn count(&self, joint: usize) -> usize {
        self.axes.iter().filter(|axis| self.joints[axis.joint].0 == joint).count()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.axes.is_empty()
    }

    /// Terms of the joints after the logarithms of their constants are changed by these steps, one step for each
    /// constant.
    pub(crate) fn moved(&self, steps: &[f64]) -> Vec<(usize, Vec<TorqueTerm>)> {
        let mut moved = self.joints.clone();
        for (place, (_, terms)) in moved.iter_mut().enumerate() {
            for (number, term) in terms.iter_mut().enumerate() {
                let mut own = term.kind().coordinates();
                let of_term = |axis: &Axis| axis.joint == place && axis.terms.contains(&number);
                for (axis, step) in self.axes.iter().zip(steps).filter(|(axis, _)| of_term(axis)) {
                    own[axis.place] += step;
                }
                if !own.is_empty() {
                    *term = term.at(&own, self.scales[place].velocity);
                }
            }
        }
        moved
    }

    /// For each joint with additional terms that are `weak` when their constants are free: the terms of the joint
    /// without the weakest one. `norms` are the norms of the model's columns over all rows.
    pub(crate) fn without_weakest(
        &self,
        weak: Weak,
        model: &RegressorModel,
        norms: &[f64],
        last: &ConstantsStep,
        thresholds: FrictionThresholds,
    ) -> Vec<(usize, Vec<TorqueTerm>)> {
        let test = TermTest { columns: model.layout().columns(), norms, estimate: &last.estimate, thresholds };
        let first = last.estimate.values.len() - self.axes.len();
        let of_joint = |(place, (joint, terms)): (usize, &(usize, Vec<TorqueTerm>))| {
            let own_constants = |term: &TorqueTerm| self.own_constants(place, term, first);
            Some((*joint, test.without_weakest(terms, weak, own_constants)?))
        };
        self.joints.iter().enumerate().filter_map(of_joint).collect()
    }

    /// Whether a joint has possibly insignificant additional terms that were not in its first selection, `before`.
    /// Other arguments as in [`without_weakest`](Self::without_weakest).
    pub(crate) fn has_doubtful_term(
        &self,
        joint: usize,
        before: &[TorqueTerm],
        model: &RegressorModel,
        norms: &[f64],
        last: &ConstantsStep,
        thresholds: FrictionThresholds,
    ) -> bool {
        let first = last.estimate.values.len() - self.axes.len();
        let Some(place) = self.joints.iter().position(|(own, _)| *own == joint) else { return false };
        let own_constants = |term: &TorqueTerm| self.own_constants(place, term, first);
        let test = TermTest { columns: model.layout().columns(), norms, estimate: &last.estimate, thresholds };
        test.has_doubtful_term(&self.joints[place].1, before, own_constants)
    }

    /// Columns of the constants that only the term `term` has. `place` is the index of the joint; `first` is the first
    /// column of the constants.
    fn own_constants(&self, place: usize, term: &TorqueTerm, first: usize) -> Vec<usize> {
        let terms = &self.joints[place].1;
        let is_own = |axis: &Axis| axis.joint == place && matches!(axis.terms[..], [only] if terms[only] == *term);
        let own = self.axes.iter().enumerate().filter(|(_, axis)| is_own(axis));
        own.map(|(number, _)| first + number).collect()
    }

    /// Design effect for the friction of a joint: number of correlated rows that contain as much information as one
    /// independent row. It is the mean variance ratio `tr(Σ_w⁻¹ Σ) / p` of the p coefficients and constants of the
    /// friction, with the reported covariance Σ and the covariance for white noise Σ_w (Rao and Scott, Annals of
    /// Statistics 12 (1984) 46). It is at least 1, and 1 if unknown.
    pub(crate) fn design_effect(&self, joint: usize, model: &RegressorModel, last: &ConstantsStep) -> f64 {
        let Some(place) = self.joints.iter().position(|(own, _)| *own == joint) else { return 1.0 };
        let estimate = &last.estimate;
        let first = estimate.values.len() - self.axes.len();
        let is_term = |column: &Column| matches!(column, Column::Term(own) if self.joints[place].1.contains(own));
        let terms = model.layout().columns().iter().enumerate().filter(|(_, column)| is_term(column));
        let axes = self.axes.iter().enumerate().filter(|(_, axis)| axis.joint == place);
        let columns = terms.map(|(column, _)| column).chain(axes.map(|(number, _)| first + number));
        let known: Vec<usize> = columns.filter(|&column| estimate.covariance_white[(column, column)] > 0.0).collect();
        let block = |of: &DMatrix<f64>| {
            DMatrix::from_fn(known.len(), known.len(), |row, column| of[(known[row], known[column])])
        };
        let Some(white) = block(&estimate.covariance_white).cholesky() else { return 1.0 };
        let ratio = white.solve(&block(&estimate.covariance)).trace() / known.len() as f64;
        if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    }

    /// The term with the logarithm of one of its constants changed by `step`.
    fn beside(&self, axis: &Axis, number: usize, step: f64) -> TorqueTerm {
        let term = &self.joints[axis.joint].1[number];
        let mut own = term.kind().coordinates();
        own[axis.place] += step;
        term.at(&own, self.scales[axis.joint].velocity)
    }

    /// Terms with a smaller and a larger value of every constant, which are the additional columns of a pass.
    pub(crate) fn neighbours(&self) -> Vec<TorqueTerm> {
        let of_axis = |axis: &Axis| -> Vec<TorqueTerm> {
            axis.terms
                .iter()
                .flat_map(|&number| [-HALF_DIFFERENCE, HALF_DIFFERENCE].map(|step| self.beside(axis, number, step)))
                .collect()
        };
        self.axes.iter().flat_map(of_axis).collect()
    }

    /// Computes the step and its covariance with the function `solve`. `fitted` are the values with the current
    /// constants: those of the columns of `model`, then those of payloads. `wide_problem` also contains the columns of
    /// `wide`, including all [`neighbours`](Self::neighbours).
    pub(crate) fn step(
        &self,
        model: &RegressorModel,
        fitted: &[f64],
        wide: &RegressorModel,
        wide_problem: &LinearProblem,
        solve: impl Fn(&LinearProblem) -> Result<Estimate, EstimationError>,
    ) -> Result<ConstantsStep, EstimationError> {
        let problem = self.linearised(model, fitted, wide, wide_problem)?;
        let found = solve(&problem)?;
        let (count, own) = (problem.columns().len() - self.axes.len(), self.axes.len());
        let furthest = |joint: usize| {
            let steps = self.axes.iter().enumerate().filter(|(_, axis)| axis.joint == joint);
            steps.fold(0.0_f64, |most, (axis, _)| most.max(found.values[count + axis].abs()))
        };
        let step = |(place, axis): (usize, &Axis)| {
            found.values[count + place] * (MAX_STEP / furthest(axis.joint).max(MAX_STEP))
        };
        // The sensitivity is computed with the covariance for white noise, because least squares uses these weights.
        let white = found.covariance_white.view((count, count), (own, own)).into_owned();
        let across = found.covariance_white.view((0, count), (count, own)).into_owned();
        let covariance = match white.cholesky() {
            Some(white) => {
                let answers = white.solve(&across.transpose()).transpose();
                let further = &answers * found.covariance.view((count, count), (own, own)) * answers.transpose();
                (&further + further.transpose()) * 0.5
            }
            None => DMatrix::zeros(count, count),
        };
        Ok(ConstantsStep {
            steps: self.axes.iter().enumerate().map(step).collect(),
            std: found.std[count..].to_vec(),
            error: ConstantsError { symbols: problem.columns()[..count].to_vec(), covariance },
            estimate: found,
        })
    }

    /// Linearised problem with the columns `[Y(c) | ∂(Y θ)/∂c]`: columns of the model, columns of payloads, and one
    /// column for each constant.
    fn linearised(
        &self,
        model: &RegressorModel,
        fitted: &[f64],
        wide: &RegressorModel,
        wide_problem: &LinearProblem,
    ) -> Result<LinearProblem, EstimationError> {
        let (own, further) = (model.layout().columns().len(), wide.layout().columns().len());
        let loads = wide_problem.columns().len() - further;
        let count = own + loads;
        // New index of a column of the wide problem; the columns of neighbours are removed.
        let kept = |column: usize| match column {
            column if column < own => Some(column),
            column if column < further => None,
            column => Some(column - further + own),
        };
        let old = |column: usize| if column < own { column } else { column - own + further };

        // ∂(Y θ)/∂c = θ (Y(c + h) - Y(c - h)) / 2h, summed over all terms with this constant.
        let place = |term: &TorqueTerm| {
            wide.layout().columns().iter().position(|column| matches!(column, Column::Term(own) if own == term))
        };
        let differences: Vec<Vec<(usize, f64)>> = self
            .axes
            .iter()
            .map(|axis| {
                let mut of_axis = Vec::new();
                for &number in &axis.terms {
                    let centre = place(&self.joints[axis.joint].1[number]);
                    let value = centre.and_then(|centre| fitted.get(centre)).copied().unwrap_or(0.0);
                    for step in [-HALF_DIFFERENCE, HALF_DIFFERENCE] {
                        if let Some(beside) = place(&self.beside(axis, number, step)) {
                            of_axis.push((beside, value * step / (2.0 * HALF_DIFFERENCE * HALF_DIFFERENCE)));
                        }
                    }
                }
                of_axis
            })
            .collect();

        let names = (0..count).map(|column| wide_problem.columns()[old(column)].clone());
        let names = names.chain((0..self.axes.len()).map(|axis| format!("constant {axis}"))).collect();
        let padded = |values: &[f64]| -> Vec<f64> {
            (0..count).map(|column| values[old(column)]).chain(vec![0.0; self.axes.len()]).collect()
        };
        let mut problem =
            LinearProblem::new(names, wide_problem.joints().to_vec()).with_fallback(padded(wide_problem.fallback()))?;
        let mapped = |rows: &JointRows| -> Result<(Vec<usize>, SegmentedFactor), EstimationError> {
            let local = |column: usize| rows.columns.iter().position(|own| *own == column);
            let of_model: Vec<(usize, usize)> =
                rows.columns.iter().enumerate().filter_map(|(local, &column)| Some((local, kept(column)?))).collect();
            let is_here = |axis: &usize| differences[*axis].iter().any(|(column, _)| local(*column).is_some());
            let axes: Vec<usize> = (0..self.axes.len()).filter(is_here).collect();
            let mut map = DMatrix::zeros(rows.columns.len() + 1, of_model.len() + axes.len() + 1);
            for (to, (from, _)) in of_model.iter().enumerate() {
                map[(*from, to)] = 1.0;
            }
            for (number, &axis) in axes.iter().enumerate() {
                for &(column, weight) in &differences[axis] {
                    if let Some(from) = local(column) {
                        map[(from, of_model.len() + number)] += weight;
                    }
                }
            }
            map[(rows.columns.len(), of_model.len() + axes.len())] = 1.0;
            let columns = of_model.iter().map(|(_, column)| *column).chain(axes.iter().map(|axis| count + axis));
            Ok((columns.collect(), rows.factor.mapped(&map)?))
        };
        let all = wide_problem.equations().par_iter().map(mapped).collect::<Result<Vec<_>, _>>()?;
        for (rows, (columns, factor)) in wide_problem.equations().iter().zip(all) {
            problem.add(&wide_problem.logs()[rows.log], rows.joint, columns, factor)?;
        }

        // The prior of the parameters is unchanged. The prior of the constants keeps them near their current values.
        let before = wide_problem.prior();
        let known = before.map_or(0, |prior| prior.sqrt_information().nrows());
        let mean = before.map_or_else(|| vec![0.0; count + self.axes.len()], |prior| padded(prior.mean()));
        let information =
            DMatrix::from_fn(known + self.axes.len(), count + self.axes.len(), |row, column| match before {
                Some(prior) if row < known && column < count => prior.sqrt_information()[(row, old(column))],
                _ if row >= known && column == count + row - known => PRIOR_STD.recip(),
                _ => 0.0,
            });
        problem.with_prior(mean, information)
    }

    /// Constants of every joint with their 95 % intervals, joint by joint.
    pub(crate) fn with_intervals(&self, last: &ConstantsStep) -> Vec<(usize, Vec<FrictionConstant>)> {
        let of_joint = |(place, (joint, terms)): (usize, &(usize, Vec<TorqueTerm>))| {
            let of_axis = |(axis, std): (&Axis, &f64)| {
                let term = &terms[axis.terms[0]];
                let own = DVector::from_vec(term.kind().coordinates());
                let value = |sigmas: f64| {
                    let mut moved = own.clone();
                    moved[axis.place] += sigmas * std;
                    term.constant_at(axis.place, moved.as_slice(), self.scales[place].velocity)
                };
                let (name, middle) = value(0.0);
                let mut ends = [value(-HALF_WIDTH_95).1, value(HALF_WIDTH_95).1];
                ends.sort_by(f64::total_cmp);
                FrictionConstant {
                    term: term.kind_name().to_owned(),
                    constant: name.to_owned(),
                    value: middle,
                    interval_95: ends,
                }
            };
            let own = self.axes.iter().zip(&last.std).filter(|(axis, _)| axis.joint == place);
            (*joint, own.map(of_axis).collect())
        };
        self.joints.iter().enumerate().map(of_joint).collect()
    }
}

/// Free constants of one joint's terms. Terms that change their sign at rest share one width, because they describe one
/// friction.
fn axes_of(joint: usize, terms: &[TorqueTerm]) -> Vec<Axis> {
    let mut axes: Vec<Axis> = Vec::new();
    for (number, term) in terms.iter().enumerate() {
        let is_smooth = matches!(step_of(term), Some(CoulombShape::Smooth { .. }));
        for place in 0..term.kind().coordinates().len() {
            let has_same_step = |axis: &Axis| axis.place == 0 && step_of(&terms[axis.terms[0]]) == step_of(term);
            let same = axes.iter_mut().find(|axis| place == 0 && is_smooth && has_same_step(axis));
            match same {
                Some(axis) => axis.terms.push(number),
                None => axes.push(Axis { joint, terms: vec![number], place }),
            }
        }
    }
    axes
}
