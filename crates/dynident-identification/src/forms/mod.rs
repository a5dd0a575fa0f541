//! The identified model in export formats that cannot contain all of its torque terms: URDF, for example, has no drive
//! inertia.
//!
//! Each format declares the [class of terms](dynident_model::terms::TermClass) that it can contain. Without one of its
//! terms, the model predicts another torque. Therefore the values of the remaining terms are fitted again, with the
//! bodies of the identified model. The result is tested on the held-out recordings, with the torque that a program
//! computes from the exported file.

mod refit;
mod test;

pub use refit::{FormFit, form_fits};
