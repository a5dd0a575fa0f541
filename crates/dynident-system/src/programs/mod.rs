//! Permission, start and stop of programs.

mod command_line;
mod group;
mod permission;
mod run;

pub use group::{GroupId, Pipes, ProcessGroup};
pub use permission::{PermittedProgram, ProgramPermission, ProgramPurpose, ProgramRefused, ProgramRequest};
pub use run::{RunError, RunLimits, run_to_end};
