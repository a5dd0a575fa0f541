//! Why the macros of a robot file cannot be expanded.

use dynident_system::RunError;
use thiserror::Error;

/// Why the macros of a robot file cannot be expanded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum XacroError {
    /// No program may be started.
    #[error(
        "the file contains macros that only the program xacro can expand. xacro runs Python code of the file, so that \
         it needs permission, and nothing was started. If you trust the file, permit it (--allow-command; in Python \
         allow_command=True), or expand the file yourself and use the result:\n  {by_hand}"
    )]
    NotPermitted {
        /// The command to run by hand.
        by_hand: String,
    },
    /// The program failed, or was stopped.
    #[error("the macros of the file cannot be expanded: {source}{}", fix(source))]
    Program {
        /// How.
        #[from]
        source: RunError,
    },
    /// The output of the program is no text.
    #[error("the macros of the file cannot be expanded: the output of xacro is not UTF-8 text")]
    NotText,
    /// The file's path cannot be given to the program.
    #[error("the path is not UTF-8 text, and cannot be given to xacro: rename the file")]
    Path,
    /// Arguments for a file that needs no program.
    #[error("the file contains no xacro macros: remove the xacro arguments ([robot] xacro, --xacro)")]
    NoMacros,
    /// A name that cannot be the name of an argument.
    #[error(
        "invalid xacro argument `{name}` = `{value}`: a name consists of ASCII letters, digits and `_-./` and begins with a letter or `_`"
    )]
    Argument {
        /// The name.
        name: String,
        /// The value.
        value: String,
    },
    /// A time limit that is not positive.
    #[error("xacro_limit_s = {limit_s}: give more than 0, at most 1e6 s")]
    TimeLimit {
        /// The limit, s.
        limit_s: f64,
    },
}

/// What to do about a failure.
fn fix(failure: &RunError) -> &'static str {
    match failure {
        RunError::NotFound { .. } => {
            "; install it (it comes with ROS, and as `pip install xacro`), or expand the file on another computer"
        }
        RunError::TimedOut { .. } => "; give it more time ([robot] xacro_limit_s, --xacro-limit-s)",
        RunError::Failed { .. } => "; correct the file or the arguments ([robot] xacro, --xacro)",
        _ => "",
    }
}
