//! What can be wrong with a section.

/// A section that cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A cell leads to a section that the page does not have.
    #[error("table `{section}`: a cell leads to `{to}`, which is the title of no section: give a title of this page")]
    Link {
        /// The table's title.
        section: String,
        /// The title that was looked for.
        to: String,
    },
    /// Lists that do not belong together.
    #[error("section `{section}`: {what} has {found} entries where {expected} are needed; give one for each")]
    Shape {
        /// The section's title.
        section: String,
        /// Which list.
        what: String,
        /// Entries it should have.
        expected: usize,
        /// Entries it has.
        found: usize,
    },
    /// Times or positions that are not finite or do not increase.
    #[error("section `{section}`: the x axis must be finite and not decrease, but entry {at} (0-based) is {value}")]
    Axis {
        /// The section's title.
        section: String,
        /// Place of the entry.
        at: usize,
        /// The entry.
        value: f64,
    },
    /// A template that failed: a defect of this crate.
    #[error("the page's template failed: {0}")]
    Template(#[from] minijinja::Error),
    /// Data that could not be written as JSON: a defect of this crate.
    #[error("a plot's data could not be written: {0}")]
    Data(#[from] serde_json::Error),
}
