//! The model in forms that cannot hold all of its torque terms: URDF has no drive inertia, code has no memory.
//!
//! Each form declares the [class of terms](dynident_model::terms::TermClass) that it can hold. Leaving a term out
//! changes the torque, so the remaining terms are fitted again within the class, with the bodies of the identified
//! model. The result is tested on the held-out recordings as a reader of the form computes it.

mod refit;
mod test;

pub use refit::{FormFit, form_fits};
