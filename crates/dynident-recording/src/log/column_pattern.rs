//! Expansion of ranges and joint names in the names of columns and files: `"q{1..7}_rad"`, `"effort[{joint}]"`.

use crate::error::FormatError;

/// Maximum number of columns in a range; it limits the memory.
const MAX_COLUMNS: u64 = 4096;

/// Placeholder for the name of each joint of the study.
const JOINT: &str = "{joint}";

/// As [`expand_pattern`]; `effort[{joint}]` gives one name for each of `joints`, in their order.
pub(crate) fn expand_for_joints(key: &str, pattern: &str, joints: &[String]) -> Result<Vec<String>, FormatError> {
    if pattern.contains(JOINT) && !joints.is_empty() {
        return Ok(joints.iter().map(|joint| pattern.replace(JOINT, joint)).collect());
    }
    expand_pattern(key, pattern)
}

/// Expands `pattern`: `q{1..3}` gives `q1 q2 q3`, `{01..12}` keeps leading zeros, a text without a range is unchanged.
pub(crate) fn expand_pattern(key: &str, pattern: &str) -> Result<Vec<String>, FormatError> {
    let range = pattern.find('{').and_then(|open| {
        let close = open + pattern[open..].find('}')?;
        let (first, last) = pattern[open + 1..close].split_once("..")?;
        Some((open, close, first, last))
    });
    let Some((open, close, first, last)) = range else { return Ok(vec![pattern.to_owned()]) };
    let number = |text: &str| {
        text.parse::<u64>().map_err(|_| {
            FormatError::new(key, format!("`{text}` in `{pattern}` is not a whole number"), "write a range as {1..7}")
        })
    };
    let width = if first.starts_with('0') { first.len() } else { 0 };
    let (first, last) = (number(first)?, number(last)?);
    if last < first || last - first >= MAX_COLUMNS || width > 20 {
        return Err(FormatError::new(
            key,
            format!("the range in `{pattern}` is empty or too long"),
            format!("write {{first..last}} with at most {MAX_COLUMNS} columns"),
        ));
    }
    Ok((first..=last).map(|i| format!("{}{i:0width$}{}", &pattern[..open], &pattern[close + 1..])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_expand_in_order() {
        assert_eq!(expand_pattern("k", "q{1..3}_rad").unwrap(), ["q1_rad", "q2_rad", "q3_rad"]);
        assert_eq!(expand_pattern("k", "{09..10}").unwrap(), ["09", "10"]);
        assert_eq!(expand_pattern("k", "plain {x}").unwrap(), ["plain {x}"]);
        assert_eq!(expand_pattern("k", "a{b").unwrap(), ["a{b"]);
    }

    #[test]
    fn joints_are_named() {
        let joints = ["pan", "lift"].map(str::to_owned);
        assert_eq!(expand_for_joints("k", "x[{joint}]", &joints).unwrap(), ["x[pan]", "x[lift]"]);
        assert_eq!(expand_for_joints("k", "x{1..2}", &joints).unwrap(), ["x1", "x2"]);
    }

    #[test]
    fn absurd_ranges_are_refused() {
        for pattern in ["q{7..1}", "q{1..9999999}", "q{a..b}", "q{1..99999999999999999999}", "q{-1..2}"] {
            assert!(expand_pattern("k", pattern).is_err(), "{pattern}");
        }
    }
}
