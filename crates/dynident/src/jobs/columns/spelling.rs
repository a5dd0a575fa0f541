//! Column names in the notation of a study.

use dynident_text::quoted;

/// Splits a name into a common pattern and its own part: `q12_rad` into `q{}_rad` and `12`, `tau[elbow]` into `tau[]`
/// and `elbow`.
fn split_pattern(name: &str) -> (String, String) {
    if let Some((open, close)) = name.rfind('[').zip(name.rfind(']')).filter(|(open, close)| open < close) {
        return (format!("{}[{}", &name[..open], &name[close..]), name[open + 1..close].to_owned());
    }
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
    // A bare number would be a column index, so names are quoted.
    let names: Vec<String> = members.iter().map(|(_, name)| quoted(name)).collect();
    format!("[{}]", names.join(", "))
}

/// Column names in study notation: a pattern if they differ by consecutive numbers, otherwise a list.
pub(in crate::jobs) fn column_list(names: &[String]) -> String {
    let parts: Vec<(String, String)> = names.iter().map(|name| split_pattern(name)).collect();
    if parts.windows(2).all(|pair| pair[0].0 == pair[1].0) {
        let members: Vec<_> = parts.into_iter().zip(names).map(|((_, own), name)| (own, name.clone())).collect();
        return columns(&members);
    }
    format!("[{}]", names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", "))
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
        assert_eq!(list(&["x[pan]", "x[lift]"]), "[\"x[pan]\", \"x[lift]\"]");
    }
}
