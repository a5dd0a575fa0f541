//! Permission of programs.

use super::command_line::shell_words;
use core::fmt;
use thiserror::Error;

/// Purpose of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ProgramPurpose {
    /// The robot program of an iteration: `[iteration] robot = { kind = "process" }` of a study.
    Robot,
    /// Expansion of the xacro macros of a robot file. xacro evaluates Python expressions in that file.
    Xacro,
}

impl fmt::Display for ProgramPurpose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Robot => "the program of the robot",
            Self::Xacro => "the program that expands the robot file",
        })
    }
}

/// A program to be started.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ProgramRequest {
    /// Purpose of the program.
    pub purpose: ProgramPurpose,
    /// The program and its arguments.
    pub command: Vec<String>,
}

impl ProgramRequest {
    /// The request for a command.
    pub fn new<S: Into<String>>(purpose: ProgramPurpose, command: impl IntoIterator<Item = S>) -> Self {
        Self { purpose, command: command.into_iter().map(Into::into).collect() }
    }

    /// The command as typed into a POSIX shell. May contain terminal control characters.
    pub fn command_line(&self) -> String {
        shell_words(&self.command)
    }
}

/// A study or a robot file names a program, and programs run only with permission. Read the command; if you trust it,
/// permit it with `--allow-command` (Python: `allow_command=True`).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{} was not permitted and not started: {}", .request.purpose, .request.command_line())]
pub struct ProgramRefused {
    /// The program.
    pub request: ProgramRequest,
}

/// Which programs Dynident may start. By default none, because files of unknown origin can name or require programs (a
/// study its robot's program, a robot file with macros `xacro`).
#[derive(Clone, Copy, Default)]
pub enum ProgramPermission<'a> {
    /// No program.
    #[default]
    Refuse,
    /// Every program that the files of a job name or require.
    Allow,
    /// A function decides before each start; `true` permits the program.
    Ask(&'a dyn Fn(&ProgramRequest) -> bool),
}

impl fmt::Debug for ProgramPermission<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Refuse => "Refuse",
            Self::Allow => "Allow",
            Self::Ask(_) => "Ask(..)",
        })
    }
}

impl ProgramPermission<'_> {
    /// `Allow` or `Refuse`.
    pub fn from_flag(is_allowed: bool) -> Self {
        if is_allowed { Self::Allow } else { Self::Refuse }
    }

    /// Decides whether a program may be started.
    ///
    /// # Errors
    /// [`ProgramRefused`] if it is not permitted.
    pub fn permit(&self, request: ProgramRequest) -> Result<PermittedProgram, ProgramRefused> {
        let is_permitted = match self {
            Self::Refuse => false,
            Self::Allow => true,
            Self::Ask(decide) => decide(&request),
        };
        if is_permitted { Ok(PermittedProgram { request }) } else { Err(ProgramRefused { request }) }
    }
}

/// A permitted program, created only by [`ProgramPermission::permit`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PermittedProgram {
    request: ProgramRequest,
}

impl PermittedProgram {
    /// The permitted request.
    pub fn request(&self) -> &ProgramRequest {
        &self.request
    }

    /// The program without its arguments.
    pub fn name(&self) -> &str {
        self.request.command.first().map_or("", String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::Cell;

    #[test]
    fn nothing_is_permitted_without_a_yes() {
        let request = || ProgramRequest::new(ProgramPurpose::Robot, ["python3", "client.py"]);
        let refused = ProgramPermission::default().permit(request()).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "the program of the robot was not permitted and not started: python3 client.py"
        );
        assert!(ProgramPermission::from_flag(false).permit(request()).is_err());
        assert_eq!(ProgramPermission::Allow.permit(request()).unwrap().name(), "python3");
        let asked = Cell::new(0);
        let decide = |request: &ProgramRequest| {
            asked.set(asked.get() + 1);
            request.purpose == ProgramPurpose::Xacro
        };
        assert!(ProgramPermission::Ask(&decide).permit(request()).is_err() && asked.get() == 1);
    }
}
