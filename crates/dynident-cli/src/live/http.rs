//! Requests and responses of HTTP/1.1, as far as the live page needs them: no body of a request, one request for each
//! connection, bounded length and time.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

const MAX_HEAD_BYTES: usize = 8192;
/// Time for a whole request, and for each part of a response.
const REQUEST_TIME: Duration = Duration::from_secs(3);
const WRITE_TIME: Duration = Duration::from_secs(5);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) method: String,
    pub(super) path: String,
    pub(super) query: String,
    pub(super) host: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) fetch_site: Option<String>,
}

impl Request {
    /// Reads the head of a request; `None` for anything else.
    pub(super) fn read(stream: &mut TcpStream) -> Option<Self> {
        let ends = Instant::now() + REQUEST_TIME;
        let mut head = Vec::new();
        let mut part = [0; 1024];
        while !head.windows(4).any(|end| end == b"\r\n\r\n") {
            let left = ends.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())?;
            stream.set_read_timeout(Some(left)).ok()?;
            let count = stream.read(&mut part).ok().filter(|count| *count > 0)?;
            head.extend_from_slice(&part[..count]);
            if head.len() > MAX_HEAD_BYTES {
                return None;
            }
        }
        Self::parse(core::str::from_utf8(&head).ok()?)
    }

    pub(super) fn parse(head: &str) -> Option<Self> {
        let mut lines = head.split("\r\n");
        let mut words = lines.next()?.split(' ');
        let (method, target, version) = (words.next()?, words.next()?, words.next()?);
        if !version.starts_with("HTTP/1.") || words.next().is_some() || !target.starts_with('/') {
            return None;
        }
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let mut request =
            Self { method: method.to_owned(), path: path.to_owned(), query: query.to_owned(), ..Self::default() };
        for line in lines.take_while(|line| !line.is_empty()) {
            let (name, value) = line.split_once(':')?;
            let place = match &*name.to_ascii_lowercase() {
                "host" => &mut request.host,
                "origin" => &mut request.origin,
                "sec-fetch-site" => &mut request.fetch_site,
                _ => continue,
            };
            // A second header of these names is ambiguous.
            if place.replace(value.trim().to_owned()).is_some() {
                return None;
            }
        }
        Some(request)
    }

    /// A number in the query of the address, such as 7 in `from=7`.
    pub(super) fn number(&self, name: &str) -> Option<u64> {
        let value = self.query.split('&').find_map(|pair| pair.split_once('=').filter(|(key, _)| *key == name));
        value.and_then(|(_, value)| value.parse().ok())
    }
}

/// Headers of every response: nothing is stored, and the page loads nothing from elsewhere.
const HEADERS: &str = "Cache-Control: no-store\r\nConnection: close\r\nX-Content-Type-Options: nosniff\r\n\
    Referrer-Policy: no-referrer\r\nX-Frame-Options: DENY\r\nContent-Security-Policy: default-src 'none'; \
    script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'\r\n";

/// Writes a response; `status` is for example `200 OK`.
pub(super) fn respond(stream: &mut TcpStream, status: &str, kind: &str, body: &str) -> io::Result<()> {
    stream.set_write_timeout(Some(WRITE_TIME))?;
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\n{HEADERS}\r\n"
    );
    stream.write_all(&[head.as_bytes(), body.as_bytes()].concat())?;
    stream.flush()
}
