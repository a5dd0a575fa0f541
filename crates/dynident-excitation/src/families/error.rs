//! Errors in the settings of a family.

use thiserror::Error;

/// Reason why a family cannot be created.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FamilyError {
    /// A setting of the trajectory family under `[design.family]` is outside its range. Write a value within the range
    /// that the message names.
    #[error("family {family}, setting {setting} = {value}: {fix}")]
    Setting {
        /// Name of the family.
        family: &'static str,
        /// Name of the setting.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// Valid values.
        fix: &'static str,
    },
    /// The function that a program passed as motion does not give what it promised: for example, velocities that are
    /// not the derivatives of the positions, or values that are not finite. Correct the function.
    #[error("family function `{name}`: {problem}")]
    Function {
        /// Name of the function.
        name: String,
        /// The problem and its fix.
        problem: &'static str,
    },
    /// A list of the trajectory family must have one entry for each joint or parameter. Add or remove entries.
    #[error("family {family}, {what}: expected {expected} entries, found {found}")]
    Length {
        /// Name of the family.
        family: &'static str,
        /// The list.
        what: &'static str,
        /// Expected length.
        expected: usize,
        /// Given length.
        found: usize,
    },
}

/// Maximum number of joints, strokes, harmonics, points and postures; a larger number is a typing error.
pub(crate) const MAX_COUNT: usize = 1000;

pub(crate) fn require(
    ok: bool,
    family: &'static str,
    setting: &'static str,
    value: f64,
    fix: &'static str,
) -> Result<(), FamilyError> {
    if ok { Ok(()) } else { Err(FamilyError::Setting { family, setting, value, fix }) }
}

pub(crate) fn require_frame(family: &'static str, joints: usize, duration_s: f64) -> Result<(), FamilyError> {
    require((1..=MAX_COUNT).contains(&joints), family, "joints", joints as f64, "give between 1 and 1000 joints")?;
    let fix = "give between a millisecond and 1e7 seconds";
    require((1e-3..=1e7).contains(&duration_s), family, "duration_s", duration_s, fix)
}
