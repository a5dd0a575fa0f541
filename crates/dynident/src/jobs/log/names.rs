//! What names of columns tell: units, times, joints.

use crate::result::LogContents;
use core::fmt::Write;

/// Endings of names and their units, as studies write them.
const ENDINGS: [(&str, &str); 17] = [
    ("rad/s", "rad/s"),
    ("rad_s", "rad/s"),
    ("radps", "rad/s"),
    ("rad", "rad"),
    ("deg/s", "deg/s"),
    ("deg", "deg"),
    ("nm", "N m"),
    ("rpm", "rpm"),
    ("degc", "degC"),
    ("ma", "mA"),
    ("a", "A"),
    ("mm", "mm"),
    ("m", "m"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
    ("s", "s"),
];

/// Fields of ROS messages that hold joints, and their units (REP 103).
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

/// The unit that a name says: `q1_rad`, `tau_Nm[3]`, `/joint_states.effort[elbow]`.
pub(super) fn unit(name: &str) -> Option<&'static str> {
    let (stem, _) = parted(name);
    let lower = stem.to_lowercase();
    // Only ROS topics begin with a stroke.
    if name.starts_with('/')
        && let Some((_, unit)) = FIELDS.iter().find(|(field, _)| lower.trim_end_matches("[]").ends_with(field))
    {
        return Some(unit);
    }
    let ends = |ending: &str| {
        lower.trim_end_matches("[]").strip_suffix(ending).is_some_and(|before| before.ends_with(['_', ' ', '(', '[']))
    };
    ENDINGS.iter().find(|(ending, _)| ends(ending)).map(|(_, unit)| *unit)
}

/// The unit in seconds of a column that is a time by its name.
pub(in crate::jobs) fn time_unit_s(name: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    let own = lower.rsplit(['.', '/']).next().unwrap_or(&lower);
    let (word, unit) = own.rsplit_once('_').unwrap_or((own, ""));
    let named = |word: &str| matches!(word, "t" | "time" | "timestamp" | "stamp" | "log_time" | "elapsed" | "seconds");
    match (named(own), named(word), unit) {
        (true, _, _) | (_, true, "s" | "sec") => Some(1.0),
        (_, true, "ms") => Some(1e-3),
        (_, true, "us") => Some(1e-6),
        (_, true, "ns") => Some(1e-9),
        _ => None,
    }
}

/// A name as what its siblings share and what is its own: `q12_rad` is `q{}_rad` and `12`, `tau[elbow]` is `tau[]` and
/// `elbow`.
fn parted(name: &str) -> (String, String) {
    if let Some((open, close)) = name.rfind('[').zip(name.rfind(']')).filter(|(open, close)| open < close) {
        return (format!("{}[{}", &name[..open], &name[close..]), name[open + 1..close].to_owned());
    }
    let Some(end) = name.rfind(|c: char| c.is_ascii_digit()) else { return (name.to_owned(), String::new()) };
    let begin = name[..=end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    (format!("{}{{}}{}", &name[..begin], &name[end + 1..]), name[begin..=end].to_owned())
}

const POSITIONS: [&str; 9] =
    ["q", "pos", "position", "positions", "angle", "joint_pos", "joint_position", "actual_q", "state"];
const TORQUES: [&str; 8] = ["tau", "torque", "torques", "effort", "efforts", "current", "currents", "moment"];

/// Whether the shared part of a name is one of `words`: as a whole, or between signs.
fn says(stem: &str, words: &[&str]) -> bool {
    let lower = stem.to_lowercase();
    let parts = || lower.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty());
    // Desired, commanded and erroneous values are not what was measured.
    if parts().any(|part| {
        matches!(part, "desired" | "reference" | "command" | "cmd" | "target" | "error" | "ref" | "dq" | "ddq")
    }) {
        return false;
    }
    parts().any(|part| words.contains(&part))
}

/// Columns of a group that share a name but for their own part, in order.
struct Family {
    group: usize,
    stem: String,
    /// Own part and whole name of each.
    members: Vec<(String, String)>,
}

/// A beginning of a study's `[format]`.
pub(super) fn study_format(found: &LogContents) -> String {
    let mut families: Vec<Family> = Vec::new();
    for channel in &found.channels {
        let (stem, own) = parted(&channel.name);
        let member = (own, channel.name.clone());
        match families.iter_mut().find(|family| family.group == channel.group && family.stem == stem) {
            Some(family) => family.members.push(member),
            None => families.push(Family { group: channel.group, stem, members: vec![member] }),
        }
    }
    let family = |words: &[&str]| {
        // The most joints; of several the first.
        families.iter().filter(|family| says(&family.stem, words)).rev().max_by_key(|family| family.members.len())
    };
    let (position, torque) = (family(&POSITIONS), family(&TORQUES));
    let group = position.or(torque).map_or(0, |family| family.group);
    let mut text = "[format]\n".to_owned();
    match found.groups.get(group).and_then(|group| group.time.as_ref()) {
        Some(time) => {
            let unit = time_unit_s(time).map_or("", |unit| match unit {
                1e-3 => ", unit = \"ms\"",
                1e-6 => ", unit = \"us\"",
                1e-9 => ", unit = \"ns\"",
                _ => "",
            });
            let _ = writeln!(text, "time = {{ column = {}{unit} }}", quoted(time));
        }
        None => text += "rate_hz = 0.0  # no column of time was recognised: give its rate, or time = { column = .. }\n",
    }
    for (key, family) in [("position", position), ("torque", torque)] {
        let Some(Family { members, .. }) = family else {
            let _ = writeln!(text, "{key} = {{ columns = [] }}  # not recognised by name: which columns?");
            continue;
        };
        let unit = unit(&members[0].1).filter(|unit| !matches!((key, *unit), ("position", "rad") | ("torque", "N m")));
        let unit = unit.map_or(String::new(), |unit| format!(", unit = \"{unit}\""));
        let _ = writeln!(text, "{key} = {{ columns = {}{unit} }}", columns(members));
    }
    text
}

/// Columns as a study writes them: a pattern with a range, or their names.
fn columns(members: &[(String, String)]) -> String {
    let numbers: Option<Vec<u64>> = members.iter().map(|(own, _)| own.parse().ok()).collect();
    if let Some(numbers) = numbers
        && members.len() > 1
        && numbers.windows(2).all(|pair| pair[1] == pair[0] + 1)
        && members[0].0 == numbers[0].to_string()
    {
        let (first, last) = (&members[0], &members[members.len() - 1]);
        let at = first.1.rfind(first.0.as_str()).unwrap_or(0);
        let (before, after) = (&first.1[..at], &first.1[at + first.0.len()..]);
        if !before.contains('{') {
            return quoted(&format!("{before}{{{}..{}}}{after}", first.0, last.0));
        }
    }
    // A number is an index only where columns have no names; in quotes it is a name.
    let names: Vec<String> = members.iter().map(|(_, name)| quoted(name)).collect();
    format!("[{}]", names.join(", "))
}

/// Names of columns as a study writes them: a pattern where they differ by a running number, else a list.
pub(in crate::jobs) fn column_list(names: &[String]) -> String {
    let parts: Vec<(String, String)> = names.iter().map(|name| parted(name)).collect();
    if parts.windows(2).all(|pair| pair[0].0 == pair[1].0) {
        let members: Vec<_> = parts.into_iter().zip(names).map(|((_, own), name)| (own, name.clone())).collect();
        return columns(&members);
    }
    format!("[{}]", names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", "))
}

/// A text in quotes, as TOML has it.
pub(in crate::jobs) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_units_times_and_families() {
        assert_eq!(unit("q1_rad"), Some("rad"));
        assert_eq!(unit("tau_Nm[3]"), Some("N m"));
        assert_eq!(unit("/joint_states.effort[elbow]"), Some("N m"));
        assert_eq!(unit("alpha"), None);
        assert_eq!(time_unit_s("t_ms"), Some(1e-3));
        assert_eq!(time_unit_s("/arm.header.stamp"), Some(1.0));
        assert_eq!(time_unit_s("tau"), None);
        assert_eq!(parted("q12_rad"), ("q{}_rad".to_owned(), "12".to_owned()));
        assert_eq!(parted("/a.position[elbow]"), ("/a.position[]".to_owned(), "elbow".to_owned()));
        assert_eq!(parted("7"), ("{}".to_owned(), "7".to_owned()));
        let members =
            |names: &[&str]| names.iter().map(|name| (parted(name).1, (*name).to_owned())).collect::<Vec<_>>();
        assert_eq!(columns(&members(&["q1_rad", "q2_rad"])), "\"q{1..2}_rad\"");
        assert_eq!(columns(&members(&["q[0]", "q[1]"])), "\"q[{0..1}]\"");
        assert_eq!(columns(&members(&["x[pan]", "x[lift]"])), "[\"x[pan]\", \"x[lift]\"]");
    }
}
