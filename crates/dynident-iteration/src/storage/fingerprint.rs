//! Fingerprint of the inputs of an iteration as text: a hash of all inputs, then one hash per table of the settings.

/// Describes that runs or a trajectory with the fingerprint `there` were made with other settings than `here`, and
/// names the tables that differ. A fingerprint is the hash of all inputs, followed by `name:hash` for each table.
///
/// ```
/// let words = dynident_iteration::other_settings("1 design:7 robot:3", "2 design:8 robot:3");
/// assert!(words.contains("([design] differs)"));
/// ```
#[must_use]
pub fn other_settings(there: &str, here: &str) -> String {
    let tables = |text: &str| -> Vec<(String, String)> {
        let parts = text.split(' ').filter_map(|part| part.split_once(':'));
        parts.map(|(name, number)| (name.to_owned(), number.to_owned())).collect()
    };
    let (there, here) = (tables(there), tables(here));
    let of = |all: &[(String, String)], name: &str| all.iter().find(|own| own.0 == name).map(|own| own.1.clone());
    let mut names: Vec<&String> = there.iter().chain(&here).map(|(name, _)| name).collect();
    names.sort();
    names.dedup();
    let differs = |name: &&&String| of(&there, name) != of(&here, name);
    let other: Vec<String> = names.iter().filter(differs).map(|name| format!("[{name}]")).collect();
    let which = match other.len() {
        _ if there.is_empty() || here.is_empty() => String::new(),
        0 => String::new(),
        1 => format!(" ({} differs)", other[0]),
        _ => format!(" ({} differ)", other.join(", ")),
    };
    format!(
        "belongs to an iteration with other settings{which}: change them back, take --fresh, which removes its runs and \
         makes all anew, or give another --out"
    )
}
