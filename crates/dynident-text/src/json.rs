//! Writes JSON without invisible characters.

use crate::invisible::visible;
use serde::Serialize;
use serde_json::Value;
use std::borrow::Cow;

/// A value as one line of JSON. Invisible characters, which `serde_json` does not escape from U+007F on, are escaped;
/// the data are unchanged.
///
/// # Errors
/// As [`serde_json::to_string`].
pub fn to_string(value: &(impl Serialize + ?Sized)) -> Result<String, serde_json::Error> {
    serde_json::to_string(value).map(escaped)
}

/// As [`to_string`], with indentation.
///
/// # Errors
/// As [`serde_json::to_string_pretty`].
pub fn to_string_pretty(value: &(impl Serialize + ?Sized)) -> Result<String, serde_json::Error> {
    serde_json::to_string_pretty(value).map(escaped)
}

/// Canonical text of a JSON document: keys in alphabetical order, no white space. Documents with equal data have equal
/// texts, so that the text can be hashed.
pub fn canonical(value: &Value) -> String {
    let mut out = String::new();
    push_canonical(&mut out, value);
    out
}

fn push_canonical(out: &mut String, value: &Value) {
    match value {
        Value::Array(values) => {
            out.push('[');
            for (place, value) in values.iter().enumerate() {
                out.push_str(if place > 0 { "," } else { "" });
                push_canonical(out, value);
            }
            out.push(']');
        }
        Value::Object(values) => {
            let mut entries: Vec<(&String, &Value)> = values.iter().collect();
            entries.sort_by_key(|(key, _)| *key);
            out.push('{');
            for (place, (key, value)) in entries.into_iter().enumerate() {
                out.push_str(if place > 0 { "," } else { "" });
                out.push_str(&Value::from(key.as_str()).to_string());
                out.push(':');
                push_canonical(out, value);
            }
            out.push('}');
        }
        leaf => out.push_str(&leaf.to_string()),
    }
}

/// Escapes invisible characters. Outside of strings, JSON is ASCII and its only control character is the newline.
fn escaped(text: String) -> String {
    match visible(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(escaped) => escaped,
    }
}

#[cfg(test)]
mod tests {
    use crate::is_invisible;
    use proptest::prelude::*;

    #[test]
    fn layout_and_order_do_not_matter() {
        let of = |text: &str| super::canonical(&serde_json::from_str(text).unwrap());
        let text = of("{\"b\": [1, 1e-05, \"\\u202e\"],\n \"a\": {\"y\": null, \"x\": 2.50}}");
        assert_eq!(text, of("{\"a\":{\"x\":2.5,\"y\":null},\"b\":[1,0.00001,\"\u{202e}\"]}"));
        assert_ne!(text, of("{\"a\":{\"x\":2.5,\"y\":null},\"b\":[1,0.00002,\"\u{202e}\"]}"));
    }

    proptest! {
        #[test]
        fn data_are_the_same(text in any::<String>(), more in "[\u{0}-\u{9f}\u{ad}\u{200b}-\u{206f}\u{e0001}\u{feff}]{0,20}") {
            let value = serde_json::json!({ &text: [&more, 1.5, null] });
            for json in [super::to_string(&value).unwrap(), super::to_string_pretty(&value).unwrap()] {
                prop_assert!(!json.contains(|c| c != '\n' && is_invisible(c)));
                prop_assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap(), value.clone());
            }
        }
    }
}
