//! **Accuracy benchmarks.** [`accuracy`] is the benchmark of `dynident benchmark`: it compares estimators with each
//! other and with the Cramér-Rao bound. [`cutoffs`] and [`friction_truths`] compare the default cut-off and the
//! default friction with the best possible choice, and [`default_study`] all defaults of a study that sets nothing
//! but its files. The program `dynident-benchmark` measures speed; `benchmarks/` compares its results with other
//! libraries.

#![forbid(unsafe_code)]

pub mod accuracy;
pub mod cutoffs;
pub mod default_study;
pub mod friction_truths;
mod simulated_logs;
