//! Errors of report sections.

/// A section that cannot be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A page that a program composed has a link to a section that it does not have. Correct the title in the link.
    #[error("table `{section}`: a cell links to the missing section `{to}`: use the title of a section of this page")]
    Link {
        /// Title of the table.
        section: String,
        /// The missing title.
        to: String,
    },
    /// A program passed lists of different lengths to a plot or table. Correct the call.
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
    /// A program passed x values that decrease or are not finite. Sort the samples.
    #[error("section `{section}`: the x axis must be finite and not decrease, but entry {at} (0-based) is {value}")]
    Axis {
        /// Title of the section.
        section: String,
        /// Index of the entry.
        at: usize,
        /// The value.
        value: f64,
    },
    /// The figure is too narrow for text of this size. Increase the width, or reduce the size of the text.
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
    /// The resolution of a PNG file is outside its range. Usual are 150 to 600 dpi.
    #[error("invalid resolution of a PNG, {dpi} dpi: give 30 to 2400 dpi")]
    Resolution {
        /// Pixels per inch.
        dpi: f64,
    },
    /// Width, height and resolution together give too many pixels. Reduce the resolution.
    #[error(
        "a PNG of {width_px} × {height_px} pixels is too large: reduce the resolution to at most 50 million pixels"
    )]
    Pixels {
        /// Width, pixels.
        width_px: f64,
        /// Height, pixels.
        height_px: f64,
    },
    /// A name in the figure has letters, for example Chinese or Arabic ones, that the font inside PDF and PNG files
    /// lacks. Write SVG, or rename.
    #[error(
        "the font of PDF and PNG has no glyph for {characters:?}: write .svg, which uses the fonts of the computer, or rename the joint or parameter"
    )]
    Characters {
        /// The characters.
        characters: String,
    },
    /// The program was compiled without this file format of figures. Write SVG, or use the released program.
    #[error("this build of Dynident writes no {form}: write .svg and convert it, or use the program of the releases")]
    NotBuilt {
        /// File format.
        form: &'static str,
    },
    /// A bug in Dynident: the figure cannot be converted. Report the message, and write SVG meanwhile.
    #[error("cannot write the {form} of a figure: {message}")]
    Conversion {
        /// File format.
        form: &'static str,
        /// The problem.
        message: String,
    },
    /// A bug in Dynident: the page cannot be composed. Report the message.
    #[error("a template of the page failed: {0}")]
    Template(#[from] minijinja::Error),
    /// A bug in Dynident: the data of a plot cannot be written as JSON. Report the message.
    #[error("cannot write the data of a plot: {0}")]
    Data(#[from] serde_json::Error),
}
