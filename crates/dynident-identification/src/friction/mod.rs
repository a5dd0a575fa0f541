//! Which friction the joints have, chosen by the training logs.

mod candidates;
mod choice;

pub use candidates::FrictionSearch;
pub use choice::{FrictionCandidate, JointFriction};

pub(crate) use candidates::candidate_columns;
pub(crate) use choice::{choose_friction, chosen_model};
