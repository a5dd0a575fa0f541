//! The friction that recordings choose: which terms, with which constants, at which cut-off.
//!
//! From below: `passes` are the rows that all of it rests on, `constants` finds the best constants of given terms,
//! `choice` the terms, and `cutoff` tries the fit's own cut-off where noise smears what a higher one shows. Columns,
//! candidates and the search among them, which know of no recording, are [`friction`](crate::friction)'s.

mod choice;
mod constants;
mod cutoff;
mod passes;

pub use choice::{ChosenFriction, choose_friction};

pub(crate) use choice::constants_of_all_rows;
pub(crate) use cutoff::{friction_by_cutoffs, friction_of_less_noise};
