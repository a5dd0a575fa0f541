//! Conversion of columns to joint values: unit, sign, scale, matrix, offset.

use super::channels::{ChannelGroup, ColumnRef, OneOrMany};
use super::units::{Quantity, si_factor};
use crate::error::FormatError;

/// Conversion `joint = matrix · column + offset`; the matrix includes unit, sign and scale.
#[derive(Clone, Debug)]
pub(crate) struct Mapping {
    /// For each joint, the columns with nonzero factors and these factors.
    terms: Vec<Vec<(usize, f64)>>,
    offset: Vec<f64>,
}

impl Mapping {
    pub(crate) fn new(group: &ChannelGroup, quantity: Quantity, names: &[String]) -> Result<Self, FormatError> {
        let key = quantity.key();
        let joints = names.len();
        let columns = group.columns_of(key, names)?.len();
        let factor = |column: usize| group.factor(quantity, column);
        let offset = (0..joints).map(|joint| group.offset.as_ref().and_then(|o| o.at(joint)).unwrap_or(0.0)).collect();
        if let Some(sum) = &group.sum {
            let of_joint = |joint: usize| {
                let term = |(at, value): (usize, &OneOrMany<f64>)| {
                    (at * joints + joint, value.at(joint).unwrap_or(0.0) * factor(joint))
                };
                sum.iter().enumerate().map(term).collect()
            };
            return Ok(Self { terms: (0..joints).map(of_joint).collect(), offset });
        }
        let matrix = match (&group.matrix, &group.inverse_matrix) {
            (Some(matrix), _) => Some(matrix.clone()),
            (None, Some(matrix)) => Some(inverse(matrix).ok_or_else(|| {
                FormatError::new(
                    format!("{key}.inverse_matrix"),
                    "the matrix is singular",
                    "give the square, invertible matrix with columns = M joint",
                )
            })?),
            (None, None) => None,
        };
        let terms = (0..joints)
            .map(|joint| match &matrix {
                None => vec![(joint, factor(joint))],
                Some(matrix) => (0..columns)
                    .map(|column| (column, matrix[joint][column] * factor(column)))
                    .filter(|(_, weight)| *weight != 0.0)
                    .collect(),
            })
            .collect();
        Ok(Self { terms, offset })
    }

    /// Computes the joint values `out` (one vector for each joint) from the raw `columns`.
    pub(crate) fn apply(&self, columns: &[Vec<f64>], out: &mut [Vec<f64>]) {
        for ((terms, offset), out) in self.terms.iter().zip(&self.offset).zip(out) {
            out.clear();
            match terms.split_first() {
                None => out.resize(columns.first().map_or(0, Vec::len), *offset),
                Some(((column, weight), rest)) => {
                    out.extend(columns[*column].iter().map(|value| value * weight));
                    for (column, weight) in rest {
                        for (out, value) in out.iter_mut().zip(&columns[*column]) {
                            *out += value * weight;
                        }
                    }
                    if *offset != 0.0 {
                        for out in out.iter_mut() {
                            *out += offset;
                        }
                    }
                }
            }
        }
    }
}

impl ChannelGroup {
    /// Factor from a column to SI: unit, scale and sign.
    fn factor(&self, quantity: Quantity, column: usize) -> f64 {
        let unit = self.unit.as_ref().and_then(|unit| unit.at(column));
        let unit = unit.map_or(Some(1.0), |unit| si_factor(&unit, quantity)).unwrap_or(1.0);
        let scale = self.scale.as_ref().and_then(|scale| scale.at(column)).unwrap_or(1.0);
        let sign = self.sign.as_ref().and_then(|sign| sign.at(column)).unwrap_or(1.0);
        unit * scale * sign
    }

    /// Inverts the conversion: computes the columns that correspond to these joint values (SI units),
    /// `(joint - offset) / (scale · sign · unit)`, with the names of the columns.
    ///
    /// # Errors
    /// Another number of columns than of joints; a matrix, or a factor of zero.
    pub fn recorded(
        &self,
        quantity: Quantity,
        joints: &[String],
        values: &[Vec<f64>],
    ) -> Result<Vec<(ColumnRef, Vec<f64>)>, FormatError> {
        let key = quantity.key();
        self.validate(quantity, joints)?;
        if self.matrix.is_some() || self.inverse_matrix.is_some() || self.sum.is_some() {
            let problem = "values of the joints are converted to columns by unit, scale, sign and offset only";
            return Err(FormatError::new(
                format!("{key}.matrix"),
                problem,
                "remove the matrix or sum for this command",
            ));
        }
        let columns = self.columns_of(key, joints)?;
        let converted = columns.into_iter().zip(values).enumerate().map(|(joint, (column, values))| {
            let offset = self.offset.as_ref().and_then(|offset| offset.at(joint)).unwrap_or(0.0);
            let factor = self.factor(quantity, joint);
            if factor == 0.0 {
                return Err(FormatError::new(format!("{key}.scale"), "a factor of zero", "give another factor"));
            }
            Ok((column, values.iter().map(|value| (value - offset) / factor).collect()))
        });
        converted.collect()
    }
}

/// Gauss-Jordan inversion with row pivoting; `None` if a pivot is below 1e-12 of the largest entry.
fn inverse(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    if matrix.iter().any(|row| row.len() != n) {
        return None;
    }
    let scale = matrix.iter().flatten().fold(0.0_f64, |max, value| max.max(value.abs()));
    let mut work: Vec<Vec<f64>> = matrix
        .iter()
        .enumerate()
        .map(|(i, row)| row.iter().copied().chain((0..n).map(|j| if i == j { 1.0 } else { 0.0 })).collect())
        .collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|a, b| work[*a][k].abs().total_cmp(&work[*b][k].abs()))?;
        let value = work[pivot][k];
        if value.abs().partial_cmp(&(1e-12 * scale)) != Some(core::cmp::Ordering::Greater) {
            return None;
        }
        work.swap(k, pivot);
        work[k].iter_mut().for_each(|entry| *entry /= value);
        let pivot_row = work[k].clone();
        for (i, row) in work.iter_mut().enumerate() {
            let factor = row[k];
            if i != k && factor != 0.0 {
                row.iter_mut().zip(&pivot_row).for_each(|(entry, pivot)| *entry -= factor * pivot);
            }
        }
    }
    Some(work.into_iter().map(|row| row[n..].to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(toml: &str) -> ChannelGroup {
        toml::from_str(toml).unwrap()
    }

    fn joints(count: usize) -> Vec<String> {
        (0..count).map(|joint| joint.to_string()).collect()
    }

    #[test]
    fn recorded_columns_give_the_values_of_the_joints() {
        let text = "columns = [\"action[a]\", \"action[b]\"]\nunit = [\"deg\", \"rad\"]\nscale = [1.0, 0.02]\nsign = [-1, 1]\noffset = [0.25, -0.5]";
        let group = group(text);
        let values = vec![vec![0.0, 1.5], vec![-0.5, 1.5]];
        let recorded = group.recorded(Quantity::Command, &joints(2), &values).unwrap();
        assert_eq!(recorded[1], (ColumnRef::Name("action[b]".into()), vec![0.0, 100.0]));
        let columns: Vec<Vec<f64>> = recorded.into_iter().map(|(_, values)| values).collect();
        let mut out = vec![Vec::new(); 2];
        Mapping::new(&group, Quantity::Command, &joints(2)).unwrap().apply(&columns, &mut out);
        for (out, value) in out.iter().flatten().zip(values.iter().flatten()) {
            // A division and a multiplication of numbers near one.
            assert!((out - value).abs() < 1e-15, "{out} {value}");
        }
        let coupled = ChannelGroup { matrix: Some(vec![vec![1.0, 0.0], vec![1.0, 1.0]]), ..group };
        let refused = coupled.recorded(Quantity::Command, &joints(2), &values).unwrap_err();
        assert!(refused.to_string().contains("command.matrix"), "{refused}");
    }

    #[test]
    fn inverse_matrix_undoes_the_joint_to_motor_matrix() {
        let group = group("columns = [0, 1]\ninverse_matrix = [[45.0, 0.0], [32.0, 32.0]]\noffset = [0.0, 0.5]");
        let mapping = Mapping::new(&group, Quantity::Position, &joints(2)).unwrap();
        // Joints (0.1, 0.2) turn the motors by (4.5, 9.6).
        let mut out = vec![Vec::new(), Vec::new()];
        mapping.apply(&[vec![4.5], vec![9.6]], &mut out);
        assert!((out[0][0] - 0.1).abs() < 1e-15 && (out[1][0] - 0.7).abs() < 1e-15, "{out:?}");
    }

    #[test]
    fn unit_sign_and_scale_multiply_before_the_offset() {
        let group = group("columns = [0]\nunit = \"deg\"\nsign = -1\nscale = 2.0\noffset = 1.0");
        let mapping = Mapping::new(&group, Quantity::Position, &joints(1)).unwrap();
        let mut out = vec![Vec::new()];
        mapping.apply(&[vec![90.0]], &mut out);
        assert!((out[0][0] - (1.0 - core::f64::consts::PI)).abs() < 1e-15);
    }

    #[test]
    fn a_sum_is_the_torque_of_a_position_controller() {
        let text = "columns = [0, 1, 2, 3, 4, 5]\nsum = [[100.0, 50.0], [-100.0, -50.0], 1.0]\nsign = [1.0, -1.0]";
        let group = group(text);
        group.validate(Quantity::Torque, &joints(2)).unwrap();
        let mapping = Mapping::new(&group, Quantity::Torque, &joints(2)).unwrap();
        let mut out = vec![Vec::new(); 2];
        // Commands, positions and feed-forward of both joints.
        mapping.apply(&[vec![0.5], vec![0.75], vec![0.25], vec![1.0], vec![3.0], vec![-2.0]], &mut out);
        assert_eq!(out, [[100.0 * 0.25 + 3.0], [50.0 * 0.25 + 2.0]]);
        let problem = |text: &str| {
            let group: ChannelGroup = toml::from_str(text).unwrap();
            group.validate(Quantity::Torque, &joints(2)).unwrap_err().to_string()
        };
        assert!(problem("columns = [0, 1, 2]\nsum = [1.0, -1.0]").contains("3 columns for 2 factors"));
        assert!(problem("columns = [0, 1]\nsum = [[1.0]]").contains("torque.sum"));
        assert!(problem("columns = [0, 1]\nsum = [1.0]\nmatrix = [[1.0, 0.0], [0.0, 1.0]]").contains("torque.sum"));
        assert!(problem("columns = [0, 1]\nsum = []").contains("torque.columns"));
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let group = group("columns = [0, 1]\ninverse_matrix = [[1.0, 2.0], [2.0, 4.0]]");
        assert!(Mapping::new(&group, Quantity::Position, &joints(2)).is_err());
    }
}
