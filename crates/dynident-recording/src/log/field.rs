//! The value of a field of a text table: a number, a truth value, a date and time, or an entry of a list.

use super::plain_row::plain_decimal;

/// The number in a field: in the syntax of the standard library, including `nan` and `inf`; 1 and 0 for true and false;
/// seconds for a [date and time](seconds). A decimal comma is read if `comma` allows it.
pub(super) fn number(field: &[u8], comma: bool) -> Option<f64> {
    match plain_decimal(field) {
        Some((value, length)) if length == field.len() => return Some(value),
        _ => {}
    }
    let text = core::str::from_utf8(field).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    match text {
        "true" | "True" | "TRUE" => Some(1.0),
        "false" | "False" | "FALSE" => Some(0.0),
        _ if comma && text.matches(',').count() == 1 && !text.contains('.') => text.replace(',', ".").parse().ok(),
        _ => seconds(text),
    }
}

/// Entry number `place` of a list of `count` numbers such as `[0.1, 0.2]`, `(0.1; 0.2)` or `[0.1 0.2]`.
pub(super) fn entry(field: &[u8], place: usize, count: usize) -> Option<f64> {
    let mut entries = entries(field)?;
    let value = number(entries.nth(place)?, false)?;
    (entries.count() + place + 1 == count).then_some(value)
}

/// Number of entries of a list of numbers; `None` for other fields.
pub(super) fn list_length(field: &[u8]) -> Option<usize> {
    let mut count = 0;
    for entry in entries(field)? {
        number(entry, false)?;
        count += 1;
    }
    (count > 0).then_some(count)
}

fn entries(field: &[u8]) -> Option<impl Iterator<Item = &[u8]>> {
    let ([b'[', inner @ .., b']'] | [b'(', inner @ .., b')']) = field else { return None };
    let between = |byte: &u8| matches!(byte, b',' | b';') || byte.is_ascii_whitespace();
    Some(inner.split(between).filter(|entry| !entry.is_empty()))
}

/// Seconds since 1970 of `2026-01-31 10:00:00.5`, with `T` or a blank, and without a zone, with `Z`, or with `+01:00`;
/// seconds of the day of `10:00:00.5`.
fn seconds(text: &str) -> Option<f64> {
    let Some((date, time)) = text.split_once(['T', ' ']) else { return seconds_of_day(text) };
    let mut parts = date.splitn(3, '-');
    let [year, month, day] =
        [(4, parts.next()?), (2, parts.next()?), (2, parts.next()?)].map(|(count, part)| digits(part, count));
    let (year, month, day) = (year?, month?, day?);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let (time, zone_s) = match (time.strip_suffix('Z'), time.rfind(['+', '-'])) {
        (Some(time), _) => (time, 0.0),
        (None, None) => (time, 0.0),
        (None, Some(at)) => {
            let (hours, minutes) = time[at + 1..].split_once(':')?;
            let zone_s = (digits(hours, 2)? * 60 + digits(minutes, 2)?) as f64 * 60.0;
            (&time[..at], if time[at..].starts_with('-') { -zone_s } else { zone_s })
        }
    };
    Some(86_400.0 * days_since_1970(year, month, day) as f64 + (seconds_of_day(time)? - zone_s))
}

fn seconds_of_day(time: &str) -> Option<f64> {
    let mut parts = time.splitn(3, ':');
    let [hours, minutes] = [digits(parts.next()?, 2)?, digits(parts.next()?, 2)?];
    let seconds = parts.next()?;
    let whole = seconds.split('.').next().unwrap_or_default();
    let is_plain = seconds.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    let is_valid = hours < 24 && minutes < 60 && digits(whole, 2)? <= 60 && is_plain;
    if is_valid { Some((60 * hours + minutes) as f64 * 60.0 + seconds.parse::<f64>().ok()?) } else { None }
}

fn digits(text: &str, count: usize) -> Option<i64> {
    (text.len() == count && text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// Days from 1970-01-01 in the Gregorian calendar. The year starts in March, so that the leap day is its last; the
/// months from March have 153 days in five.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<f64> {
        number(text.as_bytes(), false)
    }

    #[test]
    fn numbers_are_read_as_the_standard_library_does() {
        assert_eq!(read("-0").map(f64::is_sign_negative), Some(true));
        assert_eq!([read("1e5"), read("+1"), read("1.5")], [Some(1e5), Some(1.0), Some(1.5)]);
        assert_eq!([read(""), read("1..2"), read("1,5"), read("RUNNING")], [None; 4]);
        assert_eq!([read("True"), read("false")], [Some(1.0), Some(0.0)]);
        assert_eq!(number(b"-1,5", true), Some(-1.5));
        assert_eq!([number(b"1,000,000", true), number(b"1.000,5", true)], [None; 2]);
    }

    /// Expected values by `datetime.fromisoformat(..).timestamp()` of Python.
    #[test]
    fn dates_are_seconds() {
        for (text, expected) in [
            ("1970-01-01T00:00:00", 0.0),
            ("2026-01-02T10:00:00.004", 1_767_348_000.004),
            ("2024-02-29 23:59:59Z", 1_709_251_199.0),
            ("2000-03-01T00:00:00+01:00", 951_865_200.0),
            ("1969-12-31T23:00:00-01:30", 1_800.0),
            ("2100-03-01 00:00:00", 4_107_542_400.0),
            ("12:00:01.5", 43_201.5),
        ] {
            assert_eq!(read(text), Some(expected), "{text}");
        }
        for text in
            ["2026-13-01T00:00:00", "2026-01-02", "26-01-02T00:00:00", "24:00:00", "1:2:3", "12:00", "T", "12:00:-1"]
        {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn lists_have_entries() {
        assert_eq!(
            [list_length(b"[0.1, -2,3e0]"), list_length(b"(1 2)"), list_length(b"[7]")],
            [Some(3), Some(2), Some(1)]
        );
        for text in ["[]", "[a, 1]", "1, 2", "[1, 2", "[1, 2)"] {
            assert_eq!(list_length(text.as_bytes()), None, "{text}");
        }
        assert_eq!([entry(b"[1, 2]", 1, 2), entry(b"[1, 2]", 1, 3), entry(b"[1, 2]", 0, 1)], [Some(2.0), None, None]);
    }
}
