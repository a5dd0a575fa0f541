//! The online crate against the batch, and against simulated contact.

mod contact;
mod derivatives;
mod estimator;
