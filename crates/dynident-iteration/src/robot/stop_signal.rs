//! A stop that somebody asks for while a robot runs.

use core::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Asks robots to stop: shared between who may ask (a handler of Ctrl-C, a button) and who runs a robot. Asked once, a
/// run that is under way gets a stop message, and no further run begins; [`kill_robots`](Self::kill_robots) is for
/// those who do not want to wait for the answer.
///
/// ```
/// let stop = dynident_iteration::StopSignal::default();
/// let button = stop.clone();
/// std::thread::spawn(move || button.request()).join().unwrap();
/// assert!(stop.is_requested());
/// ```
#[derive(Clone, Default)]
pub struct StopSignal {
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    requested: AtomicBool,
    next: AtomicU64,
    listeners: Mutex<Vec<Listener>>,
}

/// A robot that runs.
struct Listener {
    number: u64,
    wake: Box<dyn Fn() + Send>,
    kill: Box<dyn Fn() + Send>,
}

impl fmt::Debug for StopSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StopSignal").field("requested", &self.is_requested()).finish_non_exhaustive()
    }
}

impl StopSignal {
    /// Asks for the stop. Robots that run hear of it at once.
    pub fn request(&self) {
        self.shared.requested.store(true, Ordering::SeqCst);
        self.each(|listener| (listener.wake)());
    }

    /// Whether a stop was asked for.
    pub fn is_requested(&self) -> bool {
        self.shared.requested.load(Ordering::SeqCst)
    }

    /// Kills every program that serves a robot, with all the processes of its group, without a word; whether there was
    /// one. Nobody knows afterwards whether its robot stands.
    pub fn kill_robots(&self) -> bool {
        self.each(|listener| (listener.kill)()) > 0
    }

    /// `wake` is called when a stop is asked for, `kill` by [`kill_robots`](Self::kill_robots), until the guard is
    /// dropped. Neither may wait for anything.
    pub(super) fn listen(&self, wake: Box<dyn Fn() + Send>, kill: Box<dyn Fn() + Send>) -> Listening {
        let number = self.shared.next.fetch_add(1, Ordering::SeqCst);
        if let Ok(mut listeners) = self.shared.listeners.lock() {
            listeners.push(Listener { number, wake, kill });
        }
        Listening { signal: self.clone(), number }
    }

    /// How many there are.
    fn each(&self, call: impl Fn(&Listener)) -> usize {
        let Ok(listeners) = self.shared.listeners.lock() else { return 0 };
        listeners.iter().for_each(call);
        listeners.len()
    }
}

/// Listens as long as it lives.
#[derive(Debug)]
pub(super) struct Listening {
    signal: StopSignal,
    number: u64,
}

impl Drop for Listening {
    fn drop(&mut self) {
        if let Ok(mut listeners) = self.signal.shared.listeners.lock() {
            listeners.retain(|listener| listener.number != self.number);
        }
    }
}
