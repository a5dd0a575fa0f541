//! Arrow: tables in the file format (`ARROW1`, also called Feather version 2) and in the streaming format, with columns
//! as for Parquet. Format:
//! <https://arrow.apache.org/docs/format/Columnar.html#serialization-and-interprocess-communication-ipc>.

#[cfg(feature = "arrow")]
mod batch;
#[cfg(feature = "arrow")]
mod flat;
#[cfg(feature = "arrow")]
mod reading;
#[cfg(feature = "arrow")]
mod schema;

#[cfg(feature = "arrow")]
pub(crate) use reading::open;

pub(crate) const MAGIC: &[u8] = b"ARROW1";

/// Whether `head` is the start of a stream: a message marker, its length, and a small offset of its first table.
pub(crate) fn begins_stream(head: &[u8]) -> bool {
    let word = |at: usize| Some(u32::from_le_bytes(head.get(at..at + 4)?.try_into().ok()?));
    let small = |at: usize, most: u32| word(at).is_some_and(|number| (1..most).contains(&number));
    word(0) == Some(u32::MAX) && small(4, 1 << 30) && small(8, 1 << 16)
}

#[cfg(not(feature = "arrow"))]
pub(crate) fn open(
    path: &std::path::Path,
    _: crate::limits::Budget,
) -> Result<Box<dyn crate::table::Table>, crate::error::FileError> {
    Err(crate::error::FileError::NotBuilt { file: path.to_owned(), format: "an Arrow table", feature: "arrow" })
}
