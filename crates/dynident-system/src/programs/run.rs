//! Runs a program to its end and returns its standard output.

use super::group::{Pipes, ProcessGroup};
use super::permission::PermittedProgram;
use std::io::{self, ErrorKind, Read};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use thiserror::Error;

const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Time for a program to end after the request.
const END_TIMEOUT: Duration = Duration::from_millis(500);
/// Time for a pipe to close after all processes of the group have ended.
const PIPE_TIMEOUT: Duration = Duration::from_secs(1);
/// Maximum length of the standard error in a message, bytes: its end, which shows the cause.
const MAX_SHOWN_BYTES: usize = 400;
/// Maximum size of the stored standard error, bytes.
const MAX_ERROR_BYTES: u64 = 1 << 20;

/// Limits of running time and output of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunLimits {
    /// Time limit, s.
    pub time_s: f64,
    /// Largest output, bytes.
    pub output_bytes: u64,
}

/// Why a program gave no output. The program and all its child processes have been stopped.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum RunError {
    /// The program is not installed, or its name is misspelt. Install it, or write its full path.
    #[error("the program {program} is not installed, or not in a folder of PATH")]
    NotFound { program: String },
    /// The operating system refuses to start the program, for example because the file is not executable. Correct its
    /// permissions.
    #[error("the program {program} cannot be started: {source}")]
    NotStarted { program: String, source: io::Error },
    /// The program was slower than its time limit, or waits for input. Raise the limit, or run the program by hand.
    #[error("the program {program} did not end within {limit_s} s and was stopped")]
    TimedOut { program: String, limit_s: f64 },
    /// You stopped the command, for example by Ctrl-C, and Dynident stopped the program.
    #[error("the program {program} was stopped on request")]
    Stopped { program: String },
    /// The program printed far more than expected, probably in an endless loop. Run it by hand and check its output.
    #[error("the program {program} wrote more than {} MiB and was stopped", most_bytes >> 20)]
    TooLarge { program: String, most_bytes: u64 },
    /// The program ended with an error. Its own message follows; run the program by hand to find the cause.
    #[error("the program {program} failed ({exit}): {message}")]
    Failed { program: String, exit: String, message: String },
    /// The connection to the program broke. Run the command again.
    #[error("the output of the program {program} cannot be read: {source}")]
    Output { program: String, source: io::Error },
}

/// Runs a program without standard input until it ends, and returns its standard output. Afterwards no process of its
/// group runs.
///
/// # Errors
/// See [`RunError`]; also if `is_stopped` returns true while the program runs.
pub fn run_to_end(
    program: &PermittedProgram,
    limits: RunLimits,
    is_stopped: &dyn Fn() -> bool,
) -> Result<Vec<u8>, RunError> {
    let name = || program.name().to_owned();
    let mut group = ProcessGroup::start(program, Pipes::OUTPUT_ONLY).map_err(|source| match source.kind() {
        ErrorKind::NotFound => RunError::NotFound { program: name() },
        _ => RunError::NotStarted { program: name(), source },
    })?;
    let child = group.program();
    // Both pipes are read concurrently, because a full pipe would block the program.
    let output = child.stdout.take().map(|pipe| read_in_thread(pipe, limits.output_bytes.saturating_add(1)));
    let errors = child.stderr.take().map(|pipe| read_in_thread(pipe, MAX_ERROR_BYTES));
    let limit = Duration::try_from_secs_f64(limits.time_s).unwrap_or(Duration::MAX);
    let begin = Instant::now();
    let mut received = None;
    let outcome = loop {
        if received.is_none() {
            received = output.as_ref().and_then(|output| output.try_recv().ok());
        }
        if let Some(Ok(bytes)) = &received
            && bytes.len() as u64 > limits.output_bytes
        {
            break Err(RunError::TooLarge { program: name(), most_bytes: limits.output_bytes });
        }
        if let Some(exit) = group.exit() {
            break Ok(exit);
        }
        if is_stopped() {
            break Err(RunError::Stopped { program: name() });
        }
        if begin.elapsed() >= limit {
            break Err(RunError::TimedOut { program: name(), limit_s: limits.time_s });
        }
        std::thread::sleep(POLL_INTERVAL);
    };
    // Child processes may keep the pipes open, so they are ended as well.
    let is_success = group.end(if outcome.is_ok() { Duration::ZERO } else { END_TIMEOUT });
    let exit = outcome?;
    let drained = |pipe: &Receiver<io::Result<Vec<u8>>>| {
        let late = || io::Error::new(ErrorKind::TimedOut, "another process keeps its pipe open");
        pipe.recv_timeout(PIPE_TIMEOUT).unwrap_or_else(|_| Err(late()))
    };
    let bytes = match (received, &output) {
        (Some(bytes), _) => bytes,
        (None, Some(output)) => drained(output),
        (None, None) => Ok(Vec::new()),
    };
    // Tested first: a program whose output is no longer read fails for that reason.
    if bytes.as_ref().is_ok_and(|bytes| bytes.len() as u64 > limits.output_bytes) {
        return Err(RunError::TooLarge { program: name(), most_bytes: limits.output_bytes });
    }
    if !is_success {
        let message = errors.as_ref().and_then(|errors| drained(errors).ok()).unwrap_or_default();
        return Err(RunError::Failed { program: name(), exit, message: end_of(&String::from_utf8_lossy(&message)) });
    }
    bytes.map_err(|source| RunError::Output { program: name(), source })
}

/// Reads a pipe to its end on a separate thread, at most `most_bytes`.
fn read_in_thread(pipe: impl Read + Send + 'static, most_bytes: u64) -> Receiver<io::Result<Vec<u8>>> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let read = pipe.take(most_bytes).read_to_end(&mut bytes).map(|_| bytes);
        // The receiver may be gone.
        let _ = send.send(read);
    });
    receive
}

fn end_of(message: &str) -> String {
    let message = message.trim();
    let first = message.len().saturating_sub(MAX_SHOWN_BYTES);
    let start = (first..message.len()).find(|&at| message.is_char_boundary(at)).unwrap_or(0);
    message[start..].replace('\n', " ")
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ProgramPermission, ProgramPurpose, ProgramRequest};

    fn shell(script: &str) -> PermittedProgram {
        ProgramPermission::Allow.permit(ProgramRequest::new(ProgramPurpose::Xacro, ["sh", "-c", script])).unwrap()
    }

    const LIMITS: RunLimits = RunLimits { time_s: 20.0, output_bytes: 1000 };

    fn failure(script: &str, limits: RunLimits) -> String {
        run_to_end(&shell(script), limits, &|| false).unwrap_err().to_string()
    }

    #[test]
    fn the_output_of_a_program_that_succeeds_is_returned() {
        assert_eq!(run_to_end(&shell("printf text"), LIMITS, &|| false).unwrap(), b"text");
        // A remaining child process keeps the pipe open, and is ended.
        let begin = Instant::now();
        assert_eq!(run_to_end(&shell("sleep 60 & printf text"), LIMITS, &|| false).unwrap(), b"text");
        assert!(begin.elapsed() < Duration::from_secs(15));
    }

    #[test]
    fn a_failure_is_named() {
        assert_eq!(failure("echo line >&2; exit 3", LIMITS), "the program sh failed (exit status: 3): line");
        let large = RunLimits { output_bytes: 3 << 20, ..LIMITS };
        assert_eq!(failure("cat /dev/zero", large), "the program sh wrote more than 3 MiB and was stopped");
        let missing = ProgramRequest::new(ProgramPurpose::Xacro, ["no-such-program-of-dynident"]);
        let missing = ProgramPermission::Allow.permit(missing).unwrap();
        let message = run_to_end(&missing, LIMITS, &|| false).unwrap_err().to_string();
        assert!(message.contains("no-such-program-of-dynident is not installed"), "{message}");
    }

    #[test]
    fn a_program_that_does_not_end_is_stopped() {
        let short = RunLimits { time_s: 0.2, ..LIMITS };
        assert_eq!(failure("sleep 60", short), "the program sh did not end within 0.2 s and was stopped");
        // Also for a program that closes its pipes, and one that ignores the request to end.
        assert!(failure("exec >&- 2>&-; sleep 60", short).contains("0.2 s"));
        assert!(failure("trap '' TERM; sleep 60; sleep 60", short).contains("0.2 s"));
        let stopped = run_to_end(&shell("sleep 60"), LIMITS, &|| true).unwrap_err();
        assert!(matches!(stopped, RunError::Stopped { .. }), "{stopped}");
    }
}
