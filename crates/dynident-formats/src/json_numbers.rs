//! The numbers of a JSON value by their paths: `arm.q[0]`, or `arm.q[elbow]` for a message that contains names.

use core::fmt::Write;
use serde_json::Value;

/// Calls `found` for each number of `value` with its path; true and false are 1 and 0, null is a missing number.
pub(crate) fn flattened(value: &Value, path: &mut String, found: &mut impl FnMut(&str, f64)) {
    add(value, path, None, found);
}

/// Like [`flattened`], but for a message: the entries of its arrays are named by the array of texts in the same
/// object.
pub(crate) fn flattened_message(value: &Value, path: &mut String, found: &mut impl FnMut(&str, f64)) {
    add(value, path, Some(&[]), found);
}

/// Names for the entries of the arrays in `entries`, if there are any.
fn names(entries: &serde_json::Map<String, Value>) -> Option<&[Value]> {
    let is_names = |key: &str| key == "name" || key == "names" || key.ends_with("_names");
    let lists = entries.iter().filter(|(key, _)| is_names(key)).filter_map(|(_, value)| value.as_array());
    let are_distinct =
        |list: &[Value]| list.iter().enumerate().all(|(at, name)| name.is_string() && !list[..at].contains(name));
    lists.into_iter().find(|list| !list.is_empty() && are_distinct(list)).map(Vec::as_slice)
}

/// Adds the numbers of `value`; `labels` are the names of entries, `None` without names.
fn add(value: &Value, path: &mut String, labels: Option<&[Value]>, found: &mut impl FnMut(&str, f64)) {
    let length = path.len();
    match value {
        Value::Number(number) => found(path, number.as_f64().unwrap_or(f64::NAN)),
        Value::Bool(flag) => found(path, f64::from(u8::from(*flag))),
        Value::Null => found(path, f64::NAN),
        Value::String(_) => {}
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                let own = labels.filter(|labels| labels.len() == items.len());
                let _ = match own.and_then(|labels| labels[index].as_str()) {
                    Some(label) => write!(path, "[{label}]"),
                    None => write!(path, "[{index}]"),
                };
                add(item, path, labels.map(|_| &[][..]), found);
                path.truncate(length);
            }
        }
        Value::Object(entries) => {
            let labels = labels.map(|outer| names(entries).unwrap_or(outer));
            for (key, entry) in entries {
                if length > 0 {
                    path.push('.');
                }
                *path += key;
                add(entry, path, labels, found);
                path.truncate(length);
            }
        }
    }
}
