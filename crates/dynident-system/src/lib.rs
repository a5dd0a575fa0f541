//! Access to the operating system for all crates of Dynident: programs, folders and files.
//!
//! | task | use |
//! | --- | --- |
//! | decide which programs may be started | [`ProgramPermission`], [`ProgramRequest`] |
//! | start a permitted program and stop it with all the processes that it starts | [`ProcessGroup`] |
//! | run a permitted program to its end within a time limit and take its output | [`run_to_end`] |
//! | list a folder, remove a folder with its contents | [`names`], [`remove_folder`] |
//! | a folder that is removed when it is no longer needed | [`TemporaryFolder`] |
//! | write a file that appears whole or not at all | [`write_atomically`], [`check_writable`] |
//!
//! No other crate of Dynident starts a program: [`ProcessGroup::start`] is the only place, and it takes a
//! [`PermittedProgram`], which only [`ProgramPermission::permit`] makes.
//!
//! ```
//! use dynident_system::{ProgramPermission, ProgramPurpose, ProgramRequest};
//!
//! let request = ProgramRequest::new(ProgramPurpose::Xacro, ["xacro", "my arm.xacro"]);
//! assert_eq!(request.command_line(), "xacro 'my arm.xacro'");
//! let refused = ProgramPermission::default().permit(request).unwrap_err();
//! assert!(refused.to_string().contains("not permitted"));
//! ```

#![forbid(unsafe_code)]

mod folder;
mod programs;
mod temporary_folder;
mod whole_file;

pub use folder::{names, remove_folder};
pub use programs::{
    GroupId, PermittedProgram, Pipes, ProcessGroup, ProgramPermission, ProgramPurpose, ProgramRefused, ProgramRequest,
    RunError, RunLimits, run_to_end,
};
pub use temporary_folder::TemporaryFolder;
pub use whole_file::{check_writable, write_atomically};
