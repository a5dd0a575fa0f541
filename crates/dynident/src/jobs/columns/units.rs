//! Units from the endings of column names.

use super::quantity::Quantity;
use std::borrow::Cow;

/// Ending, unit in the notation of a study, and joint quantity with this unit; longest ending first.
const ENDINGS: [(&str, &str, Option<Quantity>); 56] = [
    ("rad_per_s2", "rad/s^2", Some(Quantity::Acceleration)),
    ("rad_s2", "rad/s^2", Some(Quantity::Acceleration)),
    ("rad/s^2", "rad/s^2", Some(Quantity::Acceleration)),
    ("rad/s2", "rad/s^2", Some(Quantity::Acceleration)),
    ("deg_per_s2", "deg/s^2", Some(Quantity::Acceleration)),
    ("deg_s2", "deg/s^2", Some(Quantity::Acceleration)),
    ("deg/s^2", "deg/s^2", Some(Quantity::Acceleration)),
    ("deg/s2", "deg/s^2", Some(Quantity::Acceleration)),
    ("°/s^2", "deg/s^2", Some(Quantity::Acceleration)),
    ("°/s2", "deg/s^2", Some(Quantity::Acceleration)),
    ("°/s²", "deg/s^2", Some(Quantity::Acceleration)),
    ("rad_per_s", "rad/s", Some(Quantity::Velocity)),
    ("rad_s", "rad/s", Some(Quantity::Velocity)),
    ("rad/s", "rad/s", Some(Quantity::Velocity)),
    ("radps", "rad/s", Some(Quantity::Velocity)),
    ("deg_per_s", "deg/s", Some(Quantity::Velocity)),
    ("deg_s", "deg/s", Some(Quantity::Velocity)),
    ("degps", "deg/s", Some(Quantity::Velocity)),
    ("dps", "deg/s", Some(Quantity::Velocity)),
    ("°/s", "deg/s", Some(Quantity::Velocity)),
    ("deg/s", "deg/s", Some(Quantity::Velocity)),
    ("rpm", "rpm", Some(Quantity::Velocity)),
    ("mm/s", "mm/s", Some(Quantity::Velocity)),
    ("mm_s", "mm/s", Some(Quantity::Velocity)),
    ("m/s", "m/s", Some(Quantity::Velocity)),
    ("mrad", "mrad", Some(Quantity::Position)),
    ("radians", "rad", Some(Quantity::Position)),
    ("rad", "rad", Some(Quantity::Position)),
    ("degrees", "deg", Some(Quantity::Position)),
    ("deg", "deg", Some(Quantity::Position)),
    ("°", "deg", Some(Quantity::Position)),
    ("rev", "rev", Some(Quantity::Position)),
    ("mnm", "mN m", Some(Quantity::Torque)),
    ("mn m", "mN m", Some(Quantity::Torque)),
    ("knm", "kN m", Some(Quantity::Torque)),
    ("kn m", "kN m", Some(Quantity::Torque)),
    ("ncm", "N cm", Some(Quantity::Torque)),
    ("n cm", "N cm", Some(Quantity::Torque)),
    ("nmm", "N mm", Some(Quantity::Torque)),
    ("n mm", "N mm", Some(Quantity::Torque)),
    ("kgf cm", "kgf cm", Some(Quantity::Torque)),
    ("lbf in", "lbf in", Some(Quantity::Torque)),
    ("lbf ft", "lbf ft", Some(Quantity::Torque)),
    ("n m", "N m", Some(Quantity::Torque)),
    ("nm", "N m", Some(Quantity::Torque)),
    ("ma", "mA", Some(Quantity::Current)),
    ("amps", "A", Some(Quantity::Current)),
    ("a", "A", Some(Quantity::Current)),
    // Units that do not belong to a joint quantity.
    ("degc", "degC", None),
    ("mm", "mm", None),
    ("ms", "ms", None),
    ("us", "us", None),
    ("ns", "ns", None),
    ("sec", "s", None),
    ("m", "m", None),
    ("s", "s", None),
];

/// The unit for a column of `quantity`, if its name contains `unit`, which usually belongs to the quantity `of_unit`:
/// a velocity in `deg` is in deg/s. `None` if the unit is not possible for this quantity.
pub(super) fn unit_for(unit: &'static str, of_unit: Option<Quantity>, quantity: Quantity) -> Option<&'static str> {
    if of_unit == Some(quantity) {
        return Some(unit);
    }
    match (quantity, unit) {
        (Quantity::Velocity, "rad") => Some("rad/s"),
        (Quantity::Velocity, "deg") => Some("deg/s"),
        (Quantity::Acceleration, "rad" | "rad/s") => Some("rad/s^2"),
        (Quantity::Acceleration, "deg" | "deg/s") => Some("deg/s^2"),
        _ => None,
    }
}

const FIELDS: [(&str, &str); 8] = [
    (".position", "rad"),
    (".positions", "rad"),
    (".velocity", "rad/s"),
    (".velocities", "rad/s"),
    (".effort", "N m"),
    (".efforts", "N m"),
    (".log_time", "s"),
    (".stamp", "s"),
];

/// Unit in a name: `q1_rad`, `tau_Nm[3]`, `/joint_states.effort[elbow]`.
pub(in crate::jobs) fn unit(name: &str) -> Option<&'static str> {
    let lower = name.to_lowercase();
    // Only ROS topics begin with a slash.
    if name.starts_with('/') {
        let field = indexed(&lower).0;
        if let Some((_, unit)) = FIELDS.iter().find(|(end, _)| field.ends_with(end)) {
            return Some(unit);
        }
    }
    ended(&lower).map(|(_, unit, _)| unit)
}

/// Splits a lower-case name into the part before its unit (with any index in brackets), the unit, and its quantity.
pub(super) fn ended(lower: &str) -> Option<(String, &'static str, Option<Quantity>)> {
    if let Some((before, inside)) = in_brackets(lower)
        // `N·m`, `kgf.cm`.
        && let plain = inside.replace(['·', '⋅', '*', '.'], " ")
        && let Some((_, unit, quantity)) = ENDINGS.iter().find(|(ending, ..)| *ending == inside || *ending == plain)
        // `effort[a]` is the effort of a joint called a, not an effort in A.
        && (inside.len() > 1 || before.ends_with(' ') || !lower.ends_with(']'))
    {
        return Some((before.trim_end().to_owned(), unit, *quantity));
    }
    // In `tau_Nm[3]` and `tau_Nm_3` the unit precedes the index. A letter before a number may be another word.
    let (name, index) = indexed(lower);
    let name = name.trim_end();
    let is_number_of = |ending: &str| index.starts_with('_') && ending.len() == 1;
    let before = |ending: &str| {
        let before = name.strip_suffix(ending).filter(|_| !is_number_of(ending))?;
        (before.ends_with(|c: char| "_ /-".contains(c)) && before.len() > 1).then_some(before)
    };
    let found = ENDINGS.iter().find_map(|(ending, unit, quantity)| Some((before(ending)?, *unit, *quantity)));
    found.map(|(before, unit, quantity)| (format!("{before}{index}"), unit, quantity))
}

/// Splits `time [ms]`, `time (ms)` or `time {ms}` into the part before the brackets and the part in the brackets.
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let pairs = [('[', ']'), ('(', ')'), ('{', '}')];
    let of = |(open, close): (char, char)| name.trim_end().strip_suffix(close)?.rsplit_once(open);
    let (before, inside) = pairs.into_iter().find_map(of)?;
    Some((before, inside.trim()))
}

/// Splits a name before its index: `tau[3]`, `tau_3`.
fn indexed(name: &str) -> (&str, &str) {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match (name.rfind('['), stem.strip_suffix('_')) {
        (Some(at), _) if name.ends_with(']') && at > 0 => name.split_at(at),
        (_, Some(before)) if stem.len() < name.len() => name.split_at(before.len()),
        _ => (name, ""),
    }
}

/// Unit, in seconds, of a column whose name is a time.
pub(in crate::jobs) fn time_unit_s(name: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    let own = lower.rsplit(['.', '/']).next().unwrap_or(&lower);
    let (word, unit) = in_brackets(own).or_else(|| own.rsplit_once('_')).unwrap_or((own, ""));
    let word = word.trim_end();
    let named = |word: &str| {
        matches!(
            word,
            "t" | "time" | "timestamp" | "stamp" | "log_time" | "elapsed" | "seconds" | "secs" | "sec" | "clock"
        )
    };
    match (named(own), named(word), unit) {
        (true, _, _) | (_, true, "s" | "sec") => Some(1.0),
        (_, true, "ms") => Some(1e-3),
        (_, true, "us") => Some(1e-6),
        (_, true, "ns") => Some(1e-9),
        _ => None,
    }
}

/// The name with the unit that the file contains separately: `q1 [deg]`. A name that already contains a unit is not
/// changed.
pub(in crate::jobs) fn with_unit<'a>(name: &'a str, stated: Option<&str>) -> Cow<'a, str> {
    match stated {
        Some(stated) if unit(name).is_none() => {
            let stated = stated.trim_matches(|c: char| "[](){} ".contains(c));
            Cow::Owned(format!("{name} [{stated}]"))
        }
        _ => Cow::Borrowed(name),
    }
}

/// The time column as a value for a study's `time`; `unit` is the unit of its channel.
pub(in crate::jobs) fn time_as_toml(name: &str, unit: Option<&str>) -> String {
    // The name of a column that was found by its values contains no unit.
    let stated = unit
        .filter(|unit| time_unit_s(name).is_none() || *unit == "d")
        .map(|unit| unit.trim_matches(['[', ']', '(', ')']));
    let unit = match (time_unit_s(&with_unit(name, unit)), stated) {
        (Some(1e-3), _) | (None, Some("ms")) => ", unit = \"ms\"",
        (Some(1e-6), _) | (None, Some("us")) => ", unit = \"us\"",
        (Some(1e-9), _) | (None, Some("ns")) => ", unit = \"ns\"",
        (_, Some("d")) => ", scale = 86400.0",
        _ => "",
    };
    format!("{{ column = {}{unit} }}", dynident_text::quoted(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_times_from_names() {
        assert_eq!(unit("q1_rad"), Some("rad"));
        assert_eq!(unit("tau_Nm[3]"), Some("N m"));
        assert_eq!(unit("/joint_states.effort[elbow]"), Some("N m"));
        assert_eq!(unit("alpha"), None);
        assert_eq!(time_unit_s("t_ms"), Some(1e-3));
        assert_eq!(time_unit_s("/arm.header.stamp"), Some(1.0));
        for (name, unit_s) in [("Time [ms]", 1e-3), ("Timestamp (ms)", 1e-3), ("t [s]", 1.0), ("time {us}", 1e-6)] {
            assert_eq!(time_unit_s(name), Some(unit_s), "{name}");
        }
        for (name, expected) in [
            ("J1 torque [Nm]", Some("N m")),
            ("axis 2 act angle (deg)", Some("deg")),
            ("current [A]", Some("A")),
            ("q3[rad]", Some("rad")),
            ("speed {deg/s}", Some("deg/s")),
            // The effort of a joint that is called a.
            ("effort[a]", None),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
        assert_eq!(time_unit_s("tau"), None);
        assert_eq!(time_as_toml("t_us", None), "{ column = \"t_us\", unit = \"us\" }");
        // A unit in a row of units.
        assert_eq!(time_as_toml("t", Some("d")), "{ column = \"t\", scale = 86400.0 }");
        assert_eq!(time_as_toml("t", Some("[ms]")), "{ column = \"t\", unit = \"ms\" }");
        assert_eq!([with_unit("q1", Some("[deg]")), with_unit("q1_rad", Some("deg"))], ["q1 [deg]", "q1_rad"]);
    }
}
