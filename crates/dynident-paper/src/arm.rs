//! The paper's planar arm, and studies that a user can run again.

use dynident::{Error, write_atomically};
use dynident_model::{Model, load_robot};
use std::path::{Path, PathBuf};

/// The arm and its design study, copies of the examples: names in the output, and texts.
pub(crate) const DESCRIPTION: (&str, &str) =
    ("study/robots/paper_2r.toml", include_str!("../study/robots/paper_2r.toml"));
pub(crate) const DESIGN: (&str, &str) = ("study/design_paper.toml", include_str!("../study/design_paper.toml"));

/// Length between the joints, m, and gravity, m/s².
pub(crate) const A1: f64 = 1.0;
pub(crate) const GRAVITY: f64 = 9.8;

pub(crate) const TRUTH: [f64; 6] = [2.0, 2.0, 0.0, 1.0, 1.0, 0.0];

pub(crate) struct Arm {
    pub(crate) model: Model,
    pub(crate) description: PathBuf,
    pub(crate) design: PathBuf,
}

impl Arm {
    /// Writes the robot description and the design study into `folder`, and loads them like a user's own.
    pub(crate) fn written(folder: &Path) -> Result<Self, Error> {
        let (description, design) = (folder.join(DESCRIPTION.0), folder.join(DESIGN.0));
        write_atomically(&description, DESCRIPTION.1.as_bytes())?;
        write_atomically(&design, DESIGN.1.as_bytes())?;
        Ok(Self { model: load_robot(&description)?.model, description, design })
    }
}
