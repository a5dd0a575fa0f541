//! **How accurate, how fast?** [`accuracy`] holds what `dynident benchmark` runs: estimators beside each other and
//! beside the Cramér-Rao bound; [`cutoffs`] and [`friction_truths`] set the default cut-off and friction
//! against the best that can be had with the truth in hand, [`default_study`] all that a study without keys does. Speed
//! is the program `dynident-benchmark`, whose figures stand beside those of other libraries in `benchmarks/`.

#![forbid(unsafe_code)]

pub mod accuracy;
pub mod cutoffs;
pub mod default_study;
pub mod friction_truths;
mod simulated_logs;
