//! The live page of `iterate`: a run is seen and stopped from it.
#![cfg(unix)]

use crate::robots_outside::{robot, said, study};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest time for a program of a busy computer to answer.
const PATIENCE: Duration = Duration::from_secs(60);

struct Live {
    program: Child,
    errors: BufReader<ChildStderr>,
    address: String,
    path: String,
}

impl Live {
    fn begin(study: &std::path::Path, further: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
        command.arg("iterate").arg(study).arg("--out").arg(study.with_file_name("result"));
        command.args(["--allow-command", "--live"]).args(further);
        let mut program = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut errors = BufReader::new(program.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("live page: ") {
            line.clear();
            assert!(errors.read_line(&mut line).unwrap() > 0, "no link");
        }
        let url = line.trim().split_once("http://").unwrap().1;
        let (address, path) = url.split_once('/').unwrap();
        Self { program, errors, address: address.to_owned(), path: format!("/{path}") }
    }

    fn asked(&self, method: &str, name: &str) -> Option<String> {
        let mut stream = TcpStream::connect(&self.address).ok()?;
        let (path, address) = (&self.path, &self.address);
        stream.write_all(format!("{method} {path}{name} HTTP/1.1\r\nHost: {address}\r\n\r\n").as_bytes()).ok()?;
        let mut text = String::new();
        stream.read_to_string(&mut text).ok()?;
        let (head, body) = text.split_once("\r\n\r\n")?;
        head.starts_with("HTTP/1.1 200").then(|| body.to_owned())
    }

    fn state_when(&self, holds: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        loop {
            let state: Value = serde_json::from_str(&self.asked("GET", "state").unwrap()).unwrap();
            if holds(&state) {
                return state;
            }
            assert!(begin.elapsed() < PATIENCE, "{state}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

#[test]
fn a_run_is_seen_and_stopped_from_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let rest = r#"printf '%s\n' '{"type":"sample","t_s":0.5,"q":[0.001,0.002],"tau":[1.0,2.0]}'
        read -r stop; printf '%s\n' "$stop" >>"$1/heard"
        printf '%s\n' '{"type":"end","status":"stopped","reason":"as asked"}'"#;
    robot(folder.path(), rest);
    let study = study(folder.path(), "");
    let mut live = Live::begin(&study, &[]);
    let state = live.state_when(|state| state["rows"].as_array().is_some_and(|rows| rows.len() == 2));
    assert_eq!(state["rows"][1], serde_json::json!([0.5, 0.001, 0.002, 1.0, 2.0]));
    assert_eq!((&state["is_moving"], &state["head"]["words"]), (&true.into(), &"run 1".into()));
    assert!(live.asked("GET", "").unwrap().contains("Stop the robot"));
    assert!(!folder.path().join("heard").exists());
    live.asked("POST", "stop").unwrap();
    // The open page sees the end.
    let last = live.state_when(|state| state["ended"] == true);
    assert!(last["status"].as_str().unwrap().contains("ended"), "{last}");
    let status = live.program.wait().unwrap();
    let mut rest = String::new();
    live.errors.read_to_string(&mut rest).unwrap();
    assert_eq!(status.code(), Some(130), "{rest}");
    let heard = std::fs::read_to_string(folder.path().join("heard")).unwrap();
    assert!(heard.lines().count() == 1 && heard.contains(r#""type":"stop""#), "{heard}");
    // Nothing listens after the command.
    assert!(TcpStream::connect(&live.address).is_err());
}

#[test]
fn an_address_that_cannot_be_used_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    robot(folder.path(), "");
    let study = study(folder.path(), "");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let run = |further: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
        command.arg("iterate").arg(&study).arg("--out").arg(study.with_file_name("result")).arg("--allow-command");
        command.args(further).stdin(Stdio::null()).output().unwrap()
    };
    let output = run(&["--live", "--live-address", &address]);
    assert!(output.status.code() == Some(2) && said(&output).contains("--live-address"), "{}", said(&output));
    // The address is only for the live page, and is not a name.
    for further in [&["--live-address", "127.0.0.1:0"][..], &["--live", "--live-address", "localhost:0"]] {
        assert_eq!(run(further).status.code(), Some(2));
    }
}
