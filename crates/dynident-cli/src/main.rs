//! The `dynident` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(dynident_cli::run(std::env::args_os()))
}
