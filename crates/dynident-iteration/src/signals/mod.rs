//! Signals of a run: rest, dry friction at reversals, oscillation.

pub(crate) mod dry_steps;
pub(crate) mod near_rest;
pub(crate) mod oscillation;
pub(crate) mod rests;
