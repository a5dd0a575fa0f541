//! Validation of limits in settings.

use thiserror::Error;

/// A setting of `check` is zero, negative or not finite. Write a positive number.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("limit {name} = {value}: give a finite number above zero")]
pub struct InvalidLimit {
    /// Name of the setting.
    pub name: &'static str,
    /// Value of the setting.
    pub value: f64,
}

/// Checks that all limits are finite and above zero.
pub(crate) fn check_limits(limits: &[(&'static str, f64)]) -> Result<(), InvalidLimit> {
    let invalid = limits.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0));
    invalid.map_or(Ok(()), |&(name, value)| Err(InvalidLimit { name, value }))
}
