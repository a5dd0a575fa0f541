//! Arrays with a fixed length: a value too many is an error.

use serde::Deserialize;

/// Without this function serde ignores extra values.
fn counted<T, const N: usize, E: serde::de::Error>(values: Vec<T>) -> Result<[T; N], E> {
    let found = values.len();
    values.try_into().map_err(|_| E::custom(format!("{found} values where {N} are expected")))
}

pub(super) fn two<'de, T: Deserialize<'de>, D: serde::Deserializer<'de>>(deserializer: D) -> Result<[T; 2], D::Error> {
    counted(Vec::deserialize(deserializer)?)
}

pub(super) fn exactly<'de, T: Deserialize<'de>, const N: usize, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[T; N]>, D::Error> {
    counted(Vec::deserialize(deserializer)?).map(Some)
}
