//! What can be wrong with the settings of a family.

use thiserror::Error;

/// Why a family could not be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FamilyError {
    /// A setting has no meaning or asks for no motion.
    #[error("family {family}, setting {setting} = {value}: {fix}")]
    Setting {
        /// The family.
        family: &'static str,
        /// The setting's name.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What would do.
        fix: &'static str,
    },
    /// A caller's own family that is not what it says it is.
    #[error("family function `{name}`: {problem}")]
    Function {
        /// Its name.
        name: String,
        /// What is wrong, and what to do.
        problem: &'static str,
    },
    /// A list has the wrong number of entries.
    #[error("family {family}, {what}: expected {expected} entries, found {found}")]
    Length {
        /// The family.
        family: &'static str,
        /// Which list.
        what: &'static str,
        /// Entries needed.
        expected: usize,
        /// Entries given.
        found: usize,
    },
}

/// The largest number of joints, strokes, harmonics, points and postures accepted: more is a slip of the keyboard, not
/// a robot.
pub(crate) const MOST: usize = 1000;

/// Passes if `ok`, else says what is wrong with the setting.
pub(crate) fn require(
    ok: bool,
    family: &'static str,
    setting: &'static str,
    value: f64,
    fix: &'static str,
) -> Result<(), FamilyError> {
    if ok { Ok(()) } else { Err(FamilyError::Setting { family, setting, value, fix }) }
}

/// The checks that all families share: some joints, and a duration with which rates can be computed.
pub(crate) fn require_frame(family: &'static str, joints: usize, duration_s: f64) -> Result<(), FamilyError> {
    require((1..=MOST).contains(&joints), family, "joints", joints as f64, "give between 1 and 1000 joints")?;
    let fix = "give between a millisecond and 1e7 seconds";
    require((1e-3..=1e7).contains(&duration_s), family, "duration_s", duration_s, fix)
}
