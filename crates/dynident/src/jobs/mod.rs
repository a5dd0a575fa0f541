//! The jobs of the commands: each reads files, calls the lower crates, and returns the output.

pub(crate) mod check;
mod columns;
pub(crate) mod compare;
pub(crate) mod design;
mod differences;
pub(crate) mod evaluate;
pub(crate) mod export;
mod figure_files;
pub(crate) mod identify;
pub(crate) mod inspect;
pub(crate) mod iterate;
pub(crate) mod lerobot;
pub(crate) mod log;
mod log_summary;
pub(crate) mod new_study;
pub(crate) mod options;
pub(crate) mod predict;
mod provenance;
mod recorded_velocities;
pub(crate) mod reduce;
pub(crate) mod servo;
pub(crate) mod simulate;
pub(crate) mod test_samples;
pub(crate) mod validate;
pub(crate) mod view;
mod violations;
