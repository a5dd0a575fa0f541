//! The answer to a question on the terminal: typed after the question was there, and not awaited past Ctrl-C.

use crate::terminal;

/// What is said where Ctrl-C ends the wait for an answer.
#[cfg(unix)]
const GIVEN_UP: &str = "a stop was asked for: the question counts as answered with no";

/// The line that answers a question; none at the end of the input, and once Ctrl-C was pressed.
#[cfg(unix)]
pub(super) fn to(question: &str) -> Option<String> {
    use super::interruption;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::io::{Errno, read};
    use rustix::termios::{QueueSelector, tcflush};

    // Ctrl-C wakes another thread, which does not reach this one.
    const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
    // Read without the standard library's buffer: lines typed ahead would wait there, out of the terminal's reach.
    let terminal = std::io::stdin();
    // What was typed before is no answer to this question: a doubled Enter moves no arm.
    let _ = tcflush(&terminal, QueueSelector::IFlush);
    terminal::ask(question);
    let mut line = Vec::new();
    while !line.contains(&b'\n') {
        if interruption::pressed() {
            terminal::ask("\n");
            terminal::remark(GIVEN_UP);
            return None;
        }
        match poll(&mut [PollFd::new(&terminal, PollFlags::IN)], Some(&LOOK)) {
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

/// The line that answers a question; none once Ctrl-C was pressed.
#[cfg(not(unix))]
pub(super) fn to(question: &str) -> Option<String> {
    terminal::ask(question);
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).ok()?;
    (!super::interruption::pressed()).then_some(answer)
}
