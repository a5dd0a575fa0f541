//! Text of a result, and the hash that detects an edited or damaged one.

use super::identification::ResultFile;
use core::fmt::Write;
use serde_json::Value;
use sha2::{Digest, Sha256};

pub(super) const HASH_KEY: &str = "provenance.content_sha256";

impl ResultFile {
    /// The text of `result.json`.
    ///
    /// # Errors
    /// As [`dynident_text::json::to_string_pretty`].
    pub fn to_json(&self) -> serde_json::Result<String> {
        Ok(dynident_text::json::to_string_pretty(self)? + "\n")
    }

    /// Stores the hash of the content in `provenance`. Call it after the last change; `timings_s` and
    /// `provenance.command` may change later. Has no effect without provenance.
    pub fn seal(&mut self) {
        // An error is reported when the file is written.
        let hash = serde_json::to_value(&*self).ok().map(|content| content_sha256(&content));
        if let Some(provenance) = &mut self.provenance {
            provenance.content_sha256 = hash;
        }
    }
}

/// SHA-256 of a result's content, independent of the layout of the JSON text. Excludes keys that may differ between
/// equal results.
pub(super) fn content_sha256(result: &Value) -> String {
    let mut content = result.clone();
    if let Some(all) = content.as_object_mut() {
        all.remove("timings_s");
        if let Some(provenance) = all.get_mut("provenance").and_then(Value::as_object_mut) {
            provenance.remove("command");
            provenance.remove("content_sha256");
        }
    }
    Sha256::digest(dynident_text::json::canonical(&content)).iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The hash that is stored in a result.
pub(super) fn stated_sha256(result: &Value) -> Option<&str> {
    result.get("provenance")?.get("content_sha256")?.as_str()
}
