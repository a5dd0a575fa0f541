//! Integration tests of the benchmark.

mod accuracy;
mod default_study;
