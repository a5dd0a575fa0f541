//! Fast parser for rows in the usual notation: numbers with few digits, no blanks, no quotes.
//!
//! [`TextTable`](super::text::TextTable) reads other rows field by field.

use memchr::memchr2;

/// Maximum number of digits that a double represents exactly.
const MAX_DIGITS: usize = 15;
const POWERS: [f64; MAX_DIGITS + 1] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Reads the fields of `line` into `values`. `places` contains for each field its index in `values`, or `None` for a
/// field that is not needed. Returns false if the number of fields differs, or if a field needs the general parser.
pub(super) fn read_plain_row(line: &[u8], delimiter: u8, places: &[Option<usize>], values: &mut [f64]) -> bool {
    let mut rest = line;
    for (field, place) in places.iter().enumerate() {
        let is_last = field + 1 == places.len();
        let ends = |length: usize| match rest.get(length) {
            Some(byte) => *byte == delimiter && !is_last,
            None => is_last,
        };
        let plain = place.and_then(|_| plain_decimal(rest)).filter(|(_, length)| ends(*length));
        let length = if let (Some(place), Some((value, length))) = (place, plain) {
            values[*place] = value;
            length
        } else {
            let length = memchr2(delimiter, b'"', rest).unwrap_or(rest.len());
            if !ends(length) {
                return false;
            }
            if let Some(place) = place {
                let Some(value) = other_number(&rest[..length]) else { return false };
                values[*place] = value;
            }
            length
        };
        rest = rest.get(length + 1..).unwrap_or(&[]);
    }
    true
}

/// Value of a field with an exponent or with more digits; NaN for an empty field.
fn other_number(field: &[u8]) -> Option<f64> {
    let field = field.trim_ascii();
    if field.is_empty() { Some(f64::NAN) } else { core::str::from_utf8(field).ok()?.parse().ok() }
}

/// Reads a number such as `-12.345678` at the start of `text`, and returns it with its length. The digits as an integer
/// below 2⁵³ and the power of ten are both exact, so a single division gives the correctly rounded result.
pub(super) fn plain_decimal(text: &[u8]) -> Option<(f64, usize)> {
    let sign = usize::from(text.first() == Some(&b'-'));
    let digits = &text[sign..];
    let digit = |at: usize| digits.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10);
    let (mut integer, mut count) = (0_u64, 0);
    while let Some(next) = digit(count).filter(|_| count < MAX_DIGITS) {
        integer = 10 * integer + u64::from(next);
        count += 1;
    }
    let whole = count;
    let mut length = whole;
    if digits.get(whole) == Some(&b'.') {
        let eight = digits[whole + 1..].first_chunk().copied().filter(|_| whole + 8 <= MAX_DIGITS);
        if let Some(eight) = eight.and_then(eight_digits) {
            integer = 100_000_000 * integer + eight;
            count += 8;
        }
        while let Some(next) = digit(count + 1).filter(|_| count < MAX_DIGITS) {
            integer = 10 * integer + u64::from(next);
            count += 1;
        }
        length = count + 1;
    }
    // Numbers with more digits need the general parser.
    if count == 0 || digit(length).is_some() {
        return None;
    }
    let value = integer as f64 / POWERS[count - whole];
    Some((if sign == 1 { -value } else { value }, sign + length))
}

/// Parses eight digits at once: first pairs of digits, then groups of four, then all eight. Source: Lemire, Softw.
/// Pract. Exp. 51 (2021) 1700.
fn eight_digits(text: [u8; 8]) -> Option<u64> {
    let bytes = u64::from_le_bytes(text);
    let upper_halves = 0xF0F0_F0F0_F0F0_F0F0;
    let are_digits = bytes & upper_halves == 0x3030_3030_3030_3030
        && bytes.wrapping_add(0x0606_0606_0606_0606) & upper_halves == 0x3030_3030_3030_3030;
    are_digits.then(|| {
        let pairs = (bytes & 0x0F0F_0F0F_0F0F_0F0F).wrapping_mul((10 << 8) + 1) >> 8;
        let fours = (pairs & 0x00FF_00FF_00FF_00FF).wrapping_mul((100 << 16) + 1) >> 16;
        (fours & 0x0000_FFFF_0000_FFFF).wrapping_mul((10_000 << 32) + 1) >> 32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(line: &str, places: &[Option<usize>]) -> Option<Vec<u64>> {
        let mut values = vec![0.0; places.iter().flatten().count()];
        read_plain_row(line.as_bytes(), b',', places, &mut values)
            .then(|| values.into_iter().map(f64::to_bits).collect())
    }

    #[test]
    fn values_equal_those_of_the_standard_library() {
        let mut state = 1_u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let integer = (state >> 3) % 10_u64.pow(1 + (state % 19) as u32);
            let mut text = integer.to_string();
            text.insert((state >> 40) as usize % (text.len() + 1), '.');
            if state & 4 == 0 {
                text.insert(0, '-');
            }
            if state.is_multiple_of(5) {
                text += "e-3";
            }
            let expected = text.parse::<f64>().unwrap().to_bits();
            assert_eq!(row(&text, &[Some(0)]), Some(vec![expected]), "{text}");
            assert_eq!(row(&format!("x,{text},1"), &[None, Some(0), None]), Some(vec![expected]), "{text}");
            let digits = text.bytes().filter(u8::is_ascii_digit).count();
            if digits <= MAX_DIGITS && !text.contains('e') {
                let plain = plain_decimal(text.as_bytes()).map(|(value, length)| (value.to_bits(), length));
                assert_eq!(plain, Some((expected, text.len())), "{text}");
            }
        }
        for text in ["", "-", ".", "-.", "+1", "nan", "1234567890123456", "0.1234567890123456", "--1"] {
            assert_eq!(plain_decimal(text.as_bytes()), None, "{text}");
        }
        assert_eq!(plain_decimal(b"-0,5"), Some((-0.0, 2)));
    }

    #[test]
    fn other_rows_are_left_to_the_general_parser() {
        let places = [Some(0), Some(1)];
        for line in ["1", "1,2,3", "1,\"2\"", "1,0x2", "1;2", "\"1,2", "1,2,", ""] {
            assert_eq!(row(line, &places), None, "{line}");
        }
        let both = |a: f64, b: f64| Some(vec![a.to_bits(), b.to_bits()]);
        assert_eq!(row("1, 2 ", &places), both(1.0, 2.0));
        assert_eq!(row("1.5,", &places), both(1.5, f64::NAN));
        assert_eq!(row("-inf,1e5", &places), both(f64::NEG_INFINITY, 1e5));
    }
}
