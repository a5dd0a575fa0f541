//! The friction that recordings choose: which terms, with which constants, at which cut-off.
//!
//! From below: `passes` are the rows that all of it rests on, `constants` finds the best constants of given terms,
//! `choice` the terms, and `cutoff` tries another cut-off where friction is told better there. Columns,
//! candidates and the search among them, which know of no recording, are [`friction`](crate::friction)'s.

mod choice;
mod constants;
mod cutoff;
mod passes;

pub use choice::{ChosenFriction, choose_friction};

pub(crate) use choice::{GridFriction, GridTerms, constants_of_all_rows, friction_by_grid};
pub(crate) use cutoff::{OtherFriction, friction_of_other_cutoff, friction_with_cutoff};
