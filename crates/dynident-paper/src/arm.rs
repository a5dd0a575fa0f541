//! The paper's planar arm, and the studies that a user can run again by hand.

use dynident::{Error, write_whole};
use dynident_model::{Model, load_robot};
use std::path::{Path, PathBuf};

/// The arm and its design study, as they lie in the examples: their names among the outputs, and their texts.
pub(crate) const DESCRIPTION: (&str, &str) =
    ("study/robots/paper_2r.toml", include_str!("../study/robots/paper_2r.toml"));
pub(crate) const DESIGN: (&str, &str) = ("study/design_paper.toml", include_str!("../study/design_paper.toml"));

/// The arm's length between the joints, m, and gravity.
pub(crate) const A1: f64 = 1.0;
pub(crate) const GRAVITY: f64 = 9.8;

/// Theta of the paper's section 3.
pub(crate) const TRUTH: [f64; 6] = [2.0, 2.0, 0.0, 1.0, 1.0, 0.0];

/// Where the study's files stand.
pub(crate) struct Arm {
    pub(crate) model: Model,
    pub(crate) description: PathBuf,
    pub(crate) design: PathBuf,
}

impl Arm {
    /// Writes the description and the design study into `folder` and reads them back, as a user's own would be.
    pub(crate) fn written(folder: &Path) -> Result<Self, Error> {
        let (description, design) = (folder.join(DESCRIPTION.0), folder.join(DESIGN.0));
        write_whole(&description, DESCRIPTION.1.as_bytes())?;
        write_whole(&design, DESIGN.1.as_bytes())?;
        Ok(Self { model: load_robot(&description)?.model, description, design })
    }
}
