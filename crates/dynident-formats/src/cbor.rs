//! Messages in CBOR (RFC 8949) as JSON values: maps with names, lists, numbers, texts.

use serde_json::Value;

const MAX_NESTING: usize = 16;

/// The value of a message; numbers that are not finite are null.
///
/// # Errors
/// The problem of the message.
pub(crate) fn value(message: &[u8]) -> Result<Value, String> {
    ciborium::de::from_reader_with_recursion_limit(message, MAX_NESTING)
        .map_err(|error| format!("it is not CBOR with names ({error})"))
}

#[cfg(test)]
mod tests {
    use super::value;

    /// Examples of RFC 8949, appendix A.
    #[test]
    fn values_are_those_of_the_standard() {
        for (bytes, expected) in [
            (&b"\xa2\x61a\x01\x61b\x82\x02\x03"[..], r#"{"a":1,"b":[2,3]}"#),
            (b"\x9f\x01\x82\x02\x03\x9f\x04\x05\xff\xff", "[1,[2,3],[4,5]]"),
            (b"\xbf\x61a\xf5\x61b\x20\xff", r#"{"a":true,"b":-1}"#),
            (b"\xfb\xc0\x10\x66\x66\x66\x66\x66\x66", "-4.1"),
            (b"\xf9\x3e\x00", "1.5"),
            (b"\xf9\x7c\x00", "null"),
        ] {
            assert_eq!(value(bytes).unwrap().to_string(), expected);
        }
        for broken in [&b""[..], b"\x82\x01", b"\xa1\x61", &[0x81; 100], b"\x9b\xff\xff\xff\xff\xff\xff\xff\xff"] {
            assert!(value(broken).is_err(), "{broken:?}");
        }
    }
}
