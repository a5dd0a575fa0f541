//! The online crate against the batch, and against simulated contact.

mod consistent;
mod contact;
mod derivatives;
mod drift;
mod estimator;
