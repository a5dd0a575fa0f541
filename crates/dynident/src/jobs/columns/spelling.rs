//! Column names in the notation of a study.

use super::meaning::JointKey;
use dynident_text::quoted;

/// Splits a name into a pattern that several names share and its own part: `q12_rad` into `q{}_rad` and `12`,
/// `tau[elbow]` into `tau[]` and `elbow`.
fn split_pattern(name: &str) -> (String, String) {
    if let Some((open, close)) = name.rfind('[').zip(name.rfind(']')).filter(|(open, close)| open < close) {
        return (format!("{}[{}", &name[..open], &name[close..]), name[open + 1..close].to_owned());
    }
    split_number(name)
}

/// Splits a name at its last number: `a[joint_1.pos]` into `a[joint_{}.pos]` and `1`.
fn split_number(name: &str) -> (String, String) {
    let Some(end) = name.rfind(|c: char| c.is_ascii_digit()) else { return (name.to_owned(), String::new()) };
    let begin = name[..=end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    (format!("{}{{}}{}", &name[..begin], &name[end + 1..]), name[begin..=end].to_owned())
}

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
    // A bare number would be read as a column index, so names are quoted.
    let names: Vec<String> = members.iter().map(|(_, name)| quoted(name)).collect();
    format!("[{}]", names.join(", "))
}

/// Column names in study notation: a pattern if they differ by consecutive numbers, otherwise a list.
pub(in crate::jobs) fn column_list(names: &[String]) -> String {
    for split in [split_number, split_pattern] {
        let parts: Vec<(String, String)> = names.iter().map(|name| split(name)).collect();
        if parts.windows(2).all(|pair| pair[0].0 == pair[1].0) {
            let members: Vec<_> = parts.into_iter().zip(names).map(|((_, own), name)| (own, name.clone())).collect();
            return columns(&members);
        }
    }
    format!("[{}]", names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", "))
}

/// One pattern for columns that differ only in the names of their joints, such as `effort[{joint}]`; `None` for
/// others.
pub(in crate::jobs) fn joint_pattern(columns: &[(JointKey, String)]) -> Option<String> {
    let pattern = |(key, name): &(JointKey, String)| {
        let JointKey::Name(joint) = key else { return None };
        let at = name.to_ascii_lowercase().rfind(joint.as_str())?;
        Some(format!("{}{{joint}}{}", &name[..at], &name[at + joint.len()..]))
    };
    let first = pattern(columns.first()?)?;
    columns.iter().all(|column| pattern(column).as_ref() == Some(&first)).then_some(first)
}

/// Names of columns for a message: consecutive numbers become one pattern; at most `most` entries.
pub(in crate::jobs) fn shown(names: &[String], most: usize) -> String {
    let mut parts: Vec<(String, Vec<String>)> = Vec::new();
    for name in names {
        let (pattern, own) = split_pattern(name);
        match parts.iter_mut().find(|(known, _)| !own.is_empty() && *known == pattern) {
            Some((_, owns)) => owns.push(own),
            None => parts.push((pattern, vec![own])),
        }
    }
    let one = |(pattern, owns): &(String, Vec<String>)| {
        let own = match &owns[..] {
            [first, .., last] => format!("{{{first}..{last}}}"),
            [own] => own.clone(),
            [] => String::new(),
        };
        // A pattern has empty brackets instead of the part that varies.
        if pattern.contains("{}") {
            pattern.replacen("{}", &own, 1)
        } else {
            pattern.replacen("[]", &format!("[{own}]"), 1)
        }
    };
    let list: Vec<String> = parts.iter().take(most).map(one).collect();
    let more = if parts.len() > most { format!(" and {} more kinds", parts.len() - most) } else { String::new() };
    format!("{}{more}", list.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn running_numbers_become_a_pattern() {
        assert_eq!(split_pattern("q12_rad"), ("q{}_rad".to_owned(), "12".to_owned()));
        assert_eq!(split_pattern("/a.position[elbow]"), ("/a.position[]".to_owned(), "elbow".to_owned()));
        assert_eq!(split_pattern("7"), ("{}".to_owned(), "7".to_owned()));
        let list = |names: &[&str]| column_list(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(list(&["q1_rad", "q2_rad"]), "\"q{1..2}_rad\"");
        assert_eq!(list(&["q[0]", "q[1]"]), "\"q[{0..1}]\"");
        assert_eq!(list(&["x[left_1.pos]", "x[left_2.pos]"]), "\"x[left_{1..2}.pos]\"");
        assert_eq!(list(&["x[j_2]", "x[j_1]"]), "[\"x[j_2]\", \"x[j_1]\"]");
        assert_eq!(list(&["x[pan]", "x[lift]"]), "[\"x[pan]\", \"x[lift]\"]");
    }

    #[test]
    fn columns_of_one_kind_are_shown_once() {
        let names = ["t", "q1", "q2", "q3", "/a.effort[pan]", "/a.effort[lift]", "speed"].map(str::to_owned);
        assert_eq!(shown(&names, 9), "t, q{1..3}, /a.effort[{pan..lift}], speed");
        assert_eq!(shown(&names, 2), "t, q{1..3} and 2 more kinds");
    }

    #[test]
    fn names_of_joints_become_a_pattern() {
        let column = |joint: &str, name: &str| (JointKey::Name(joint.to_owned()), name.to_owned());
        let columns = [column("elbow", "/js.effort[Elbow]"), column("a1", "/js.effort[A1]")];
        assert_eq!(joint_pattern(&columns).as_deref(), Some("/js.effort[{joint}]"));
        assert_eq!(joint_pattern(&[column("elbow", "elbow.pos"), column("a1", "effort[a1]")]), None);
        assert_eq!(joint_pattern(&[(JointKey::Number(1), "q1".to_owned())]), None);
    }
}
