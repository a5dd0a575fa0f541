//! The server with real TCP clients.

use super::{LiveServer, LiveState};
use dynident::MotionObserver;
use dynident::iteration::robot::{ExpectedTorque, ObservedSample, RunPart, SampleObserver};
use dynident::iteration::{BegunMotion, NextMotion, RunPurpose, StopSignal};
use dynident::simulation::Reference;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::Duration;

struct Page {
    server: LiveServer,
    state: Arc<LiveState>,
    stop: StopSignal,
    address: SocketAddr,
    /// Path with the token.
    path: String,
}

fn page() -> Page {
    let stop = StopSignal::default();
    let state = Arc::new(LiveState::new("an arm".to_owned(), stop.clone()));
    let server = LiveServer::start((Ipv4Addr::LOCALHOST, 0).into(), Arc::clone(&state)).unwrap();
    let (address, path) = server.url().strip_prefix("http://").unwrap().split_once('/').unwrap();
    let (address, path) = (address.parse().unwrap(), format!("/{path}"));
    Page { server, state, stop, address, path }
}

/// Sends a request with these lines and returns status and body.
fn sent(address: SocketAddr, head: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(head.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
}

impl Page {
    fn asked(&self, method: &str, path: &str, headers: &str) -> (u16, String) {
        sent(self.address, &format!("{method} {path} HTTP/1.1\r\n{headers}\r\n"))
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.asked("GET", &format!("{}{path}", self.path), &format!("Host: {}\r\n", self.address))
    }

    fn state(&self, query: &str) -> Value {
        let (status, body) = self.get(&format!("state{query}"));
        assert_eq!(status, 200);
        serde_json::from_str(&body).unwrap()
    }

    /// Begins a motion of two joints at rest.
    fn begin(&self, duration_s: f64) {
        let reference = Reference::standing(&[0.1, 0.2], 1000.0, duration_s).unwrap();
        let motion = NextMotion {
            run: 3,
            leg: (0, 1),
            controller: "joint-pd".to_owned(),
            model_based: false,
            duration_s,
            speed: 1.0,
            purpose: RunPurpose::Run,
            largest_speed: vec![("a</script>".to_owned(), 0.0), ("b".to_owned(), 0.0)],
            rehearsal: None,
            ways: None,
        };
        let expected = ExpectedTorque {
            times_s: vec![0.0, duration_s],
            torque: vec![vec![1.0, 2.0], vec![3.0, 4.0]],
            half_width_95: vec![vec![0.1; 2], vec![0.2; 2]],
        };
        self.state.begins(&BegunMotion { motion: &motion, reference: &reference, expected: Some(&expected) });
    }

    fn sample(&self, time_s: f64) {
        self.state.sample(&ObservedSample { part: RunPart::Motion, time_s, q: &[0.1, time_s], tau: &[5.0, 6.0] });
    }
}

#[test]
fn only_requests_with_token_from_the_own_page_get_data() {
    let page = page();
    let (address, port) = (page.address, page.address.port());
    let own = format!("Host: {address}\r\n");
    let path = page.path.clone();
    assert!(page.path.len() > 32 && page.server.url().starts_with("http://127.0.0.1:"));
    let other = LiveServer::start((Ipv4Addr::LOCALHOST, 0).into(), Arc::clone(&page.state)).unwrap();
    assert_ne!(other.url().rsplit('/').nth(1), page.server.url().rsplit('/').nth(1));
    for (status, target, headers) in [
        (200, path.clone(), own.clone()),
        (200, format!("{path}page.js"), own.clone()),
        (200, format!("{path}state"), format!("Host: localhost:{port}\r\n")),
        (200, format!("{path}state"), format!("{own}Origin: http://{address}\r\nSec-Fetch-Site: same-origin\r\n")),
        // No token, a wrong one, a part of it, a longer one.
        (404, "/".to_owned(), own.clone()),
        (404, "/state".to_owned(), own.clone()),
        (404, format!("/{}/state", "0".repeat(32)), own.clone()),
        (404, format!("{}/state", &path[..20]), own.clone()),
        (404, format!("{}0/state", path.trim_end_matches('/')), own.clone()),
        (404, format!("{path}../etc/passwd"), own.clone()),
        // Another host, also a name that leads to this address, and another port.
        (403, format!("{path}state"), "Host: evil.example\r\n".to_owned()),
        (403, format!("{path}state"), format!("Host: evil.example:{port}\r\n")),
        (403, format!("{path}state"), format!("Host: 127.0.0.1:{}\r\n", port ^ 1)),
        (403, format!("{path}state"), format!("Host: 10.0.0.1:{port}\r\n")),
        (403, format!("{path}state"), String::new()),
        // Another origin or site.
        (403, format!("{path}state"), format!("{own}Origin: http://evil.example\r\n")),
        (403, format!("{path}state"), format!("{own}Origin: null\r\n")),
        (403, format!("{path}state"), format!("{own}Origin: https://{address}\r\n")),
        (403, format!("{path}state"), format!("{own}Sec-Fetch-Site: cross-site\r\n")),
        // Ambiguous or malformed.
        (400, format!("{path}state"), format!("{own}Host: {address}\r\n")),
        (400, format!("{path}state"), format!("{own}no colon\r\n")),
        (400, format!("{path}state x"), own.clone()),
    ] {
        let (found, body) = page.asked("GET", &target, &headers);
        assert_eq!(found, status, "{target} {headers}");
        assert!(status == 200 || body.is_empty(), "{target} {headers}: {body}");
    }
    assert!(!page.stop.is_requested());
}

#[test]
fn only_a_post_with_the_token_stops_the_robot() {
    let page = page();
    let (path, own) = (format!("{}stop", page.path), format!("Host: {}\r\n", page.address));
    assert_eq!(page.asked("GET", &path, &own).0, 405);
    assert_eq!(page.asked("POST", "/stop", &own).0, 404);
    assert_eq!(page.asked("POST", &path, &format!("{own}Origin: http://evil.example\r\n")).0, 403);
    assert!(!page.stop.is_requested() && page.state("")["stop_requested"] == false);
    assert_eq!(page.asked("POST", &path, &own).0, 200);
    assert!(page.stop.is_requested() && page.state("")["stop_requested"] == true);
}

#[test]
fn clients_see_the_same_and_ask_for_new_samples_only() {
    let page = page();
    assert_eq!(page.state("")["motion"], 0);
    page.begin(3.0);
    for k in 0..100 {
        page.sample(f64::from(k) * 0.03);
    }
    let (one, two) = (page.state(""), page.state(""));
    assert_eq!(one["rows"], two["rows"]);
    assert_eq!(one["rows"].as_array().unwrap().len(), 100);
    assert_eq!(one["rows"][50], serde_json::json!([1.5, 0.1, 1.5, 5.0, 6.0]));
    assert_eq!(one["head"]["joints"][0], "a</script>");
    assert_eq!(one["head"]["expected"]["half"][1][0], 0.2);
    let new = page.state("?motion=1&from=98");
    assert_eq!((new["from"].as_u64(), new["rows"].as_array().unwrap().len()), (Some(98), 2));
    assert!(new["head"].is_null());
    // Another motion, and numbers that no page sends.
    page.begin(3.0);
    let next = page.state("?motion=1&from=98");
    assert_eq!((next["motion"].as_u64(), next["from"].as_u64()), (Some(2), Some(0)));
    assert!(next["head"].is_object());
    assert_eq!(page.state("?motion=2&from=18446744073709551615")["rows"].as_array().unwrap().len(), 0);
    assert!(page.state("?motion=x&from=-1")["head"].is_object());
}

/// An hour at 1000 Hz, and more samples than the reference has.
#[test]
fn memory_is_bounded() {
    let page = page();
    page.begin(10.0);
    for k in 0..3_600_000 {
        page.sample(f64::from(k) * 0.001);
    }
    let rows = page.state("")["rows"].as_array().unwrap().len();
    assert!((1500..=3000).contains(&rows), "{rows}");
}

/// Clients that say nothing, send half a request or too much, or go away do not hinder others.
#[test]
fn bad_clients_do_no_harm() {
    let page = page();
    let connect = || TcpStream::connect(page.address).unwrap();
    let silent: Vec<TcpStream> = (0..10).map(|_| connect()).collect();
    let mut half = connect();
    half.write_all(b"GET /").unwrap();
    let mut long = connect();
    // The server may close the connection before all is sent.
    let _ = long.write_all(&vec![b'x'; 100_000]);
    drop(long);
    // More than the server answers at once.
    for _ in 0..40 {
        let mut killed = connect();
        killed
            .write_all(format!("GET {}state HTTP/1.1\r\nHost: {}\r\n\r\n", page.path, page.address).as_bytes())
            .unwrap();
        drop(killed);
    }
    assert_eq!(page.get("state").0, 200);
    drop((silent, half));
    let address = page.address;
    drop(page);
    // The server ends with its value.
    assert!(TcpStream::connect(address).is_err());
}
