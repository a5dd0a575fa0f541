//! Names in code.

/// Maximum length of an identifier; with the suffixes of exported functions it is below the 63 characters of C99 and
/// MATLAB.
pub const IDENTIFIER_LENGTH: usize = 40;

/// Lower-case letters, digits and `_` of a name, starting with a letter, at most [`IDENTIFIER_LENGTH`] characters;
/// `robot` if no letter or digit remains. The result is a prefix of names in code and may be a keyword.
///
/// ```
/// assert_eq!(dynident_text::identifier("2 Arms; import os"), "robot_2_arms__import_os");
/// ```
pub fn identifier(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let mut text: String = name.chars().take(IDENTIFIER_LENGTH).map(safe).collect();
    if !text.chars().any(|c| c.is_ascii_alphanumeric()) {
        "robot".clone_into(&mut text);
    }
    if text.starts_with(|c: char| !c.is_ascii_alphabetic()) {
        text.insert_str(0, "robot_");
        text.truncate(IDENTIFIER_LENGTH);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_identifiers() {
        assert_eq!(identifier("UR10"), "ur10");
        assert_eq!(identifier(""), "robot");
        assert_eq!(identifier("関節"), "robot");
        assert_eq!(identifier("a\nb\u{202e}"), "a_b_");
        assert_eq!(identifier(&"9".repeat(100)).len(), IDENTIFIER_LENGTH);
    }
}
