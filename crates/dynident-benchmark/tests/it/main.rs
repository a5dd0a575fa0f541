//! What the benchmark says, and that it says the same again.

mod accuracy;
mod default_study;
