//! The value in a field of a text table: a number, a truth value, a date and time, or an entry of a list.

use super::plain_row::plain_decimal;

/// The number in a field. Accepted are the syntax of the standard library, including `nan` and `inf`, and that of
/// Fortran (`1.5D-3`); true and false (1 and 0); a [date and time](seconds) and `0.5 sec` (seconds). A decimal comma is
/// accepted if `comma` is true.
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
        _ if comma && text.matches(',').count() == 1 && !text.contains('.') => {
            text.replace(',', ".").parse().ok().or_else(|| seconds(text))
        }
        _ => fortran(text).or_else(|| text.strip_suffix(" sec")?.parse().ok()).or_else(|| seconds(text)),
    }
}

/// A number in double precision as Fortran writes it: `-0.15D+01`.
fn fortran(text: &str) -> Option<f64> {
    let is_number = |byte: u8| byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.' | b'D' | b'd');
    text.bytes().all(is_number).then(|| text.replace(['D', 'd'], "e").parse().ok())?
}

/// Entry with the index `place` in a list of `count` numbers such as `[0.1, 0.2]`, `(0.1; 0.2)` or `[0.1 0.2]`.
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

/// Seconds since 1970 for `2026-01-31 10:00:00.5`, with `T` or a blank, and without a time zone, with `Z`, or with
/// `+01:00`; also for the other [notations of the date](days). Seconds of the day for `10:00:00.5` or `10:00:00.5 PM`.
fn seconds(text: &str) -> Option<f64> {
    let Some((date, time)) = text.split_once(['T', ' ']) else { return seconds_of_day(text) };
    let Some(days) = days(date) else { return seconds_of_day(text) };
    let (time, zone_s) = match (time.strip_suffix('Z'), time.rfind(['+', '-'])) {
        (Some(time), _) => (time, 0.0),
        (None, None) => (time, 0.0),
        (None, Some(at)) => {
            let (hours, minutes) = time[at + 1..].split_once(':')?;
            let zone_s = (digits(hours, 2)? * 60 + digits(minutes, 2)?) as f64 * 60.0;
            (&time[..at], if time[at..].starts_with('-') { -zone_s } else { zone_s })
        }
    };
    // Basic format of ISO 8601, for example `100000.5`.
    let of_day_s = match (time.get(..2), time.get(2..4), time.get(4..)) {
        (Some(hours), Some(minutes), Some(rest)) if !time.contains(':') => {
            seconds_of_day(&format!("{hours}:{minutes}:{rest}"))?
        }
        _ => seconds_of_day(time)?,
    };
    Some(86_400.0 * days as f64 + (of_day_s - zone_s))
}

/// Days since 1970 for `2026-01-31`, `20260131`, `2026/1/31`, `31.1.2026` and `1/31/2026`. In the last notation, the
/// first number is the day if it is above 12.
fn days(date: &str) -> Option<i64> {
    let short = |text: &str| (text.len() <= 2).then(|| digits(text, text.len()))?;
    let parts = |separator: char| date.split(separator).collect::<Vec<&str>>();
    let (year, month, day) = match (&parts('-')[..], &parts('.')[..], &parts('/')[..]) {
        ([year, month, day], ..) => (digits(year, 4)?, digits(month, 2)?, digits(day, 2)?),
        (_, [day, month, year], _) => (digits(year, 4)?, short(month)?, short(day)?),
        (_, _, [year, month, day]) if year.len() == 4 => (digits(year, 4)?, short(month)?, short(day)?),
        (_, _, [first, second, year]) => {
            let (first, second) = (short(first)?, short(second)?);
            let (month, day) = if first > 12 { (second, first) } else { (first, second) };
            (digits(year, 4)?, month, day)
        }
        _ => {
            let all = digits(date, 8)?;
            (all / 10_000, all / 100 % 100, all % 100)
        }
    };
    let is_valid = (1..=12).contains(&month) && (1..=31).contains(&day);
    is_valid.then(|| days_since_1970(year, month, day))
}

fn seconds_of_day(time: &str) -> Option<f64> {
    let half = time.len().checked_sub(3).and_then(|at| Some((time.get(..at)?, time.get(at..)?)));
    let (time, noon_h) = match half {
        Some((time, half)) if half.eq_ignore_ascii_case(" am") => (time, Some(0)),
        Some((time, half)) if half.eq_ignore_ascii_case(" pm") => (time, Some(12)),
        _ => (time, None),
    };
    let mut parts = time.splitn(3, ':');
    let (hours, minutes, seconds) = (parts.next()?, digits(parts.next()?, 2)?, parts.next()?);
    let hours = match noon_h {
        Some(noon_h) => digits(hours, hours.len()).filter(|hours| (1..=12).contains(hours))? % 12 + noon_h,
        None => digits(hours, 2)?,
    };
    let whole = seconds.split(['.', ',']).next().unwrap_or_default();
    let is_plain = seconds.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b','));
    let is_valid = hours < 24 && minutes < 60 && digits(whole, 2)? <= 60 && is_plain;
    let seconds: f64 = seconds.replace(',', ".").parse().ok()?;
    is_valid.then_some((60 * hours + minutes) as f64 * 60.0 + seconds)
}

fn digits(text: &str, count: usize) -> Option<i64> {
    (text.len() == count && text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// Days since 1970-01-01 in the Gregorian calendar. The year is taken to start in March, so that the leap day is its
/// last day; from March on, five months have 153 days.
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
        assert_eq!(
            [read("-0.15D+01"), read("2d3"), read("D"), read("0.008 sec")],
            [Some(-1.5), Some(2e3), None, Some(0.008)]
        );
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
            ("12:00:01,5", 43_201.5),
            ("05.03.2024 12:00:00,004", 1_709_640_000.004),
            ("3/5/2024 12:00:00.004 PM", 1_709_640_000.004),
            ("3/5/2024 1:00:00 AM", 1_709_600_400.0),
            ("31/12/1969 23:59:59", -1.0),
            ("2024/3/5 12:00:00", 1_709_640_000.0),
            ("20240305T120000.5Z", 1_709_640_000.5),
            ("12:30:00 am", 1_800.0),
        ] {
            assert_eq!(read(text), Some(expected), "{text}");
        }
        for text in [
            "2026-13-01T00:00:00",
            "2026-01-02",
            "26-01-02T00:00:00",
            "24:00:00",
            "1:2:3",
            "12:00",
            "T",
            "12:00:-1",
            "13:00:00 PM",
            "1.2.3 4",
        ] {
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
