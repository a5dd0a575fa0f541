//! Which parts of a robot differ: evidence for explanations of a difference between two sets of parameters.
//!
//! The difference `d` of two estimates of the same parameters, or of an estimate and a description, has the covariance
//! `C`. A part of the robot is a [`ChangeGroup`]: a few unknowns `φ` with the effect `B φ` on `d`, scaled so that the
//! expected size of each unknown is 1. An [`Explanation`] is a set of groups that changed. With a normal distribution
//! of the unknowns, its evidence has a closed form (Bishop 2006, section 3.5):
//!
//! ```text
//! p(d | groups) = N(d; 0, c² C + s² Σ_g B_g B_gᵀ)
//! ```
//!
//! The scales `s` of the changes and `c` of the error bars are not known; the evidence is the mean over the values
//! in [`ChangeSettings`]. The scales of two groups have the ratios [`ChangeSettings::pair_ratios`]: a large tool at
//! the flange may occur together with a small change of a heavy link. The odds of two explanations are the ratios of
//! evidence times prior probability.
//!
//! If everything may differ a little, the size of these small differences is not known either. [`explanations`]
//! therefore accepts several covariances `C`, such as those of the error bars plus small differences of several sizes,
//! and compares each set of groups with each of them.

use crate::error::{EstimationError, expect, require};
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;

/// Share that is added to each variance, so that rounding does not make a covariance indefinite.
const ROUNDING: f64 = 1e-9;

/// Eigenvalue of `BᵀB` relative to the largest one, below which its direction has no effect: the square of rounding.
const MIN_EIGENVALUE: f64 = 1e-13;

/// Number of pairs with the best evidence at equal scales that are compared at all ratios.
const REFINED_PAIRS: usize = 16;

/// A part of the robot that may have changed.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeGroup {
    /// Name, for the caller.
    pub name: String,
    /// `B`: effect of each unknown on the difference, per expected size of the unknown.
    pub effect: DMatrix<f64>,
}

/// Settings of [`explanations`].
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeSettings {
    /// Sizes of changes relative to the expected size, each with the same probability. Default 0.1, 0.3, 1, 3: a
    /// change can be much smaller than expected, but not much larger.
    pub scales: Vec<f64>,
    /// Factors of the error bars, each with the same probability. Default 1, 1.5, 2: on average the error bars are
    /// right, but some logs have errors that the error bars do not include.
    pub error_factors: Vec<f64>,
    /// Ratios of the scales of two groups that changed together, each with the same probability. Default 1: the same
    /// scale for both.
    pub pair_ratios: Vec<f64>,
    /// Prior probability that a group changed. Default 0.05, a change is rare.
    pub probability: f64,
    /// Maximum number of changed groups in one explanation; all groups together are a separate explanation. Default
    /// 2.
    pub most_groups: usize,
    /// Number of groups, those with the best evidence, that are combined to sets of several groups. Default 8.
    pub candidates: usize,
    /// Whether to test the explanation that all groups changed. Default true; use false if the covariances already
    /// contain small differences of all groups.
    pub together: bool,
}

impl Default for ChangeSettings {
    fn default() -> Self {
        Self {
            scales: vec![0.1, 0.3, 1.0, 3.0],
            error_factors: vec![1.0, 1.5, 2.0],
            pair_ratios: vec![1.0],
            probability: 0.05,
            most_groups: 2,
            candidates: 8,
            together: true,
        }
    }
}

impl ChangeSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for an empty list, a factor that is not positive, or a probability that is not
    /// between 0 and 0.5.
    pub fn validate(&self) -> Result<(), EstimationError> {
        let positive = |list: &[f64]| !list.is_empty() && list.iter().all(|value| value.is_finite() && *value > 0.0);
        let first = |list: &[f64]| list.first().copied().unwrap_or(f64::NAN);
        require(positive(&self.scales), "scales", first(&self.scales), "give one or more positive factors")?;
        let factors = &self.error_factors;
        require(positive(factors), "error_factors", first(factors), "give one or more positive factors")?;
        let ratios = &self.pair_ratios;
        require(positive(ratios), "pair_ratios", first(ratios), "give one or more positive factors")?;
        let is_rare = self.probability > 0.0 && self.probability <= 0.5;
        require(is_rare, "probability", self.probability, "give more than 0 and at most 0.5")?;
        Ok(())
    }
}

/// A set of groups that explains the difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The groups that changed, ascending; empty if nothing changed.
    pub groups: Vec<usize>,
    /// Index of the covariance `C` in the list given to [`explanations`].
    pub covariance: usize,
    /// Posterior probability among the compared explanations.
    pub probability: f64,
    /// `dᵀ C⁻¹ d` that remains after the change, divided by the number of parameters: about 1 for a complete
    /// explanation with true error bars.
    pub remaining: f64,
    /// The most probable scale `s` of the change of each group.
    pub scales: Vec<f64>,
    /// The most probable factor `c` of the error bars.
    pub error_factor: f64,
    /// Change of the unknowns of each group, in expected sizes, with its covariance.
    pub changes: Vec<(DVector<f64>, DMatrix<f64>)>,
}

/// Compares explanations of the difference `d` for each covariance `C`: no change, a change of each single group,
/// pairs with the most probable groups, and all groups together. The covariances have the same prior probability. The
/// most probable explanation comes first.
///
/// # Errors
/// [`EstimationError::Setting`]; [`EstimationError::Mismatch`] for another size; [`EstimationError::NotPositive`] if
/// a covariance is not positive definite.
pub fn explanations(
    difference: &DVector<f64>,
    covariances: &[DMatrix<f64>],
    groups: &[ChangeGroup],
    settings: &ChangeSettings,
) -> Result<Vec<Explanation>, EstimationError> {
    settings.validate()?;
    let n = difference.len();
    for group in groups {
        expect(&format!("rows of the effect of {}", group.name), n, group.effect.nrows())?;
    }
    let mut found = Vec::new();
    for (index, covariance) in covariances.iter().enumerate() {
        expect("rows of the covariance", n, covariance.nrows())?;
        expect("columns of the covariance", n, covariance.ncols())?;
        found.extend(explanations_with(difference, index, covariance, groups, settings)?);
    }
    let largest = found.iter().map(|(log, _)| *log).fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = found.iter().map(|(log, _)| (log - largest).exp()).sum();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(found
        .into_iter()
        .map(|(log, explanation)| Explanation { probability: (log - largest).exp() / total, ..explanation })
        .collect())
}

/// Explanations for one covariance, with the logarithm of evidence times prior probability.
fn explanations_with(
    difference: &DVector<f64>,
    index: usize,
    covariance: &DMatrix<f64>,
    groups: &[ChangeGroup],
    settings: &ChangeSettings,
) -> Result<Vec<(f64, Explanation)>, EstimationError> {
    let n = difference.len();
    let not_positive = || EstimationError::NotPositive { what: "covariance of the difference" };
    // Rounding of a covariance with strong correlations.
    let mut positive = covariance.clone();
    positive.set_diagonal(&(covariance.diagonal() * (1.0 + ROUNDING)));
    let is_finite = |of: &DMatrix<f64>| of.iter().all(|value| value.is_finite());
    let all_finite = groups.iter().all(|group| is_finite(&group.effect)) && difference.iter().all(|d| d.is_finite());
    let factor = Cholesky::new(positive).filter(|_| all_finite && is_finite(covariance)).ok_or_else(not_positive)?;
    // Scaled by the error bars, so that the covariance is the unit matrix.
    let white = |of: &DMatrix<f64>| factor.l_dirty().solve_lower_triangular(of).ok_or_else(not_positive);
    let d = white(&DMatrix::from_column_slice(n, 1, difference.as_slice()))?.column(0).into_owned();
    let starts: Vec<usize> = groups
        .iter()
        .scan(0, |end, group| {
            let start = *end;
            *end += group.effect.ncols();
            Some(start)
        })
        .collect();
    let mut effects = DMatrix::zeros(n, groups.iter().map(|group| group.effect.ncols()).sum());
    for (group, &start) in groups.iter().zip(&starts) {
        effects.columns_mut(start, group.effect.ncols()).copy_from(&white(&group.effect)?);
    }
    let columns = groups.iter().zip(&starts).map(|(group, &start)| start..start + group.effect.ncols()).collect();
    let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|value| value.ln()).sum();
    let products = effects.tr_mul(&effects);
    let along = effects.tr_mul(&d);
    let whitened =
        Whitened { count: n, square: d.norm_squared(), along, products, columns, settings, index, log_determinant };

    let prior = |count: usize| (settings.probability / (1.0 - settings.probability)).ln() * count as f64;
    let mut found = vec![whitened.explained(&[], &[], 0.0)];
    let mut single: Vec<(f64, Explanation)> =
        (0..groups.len()).map(|group| whitened.explained(&[group], &[1.0], prior(1))).collect();
    single.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best: Vec<usize> = single.iter().take(settings.candidates).map(|(_, own)| own.groups[0]).collect();
    found.extend(single);
    if settings.most_groups > 1 {
        let mut pairs = Vec::new();
        for (place, &a) in best.iter().enumerate() {
            // Combine the best groups with every other group: a second change may be visible only after the first is
            // explained.
            let others = (0..groups.len()).filter(|b| *b != a && !best[..place].contains(b));
            pairs.extend(others.map(|b| whitened.explained(&[a.min(b), a.max(b)], &[1.0; 2], prior(2))));
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        for pair in pairs.iter_mut().take(REFINED_PAIRS) {
            *pair = whitened.at_all_ratios(pair, prior(2));
        }
        found.extend(pairs);
    }
    if settings.together && groups.len() > settings.most_groups {
        let all: Vec<usize> = (0..groups.len()).collect();
        found.push(whitened.explained(&all, &vec![1.0; groups.len()], prior(1)));
    }
    Ok(found)
}

/// The difference `d` and the effects `B` of all groups in coordinates where the covariance is the unit matrix.
struct Whitened<'a> {
    /// Number of parameters.
    count: usize,
    /// `dᵀ d`.
    square: f64,
    /// `Bᵀ d`.
    along: DVector<f64>,
    /// `Bᵀ B`.
    products: DMatrix<f64>,
    /// Columns of each group in B.
    columns: Vec<Range<usize>>,
    settings: &'a ChangeSettings,
    /// Index of the covariance.
    index: usize,
    /// Half of the logarithm of the determinant of the covariance.
    log_determinant: f64,
}

impl Whitened<'_> {
    /// A pair with the mean evidence of all ratios of its scales, and the explanation at the best ratio.
    fn at_all_ratios(&self, equal: &(f64, Explanation), prior: f64) -> (f64, Explanation) {
        let other = |ratio: &f64| self.explained(&equal.1.groups, &[1.0, *ratio], prior);
        let all: Vec<(f64, Explanation)> = self.settings.pair_ratios.iter().map(other).collect();
        let log = mean_of_logarithms(all.iter().map(|(log, _)| *log));
        let best = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| equal.clone(), |(_, explanation)| (log, explanation))
    }

    /// One decomposition for all scales, `BᵀB = V S² Vᵀ` of some columns of B times their `factors`: the diagonal of
    /// S², V, and `VᵀBᵀd`.
    fn decomposed(&self, columns: &[usize], factors: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>, DVector<f64>) {
        if columns.is_empty() {
            return (DVector::zeros(0), DMatrix::zeros(0, 0), DVector::zeros(0));
        }
        let products = self.products.select_columns(columns).select_rows(columns);
        let eigen = products.component_mul(&(factors * factors.transpose())).symmetric_eigen();
        let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let squares = eigen.eigenvalues.map(|square| if square > MIN_EIGENVALUE * largest { square } else { 0.0 });
        let products = eigen.eigenvectors.tr_mul(&self.along.select_rows(columns).component_mul(factors));
        (squares, eigen.eigenvectors, products)
    }

    /// Logarithm of the evidence of a set of groups plus `prior`, and the explanation without its probability. `ratios`
    /// are the scales of the groups relative to a common one.
    fn explained(&self, groups: &[usize], ratios: &[f64], prior: f64) -> (f64, Explanation) {
        let n = self.count;
        let columns: Vec<usize> = groups.iter().flat_map(|&group| self.columns[group].clone()).collect();
        let of_group = |(&group, &ratio): (&usize, &f64)| core::iter::repeat_n(ratio, self.columns[group].len());
        let factors = DVector::from_iterator(columns.len(), groups.iter().zip(ratios).flat_map(of_group));
        let (squares, vectors, products) = self.decomposed(&columns, &factors);
        let along =
            products.zip_map(&squares, |product, square| if square > 0.0 { product / square.sqrt() } else { 0.0 });
        let rest = (self.square - along.norm_squared()).max(0.0);
        let scales: &[f64] = if groups.is_empty() { &[1.0] } else { &self.settings.scales };
        let mut logs = Vec::with_capacity(scales.len() * self.settings.error_factors.len());
        for &scale in scales {
            for &error in &self.settings.error_factors {
                let variance = error * error;
                let mut log = -0.5 * (rest / variance + (n as f64 - squares.len() as f64) * variance.ln());
                for (square, along) in squares.iter().zip(along.iter()) {
                    let total = variance + scale * scale * square;
                    log -= 0.5 * (along * along / total + total.ln());
                }
                logs.push((log, scale, error));
            }
        }
        let (_, scale, error) = logs
            .iter()
            .copied()
            .fold((f64::NEG_INFINITY, 1.0, 1.0), |best, own| if own.0 > best.0 { own } else { best });
        let log = mean_of_logarithms(logs.iter().map(|(log, ..)| *log));

        // Posterior of the unknowns at the best scale: φ = V diag(s² S / (c² + s² S²)) Uᵀ d.
        let [variance, square_scale] = [error * error, scale * scale];
        let mut remaining = rest;
        let mut changes = Vec::new();
        if !columns.is_empty() {
            // V S⁻¹ diag(s² S² / (c² + s² S²)) Uᵀ d, with the covariance s² (1 - V diag(s² S² / (c² + s² S²)) Vᵀ).
            let shrunk = squares.map(|square| square_scale * square / (variance + square_scale * square));
            let gains = products
                .zip_map(&squares, |product, square| product * square_scale / (variance + square_scale * square));
            let phi = &vectors * gains;
            let covariance = (DMatrix::identity(columns.len(), columns.len())
                - &vectors * DMatrix::from_diagonal(&shrunk) * vectors.transpose())
                * square_scale;
            remaining +=
                along.iter().zip(shrunk.iter()).map(|(along, shrunk)| ((1.0 - shrunk) * along).powi(2)).sum::<f64>();
            let mut start = 0;
            for (&group, &ratio) in groups.iter().zip(ratios) {
                let count = self.columns[group].len();
                changes.push((
                    phi.rows(start, count) * ratio,
                    covariance.view((start, start), (count, count)) * (ratio * ratio),
                ));
                start += count;
            }
        }
        let remaining = remaining / n as f64;
        let explanation = Explanation {
            groups: groups.to_vec(),
            covariance: self.index,
            probability: 0.0,
            remaining,
            scales: ratios.iter().map(|ratio| scale * ratio).collect(),
            error_factor: error,
            changes,
        };
        (log + prior - self.log_determinant, explanation)
    }
}

/// Logarithm of the mean of numbers, from their logarithms.
fn mean_of_logarithms(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    let (sum, count) = logs.fold((0.0, 0.0), |(sum, count), log| (sum + (log - largest).exp(), count + 1.0));
    largest + (sum / count).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values between -1 and 1 without a pattern.
    fn value(seed: usize) -> f64 {
        let x = (seed as f64 * 12.9898 + 78.233).sin() * 43758.5453;
        2.0 * (x - x.floor()) - 1.0
    }

    /// Standard normal values, as sums of twelve uniform ones.
    fn normal(seed: usize) -> f64 {
        (0..12).map(|k| value(1000 * seed + k)).sum::<f64>() / 2.0
    }

    const PARAMETERS: usize = 24;

    fn groups() -> Vec<ChangeGroup> {
        let effect = |group: usize| {
            DMatrix::from_fn(PARAMETERS, 4, |row, column| 5.0 * value(100_000 + 997 * group + 31 * row + column))
        };
        (0..6).map(|group| ChangeGroup { name: group.to_string(), effect: effect(group) }).collect()
    }

    fn covariance() -> DMatrix<f64> {
        let mixed = DMatrix::from_fn(PARAMETERS, PARAMETERS, |row, column| {
            if row == column { 1.0 } else { 0.1 * value(7 * row + 3 * column) }
        });
        &mixed * mixed.transpose()
    }

    fn noise(seed: usize) -> DVector<f64> {
        let factor = Cholesky::new(covariance()).unwrap().l();
        factor * DVector::from_fn(PARAMETERS, |row, _| normal(seed * PARAMETERS + row))
    }

    fn change(group: usize, seed: usize) -> DVector<f64> {
        &groups()[group].effect * DVector::from_fn(4, |row, _| normal(50_000 + 4 * seed + row))
    }

    fn best(difference: &DVector<f64>) -> Explanation {
        explanations(difference, &[covariance()], &groups(), &ChangeSettings::default()).unwrap().swap_remove(0)
    }

    #[test]
    fn the_groups_that_changed_are_found() {
        let (mut right, mut pairs) = (0, 0);
        for seed in 0..40 {
            right += usize::from(best(&(noise(seed) + change(seed % 6, seed))).groups == [seed % 6]);
            let both = change(seed % 6, seed) + change((seed + 1) % 6, seed + 500);
            let mut expected = vec![seed % 6, (seed + 1) % 6];
            expected.sort_unstable();
            pairs += usize::from(best(&(noise(seed) + both)).groups == expected);
        }
        assert!(right >= 38 && pairs >= 38, "{right} single changes and {pairs} pairs of 40");
    }

    #[test]
    fn without_a_change_no_group_is_named_and_with_all_no_single_one() {
        let (mut none, mut dense) = (0, 0);
        for seed in 0..40 {
            none += usize::from(best(&noise(seed)).groups.is_empty());
            let all: DVector<f64> = (0..6).map(|group| change(group, seed + 60 * group)).sum();
            dense += usize::from(best(&(noise(seed) + all)).groups.len() == 6);
        }
        assert!(none >= 38 && dense >= 38, "{none} without and {dense} with all changes of 40");
    }

    #[test]
    fn the_change_is_inside_its_bars() {
        let (mut inside, mut all) = (0, 0);
        for seed in 0..40 {
            let truth = DVector::from_fn(4, |row, _| normal(50_000 + 4 * seed + row));
            let found = best(&(noise(seed) + &groups()[2].effect * &truth));
            if found.groups == [2] {
                let (values, covariance) = &found.changes[0];
                let within = |k: usize| (values[k] - truth[k]).abs() <= 1.96 * covariance[(k, k)].sqrt();
                inside += (0..4).filter(|&k| within(k)).count();
                all += 4;
            }
        }
        // 95 % of 160 values, minus three standard deviations of a binomial count.
        assert!(all >= 150 && inside as f64 >= 0.90 * f64::from(all), "{inside} of {all}");
    }

    #[test]
    fn groups_with_the_same_effect_share_the_probability() {
        let mut twins = groups();
        twins[3].effect = twins[1].effect.clone();
        let difference = noise(3) + change(1, 9);
        let found = explanations(&difference, &[covariance()], &twins, &ChangeSettings::default()).unwrap();
        assert_eq!([&found[0].groups[..], &found[1].groups[..]], [&[1][..], &[3]]);
        assert!((found[0].probability - found[1].probability).abs() < 1e-9);
    }

    #[test]
    fn small_differences_everywhere_do_not_hide_a_change() {
        // Every parameter differs by about five error bars, and one group changed as well.
        let spread = covariance() * 25.0;
        let covariances = [covariance(), covariance() + &spread];
        let settings = ChangeSettings { together: false, ..ChangeSettings::default() };
        let (mut right, mut none) = (0, 0);
        for seed in 0..40 {
            let everywhere = noise(seed) + noise(seed + 300) * 5.0;
            let best = |difference: &DVector<f64>| {
                explanations(difference, &covariances, &groups(), &settings).unwrap().swap_remove(0)
            };
            let found = best(&(&everywhere + change(seed % 6, seed) * 3.0));
            right += usize::from(found.groups == [seed % 6] && found.covariance == 1);
            let found = best(&everywhere);
            none += usize::from(found.groups.is_empty() && found.covariance == 1);
        }
        assert!(right >= 36 && none >= 38, "{right} changes and {none} without of 40");
    }

    #[test]
    fn unusable_input_is_refused() {
        let run = |covariance: &DMatrix<f64>, settings: &ChangeSettings| {
            explanations(&noise(1), core::slice::from_ref(covariance), &groups(), settings).unwrap_err().to_string()
        };
        let singular = DMatrix::zeros(PARAMETERS, PARAMETERS);
        assert!(run(&singular, &ChangeSettings::default()).contains("covariance"));
        let settings = ChangeSettings { probability: 0.0, ..ChangeSettings::default() };
        assert!(run(&covariance(), &settings).contains("probability"));
        let settings = ChangeSettings { scales: Vec::new(), ..ChangeSettings::default() };
        assert!(run(&covariance(), &settings).contains("scales"));
    }
}
