//! **Which model explains these samples?** From samples in memory or a stream to an identified model.

#![forbid(unsafe_code)]

pub mod consistent;
