//! Serves the live page: one thread accepts connections, and a limited number of short-lived threads answer them.

use super::access::{Access, Refusal};
use super::http::{Request, respond};
use super::state::LiveState;
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const MAX_CONNECTIONS: usize = 32;
/// Pause after a failed attempt to accept a connection, so that a permanent failure does not occupy a processor.
const RETRY_PAUSE: Duration = Duration::from_millis(100);
/// Pause while all connections are in use. Each ends within seconds, so further clients wait.
const FULL_PAUSE: Duration = Duration::from_millis(2);

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// A running server; it ends when dropped.
#[derive(Debug)]
pub(crate) struct LiveServer {
    address: SocketAddr,
    url: String,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl LiveServer {
    /// Serves the live page on `address` and on no other.
    ///
    /// # Errors
    /// An address that cannot be used, or no random numbers.
    pub(crate) fn start(address: SocketAddr, state: Arc<LiveState>) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let access = Access::new(address).map_err(io::Error::other)?;
        let url = access.url();
        let ends = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&ends);
        let thread = std::thread::Builder::new()
            .name("live page".to_owned())
            .spawn(move || accept(&listener, &Arc::new(access), &state, &ended))?;
        Ok(Self { address, url, ends, thread: Some(thread) })
    }

    /// The link to the page, with its token.
    pub(crate) fn url(&self) -> &str {
        &self.url
    }
}

impl Drop for LiveServer {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::SeqCst);
        // A connection to the own address wakes the thread that waits for connections.
        let mut own = self.address;
        if own.ip().is_unspecified() {
            own.set_ip(if own.is_ipv4() { [127, 0, 0, 1].into() } else { 1_u128.to_be_bytes().into() });
        }
        if TcpStream::connect_timeout(&own, Duration::from_secs(1)).is_ok()
            && let Some(thread) = self.thread.take()
        {
            let _ = thread.join();
        }
    }
}

fn accept(listener: &TcpListener, access: &Arc<Access>, state: &Arc<LiveState>, ends: &AtomicBool) {
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        if ends.load(Ordering::SeqCst) {
            return;
        }
        let Ok(mut stream) = stream else {
            std::thread::sleep(RETRY_PAUSE);
            continue;
        };
        while open.load(Ordering::SeqCst) >= MAX_CONNECTIONS {
            if ends.load(Ordering::SeqCst) {
                return;
            }
            std::thread::sleep(FULL_PAUSE);
        }
        let slot = Slot::taken(&open);
        let (access, state) = (Arc::clone(access), Arc::clone(state));
        let _ = std::thread::Builder::new().name("live request".to_owned()).spawn(move || {
            let _slot = slot;
            // An error is ignored, because the client may have closed the connection.
            let _ = answer(&mut stream, &access, &state);
        });
    }
}

struct Slot(Arc<AtomicUsize>);

impl Slot {
    fn taken(open: &Arc<AtomicUsize>) -> Self {
        open.fetch_add(1, Ordering::SeqCst);
        Self(Arc::clone(open))
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

fn answer(stream: &mut TcpStream, access: &Access, state: &LiveState) -> io::Result<()> {
    let Some(request) = Request::read(stream) else {
        return respond(stream, "400 Bad Request", "text/plain", "");
    };
    let path = match access.path(&request) {
        Ok(path) => path,
        Err(Refusal::Foreign) => return respond(stream, "403 Forbidden", "text/plain", ""),
        Err(Refusal::Unknown) => return respond(stream, "404 Not Found", "text/plain", ""),
    };
    match (&*request.method, path) {
        ("GET", "") => respond(stream, "200 OK", "text/html", PAGE),
        ("GET", "page.css") => respond(stream, "200 OK", "text/css", STYLE),
        ("GET", "page.js") => respond(stream, "200 OK", "text/javascript", SCRIPT),
        ("GET", "state") => {
            let known = request.number("motion").zip(request.number("from"));
            respond(stream, "200 OK", "application/json", &state.json(known))
        }
        ("POST", "stop") => {
            state.stop();
            respond(stream, "200 OK", "application/json", "{}")
        }
        (_, "" | "page.css" | "page.js" | "state" | "stop") => {
            respond(stream, "405 Method Not Allowed", "text/plain", "")
        }
        _ => respond(stream, "404 Not Found", "text/plain", ""),
    }
}
