//! Errors of macro expansion.

use dynident_system::RunError;
use thiserror::Error;

/// Reason why the macros of a robot file cannot be expanded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum XacroError {
    /// The robot file is a xacro file, and programs run only with permission. Permit `xacro` with `--allow-command`, or
    /// run the printed command and name its output as the robot file.
    #[error(
        "the file contains macros, which need the program xacro. xacro runs Python code of the file, so \
         it needs permission; no program was started. If you trust the file, permit it (--allow-command; in Python \
         allow_command=True), or expand the file yourself and use the result:\n  {by_hand}"
    )]
    NotPermitted {
        /// The command to run by hand.
        by_hand: String,
    },
    /// `xacro` is not installed, stopped with an error or did not end in time. The text after the colon has its message
    /// and the fix.
    #[error("the macros of the file cannot be expanded: {source}{fix}", fix = fix(source))]
    Program {
        /// The failure.
        #[from]
        source: RunError,
    },
    /// `xacro` ran, but its output is not a text. Run `xacro` by hand, check the output and save it as UTF-8.
    #[error("the macros of the file cannot be expanded: the output of xacro is not UTF-8 text")]
    NotText,
    /// The path of the robot file contains bytes that are not valid UTF-8. Rename the file or its folder.
    #[error("the path is not UTF-8 text and cannot be passed to xacro: rename the file")]
    Path,
    /// The study or the command has xacro arguments, but the robot file has no macros that could use them. Remove the
    /// arguments, or give the xacro file.
    #[error("the file contains no xacro macros: remove the xacro arguments ([robot] xacro, --xacro)")]
    NoMacros,
    /// A key of `xacro` under `[robot]`, or a `--xacro NAME=VALUE`, has a name that xacro does not accept. Correct the
    /// name.
    #[error(
        "invalid xacro argument `{name}` = `{value}`: a name consists of ASCII letters, digits and `_-./` and begins with a letter or `_`"
    )]
    Argument {
        /// The name.
        name: String,
        /// The value.
        value: String,
    },
    /// `xacro_limit_s` under `[robot]`, or `--xacro-limit-s`, is zero, negative or too large. Write the number of
    /// seconds that `xacro` may run.
    #[error("xacro_limit_s = {limit_s}: give more than 0, at most 1e6 s")]
    TimeLimit {
        /// The limit, s.
        limit_s: f64,
    },
}

/// Parts of the messages of xacro if it cannot find a package of ROS: without ROS, and for an unknown package.
const PACKAGE_FAILURES: [&str; 5] =
    ["ament_index_python", "rospkg", "PackageNotFound", "package not found", "ResourceNotFound"];

/// Suggests a fix for a failure.
fn fix(failure: &RunError) -> &'static str {
    match failure {
        RunError::NotFound { .. } => {
            "; install it (it comes with ROS, and as `pip install xacro`), or expand the file on another computer"
        }
        RunError::TimedOut { .. } => "; give it more time ([robot] xacro_limit_s, --xacro-limit-s)",
        RunError::Failed { message, .. } if PACKAGE_FAILURES.iter().any(|part| message.contains(part)) => {
            "; `$(find PACKAGE)` needs ROS: source the setup of your workspace in this terminal (`source \
             install/setup.bash`) and repeat, or save the expanded description of the running robot (topic \
             /robot_description) and give that file: `ros2 param get --hide-type /robot_state_publisher \
             robot_description > robot.urdf`"
        }
        RunError::Failed { .. } => "; correct the file or the arguments ([robot] xacro, --xacro)",
        _ => "",
    }
}
