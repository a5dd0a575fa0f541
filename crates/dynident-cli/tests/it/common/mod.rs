pub(crate) use dynident_testing::repository;
use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) struct CommandOutcome {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The folder of broken inputs, which also contains a good study (`good.toml`) with its robot and log.
pub(crate) fn broken() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

pub(crate) fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
    command.current_dir(folder).args(arguments);
    command
}

/// Runs the command to its end. Death by a signal gives status -1.
pub(crate) fn run_in(folder: &Path, arguments: &[&str]) -> CommandOutcome {
    let output = command(folder, arguments).output().unwrap();
    CommandOutcome {
        status: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}
