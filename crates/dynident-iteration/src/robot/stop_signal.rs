use core::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Requests robots to stop. It is shared between the source of requests (a Ctrl-C handler, a button) and the code
/// that runs a robot. After a request, the current run receives a stop message, and no further run begins.
/// [`kill_robots`](Self::kill_robots) does not wait for the answer.
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
    /// Requests the stop; running robots are notified immediately.
    pub fn request(&self) {
        self.shared.requested.store(true, Ordering::SeqCst);
        self.each(|listener| (listener.wake)());
    }

    /// Whether a stop was requested.
    pub fn is_requested(&self) -> bool {
        self.shared.requested.load(Ordering::SeqCst)
    }

    /// Kills every robot program with its process group, without a stop message; returns whether there was a program.
    /// The robots may still be moving afterwards.
    pub fn kill_robots(&self) -> bool {
        self.each(|listener| (listener.kill)()) > 0
    }

    /// Registers callbacks until the guard is dropped: `wake` is called on a stop request, `kill` by
    /// [`kill_robots`](Self::kill_robots). Both must return immediately.
    pub(super) fn listen(&self, wake: Box<dyn Fn() + Send>, kill: Box<dyn Fn() + Send>) -> Listening {
        let number = self.shared.next.fetch_add(1, Ordering::SeqCst);
        if let Ok(mut listeners) = self.shared.listeners.lock() {
            listeners.push(Listener { number, wake, kill });
        }
        Listening { signal: self.clone(), number }
    }

    fn each(&self, call: impl Fn(&Listener)) -> usize {
        let Ok(listeners) = self.shared.listeners.lock() else { return 0 };
        listeners.iter().for_each(call);
        listeners.len()
    }
}

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
