//! Evidence for explanations of the difference between an estimate and the robot description, or of two estimates.

use super::parts::{Part, Parts, effects, parts};
use super::spread::{SPREADS, Spread, covariances_of, nominal_values};
use crate::consistent::{ConsistencySettings, body_spread};
use crate::thresholds::DescriptionThresholds;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;
use dynident_estimation::changes::{ChangeGroup, ChangeSettings, Explanation, explanations};
use nalgebra::{DMatrix, DVector};

/// Explanations of the difference between an estimate and the description of its robot, or between two estimates.
#[derive(Clone, Debug)]
pub struct Differences {
    /// All explanations, the most probable first; `covariance` of an explanation is an index in `sizes`: the size of
    /// the differences of all bodies.
    pub explanations: Vec<Explanation>,
    /// Part of the robot to which each group of unknowns belongs. A body with an effect on the torque has two groups: a
    /// change of its ten values, and a common factor.
    pub(super) parts: Vec<Part>,
    /// Change of the values of the part per unknown of each group; for a body, its ten inertial parameters.
    pub(super) unknowns: Vec<DMatrix<f64>>,
    /// Difference of the compared base parameters from the description, or between two estimates.
    pub(super) difference: DVector<f64>,
    /// Covariance of the difference of the compared base parameters; compared with a description, friction and drive
    /// parameters are treated as unknown.
    pub(super) covariance: DMatrix<f64>,
    /// Matrix E: effect of all inertial parameters on the compared base parameters.
    pub(super) effects: DMatrix<f64>,
    /// Sizes of the differences of all bodies that are compared.
    pub(super) sizes: Vec<Spread>,
    /// Prior covariance of all inertial parameters for each of `sizes`.
    pub(super) spreads: Vec<DMatrix<f64>>,
}

impl Differences {
    /// Compares base parameters `values` with indices `rows` and their `covariance` with the nominal values of `robot`.
    /// Friction, offsets and drive inertia are unknown in a description and are not tested. `None` without nominal
    /// values, or if the settings define single bodies, so that these are not the bodies of the description.
    ///
    /// # Errors
    /// As [`explanations`].
    pub fn from_description(
        robot: &ParametricModel,
        rows: &[usize],
        values: &DVector<f64>,
        covariance: &DMatrix<f64>,
        knowledge: &ConsistencySettings,
        limits: &DescriptionThresholds,
    ) -> Result<Option<Self>, EstimationError> {
        let base = robot.base();
        let is_stated = knowledge.bodies.values().any(|own| own.prior.is_some() || own.known.is_some());
        let Some(nominal) = robot.nominal_base().filter(|_| !rows.is_empty() && !is_stated) else { return Ok(None) };
        let is_described = robot.model().bodies().iter().all(|body| body.prior().is_some());
        let Some(spread) = body_spread(robot, knowledge).filter(|_| is_described) else { return Ok(None) };
        let difference = DVector::from_fn(rows.len(), |k, _| values[k] - nominal[rows[k]]);
        let inertial = robot.model().inertial_count();
        let absolute = absolute_values(values, covariance);
        let all = effects(base).select_rows(rows);
        let bars = covariance;
        let mut covariance = bars.clone();
        for column in inertial..inertial + robot.terms().len() {
            let place = rows.iter().position(|&row| base.independent()[row] == column);
            let effect = all.column(column) * (limits.unknown_term_ratio * place.map_or(1.0, |k| absolute[k]));
            covariance += &effect * effect.transpose();
        }
        let sizes = SPREADS.to_vec();
        let effects = all.columns(0, inertial).into_owned();
        let all = parts(robot.model(), base, rows, &absolute);
        let (parts, unknowns, groups) = groups(robot, all, &effects, Reference::Description, limits);
        let mut found = Self {
            explanations: Vec::new(),
            parts,
            unknowns,
            difference,
            covariance,
            effects,
            spreads: covariances_of(&spread, robot, &sizes),
            sizes,
        };
        // Only the error bars have a factor: friction is unknown, and differences of bodies have their own sizes.
        let pair_ratios = vec![1.0, 1.0 / 3.0, 3.0];
        let settings = ChangeSettings { error_factors: vec![1.0], pair_ratios, ..settings(limits) };
        found.explain(&groups, bars, &limits.error_factors, &settings)?;
        let probability = |own: &Spread| {
            let small = limits.small_probability;
            let of_all = if own.is_small(limits.max_small_share) { small } else { 1.0 - small };
            of_all * own.share(limits.max_small_share)
        };
        found.reweight(&found.of_sizes(probability));
        found.exclude_negative_masses(robot.nominal());
        Ok(Some(found))
    }

    /// Compares two estimates of the base parameters with indices `rows` of one type of robot: the second minus the
    /// first, each with values and covariance. The parts are bodies, friction and offset, and drive inertia of single
    /// joints, and the friction of all joints. The nominal values of `robot` are the bodies of the first estimate.
    ///
    /// # Errors
    /// As [`explanations`].
    pub fn between(
        robot: &ParametricModel,
        rows: &[usize],
        [(old, old_covariance), (new, new_covariance)]: [(&DVector<f64>, &DMatrix<f64>); 2],
        limits: &DescriptionThresholds,
    ) -> Result<Self, EstimationError> {
        let inertial = robot.model().inertial_count();
        let mut sizes = vec![Spread { shape: 0.0, scale: 0.0 }];
        let mut spreads = vec![DMatrix::zeros(inertial, inertial)];
        if let Some(spread) = body_spread(robot, &ConsistencySettings::default()) {
            spreads.extend(covariances_of(&spread, robot, &SPREADS));
            sizes.extend(SPREADS);
        }
        let [first, second] = [absolute_values(old, old_covariance), absolute_values(new, new_covariance)];
        let larger: Vec<f64> = first.iter().zip(&second).map(|(first, second)| first.max(*second)).collect();
        let effects = effects(robot.base()).select_rows(rows).columns(0, inertial).into_owned();
        let all = parts(robot.model(), robot.base(), rows, &larger);
        let (parts, unknowns, groups) = groups(robot, all, &effects, Reference::Estimate, limits);
        let mut found = Self {
            explanations: Vec::new(),
            parts,
            unknowns,
            difference: new - old,
            covariance: old_covariance + new_covariance,
            effects,
            sizes,
            spreads,
        };
        found.explain(&groups, &DMatrix::zeros(rows.len(), rows.len()), &[1.0], &settings(limits))?;
        let probability = |own: &Spread| {
            if own.largest() > 0.0 {
                limits.other_robot_probability * own.share(limits.max_small_share)
            } else {
                1.0 - 2.0 * limits.other_robot_probability
            }
        };
        found.reweight(&found.of_sizes(probability));
        Ok(found)
    }

    /// Finds the explanations by `groups`. The part `bars` of the covariance is multiplied by the square of each of
    /// these factors.
    fn explain(
        &mut self,
        groups: &[ChangeGroup],
        bars: &DMatrix<f64>,
        factors: &[f64],
        settings: &ChangeSettings,
    ) -> Result<(), EstimationError> {
        let with = |own: &DMatrix<f64>| &self.covariance + &self.effects * own * self.effects.transpose();
        let scaled = |own: DMatrix<f64>| factors.iter().map(move |factor| &own + bars * (factor * factor - 1.0));
        let covariances: Vec<_> = self.spreads.iter().map(with).flat_map(scaled).collect();
        self.explanations = explanations(&self.difference, &covariances, groups, settings)?;
        for own in &mut self.explanations {
            own.error_factor *= factors[own.covariance % factors.len()];
            own.covariance /= factors.len();
        }
        Ok(())
    }

    /// For each explanation, `value` of the size of the differences of all bodies.
    fn of_sizes(&self, value: impl Fn(&Spread) -> f64) -> Vec<f64> {
        self.explanations.iter().map(|own| value(&self.sizes[own.covariance])).collect()
    }

    /// Multiplies the probability of each explanation by a factor. At least one factor must be positive.
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

    /// Probability that every body differs from the description by more than the small differences of `limits`, and
    /// that no body differs by more than the others.
    pub fn everywhere(&self, limits: &DescriptionThresholds) -> f64 {
        let all = self.explanations.iter().filter(|own| self.is_everywhere(own, limits));
        all.map(|own| own.probability).sum::<f64>().min(1.0)
    }

    /// Test statistic `dᵀ C⁻¹ d` of the difference d from the description with its covariance C; friction and drive
    /// parameters are treated as unknown.
    pub fn chi_squared(&self) -> f64 {
        let scale = self.covariance.diagonal().map(|value| value.max(f64::MIN_POSITIVE).sqrt().recip());
        let scales = DMatrix::from_diagonal(&scale);
        let scaled = &scales * &self.difference;
        // For strong correlations, rounding could otherwise make the matrix indefinite.
        let rounding = DMatrix::from_diagonal_element(scale.len(), scale.len(), 1e-9);
        let factor = (&scales * &self.covariance * &scales + rounding).cholesky();
        factor.map_or(0.0, |factor| scaled.dot(&factor.solve(&scaled)))
    }

    /// [`Explanation::remaining`] of the most probable explanation by all bodies; 1 if there is none.
    pub fn remaining_everywhere(&self, limits: &DescriptionThresholds) -> f64 {
        let best = self.explanations.iter().find(|own| self.is_everywhere(own, limits));
        best.map_or(1.0, |own| own.remaining)
    }

    /// The parts that an explanation names: bodies, then terms of joints, ascending.
    pub fn parts_of(&self, explanation: &Explanation) -> Vec<Part> {
        let mut parts: Vec<Part> = explanation.groups.iter().map(|&group| self.parts[group].clone()).collect();
        parts.sort_unstable();
        parts.dedup();
        parts
    }

    /// The bodies that an explanation names, ascending.
    pub fn bodies_of(&self, explanation: &Explanation) -> Vec<usize> {
        self.parts_of(explanation).into_iter().filter_map(|part| part.body()).collect()
    }

    /// Change of the ten values of a body according to an explanation, with its covariance.
    pub fn change_of(&self, explanation: &Explanation, body: usize) -> (DVector<f64>, DMatrix<f64>) {
        let (mut change, mut covariance) = (DVector::zeros(10), DMatrix::zeros(10, 10));
        for (&group, (values, own)) in explanation.groups.iter().zip(&explanation.changes) {
            if self.parts[group] == Part::Body(body) {
                let unknowns = &self.unknowns[group];
                change += unknowns * values;
                covariance += unknowns * own * unknowns.transpose();
            }
        }
        (change, covariance)
    }

    /// Sets of parts that changed, the most probable set first; bodies in a set differ by more than the other bodies.
    /// The probability of a set is the total over all sizes of the differences of the other bodies. The empty set means
    /// that all bodies differ at most by the small differences of `limits`. Each set is returned with one explanation:
    /// the smallest differences of the other bodies that the logs do not contradict.
    pub fn sets(&self, limits: &DescriptionThresholds) -> Vec<(f64, &Explanation)> {
        // Total and largest probability of the set, and its explanation.
        let mut sets: Vec<(f64, f64, &Explanation)> = Vec::new();
        for own in self.explanations.iter().filter(|own| !self.is_everywhere(own, limits)) {
            let parts = self.parts_of(own);
            let Some((total, largest, chosen)) = sets.iter_mut().find(|(.., set)| self.parts_of(set) == parts) else {
                sets.push((own.probability, own.probability, own));
                continue;
            };
            *total += own.probability;
            let is_smaller = self.sizes[own.covariance].largest() < self.sizes[chosen.covariance].largest();
            if is_smaller && own.probability >= limits.min_share_of_largest * *largest {
                *chosen = own;
            }
        }
        sets.sort_by(|a, b| b.0.total_cmp(&a.0));
        sets.into_iter().map(|(total, _, chosen)| (total, chosen)).collect()
    }

    /// The explanation by one or two bodies that the exported model follows: the most probable one, if the evidence for
    /// such explanations reaches the threshold of `limits`.
    pub fn followed(&self, limits: &DescriptionThresholds) -> Option<&Explanation> {
        // The other bodies must differ at most by small differences, because they keep the values of the description.
        let is_small = |own: &&Explanation| self.sizes[own.covariance].largest() <= limits.max_small_share;
        let few = self.explanations.iter().filter(is_small).filter(|own| !own.groups.is_empty());
        let few: f64 = few.map(|own| own.probability).sum();
        let (_, best) = *self.sets(limits).first()?;
        (few >= limits.min_probability && !best.groups.is_empty()).then_some(best)
    }

    /// Whether an explanation names no body and all bodies differ by more than the small differences of `limits`.
    fn is_everywhere(&self, explanation: &Explanation, limits: &DescriptionThresholds) -> bool {
        let large = self.sizes[explanation.covariance].largest() > limits.max_small_share;
        large && self.bodies_of(explanation).is_empty()
    }

    /// Probability that a body changed: the sum over the explanations by few bodies that contain this body, and the
    /// explanations by all bodies.
    pub fn body_probability(&self, body: usize, limits: &DescriptionThresholds) -> f64 {
        let changed = |own: &&Explanation| self.is_everywhere(own, limits) || self.bodies_of(own).contains(&body);
        let sum: f64 = self.explanations.iter().filter(changed).map(|own| own.probability).sum();
        sum.min(1.0)
    }
}

/// What an estimate is compared with.
#[derive(Clone, Copy, PartialEq)]
enum Reference {
    Description,
    Estimate,
}

/// Groups of unknowns. A body has a group for a change of its ten values, as by a load, and one for a common factor of
/// all its values. Relative to a description it has a third group for both together, and the terms of joints are not
/// tested. Returns the part of each group, the change of the values per unknown, and the effect on the base parameters.
fn groups(
    robot: &ParametricModel,
    all: Parts,
    effects: &DMatrix<f64>,
    reference: Reference,
    limits: &DescriptionThresholds,
) -> (Vec<Part>, Vec<DMatrix<f64>>, Vec<ChangeGroup>) {
    let (mut parts, mut unknowns, mut groups) = (Vec::new(), Vec::new(), Vec::new());
    for ((part, group), sizes) in all.parts.into_iter().zip(all.groups).zip(all.sizes) {
        let is_description = reference == Reference::Description;
        if is_description && part.body().is_none() {
            continue;
        }
        let own = DMatrix::from_diagonal(&sizes);
        if let Some(body) = part.body() {
            let factor = nominal_values(robot, body) * limits.expected_factor;
            let mut both = own.clone().insert_column(sizes.len(), 0.0);
            both.set_column(sizes.len(), &(&factor * limits.factor_with_load));
            let factor = DMatrix::from_column_slice(factor.len(), 1, factor.as_slice());
            for unknown in [Some(factor), is_description.then_some(both)].into_iter().flatten() {
                parts.push(part.clone());
                let effect = effects.columns(10 * body, 10) * &unknown;
                groups.push(ChangeGroup { name: group.name.clone(), effect });
                unknowns.push(unknown);
            }
        }
        parts.push(part);
        groups.push(group);
        unknowns.push(own);
    }
    (parts, unknowns, groups)
}

/// Settings without a change of all groups together, which the differences of all bodies replace.
fn settings(limits: &DescriptionThresholds) -> ChangeSettings {
    ChangeSettings { together: false, probability: limits.change_probability, ..ChangeSettings::default() }
}

/// Absolute values with their standard deviations.
fn absolute_values(values: &DVector<f64>, covariance: &DMatrix<f64>) -> Vec<f64> {
    (0..values.len()).map(|k| values[k].abs() + covariance[(k, k)].max(0.0).sqrt()).collect()
}
