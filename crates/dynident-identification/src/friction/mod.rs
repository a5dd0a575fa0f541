//! Which friction the joints have, chosen by the training logs.

mod candidates;
mod choice;
mod constants;
mod refine;
mod search;

pub use candidates::FrictionSearch;
pub use choice::{FrictionCandidate, JointFriction, chosen_model};

pub(crate) use candidates::candidate_columns;
pub(crate) use choice::choose_friction;
pub(crate) use refine::{Neighbourhood, refined};
