//! Numbers in robot descriptions.

/// Parses a finite number in decimal or exponent notation. The error contains the problem and the fix.
pub(crate) fn parse_number(word: &str) -> Result<f64, (&'static str, &'static str)> {
    const PLAIN: &str = "a plain number such as 0.25";
    if word.contains(',') {
        return Err(("not a number", "a dot for the decimal comma and spaces between numbers"));
    }
    // Rust also accepts `inf` and `nan`, so only digits, signs, decimal points and exponents are allowed.
    let looks_numeric =
        word.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.' | b'e' | b'E'));
    match word.parse::<f64>() {
        Ok(number) if looks_numeric && number.is_finite() => Ok(number),
        Ok(_) => Err(("not finite", "a finite number")),
        Err(_) => Err(("not a number", PLAIN)),
    }
}

/// Shortens a text from a file to at most forty characters, so that a message stays on one line.
pub(crate) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(40).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(40).is_some() {
        short.push('…');
    }
    short
}
