//! Errors of report sections.

/// A section that cannot be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A cell that links to a missing section.
    #[error("table `{section}`: a cell links to the missing section `{to}`: use the title of a section of this page")]
    Link {
        /// Title of the table.
        section: String,
        /// The missing title.
        to: String,
    },
    /// Lists with inconsistent lengths.
    #[error("section `{section}`: {what} has {found} entries, but needs {expected}")]
    Shape {
        /// Title of the section.
        section: String,
        /// The list.
        what: String,
        /// Expected number of entries.
        expected: usize,
        /// Actual number of entries.
        found: usize,
    },
    /// An x axis that is not finite or decreases.
    #[error("section `{section}`: the x axis must be finite and not decrease, but entry {at} (0-based) is {value}")]
    Axis {
        /// Title of the section.
        section: String,
        /// Index of the entry.
        at: usize,
        /// The value.
        value: f64,
    },
    /// A printed figure without room for its plots.
    #[error(
        "a figure of {width_mm} mm with text of {font_pt} pt cannot hold a plot: give a width of at least 6 mm for each \
         point of the text (88 mm and 180 mm with 8 pt are usual)"
    )]
    PrintSize {
        /// Width of the figure, mm.
        width_mm: f64,
        /// Size of the text, pt.
        font_pt: f64,
    },
    /// An invalid resolution of a PNG.
    #[error("invalid resolution of a PNG, {dpi} dpi: give 30 to 2400 dpi")]
    Resolution {
        /// Pixels per inch.
        dpi: f64,
    },
    /// A PNG with too many pixels.
    #[error(
        "a PNG of {width_px} × {height_px} pixels is too large: reduce the resolution to at most 50 million pixels"
    )]
    Pixels {
        /// Width, pixels.
        width_px: f64,
        /// Height, pixels.
        height_px: f64,
    },
    /// Characters that the embedded font of PDF and PNG lacks.
    #[error(
        "the font of PDF and PNG has no glyph for {characters:?}: write .svg, which uses the fonts of the computer, or rename the joint or parameter"
    )]
    Characters {
        /// The characters.
        characters: String,
    },
    /// A form of figures that is not part of this build.
    #[error("this build of Dynident writes no {form}: write .svg and convert it, or use the program of the releases")]
    NotBuilt {
        /// The form.
        form: &'static str,
    },
    /// A picture that cannot be converted, a bug in this crate.
    #[error("cannot write the {form} of a figure: {message}")]
    Conversion {
        /// The form.
        form: &'static str,
        /// The problem.
        message: String,
    },
    /// A template that failed, a bug in this crate.
    #[error("a template of the page failed: {0}")]
    Template(#[from] minijinja::Error),
    /// Data that cannot be written as JSON, a bug in this crate.
    #[error("cannot write the data of a plot: {0}")]
    Data(#[from] serde_json::Error),
}
