use core::fmt::Write;
use dynident_text::json;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sha2::{Digest, Sha256};

const KEY: &str = "content_sha256";

#[derive(Serialize)]
struct Sealed<'a, T> {
    #[serde(flatten)]
    file: &'a T,
    content_sha256: String,
}

pub(crate) fn sealed_json<T: Serialize>(file: &T) -> Result<String, serde_json::Error> {
    let content_sha256 = content_sha256(&serde_json::to_value(file)?);
    json::to_string_pretty(&Sealed { file, content_sha256 })
}

/// Reads the output of [`sealed_json`]. Files of earlier versions have no hash.
pub(crate) fn unsealed<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let file = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let mut content: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let stated = content.as_object_mut().and_then(|all| all.remove(KEY));
    if stated.is_some_and(|stated| stated != content_sha256(&content)) {
        return Err(format!("its content does not match {KEY}: it was edited or damaged"));
    }
    Ok(file)
}

fn content_sha256(content: &Value) -> String {
    Sha256::digest(json::canonical(content)).iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edited_file_is_not_read() {
        let file = serde_json::json!({ "run": 1, "values": [1.5e-7, -0.0, 3.0], "name": "a\u{202e}" });
        let text = sealed_json(&file).unwrap();
        let read = |text: &str| unsealed::<Value>(text).map(|read| read["values"].clone());
        assert_eq!(read(&text).unwrap(), file["values"]);
        assert!(read(&text.replace("1.5e-7", "1.5e-6")).unwrap_err().contains("edited or damaged"));
        // Another layout is the same content.
        let lines: Value = serde_json::from_str(&text).unwrap();
        assert!(read(&lines.to_string()).is_ok());
        // A file of an earlier version.
        assert!(read(&file.to_string()).is_ok());
    }
}
