//! Columns of one quantity of all joints, with unit, sign, scale and matrix.

use super::column_pattern::expand_for_joints;
use super::units::{Quantity, si_factor, unit_names};
use crate::error::FormatError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A column: its name, or its index from 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "a column is a name in quotes or a 0-based index")]
pub enum ColumnRef {
    /// Index, from 0.
    Index(usize),
    /// Name in the header; may contain a range such as `q{1..7}_rad`, or `{joint}` for the name of each joint.
    Name(String),
}

/// Columns in joint order: a list, or one text with a range such as `"q{1..7}_rad"`, or with the joint names of the
/// study such as `"effort[{joint}]"`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "columns must be a list of names or 0-based indices, or one pattern such as \"q{1..7}_rad\""
)]
pub enum Columns {
    /// One name or pattern.
    Pattern(String),
    /// A list of names, patterns and indices.
    List(Vec<ColumnRef>),
}

/// One common value, or one value for each column (or joint).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(rename = "OneOrMany_{T}"))]
#[serde(untagged, expecting = "give one value for all columns, or a list with one for each")]
pub enum OneOrMany<T> {
    /// The same value for all columns.
    One(T),
    /// One value for each column.
    Many(Vec<T>),
}

impl<T: Clone> OneOrMany<T> {
    /// The value for `index`; `None` if a list is shorter.
    pub fn at(&self, index: usize) -> Option<T> {
        match self {
            Self::One(value) => Some(value.clone()),
            Self::Many(values) => values.get(index).cloned(),
        }
    }

    fn fits(&self, count: usize) -> bool {
        matches!(self, Self::One(_)) || matches!(self, Self::Many(values) if values.len() == count)
    }

    pub(crate) fn values(&self) -> &[T] {
        match self {
            Self::One(value) => core::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

/// The columns of one quantity and their conversion to joint values in SI:
///
/// `joint = M · (scale · sign · unit · column) + offset`
///
/// where `M` is `matrix`, or the inverse of `inverse_matrix`, or the identity. `scale`, `sign` and `unit` are per
/// column; `offset` is per joint and in SI (rad, m, N m, N). With `sum`, a joint has several columns.
///
/// ```
/// let coupled_wrist: dynident_recording::log::ChannelGroup = toml::from_str(
///     r#"
///     file = "motor_angles.csv"
///     columns = "Joint_{1..2}"
///     unit = "deg"
///     inverse_matrix = [[45.0, 0.0], [32.0, 32.0]]
///     offset = [0.0, 1.5707963267948966]
///     "#,
/// )
/// .unwrap();
/// assert!(coupled_wrist.scale.is_none());
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ChannelGroup {
    /// Another file of the same log with the same rows, relative to the folder of the main file. A range or `{joint}`
    /// gives one file for each column: `"axis{1..6}.csv"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// One column for each joint of the study, in the order of the study's joints (any number of columns with a
    /// matrix).
    pub columns: Columns,
    /// Unit of the columns: `rad` `deg` `rev` `m` `mm`; `rad/s` `deg/s` `rpm` ..; `N m` `N` `A` `mA` ..
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<OneOrMany<String>>,
    /// Factor in addition to the unit, for example current gain or gear ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<OneOrMany<f64>>,
    /// +1 or -1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sign: Option<OneOrMany<f64>>,
    /// Offset that is added to the joint value, for each joint, in SI units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<OneOrMany<f64>>,
    /// Matrix of `joint = matrix · columns`: one row for each joint, one entry for each column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Vec<Vec<f64>>>,
    /// Square matrix of `columns = inverse_matrix · joint`, as data sheets state it from joints to motors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inverse_matrix: Option<Vec<Vec<f64>>>,
    /// Factors of a sum of several columns for each joint, each one value or one for each joint; `columns` then lists
    /// the columns of all joints for the first factor, then those for the second, and so on. `scale`, `sign` and
    /// `unit` are per joint and apply to the sum. `columns = ["q_d{1..6}", "q{1..6}"]` with `sum = [90.0, -90.0]` is
    /// the torque of a position controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sum: Option<Vec<OneOrMany<f64>>>,
}

impl ChannelGroup {
    /// Columns with joint values in SI units, in the main file.
    pub fn new(columns: Columns) -> Self {
        Self {
            file: None,
            columns,
            unit: None,
            scale: None,
            sign: None,
            offset: None,
            matrix: None,
            inverse_matrix: None,
            sum: None,
        }
    }

    /// The columns with expanded ranges; a pattern with `{joint}` remains one entry.
    ///
    /// # Errors
    /// If a range is malformed or too long.
    pub fn column_list(&self, key: &str) -> Result<Vec<ColumnRef>, FormatError> {
        self.columns_of(key, &[])
    }

    /// The columns for a study with these joints. If there are several files, one column for each file.
    ///
    /// # Errors
    /// If a range is malformed or too long.
    pub(super) fn columns_of(&self, key: &str, joints: &[String]) -> Result<Vec<ColumnRef>, FormatError> {
        let key = format!("{key}.columns");
        let mut list = Vec::new();
        let expanded =
            |name: &str| expand_for_joints(&key, name, joints).map(|names| names.into_iter().map(ColumnRef::Name));
        match &self.columns {
            Columns::Pattern(pattern) => list.extend(expanded(pattern)?),
            Columns::List(columns) => {
                for column in columns {
                    match column {
                        ColumnRef::Index(index) => list.push(ColumnRef::Index(*index)),
                        ColumnRef::Name(name) => list.extend(expanded(name)?),
                    }
                }
            }
        }
        // The same column is read from several files.
        let files = self.files(&key, joints)?.len();
        if let ([column], true) = (&list[..], files > 1) {
            list = vec![column.clone(); files];
        }
        Ok(list)
    }

    /// The file of each column: one file for all columns, one for each column, or an empty list for the main file.
    ///
    /// # Errors
    /// If a range is malformed or too long.
    pub(super) fn files(&self, key: &str, joints: &[String]) -> Result<Vec<PathBuf>, FormatError> {
        let Some(file) = &self.file else { return Ok(Vec::new()) };
        match file.to_str() {
            Some(name) => Ok(expand_for_joints(key, name, joints)?.into_iter().map(PathBuf::from).collect()),
            None => Ok(vec![file.clone()]),
        }
    }

    pub(super) fn validate(&self, quantity: Quantity, joints: &[String]) -> Result<(), FormatError> {
        let key = quantity.key();
        let columns = self.columns_of(key, joints)?.len();
        let at = |name: &str| format!("{key}.{name}");
        if self.matrix.is_some() && self.inverse_matrix.is_some() {
            return Err(FormatError::new(at("matrix"), "matrix and inverse_matrix are both given", "keep one of them"));
        }
        let files = self.files(&at("file"), joints)?.len();
        if files > 1 && files != columns {
            return Err(wrong_length(key, "file", files, columns, "columns"));
        }
        if let Some(sum) = &self.sum {
            return self.validate_sum(quantity, joints, sum, columns);
        }
        let count_matters = self.matrix.is_none();
        if columns == 0 || (count_matters && columns != joints.len()) {
            return Err(FormatError::new(
                at("columns"),
                format!("{columns} columns for {} joints", joints.len()),
                format!("give one column for each of: {}", joints.join(", ")),
            ));
        }
        self.validate_factors(quantity, columns, joints.len())?;
        if let Some(matrix) = &self.matrix {
            check_matrix(&at("matrix"), matrix, joints.len(), columns)?;
        }
        if let Some(matrix) = &self.inverse_matrix {
            check_matrix(&at("inverse_matrix"), matrix, joints.len(), columns)?;
        }
        Ok(())
    }

    /// Checks the sum of several columns for each joint.
    fn validate_sum(
        &self,
        quantity: Quantity,
        joints: &[String],
        sum: &[OneOrMany<f64>],
        columns: usize,
    ) -> Result<(), FormatError> {
        let key = quantity.key();
        let at = |name: &str| format!("{key}.{name}");
        if self.matrix.is_some() || self.inverse_matrix.is_some() {
            return Err(FormatError::new(at("sum"), "sum and a matrix are both given", "keep one of them"));
        }
        let expected = sum.len() * joints.len();
        if columns != expected || columns == 0 {
            return Err(FormatError::new(
                at("columns"),
                format!("{columns} columns for {} factors of `sum` and {} joints", sum.len(), joints.len()),
                format!("give {expected} columns: those of all joints for the first factor, then for the second"),
            ));
        }
        if let Some(factor) = sum.iter().find(|factor| !factor.fits(joints.len())) {
            return Err(wrong_length(key, "sum", factor.values().len(), joints.len(), "joints"));
        }
        if let Some(value) = sum.iter().flat_map(OneOrMany::values).find(|value| !value.is_finite()) {
            return Err(FormatError::new(at("sum"), format!("{value:?} is not allowed"), "give finite numbers"));
        }
        self.validate_factors(quantity, joints.len(), joints.len())
    }

    /// Checks unit, scale, sign and offset.
    fn validate_factors(&self, quantity: Quantity, columns: usize, joints: usize) -> Result<(), FormatError> {
        let key = quantity.key();
        let at = |name: &str| format!("{key}.{name}");
        if let Some(unit) = &self.unit {
            if !unit.fits(columns) {
                return Err(wrong_length(key, "unit", unit.values().len(), columns, "columns"));
            }
            if let Some(unknown) = unit.values().iter().find(|unit| si_factor(unit, quantity).is_none()) {
                return Err(FormatError::new(
                    at("unit"),
                    format!("`{unknown}` is no unit of {key}"),
                    format!("use one of: {}", unit_names(quantity).join(", ")),
                ));
            }
        }
        for (name, values, expected, what) in [
            ("scale", &self.scale, columns, "columns"),
            ("sign", &self.sign, columns, "columns"),
            ("offset", &self.offset, joints, "joints"),
        ] {
            let Some(values) = values else { continue };
            if !values.fits(expected) {
                return Err(wrong_length(key, name, values.values().len(), expected, what));
            }
            let bad = values.values().iter().find(|value| match name {
                "sign" => value.abs() != 1.0,
                "scale" => !(1e-15..=1e15).contains(&value.abs()),
                _ => value.is_nan() || value.abs() > 1e15,
            });
            if let Some(value) = bad {
                let fix = match name {
                    "sign" => "write 1 or -1",
                    "scale" => "give a factor of 1e-15 to 1e15 in size",
                    _ => "give a number of at most 1e15 in size",
                };
                return Err(FormatError::new(at(name), format!("{value:?} is not allowed"), fix));
            }
        }
        Ok(())
    }
}

fn wrong_length(key: &str, name: &str, found: usize, expected: usize, what: &str) -> FormatError {
    FormatError::new(
        format!("{key}.{name}"),
        format!("{found} entries for {expected} {what}"),
        format!("give one value, or one for each of the {expected} {what}"),
    )
}

fn check_matrix(key: &str, matrix: &[Vec<f64>], rows: usize, columns: usize) -> Result<(), FormatError> {
    if matrix.len() != rows || matrix.iter().any(|row| row.len() != columns) {
        return Err(FormatError::new(
            key,
            format!("not a {rows} x {columns} matrix"),
            "give one row for each joint and one entry in it for each column",
        ));
    }
    if matrix.iter().flatten().any(|value| !value.is_finite()) {
        return Err(FormatError::new(key, "an entry is not finite", "give finite numbers"));
    }
    Ok(())
}
