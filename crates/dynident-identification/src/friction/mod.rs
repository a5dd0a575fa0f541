//! Selection of joint friction from the training logs.

mod candidates;
mod choice;
mod constants;
mod constants_fit;
mod further_laws;
mod joint_friction;
mod search;
mod second_start;
mod source;
mod weak_terms;

pub use candidates::FrictionSearch;
pub use choice::chosen_model;
pub use joint_friction::{FrictionCandidate, FrictionConstant, JointFriction, UnrestrictedFriction};
pub use source::FrictionSource;

pub(crate) use candidates::{CandidateColumn, JointScale, candidate_columns, step_columns};
pub(crate) use choice::choose_friction;
pub(crate) use constants::{is_coulomb, smooth_width, step_of_joint};
pub(crate) use constants_fit::{ConstantsError, ConstantsStep, FrictionConstants};
pub(crate) use further_laws::{FURTHER_LAWS, FurtherLaws};
pub(crate) use search::SearchLimits;
pub(crate) use second_start::{is_one_friction, second_start};
pub(crate) use weak_terms::Weak;
