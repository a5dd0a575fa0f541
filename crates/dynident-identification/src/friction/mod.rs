//! Which friction the joints have, chosen by the training logs.

mod candidates;
mod choice;
mod constants;
mod constants_fit;
mod search;
mod weak_terms;

pub use candidates::FrictionSearch;
pub use choice::{FrictionCandidate, FrictionConstant, JointFriction, chosen_model};

pub(crate) use candidates::{CandidateColumn, JointScale, candidate_columns, step_columns};
pub(crate) use choice::choose_friction;
pub(crate) use constants_fit::{ConstantsError, ConstantsStep, FrictionConstants};
