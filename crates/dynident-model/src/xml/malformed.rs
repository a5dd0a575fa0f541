//! Converts errors of the XML parser, with their positions.

use roxmltree::{Error, TextPos};

/// Why a text is not accepted as XML.
pub(crate) enum Malformed {
    /// A document type declaration, by which entities could be defined.
    Doctype,
    /// More nodes than [`MAX_NODES`](super::MAX_NODES).
    TooLarge,
    /// The markup is faulty.
    Markup {
        /// Message of the parser, without the position.
        reason: String,
    },
}

/// Byte position and reason of a parser error.
pub(crate) fn malformed(text: &str, error: &Error) -> (usize, Malformed) {
    let at = error.pos();
    match error {
        Error::DtdDetected => (text.find("<!DOCTYPE").unwrap_or(0), Malformed::Doctype),
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
            (text.len(), Malformed::Markup { reason: "the document ends too early".to_owned() })
        }
        Error::NodesLimitReached => (0, Malformed::TooLarge),
        // The parser's messages contain their position; Dynident's messages start with it.
        _ => (byte_of(text, at), Malformed::Markup { reason: error.to_string().replacen(&format!(" at {at}"), "", 1) }),
    }
}

/// Byte position of a line and column of the parser.
fn byte_of(text: &str, at: TextPos) -> usize {
    let (row, column) = (at.row.max(1) as usize - 1, at.col.max(1) as usize - 1);
    let start = if row == 0 { 0 } else { text.match_indices('\n').nth(row - 1).map_or(text.len(), |(at, _)| at + 1) };
    text[start..].char_indices().nth(column).map_or(text.len(), |(offset, _)| start + offset)
}
