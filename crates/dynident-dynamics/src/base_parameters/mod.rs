//! Base parameters: the identifiable combinations of parameters.
//!
//! The columns of the regressor are ordered from base to tip as in [`all_columns`](crate::all_columns). A column that
//! depends on earlier columns is regrouped into them (Gautier and Khalil 1990; Gautier 1991). The dependencies follow
//! from the robot's structure ([`structural`]). The rank of regressors at random states ([`numerical_rank`],
//! [`numerical_rank_by_body`]) is the cross-check. Coupled joints and declared (user-defined) torques, whose
//! dependencies the structure does not show, use random states.

mod coupled;
mod declared;
mod determination;
mod expression;
mod numerical;
mod one_joint_motions;
mod own_units;
mod structural;

pub(crate) use declared::{DeclaredFault, fault};
pub use determination::Determination;
pub use numerical::{NumericalRank, numerical_rank};
pub use one_joint_motions::numerical_rank_by_body;

use self::expression::{Digits, Omitted};
use crate::independent_columns::IndependentColumns;
use crate::regressor_panels::{Column, all_columns};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;
use nalgebra::DMatrix;

/// Tolerance of the dependence test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseParameterSettings {
    /// A column is dependent if the part that other columns do not explain is below this share of it. The default,
    /// 2e-5, is above the effect of rounded angles in robot descriptions (`1.5708` for π/2: 4e-6) and below that of
    /// an offset of a tenth of a millimetre (1e-4).
    pub tolerance: f64,
}

impl Default for BaseParameterSettings {
    fn default() -> Self {
        Self { tolerance: 2e-5 }
    }
}

/// The base parameters of a robot with its terms.
#[doc(alias("minimal parameters", "identifiable parameters"))]
#[derive(Clone, Debug)]
pub struct BaseParameters {
    columns: Vec<Column>,
    split: IndependentColumns,
    /// Length of the robot, m.
    length_m: f64,
}

impl BaseParameters {
    /// Computes the base parameters from the robot's structure, without data. Coupled joints and declared torques use
    /// random states with a fixed seed.
    pub fn new(model: &Model, terms: &[TorqueTerm], settings: &BaseParameterSettings) -> Self {
        let columns = all_columns(model, terms);
        let split = if model.coupling().is_some() {
            coupled::independent_columns(model, terms, settings.tolerance)
        } else {
            structural::identifiable_directions(model, terms, settings.tolerance).split(settings.tolerance)
        };
        let split = declared::regrouped(model, &columns, split, settings.tolerance);
        let arm_m = model.arm_m();
        Self { columns, split, length_m: if arm_m > 0.0 { arm_m } else { 1.0 } }
    }

    /// Number of base parameters.
    pub fn count(&self) -> usize {
        self.split.independent.len()
    }

    /// All columns of the regressor, base or not, in global order.
    pub fn all_columns(&self) -> &[Column] {
        &self.columns
    }

    /// Global indices of the base columns, ascending.
    pub fn independent(&self) -> &[usize] {
        &self.split.independent
    }

    /// Global indices of the regrouped (or unidentifiable) columns, ascending.
    pub fn dependent(&self) -> &[usize] {
        &self.split.dependent
    }

    /// Regrouping matrix `K` with `W[dependent] = W[independent] K` for the regressor W, so that the base parameters
    /// are `θ = π[independent] + K π[dependent]`. Shape (independent, dependent).
    pub fn regrouping(&self) -> &DMatrix<f64> {
        &self.split.regrouping
    }

    /// The base columns, for a [`PanelLayout`](crate::PanelLayout) with a full-rank regressor.
    pub fn base_columns(&self) -> Vec<Column> {
        self.split.independent.iter().map(|&index| self.columns[index].clone()).collect()
    }

    /// Values of the base parameters for values π of all parameters: `θ = π[independent] + K π[dependent]`.
    ///
    /// # Panics
    /// If `parameters` does not have one value per column.
    pub fn values(&self, parameters: &[f64]) -> Vec<f64> {
        assert_eq!(parameters.len(), self.columns.len(), "one value per column");
        let mut values: Vec<f64> = self.split.independent.iter().map(|&index| parameters[index]).collect();
        for (&column, factors) in self.split.dependent.iter().zip(self.split.regrouping.column_iter()) {
            for (value, factor) in values.iter_mut().zip(factors.iter()) {
                *value += factor * parameters[column];
            }
        }
        values
    }

    /// Indices of the parameters that no motion can determine: no base parameter contains them.
    pub fn unidentifiable(&self) -> Vec<usize> {
        let k = &self.split.regrouping;
        let dependent = self.split.dependent.iter().enumerate();
        dependent.filter(|(d, _)| k.column(*d).amax() < expression::NEGLIGIBLE).map(|(_, &column)| column).collect()
    }

    /// Declared torques that are combinations of other columns, with the symbols of the base parameters concerned.
    /// The coefficients of these declared torques are not identifiable separately; the base parameters include them.
    pub fn coincident(&self) -> Vec<(&TorqueTerm, Vec<String>)> {
        let dependent = self.split.dependent.iter().zip(self.split.regrouping.column_iter());
        let of_declared = dependent.filter_map(|(&column, factors)| match &self.columns[column] {
            Column::Term(term) if term.is_declared() => {
                let shares = self.split.independent.iter().zip(factors.iter());
                let felt = shares.filter(|(_, factor)| factor.abs() >= expression::NEGLIGIBLE);
                Some((term, felt.map(|(&base, _)| self.columns[base].symbol()).collect()))
            }
            Column::Term(_) | Column::Body { .. } => None,
        });
        of_declared.collect()
    }

    /// Readable sums, one per base parameter, for example `Izz1 + 0.49 m2`. Factors have six digits and are the same
    /// on every processor, so that the sums can serve as names. Small factors that rounded angles such as `1.5708`
    /// cause are omitted: below 1e-5 for factors in m (times the robot's length [`arm_m`](Model::arm_m)), and below
    /// 2e-6 for factors in m² (times the squared length). [`regrouping`](Self::regrouping) and all numbers contain
    /// them.
    pub fn expressions(&self) -> Vec<String> {
        expression::expressions(&self.columns, &self.split, Digits::Six, Omitted::RoundedAngles(self.length_m))
    }

    /// Like [`expressions`](Self::expressions), including the small factors, as in results of earlier versions.
    pub fn complete_expressions(&self) -> Vec<String> {
        expression::expressions(&self.columns, &self.split, Digits::Six, Omitted::Noise)
    }

    /// Like [`expressions`](Self::expressions), but for calculation: every factor has the shortest form that reads
    /// back to the same `f64`. Factors below 1e-9 (rounding) are omitted.
    pub fn exact_expressions(&self) -> Vec<String> {
        expression::expressions(&self.columns, &self.split, Digits::All, Omitted::Noise)
    }

    /// Smallest independent and largest dependent share of a column. If they differ by orders of magnitude, the
    /// choice of base parameters does not depend on the tolerance.
    pub fn gap(&self) -> (f64, f64) {
        (self.split.weakest_independent, self.split.strongest_dependent)
    }
}
