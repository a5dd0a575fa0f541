//! Reads the answer to a question on the terminal. Input typed before the question is ignored, and Ctrl-C ends the
//! wait.

use crate::terminal;

#[cfg(unix)]
const GIVEN_UP: &str = "a stop was requested: the question is treated as answered with no";

/// Returns the line that answers a question; `None` at the end of the input, or after Ctrl-C.
#[cfg(unix)]
pub(super) fn to(question: &str) -> Option<String> {
    use super::interruption;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::io::{Errno, read};
    use rustix::termios::{QueueSelector, tcflush};

    // Ctrl-C wakes another thread, so this thread polls.
    const POLL_INTERVAL: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
    // Read without the buffer of the standard library, because lines typed ahead would remain there after a flush of
    // the terminal.
    let terminal = std::io::stdin();
    // Discard earlier input: a doubled Enter must not move the robot.
    let _ = tcflush(&terminal, QueueSelector::IFlush);
    terminal::ask(question);
    let mut line = Vec::new();
    while !line.contains(&b'\n') {
        if interruption::pressed() {
            terminal::ask("\n");
            terminal::remark(GIVEN_UP);
            return None;
        }
        match poll(&mut [PollFd::new(&terminal, PollFlags::IN)], Some(&POLL_INTERVAL)) {
            Ok(0) | Err(Errno::INTR) => continue,
            Ok(_) => {}
            Err(_) => return None,
        }
        let mut bytes = [0; 256];
        match read(&terminal, &mut bytes) {
            Ok(0) if line.is_empty() => return None,
            Ok(0) => break,
            Ok(count) => line.extend_from_slice(&bytes[..count]),
            Err(Errno::INTR | Errno::AGAIN) => {}
            Err(_) => return None,
        }
    }
    Some(String::from_utf8_lossy(&line).into_owned())
}

/// Returns the line that answers a question; `None` after Ctrl-C.
#[cfg(not(unix))]
pub(super) fn to(question: &str) -> Option<String> {
    terminal::ask(question);
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).ok()?;
    (!super::interruption::pressed()).then_some(answer)
}
