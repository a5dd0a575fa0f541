//! Safe output of texts from untrusted files: names, paths and messages cannot change the structure of the output.
//!
//!
//! | output | function |
//! | --- | --- |
//! | a comment of C, C++, Rust, Python, MATLAB, YAML or TOML | [`comment`] |
//! | a string of YAML or TOML | [`quoted`] |
//! | a name in code | [`identifier`] |
//! | XML: attributes and text, comments, a whole document | [`xml::escaped`], [`xml::comment`], [`xml::document`] |
//! | a whole document of TOML | [`toml_document`] |
//! | a cell of CSV, of Markdown, of LaTeX | [`csv_field`], [`markdown`], [`latex`] |
//! | JSON | `json::to_string` (feature `json`) |
//! | a page, a picture, a terminal | [`visible`] |
//!
//! All functions escape invisible characters: see [`is_invisible`].

#![forbid(unsafe_code)]

mod comment;
mod field;
mod identifier;
mod invisible;
#[cfg(feature = "json")]
pub mod json;
mod quoted;
mod shortened;
mod toml_document;
pub mod xml;

pub use comment::comment;
pub use field::{csv_field, latex, markdown};
pub use identifier::{IDENTIFIER_LENGTH, identifier};
pub use invisible::{is_invisible, one_line, visible};
pub use quoted::quoted;
pub use shortened::{LINE_LENGTH, shortened, shortened_lines, shortened_message};
pub use toml_document::toml_document;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
