//! `dynident --version --verbose`: what to include in a report of a problem.

use dynident_lanes::Level;
use std::ffi::OsString;

/// Whether the arguments are `--version` and `--verbose`, in any order. Clap handles only the first of them.
pub(crate) fn is_requested(arguments: &[OsString]) -> bool {
    let has = |names: [&str; 2]| arguments.iter().skip(1).any(|argument| names.iter().any(|name| argument == name));
    arguments.len() == 3 && has(["--version", "-V"]) && has(["--verbose", "-v"])
}

pub(crate) fn text() -> String {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let level = Level::detect();
    [
        format!("dynident {}", env!("CARGO_PKG_VERSION")),
        format!("commit: {}", option_env!("DYNIDENT_COMMIT").unwrap_or("unknown (set DYNIDENT_COMMIT for the build)")),
        format!("system: {} {}", std::env::consts::OS, std::env::consts::ARCH),
        format!("instructions: {}, {} samples together", level.name(), level.lanes()),
        format!("threads: {threads}"),
        "robot files: URDF, MJCF, SDF, D-H table".to_owned(),
        "log files: text, JSON, NumPy, MATLAB, HDF5, Parquet, Arrow, MCAP, rosbag2, LeRobot and more (dynident docs logs)"
            .to_owned(),
        format!("pages of the book: {}", if cfg!(feature = "book") { "all" } else { "messages only" }),
    ]
    .join("\n")
}
