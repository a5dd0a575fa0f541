//! What a number in a study may be, and what is said of one that may not.

pub(super) fn positive(value: f64, key: &str) -> Result<(), String> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(format!("{key} = {value}: give a positive speed")) }
}

pub(super) fn not_negative(value: f64, key: &str) -> Result<(), String> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(format!("{key} = {value}: give 0 or more")) }
}
