//! The numbers of a JSON value by their paths: `arm.q[0]`.

use core::fmt::Write;
use serde_json::Value;

/// Calls `found` for each number of `value` with its path; true and false are 1 and 0, null is a missing number.
pub(crate) fn flattened(value: &Value, path: &mut String, found: &mut impl FnMut(&str, f64)) {
    let length = path.len();
    match value {
        Value::Number(number) => found(path, number.as_f64().unwrap_or(f64::NAN)),
        Value::Bool(flag) => found(path, f64::from(u8::from(*flag))),
        Value::Null => found(path, f64::NAN),
        Value::String(_) => {}
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                let _ = write!(path, "[{index}]");
                flattened(item, path, found);
                path.truncate(length);
            }
        }
        Value::Object(entries) => {
            for (key, entry) in entries {
                if length > 0 {
                    path.push('.');
                }
                *path += key;
                flattened(entry, path, found);
                path.truncate(length);
            }
        }
    }
}
