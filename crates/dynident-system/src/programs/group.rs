//! A program with all its child processes: on Unix a separate process group, so that Dynident handles Ctrl-C on the
//! terminal, and no process outlives it.

use super::permission::PermittedProgram;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Pipes to a program. Standard output and standard error are always pipes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pipes {
    /// Whether its standard input is a pipe; otherwise it is empty.
    pub input: bool,
}

impl Pipes {
    /// Only standard output and standard error.
    pub const OUTPUT_ONLY: Self = Self { input: false };
    /// Standard input, output and error.
    pub const ALL: Self = Self { input: true };
}

/// The processes of a started program. They are not ended on drop: call [`end`](Self::end).
#[derive(Debug)]
pub struct ProcessGroup {
    child: Child,
    id: GroupId,
}

impl ProcessGroup {
    /// Starts a permitted program in a separate group. This is the only place where Dynident starts a program.
    ///
    /// # Errors
    /// Error of the operating system; [`NotFound`](std::io::ErrorKind::NotFound) if the program does not exist.
    pub fn start(program: &PermittedProgram, pipes: Pipes) -> std::io::Result<Self> {
        let mut command = Command::new(program.name());
        command.args(program.request().command.iter().skip(1));
        command.stdin(if pipes.input { Stdio::piped() } else { Stdio::null() });
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        system::separate(&mut command);
        let child = command.spawn()?;
        let id = GroupId::of(&child);
        Ok(Self { child, id })
    }

    /// The program, for access to its pipes.
    pub fn program(&mut self) -> &mut Child {
        &mut self.child
    }

    /// The group, to kill it from another thread.
    pub fn id(&self) -> GroupId {
        self.id
    }

    /// Exit status, if the program has ended. Its child processes may still run and keep its pipes open.
    pub fn exit(&mut self) -> Option<String> {
        system::exit(&mut self.child)
    }

    /// Waits for the program to end: its exit status, or `None` after the time limit.
    pub fn exit_within(&mut self, limit: Duration) -> Option<String> {
        let start = Instant::now();
        loop {
            let exit = self.exit();
            if exit.is_some() || start.elapsed() >= limit {
                return exit;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Requests all processes of the group to end, and kills those that still run after `grace`. No process remains.
    /// Returns whether the program ended with success.
    pub fn end(&mut self, grace: Duration) -> bool {
        if self.exit().is_none() {
            system::terminate(self.id);
            self.exit_within(grace);
        }
        // The group number of an ended program stays reserved until it is waited for, so no other group is killed.
        self.id.kill();
        let _ = self.child.kill();
        self.child.wait().is_ok_and(|status| status.success())
    }
}

pub use system::GroupId;

#[cfg(unix)]
mod system {
    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
    use std::os::unix::process::CommandExt;
    use std::process::{Child, Command};

    /// Number of a process group.
    #[derive(Clone, Copy, Debug)]
    pub struct GroupId(Option<Pid>);

    impl GroupId {
        pub(super) fn of(child: &Child) -> Self {
            Self(i32::try_from(child.id()).ok().and_then(Pid::from_raw))
        }

        /// Kills all processes of the group.
        pub fn kill(self) {
            send(self, Signal::KILL);
        }
    }

    pub(super) fn separate(command: &mut Command) {
        command.process_group(0);
    }

    pub(super) fn terminate(id: GroupId) {
        send(id, Signal::TERM);
    }

    fn send(GroupId(id): GroupId, signal: Signal) {
        if let Some(id) = id {
            // A signal to an ended group is unnecessary.
            let _ = kill_process_group(id, signal);
        }
    }

    /// Does not reap the program, so that its number stays reserved until its group is killed.
    pub(super) fn exit(child: &mut Child) -> Option<String> {
        let id = i32::try_from(child.id()).ok().and_then(Pid::from_raw)?;
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        let status = waitid(WaitId::Pid(id), options).ok()??;
        Some(match (status.exit_status(), status.terminating_signal()) {
            (Some(code), _) => format!("exit status: {code}"),
            (None, Some(signal)) => format!("signal: {signal}"),
            (None, None) => "ended".to_owned(),
        })
    }
}

#[cfg(not(unix))]
mod system {
    use std::process::{Child, Command};

    /// Other systems have no process groups: only the program is killed.
    #[derive(Clone, Copy, Debug)]
    pub struct GroupId;

    impl GroupId {
        pub(super) fn of(_: &Child) -> Self {
            Self
        }

        /// Does nothing.
        pub fn kill(self) {}
    }

    pub(super) fn separate(_: &mut Command) {}

    pub(super) fn terminate(_: GroupId) {}

    pub(super) fn exit(child: &mut Child) -> Option<String> {
        child.try_wait().ok().flatten().map(|status| status.to_string())
    }
}
