//! **How accurate, how fast?** [`accuracy`] holds what `dynident benchmark` runs: estimators beside each other and
//! beside the Cramér-Rao bound; [`cutoffs`] sets the default cut-off against the best. Speed is the program
//! `dynident-benchmark`, whose figures stand beside those of other libraries in `benchmarks/`.

#![forbid(unsafe_code)]

pub mod accuracy;
pub mod cutoffs;
