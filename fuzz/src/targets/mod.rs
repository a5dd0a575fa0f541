//! Fuzz targets: one for each parser, and one for the small commands on a folder of files.

mod formats;
mod jobs;
mod parsers;
mod sage;

use std::io;

/// Runs a target on an input.
pub(crate) trait Run {
    /// Returns whether `input` was accepted; `seed` is the name of the original file.
    fn run(&mut self, seed: &str, input: &[u8]) -> bool;
}

/// A fuzz target.
pub(crate) struct Target {
    /// Name of the target and of its folder in `corpus`.
    pub(crate) name: &'static str,
    /// Executions per round.
    pub(crate) repetitions: u64,
    /// Creates the runner; each thread has a separate one.
    pub(crate) new: fn() -> io::Result<Box<dyn Run>>,
}

/// All targets.
pub(crate) const TARGETS: [Target; 24] = [
    Target { name: "urdf", repetitions: 10, new: parsers::urdf },
    Target { name: "mjcf", repetitions: 10, new: parsers::mjcf },
    Target { name: "sdf", repetitions: 20, new: parsers::sdf },
    Target { name: "mesh", repetitions: 20, new: parsers::mesh },
    Target { name: "dh", repetitions: 20, new: parsers::dh },
    Target { name: "study", repetitions: 20, new: parsers::study },
    Target { name: "expression", repetitions: 100, new: parsers::expression },
    Target { name: "log", repetitions: 10, new: parsers::log },
    Target { name: "packed_text", repetitions: 4, new: formats::any },
    Target { name: "text_arrays", repetitions: 10, new: formats::any },
    Target { name: "numpy", repetitions: 10, new: formats::any },
    Target { name: "bags", repetitions: 4, new: formats::any },
    Target { name: "parquet", repetitions: 4, new: formats::any },
    Target { name: "arrow", repetitions: 4, new: formats::any },
    Target { name: "diadem", repetitions: 4, new: formats::any },
    Target { name: "matlab", repetitions: 10, new: formats::any },
    Target { name: "sage", repetitions: 10, new: sage::sage },
    Target { name: "states", repetitions: 20, new: parsers::states },
    Target { name: "result", repetitions: 10, new: parsers::result },
    Target { name: "design", repetitions: 20, new: parsers::design },
    Target { name: "iterations", repetitions: 10, new: parsers::iterations },
    Target { name: "protocol", repetitions: 40, new: parsers::protocol },
    Target { name: "jobs", repetitions: 1, new: jobs::jobs },
    Target { name: "factors", repetitions: 10, new: parsers::factors },
];
