//! Files of figures.

use crate::error::Error;
use crate::output::write_atomically;
use crate::pages::figures::{Figure, FigureForm};
use dynident_report::PrintStyle;
use std::path::PathBuf;

impl Figure {
    /// Writes files in the formats that their endings define: all of them, or none if one cannot be drawn.
    ///
    /// # Errors
    /// Same as for [`Figure::contents`] and [`FigureForm::of`]; a file that cannot be written.
    pub fn write(&self, files: &[PathBuf], style: &PrintStyle) -> Result<(), Error> {
        let contents = files.iter().map(|path| self.contents(FigureForm::of(path)?, style));
        let contents = contents.collect::<Result<Vec<_>, _>>()?;
        files.iter().zip(&contents).try_for_each(|(path, contents)| write_atomically(path, contents))
    }
}
