//! Evidence for explanations of the difference between an estimate and the robot description.

use super::parts::{Part, Parts, effects, parts};
use crate::consistent::{ConsistencySettings, body_spread};
use crate::thresholds::DescriptionThresholds;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;
use dynident_estimation::changes::{ChangeGroup, ChangeSettings, Explanation, explanations};
use dynident_model::terms::TorqueTerm;
use nalgebra::{DMatrix, DVector};

/// Differences that all bodies have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Relative standard deviation of a body in each direction: of its mass, its inertia, and its extent for the centre
    /// of mass.
    pub shape: f64,
    /// Relative standard deviation of a common factor of all ten values of a body, as a wrong density causes.
    pub scale: f64,
}

impl Spread {
    /// The larger of both deviations.
    pub fn largest(self) -> f64 {
        self.shape.max(self.scale)
    }

    /// Prior probability: small and large differences have half each, in equal parts.
    fn probability(self) -> f64 {
        let is_small = |own: &Self| own.largest() <= SMALL;
        let count = SPREADS.iter().filter(|own| is_small(own) == is_small(&self)).count();
        let total = if is_small(&self) { SMALL_PROBABILITY } else { 1.0 - SMALL_PROBABILITY };
        total / count as f64
    }
}

/// Sizes of differences of all bodies: rounding of a description, tolerances of manufacturing, wrong densities, and
/// descriptions that are only rough. A common factor may be large while the shape is exact: otherwise single bodies
/// would explain densities that are wrong in every body. Neighbouring sizes of large differences have a ratio of 1.7,
/// less than the uncertainty of a deviation that seven bodies determine: with a ratio of 3, bars were too narrow or too
/// wide for the sizes between.
pub const SPREADS: [Spread; 22] = [
    Spread { shape: 0.003, scale: 0.003 },
    Spread { shape: 0.003, scale: 0.01 },
    Spread { shape: 0.003, scale: 0.03 },
    Spread { shape: 0.01, scale: 0.01 },
    Spread { shape: 0.01, scale: 0.03 },
    Spread { shape: 0.03, scale: 0.03 },
    Spread { shape: 0.003, scale: 0.1 },
    Spread { shape: 0.003, scale: 0.3 },
    Spread { shape: 0.01, scale: 0.1 },
    Spread { shape: 0.01, scale: 0.3 },
    Spread { shape: 0.03, scale: 0.1 },
    Spread { shape: 0.03, scale: 0.17 },
    Spread { shape: 0.03, scale: 0.3 },
    Spread { shape: 0.06, scale: 0.17 },
    Spread { shape: 0.06, scale: 0.3 },
    Spread { shape: 0.1, scale: 0.1 },
    Spread { shape: 0.1, scale: 0.17 },
    Spread { shape: 0.1, scale: 0.3 },
    Spread { shape: 0.1, scale: 1.0 },
    Spread { shape: 0.17, scale: 0.17 },
    Spread { shape: 0.17, scale: 0.3 },
    Spread { shape: 0.3, scale: 0.3 },
];

/// Largest deviation of a small difference of all bodies.
const SMALL: f64 = 0.03;

/// Prior probability of all small differences, and of all large ones: neither few nor all bodies are preferred.
const SMALL_PROBABILITY: f64 = 0.5;

/// Expected common factor of all values of a body that changed, minus 1.
const EXPECTED_FACTOR: f64 = 0.5;

/// Expected common factor with a load, relative to that without: most of a load near the centre of mass of its body is
/// a factor, and the rest is small.
const FACTOR_WITH_LOAD: f64 = 5.0;

/// Prior probability that a body changed in one of the three ways: a load, a common factor of all its values, or both.
const CHANGE_PROBABILITY: f64 = 0.025;

/// Factors of the error bars, with the same probability: bars for correlated residuals can be twice too wide.
const ERROR_FACTORS: [f64; 3] = [0.5, 1.0, 2.0];

/// Expected difference of a term relative to its value: descriptions do not contain the friction of the real drive.
const UNKNOWN_TERM_RATIO: f64 = 50.0;

/// Smaller differences of the other bodies are preferred if their probability is at least this part of the largest one:
/// a description is usually right.
const MIN_SHARE_OF_LARGEST: f64 = 0.1;

/// Explanations of the difference between an estimate and the description of its robot.
#[derive(Clone, Debug)]
pub struct DescriptionDifferences {
    /// All explanations, the most probable first; `covariance` is the index of the spread of all bodies in
    /// [`SPREADS`].
    pub explanations: Vec<Explanation>,
    /// Body of each group of the explanations: a change of ten values and a common factor for each body with an effect.
    pub(super) bodies: Vec<usize>,
    /// Change of the ten values of the body per unknown of each group.
    pub(super) unknowns: Vec<DMatrix<f64>>,
    /// Base parameters that are compared: their difference from the description.
    pub(super) difference: DVector<f64>,
    /// Covariance of their estimate, with unknown terms.
    pub(super) covariance: DMatrix<f64>,
    /// `E`: effect of all parameters of the bodies on them.
    pub(super) effects: DMatrix<f64>,
    /// Covariance of all parameters of the bodies for each of [`SPREADS`].
    pub(super) spreads: Vec<DMatrix<f64>>,
}

impl DescriptionDifferences {
    /// Compares base parameters `values` with indices `rows` and their `covariance` with the nominal values of `robot`.
    /// Friction, offsets and drive inertia are unknown in a description and are not tested. `None` without nominal
    /// values, or if the settings define single bodies, which are then not those of the description.
    ///
    /// # Errors
    /// As [`explanations`].
    pub fn new(
        robot: &ParametricModel,
        rows: &[usize],
        values: &DVector<f64>,
        covariance: &DMatrix<f64>,
        knowledge: &ConsistencySettings,
    ) -> Result<Option<Self>, EstimationError> {
        let base = robot.base();
        let is_stated = knowledge.bodies.values().any(|own| own.prior.is_some() || own.known.is_some());
        let Some(nominal) = robot.nominal_base().filter(|_| !rows.is_empty() && !is_stated) else { return Ok(None) };
        let Some(spread) = body_spread(robot, knowledge) else { return Ok(None) };
        let difference = DVector::from_fn(rows.len(), |k, _| values[k] - nominal[rows[k]]);
        let inertial = robot.model().inertial_count();
        let size = |term: &TorqueTerm| {
            let column = robot.terms().iter().position(|own| own == term).map(|place| inertial + place);
            let place = rows.iter().position(|&row| Some(base.independent()[row]) == column);
            place.map_or(1.0, |k| values[k].abs() + covariance[(k, k)].max(0.0).sqrt())
        };
        let all = effects(base).select_rows(rows);
        let mut of_terms = DMatrix::zeros(rows.len(), rows.len());
        for (place, term) in robot.terms().iter().enumerate() {
            let effect = all.column(inertial + place) * (UNKNOWN_TERM_RATIO * size(term));
            of_terms += &effect * effect.transpose();
        }
        let effects = all.columns(0, inertial).into_owned();
        let of_shape = &spread * spread.transpose();
        let mut of_scale = DMatrix::zeros(inertial, inertial);
        for first in (0..inertial).step_by(10) {
            let own = DVector::from_column_slice(&robot.nominal()[first..first + 10]);
            of_scale.view_mut((first, first), (10, 10)).copy_from(&(&own * own.transpose()));
        }
        let of = |own: &Spread| &of_shape * (own.shape * own.shape) + &of_scale * (own.scale * own.scale);
        let spreads: Vec<_> = SPREADS.iter().map(of).collect();
        // Only the error bars have a factor: friction is unknown, and differences of bodies have their own sizes.
        let with_bars = |factor: f64| covariance * (factor * factor) + &of_terms;
        let of_spread = |own: &DMatrix<f64>| &effects * own * effects.transpose();
        let covariances: Vec<_> = spreads
            .iter()
            .map(of_spread)
            .flat_map(|own| ERROR_FACTORS.map(|factor| with_bars(factor) + &own))
            .collect();
        let (bodies, unknowns, groups) = groups(robot, parts(robot.model(), base, rows, &size), &effects);
        let settings = ChangeSettings {
            together: false,
            probability: CHANGE_PROBABILITY,
            error_factors: vec![1.0],
            ..ChangeSettings::default()
        };
        let mut explanations = explanations(&difference, &covariances, &groups, &settings)?;
        for own in &mut explanations {
            own.error_factor = ERROR_FACTORS[own.covariance % ERROR_FACTORS.len()];
            own.covariance /= ERROR_FACTORS.len();
        }
        let covariance = covariance + of_terms;
        let mut found = Self { explanations, bodies, unknowns, difference, covariance, effects, spreads };
        let priors: Vec<f64> = found.explanations.iter().map(|own| SPREADS[own.covariance].probability()).collect();
        found.reweight(&priors);
        found.exclude_negative_masses(robot.nominal());
        Ok(Some(found))
    }

    /// Multiplies the probability of each explanation by a factor; at least one must be positive.
    pub(super) fn reweight(&mut self, factors: &[f64]) {
        for (own, factor) in self.explanations.iter_mut().zip(factors) {
            own.probability *= factor;
        }
        let total: f64 = self.explanations.iter().map(|own| own.probability).sum();
        for own in &mut self.explanations {
            own.probability /= total;
        }
        self.explanations.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    }

    /// Probability that every body differs by more than the small differences of `limits`, and none differs by more
    /// than the others.
    pub fn everywhere(&self, limits: &DescriptionThresholds) -> f64 {
        let all = self.explanations.iter().filter(|own| is_everywhere(own, limits));
        all.map(|own| own.probability).sum::<f64>().min(1.0)
    }

    /// `dᵀ C⁻¹ d` of the difference from the description, with unknown terms.
    pub fn chi_squared(&self) -> f64 {
        let scale = self.covariance.diagonal().map(|value| value.max(f64::MIN_POSITIVE).sqrt().recip());
        let scales = DMatrix::from_diagonal(&scale);
        let scaled = &scales * &self.difference;
        // Rounding of strong correlations must not make the matrix indefinite.
        let rounding = DMatrix::from_diagonal_element(scale.len(), scale.len(), 1e-9);
        let factor = (&scales * &self.covariance * &scales + rounding).cholesky();
        factor.map_or(0.0, |factor| scaled.dot(&factor.solve(&scaled)))
    }

    /// [`Explanation::remaining`] of the most probable explanation by all bodies; 1 without any.
    pub fn remaining_everywhere(&self, limits: &DescriptionThresholds) -> f64 {
        let best = self.explanations.iter().find(|own| is_everywhere(own, limits));
        best.map_or(1.0, |own| own.remaining)
    }

    /// The bodies that an explanation names, ascending.
    pub fn bodies_of(&self, explanation: &Explanation) -> Vec<usize> {
        let mut bodies: Vec<usize> = explanation.groups.iter().map(|&group| self.bodies[group]).collect();
        bodies.sort_unstable();
        bodies.dedup();
        bodies
    }

    /// Change of the ten values of a body under an explanation, with its covariance.
    pub fn change_of(&self, explanation: &Explanation, body: usize) -> (DVector<f64>, DMatrix<f64>) {
        let (mut change, mut covariance) = (DVector::zeros(10), DMatrix::zeros(10, 10));
        for (&group, (values, own)) in explanation.groups.iter().zip(&explanation.changes) {
            if self.bodies[group] == body {
                let unknowns = &self.unknowns[group];
                change += unknowns * values;
                covariance += unknowns * own * unknowns.transpose();
            }
        }
        (change, covariance)
    }

    /// Sets of bodies that differ by more than the others, with their total probability over all sizes of the
    /// differences of the others, the most probable first. The empty set means that all bodies differ at most by the
    /// small differences of `limits`. Each set comes with the explanation with the smallest differences of the other
    /// bodies that the logs do not contradict.
    pub fn sets(&self, limits: &DescriptionThresholds) -> Vec<(f64, &Explanation)> {
        // Total and largest probability, and the explanation.
        let mut sets: Vec<(f64, f64, &Explanation)> = Vec::new();
        for own in self.explanations.iter().filter(|own| !is_everywhere(own, limits)) {
            let bodies = self.bodies_of(own);
            let Some((total, largest, chosen)) = sets.iter_mut().find(|(.., set)| self.bodies_of(set) == bodies) else {
                sets.push((own.probability, own.probability, own));
                continue;
            };
            *total += own.probability;
            let is_smaller = SPREADS[own.covariance].largest() < SPREADS[chosen.covariance].largest();
            if is_smaller && own.probability >= MIN_SHARE_OF_LARGEST * *largest {
                *chosen = own;
            }
        }
        sets.sort_by(|a, b| b.0.total_cmp(&a.0));
        sets.into_iter().map(|(total, _, chosen)| (total, chosen)).collect()
    }

    /// The explanation by one or two bodies that the written model follows: the most probable one, if the evidence for
    /// such explanations reaches the threshold of `limits`.
    pub fn followed(&self, limits: &DescriptionThresholds) -> Option<&Explanation> {
        // The other bodies differ at most by small differences: otherwise they cannot keep the description.
        let is_small = |own: &&Explanation| SPREADS[own.covariance].largest() <= limits.max_small_share;
        let few = self.explanations.iter().filter(is_small).filter(|own| !own.groups.is_empty());
        let few: f64 = few.map(|own| own.probability).sum();
        let (_, best) = *self.sets(limits).first()?;
        (few >= limits.min_probability && !best.groups.is_empty()).then_some(best)
    }

    /// Probability that a body changed: the sum over explanations by few bodies with it, and those by all bodies.
    pub fn body_probability(&self, body: usize, limits: &DescriptionThresholds) -> f64 {
        let changed = |own: &&Explanation| is_everywhere(own, limits) || self.bodies_of(own).contains(&body);
        let sum: f64 = self.explanations.iter().filter(changed).map(|own| own.probability).sum();
        sum.min(1.0)
    }
}

/// Groups of unknowns: for each body with an effect a change of its ten values, as by a load, a common factor of all
/// its values, and both together. Their bodies, the change per unknown, and the effect on the base parameters.
fn groups(
    robot: &ParametricModel,
    parts: Parts,
    effects: &DMatrix<f64>,
) -> (Vec<usize>, Vec<DMatrix<f64>>, Vec<ChangeGroup>) {
    let (mut bodies, mut unknowns, mut groups) = (Vec::new(), Vec::new(), Vec::new());
    for ((part, group), sizes) in parts.parts.into_iter().zip(parts.groups).zip(parts.sizes) {
        let Part::Body(body) = part else { continue };
        let nominal = DMatrix::from_column_slice(10, 1, &robot.nominal()[10 * body..10 * body + 10]);
        let factor = nominal * EXPECTED_FACTOR;
        let load = DMatrix::from_diagonal(&sizes);
        let mut both = load.clone().insert_column(10, 0.0);
        both.set_column(10, &(factor.column(0) * FACTOR_WITH_LOAD));
        bodies.extend([body; 3]);
        let effects = effects.columns(10 * body, 10);
        for unknown in [&factor, &both] {
            groups.push(ChangeGroup { name: group.name.clone(), effect: &effects * unknown });
        }
        groups.push(group);
        unknowns.extend([factor, both, load]);
    }
    (bodies, unknowns, groups)
}

/// Whether an explanation names no body and all bodies differ by more than the small differences of `limits`.
fn is_everywhere(explanation: &Explanation, limits: &DescriptionThresholds) -> bool {
    explanation.groups.is_empty() && SPREADS[explanation.covariance].largest() > limits.max_small_share
}
