//! Time stamps: `2026-11-22T10:30:13Z`.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// First time that RFC 3339 cannot represent, the year 10000, s since 1970.
pub(crate) const END_OF_RFC3339_S: f64 = 253_402_300_800.0;

const UNKNOWN: &str = "unknown (the clock of the computer is not set)";

/// Current time. A clock before 1970 or after the year 9999 is treated as not set.
pub(crate) fn now() -> String {
    utc(SystemTime::now()).unwrap_or_else(|| UNKNOWN.to_owned())
}

/// A time in UTC with a resolution of 1 s; `None` before 1970 and after the year 9999.
pub(crate) fn utc(at: SystemTime) -> Option<String> {
    let since = at.duration_since(UNIX_EPOCH).ok()?;
    // The formatter panics for later times.
    (since.as_secs() < END_OF_RFC3339_S as u64).then(|| humantime::format_rfc3339_seconds(at).to_string())
}

pub(crate) fn utc_of_seconds(seconds: f64) -> Option<String> {
    let since = Duration::try_from_secs_f64(seconds).ok()?;
    utc(UNIX_EPOCH.checked_add(since)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_is_not_set_has_no_text_and_no_panic() {
        let at = |seconds: i64| {
            let distance = Duration::from_secs(seconds.unsigned_abs());
            if seconds < 0 { UNIX_EPOCH - distance } else { UNIX_EPOCH + distance }
        };
        assert_eq!(utc(at(1_700_000_000)).as_deref(), Some("2023-11-14T22:13:20Z"));
        assert_eq!(utc(at(0)).as_deref(), Some("1970-01-01T00:00:00Z"));
        assert_eq!(utc(at(253_402_300_799)).as_deref(), Some("9999-12-31T23:59:59Z"));
        for seconds in [-5_000_000_000, -1, 253_402_300_800, 1 << 50] {
            assert_eq!(utc(at(seconds)), None, "{seconds}");
        }
        for seconds in [-1.0, f64::NAN, f64::INFINITY, 1e300, 253_402_300_800.0] {
            assert_eq!(utc_of_seconds(seconds), None, "{seconds}");
        }
        assert!(now().starts_with('2') || now() == UNKNOWN);
    }
}
