//! The constants of chosen friction (width of a step, Stribeck velocity and exponent, ..), estimated together with all
//! parameters.
//!
//! The torque depends on a constant c through the column of its term alone. Around the constants so far
//! `τ = Y(c) θ + Σ_k ∂(Y θ)/∂c_k δ_k`, so that with one column more for each constant least squares finds the step δ
//! and what it costs the parameters (Gauss and Newton; for problems that are linear but for some unknowns: Golub and
//! Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). The derivative is the difference of the term's columns on both sides
//! of c, which stand in the factors of one pass over the logs. Steps end where they are small beside their own standard
//! deviation. The last step's covariance is that of the constants, and parameters answer to them by
//! `∂θ/∂c = Cov(θ, c) Cov(c, c)⁻¹`: their error bars have to hold it.

use super::candidates::JointScale;
use super::constants::step_of;
use super::joint_friction::{FrictionConstant, JointFriction};
use super::weak_terms::{Weak, has_doubtful_term, without_weakest};
use dynident_dynamics::Column;
use dynident_estimation::{Estimate, EstimationError, HALF_WIDTH_95, JointRows, LinearProblem, SegmentedFactor};
use dynident_model::terms::{CoulombShape, TorqueTerm};
use dynident_rows::RegressorModel;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Half the distance of the columns that a derivative is the difference of, in units of a constant's logarithm.
const STEP: f64 = 0.1;
/// Furthest that a constant goes in one pass, likewise: a step of the grid on which the search began.
const FURTHEST: f64 = 0.7;
/// Standard deviation of what is known of a constant beforehand, likewise: its grid spans a factor of 40 to 100, a
/// logarithm that is anywhere there has 1.1 to 1.3. It keeps constants in reach that the rows say nothing about.
const KNOWN_BEFOREHAND: f64 = 1.2;
/// Steps have ended once every one is below this share of its standard deviation, or of the constant.
const SETTLED: (f64, f64) = (0.1, 2.0e-3);
/// Times what white noise makes of a standard deviation that the one of bars may be: a step that is long beside so much
/// has not ended, whatever the bars.
const MOST_INFLATION: f64 = 10.0;

/// Chosen friction and those of its constants that can be moved.
#[derive(Clone, Debug)]
pub(crate) struct FrictionConstants {
    /// Joints with their terms.
    joints: Vec<(usize, Vec<TorqueTerm>)>,
    scales: Vec<JointScale>,
    axes: Vec<Axis>,
}

/// One constant and the terms of a joint that have it: steps at rest have one width.
#[derive(Clone, Debug)]
struct Axis {
    /// Place among the joints.
    joint: usize,
    terms: Vec<usize>,
    /// Which of the terms' coordinates.
    place: usize,
}

/// A step of the constants, and what is known of them there.
#[derive(Clone, Debug)]
pub(crate) struct ConstantsStep {
    /// Steps of the constants' logarithms, one for each axis.
    pub(crate) steps: Vec<f64>,
    std: Vec<f64>,
    error: ConstantsError,
    /// The parameters with the constants free, over the model's columns first.
    estimate: Estimate,
}

/// What the error of the constants adds to the covariance of the parameters.
#[derive(Clone, Debug)]
pub(crate) struct ConstantsError {
    symbols: Vec<String>,
    /// `S Σ_c Sᵀ`, by symbol.
    covariance: DMatrix<f64>,
}

impl ConstantsError {
    /// The covariance that this error adds to an estimate of the columns `symbols`; zero for columns that are held.
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

    /// Whether another pass would not change what is known.
    pub(crate) fn has_settled(&self) -> bool {
        self.is_below(1.0)
    }

    /// Whether a step with bars by white noise may have settled by those that are reported.
    pub(crate) fn may_have_settled(&self) -> bool {
        self.is_below(MOST_INFLATION)
    }

    /// Whether all steps are small beside bars that are so many times as wide.
    fn is_below(&self, inflation: f64) -> bool {
        let small = |(step, std): (&f64, &f64)| step.abs() <= (SETTLED.0 * inflation * std).max(SETTLED.1);
        self.steps.iter().zip(&self.std).all(small)
    }
}

impl FrictionConstants {
    /// The constants of the friction that these joints of `model` chose.
    pub(crate) fn new(model: &RegressorModel, chosen: &[JointFriction]) -> Self {
        let of_joint = |own: &JointFriction| Some((model.model().joint_index(&own.joint)?, own.terms.clone()?));
        let joints: Vec<(usize, Vec<TorqueTerm>)> = chosen.iter().filter_map(of_joint).collect();
        let axes = joints.iter().enumerate().flat_map(|(joint, (_, terms))| axes_of(joint, terms)).collect();
        let scales = joints.iter().map(|(joint, _)| JointScale::of(model.model(), *joint)).collect();
        Self { joints, scales, axes }
    }

    /// How many of them a joint has.
    pub(crate) fn count(&self, joint: usize) -> usize {
        self.axes.iter().filter(|axis| self.joints[axis.joint].0 == joint).count()
    }

    /// Whether there is none to move.
    pub(crate) fn is_empty(&self) -> bool {
        self.axes.is_empty()
    }

    /// The terms of the joints with their constants moved by these steps of their logarithms, one for each axis.
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

    /// The joints with a further term that is `weak` with the constants free, and their terms without it. `norms` are
    /// those of the model's columns over all rows.
    pub(crate) fn without_weakest(
        &self,
        weak: Weak,
        (model, norms): (&RegressorModel, &[f64]),
        last: &ConstantsStep,
    ) -> Vec<(usize, Vec<TorqueTerm>)> {
        let columns = model.layout().columns();
        let first = last.estimate.values.len() - self.axes.len();
        let of_joint = |(place, (joint, terms)): (usize, &(usize, Vec<TorqueTerm>))| {
            let own_constants = |term: &TorqueTerm| self.own_constants(place, term, first);
            Some((*joint, without_weakest((terms, weak), (columns, norms), &last.estimate, own_constants)?))
        };
        self.joints.iter().enumerate().filter_map(of_joint).collect()
    }

    /// Whether a joint has further terms that may be chance, of which a first look at the same motion had none: its
    /// terms were `before`. The rest is as in [`without_weakest`](Self::without_weakest).
    pub(crate) fn has_doubtful_term(
        &self,
        (joint, before): (usize, &[TorqueTerm]),
        (model, norms): (&RegressorModel, &[f64]),
        last: &ConstantsStep,
    ) -> bool {
        let first = last.estimate.values.len() - self.axes.len();
        let Some(place) = self.joints.iter().position(|(own, _)| *own == joint) else { return false };
        let own_constants = |term: &TorqueTerm| self.own_constants(place, term, first);
        let columns = (model.layout().columns(), norms);
        has_doubtful_term((&self.joints[place].1, before), columns, &last.estimate, own_constants)
    }

    /// Where the constants of a term of the joint at `place` stand among the columns of a step, whose axes begin at
    /// `first`. One that several terms share stays with the others.
    fn own_constants(&self, place: usize, term: &TorqueTerm, first: usize) -> Vec<usize> {
        let terms = &self.joints[place].1;
        let is_own = |axis: &Axis| axis.joint == place && matches!(axis.terms[..], [only] if terms[only] == *term);
        let own = self.axes.iter().enumerate().filter(|(_, axis)| is_own(axis));
        own.map(|(number, _)| first + number).collect()
    }

    /// How many rows that hang together say what one independent row would, of the friction of a joint: the mean ratio
    /// of variances `tr(Σ_w⁻¹ Σ) / p` of its p coefficients and constants, by the covariance that bars are made of and
    /// by that for white noise (Rao and Scott, Annals of Statistics 12 (1984) 46); 1 at least, and where nothing is
    /// known.
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

    /// The term on one side of the centre along an axis.
    fn beside(&self, axis: &Axis, number: usize, step: f64) -> TorqueTerm {
        let term = &self.joints[axis.joint].1[number];
        let mut own = term.kind().coordinates();
        own[axis.place] += step;
        term.at(&own, self.scales[axis.joint].velocity)
    }

    /// The terms on both sides of the centre along every axis: columns that a pass has to have beside the model's.
    pub(crate) fn neighbours(&self) -> Vec<TorqueTerm> {
        let of_axis = |axis: &Axis| -> Vec<TorqueTerm> {
            axis.terms.iter().flat_map(|&number| [-STEP, STEP].map(|step| self.beside(axis, number, step))).collect()
        };
        self.axes.iter().flat_map(of_axis).collect()
    }

    /// The step that the rows ask for, with its covariance by `solve`. `fitted` are the values with the constants as
    /// they are, over the columns of `model` and then those of loads; `wide_problem` has in addition the columns of
    /// `wide`, all [`neighbours`](Self::neighbours) among them.
    ///
    /// # Errors
    /// Rows that do not carry an estimate.
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
            found.values[count + place] * (FURTHEST / furthest(axis.joint).max(FURTHEST))
        };
        // How parameters answer to the constants, by white noise: so least squares weighs them.
        let white = found.covariance_white.view((count, count), (own, own)).into_owned();
        let across = found.covariance_white.view((0, count), (count, own)).into_owned();
        let covariance = match white.cholesky() {
            Some(white) => {
                let answers = white.solve(&across.transpose()).transpose();
                let further = &answers * found.covariance.view((count, count), (own, own)) * answers.transpose();
                // As symmetric as a covariance is.
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

    /// `[Y(c) | ∂(Y θ)/∂c]`: the model's columns, those of loads, and one for each constant.
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
        // Where a column of the wide problem stands in the new one; neighbours are no longer there.
        let kept = |column: usize| match column {
            column if column < own => Some(column),
            column if column < further => None,
            column => Some(column - further + own),
        };
        let old = |column: usize| if column < own { column } else { column - own + further };

        // ∂(Y θ)/∂c = θ (Y(c + h) - Y(c - h)) / 2h, summed over the terms that have the constant.
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
                    for step in [-STEP, STEP] {
                        if let Some(beside) = place(&self.beside(axis, number, step)) {
                            of_axis.push((beside, value * step / (2.0 * STEP * STEP)));
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

        // What is known beforehand: of parameters as before, of constants that they are somewhere near.
        let before = wide_problem.prior();
        let known = before.map_or(0, |prior| prior.sqrt_information().nrows());
        let mean = before.map_or_else(|| vec![0.0; count + self.axes.len()], |prior| padded(prior.mean()));
        let information =
            DMatrix::from_fn(known + self.axes.len(), count + self.axes.len(), |row, column| match before {
                Some(prior) if row < known && column < count => prior.sqrt_information()[(row, old(column))],
                _ if row >= known && column == count + row - known => KNOWN_BEFOREHAND.recip(),
                _ => 0.0,
            });
        problem.with_prior(mean, information)
    }

    /// The constants of every joint with their 95 % intervals, in the order of the joints that chose friction.
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

/// The constants of one joint's terms. What changes its sign at rest has one width: it is one friction.
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
