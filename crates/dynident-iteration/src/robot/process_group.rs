//! A program with all the processes that it starts: on Unix a process group of its own, so that the terminal's Ctrl-C
//! does not reach it past Dynident, and none of them outlives it.

use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// How often a process that should end is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// The processes of a started program.
#[derive(Debug)]
pub(super) struct ProcessGroup {
    child: Child,
    id: GroupId,
}

impl ProcessGroup {
    /// Starts the program in a group of its own.
    pub(super) fn start(command: &mut Command) -> std::io::Result<Self> {
        system::separate(command);
        let child = command.spawn()?;
        let id = GroupId::of(&child);
        Ok(Self { child, id })
    }

    /// The program itself: its pipes.
    pub(super) fn program(&mut self) -> &mut Child {
        &mut self.child
    }

    /// The group, for who is to kill it from another thread.
    pub(super) fn id(&self) -> GroupId {
        self.id
    }

    /// How the program ended, if it has: not what it started, nor who holds its pipes.
    pub(super) fn exit(&mut self) -> Option<String> {
        system::exit(&mut self.child)
    }

    /// How the program ended, if it does within the time.
    pub(super) fn exit_within(&mut self, limit: Duration) -> Option<String> {
        let start = Instant::now();
        loop {
            let exit = self.exit();
            if exit.is_some() || start.elapsed() >= limit {
                return exit;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Asks all of the group to end; those who do not within the time are killed. Nothing of it runs afterwards.
    pub(super) fn end(&mut self, grace: Duration) {
        if self.exit().is_none() {
            system::terminate(self.id);
            self.exit_within(grace);
        }
        // Until here the program, though it may have ended, keeps the group's number from being given to another.
        self.id.kill();
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(super) use system::GroupId;

#[cfg(unix)]
mod system {
    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
    use std::os::unix::process::CommandExt;
    use std::process::{Child, Command};

    /// The group's number.
    #[derive(Clone, Copy, Debug)]
    pub(in crate::robot) struct GroupId(Option<Pid>);

    impl GroupId {
        pub(super) fn of(child: &Child) -> Self {
            Self(i32::try_from(child.id()).ok().and_then(Pid::from_raw))
        }

        /// Kills all of the group.
        pub(in crate::robot) fn kill(self) {
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
            // A group that is gone is what was wanted.
            let _ = kill_process_group(id, signal);
        }
    }

    /// Looks without reaping, so that the number stays the program's until its group is killed.
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

    /// Other systems have no such group: the program alone is killed.
    #[derive(Clone, Copy, Debug)]
    pub(in crate::robot) struct GroupId;

    impl GroupId {
        pub(super) fn of(_: &Child) -> Self {
            Self
        }

        pub(in crate::robot) fn kill(self) {}
    }

    pub(super) fn separate(_: &mut Command) {}

    pub(super) fn terminate(_: GroupId) {}

    pub(super) fn exit(child: &mut Child) -> Option<String> {
        child.try_wait().ok().flatten().map(|status| status.to_string())
    }
}
