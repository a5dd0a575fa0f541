//! Errors of macro expansion.

use dynident_system::RunError;
use thiserror::Error;

/// Reason why the macros of a robot file cannot be expanded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum XacroError {
    /// No program may be started.
    #[error(
        "the file contains macros, which need the program xacro. xacro runs Python code of the file, so \
         it needs permission; no program was started. If you trust the file, permit it (--allow-command; in Python \
         allow_command=True), or expand the file yourself and use the result:\n  {by_hand}"
    )]
    NotPermitted {
        /// The command to run by hand.
        by_hand: String,
    },
    /// The program failed, or was stopped.
    #[error("the macros of the file cannot be expanded: {source}{}", fix(source))]
    Program {
        /// The failure.
        #[from]
        source: RunError,
    },
    /// The output of the program is not text.
    #[error("the macros of the file cannot be expanded: the output of xacro is not UTF-8 text")]
    NotText,
    /// A file path that cannot be passed to the program.
    #[error("the path is not UTF-8 text and cannot be passed to xacro: rename the file")]
    Path,
    /// Arguments for a file without macros.
    #[error("the file contains no xacro macros: remove the xacro arguments ([robot] xacro, --xacro)")]
    NoMacros,
    /// An invalid argument name.
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

/// Fix for a failure.
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
