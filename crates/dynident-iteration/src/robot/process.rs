//! A robot that is another program: started, spoken to by lines, and given up when it does not answer in time.

use super::protocol::{PROTOCOL, ToClient, ToHost};
use super::{Robot, RobotFault, RobotRun, RobotStatus, RunRequest, conversation};
use dynident_simulation::Record;
use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Longest line that is read, bytes: a sample of a thousand joints is a tenth of it.
const LONGEST_LINE: u64 = 1 << 20;
/// What is kept of standard error, bytes.
const LAST_WORDS: usize = 2000;

/// Who runs the control loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProcessMode {
    /// The client, at its own rate, from the files that it is handed.
    #[default]
    Run,
    /// The host: a torque there, a state back.
    Step,
}

/// How long the client may take.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProcessLimits {
    /// From its start to its hello, s. Default 30.
    pub hello_s: f64,
    /// From one message to the next, s; in the mode `run` the first sample may also take the way to the start.
    /// Default 60.
    pub message_s: f64,
    /// A whole run, s. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_s: Option<f64>,
    /// From the host's bye to its end, s; then it is killed. Default 2.
    pub bye_s: f64,
}

impl Default for ProcessLimits {
    fn default() -> Self {
        Self { hello_s: 30.0, message_s: 60.0, run_s: None, bye_s: 2.0 }
    }
}

/// A robot program and how it is spoken to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessSettings {
    /// Program and arguments.
    pub command: Vec<String>,
    /// Who runs the control loop; default the client.
    #[serde(default)]
    pub mode: ProcessMode,
    /// How long it may take.
    #[serde(default)]
    pub limits: ProcessLimits,
    /// Folder for the files that are handed over, `run_k/trajectory.csv` and `run_k/controller.json`. Default a
    /// temporary folder, deleted with the robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
}

impl ProcessSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// No program, limits that are not positive.
    pub fn validate(&self) -> Result<(), SimulationError> {
        require(!self.command.is_empty(), "command", 0.0, "give the program and its arguments")?;
        let limits = &self.limits;
        let all = [("hello_s", limits.hello_s), ("message_s", limits.message_s), ("bye_s", limits.bye_s)];
        for (what, value) in all.into_iter().chain(limits.run_s.map(|value| ("run_s", value))) {
            require(value > 0.0 && value <= 1e6, format!("limits.{what}"), value, "give more than 0, at most 1e6 s")?;
        }
        Ok(())
    }
}

/// A robot behind a program's standard input and output. The program is started with the first run and kept for the
/// next; after a failure it is killed, and the next run starts it anew.
#[derive(Debug)]
pub struct ProcessRobot {
    settings: ProcessSettings,
    joints: Vec<String>,
    client: Option<Client>,
    temporary: Option<tempfile::TempDir>,
}

impl ProcessRobot {
    /// The robot of a program, with the model's joints.
    ///
    /// # Errors
    /// As [`ProcessSettings::validate`].
    pub fn new(settings: ProcessSettings, joints: Vec<String>) -> Result<Self, SimulationError> {
        settings.validate()?;
        Ok(Self { settings, joints, client: None, temporary: None })
    }

    /// The folder of a run's files.
    fn folder(&mut self, run: usize) -> Result<PathBuf, RobotFault> {
        let file = |path: PathBuf| move |error: std::io::Error| RobotFault::File { path, reason: error.to_string() };
        let base = if let Some(folder) = &self.settings.folder {
            folder.clone()
        } else {
            if self.temporary.is_none() {
                self.temporary = Some(tempfile::tempdir().map_err(file(std::env::temp_dir()))?);
            }
            self.temporary.as_ref().map(|folder| folder.path().to_owned()).unwrap_or_default()
        };
        let folder = base.join(format!("run_{run}"));
        std::fs::create_dir_all(&folder).map_err(file(folder.clone()))?;
        std::path::absolute(&folder).map_err(file(folder))
    }

    fn converse(&mut self, request: &RunRequest<'_>, record: &mut Record) -> Result<RobotStatus, RobotFault> {
        let folder = match self.settings.mode {
            ProcessMode::Run => Some(self.folder(request.run)?),
            ProcessMode::Step => None,
        };
        let client = match &mut self.client {
            Some(client) => client,
            none => none.insert(Client::start(&self.settings, &self.joints)?),
        };
        client.run_ends =
            self.settings.limits.run_s.map(|limit| (Instant::now() + Duration::from_secs_f64(limit), limit));
        match folder {
            Some(folder) => conversation::run(client, request, &self.joints, &folder, record),
            None => conversation::steps(client, request, record),
        }
    }
}

impl Robot for ProcessRobot {
    fn name(&self) -> &str {
        &self.settings.command[0]
    }

    fn joints(&self) -> &[String] {
        &self.joints
    }

    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        request.validate(self.joints.len())?;
        let mut record = conversation::empty_record(&self.joints, request.reference.rate_hz());
        let status = match self.converse(request, &mut record) {
            Ok(status) => status,
            Err(fault) => {
                // Whatever state it is in, the next run must not begin there.
                self.client = None;
                RobotStatus::Failed { fault }
            }
        };
        Ok(RobotRun { status, record: conversation::joint_major(record), truth: None })
    }
}

/// Why a line cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
enum LineError {
    #[error("longer than a megabyte")]
    TooLong,
    #[error("not UTF-8")]
    NotText,
}

/// A line, or why there is none.
type Line = Result<String, LineError>;

/// The started program. Killed when dropped, if it does not end by itself.
#[derive(Debug)]
pub(super) struct Client {
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<Line>,
    last_words: Arc<Mutex<Vec<u8>>>,
    limits: ProcessLimits,
    /// For each joint of the model, its place in the client's vectors.
    pub(super) places: Vec<usize>,
    run_ends: Option<(Instant, f64)>,
}

impl Client {
    fn start(settings: &ProcessSettings, joints: &[String]) -> Result<Self, RobotFault> {
        let program = &settings.command[0];
        let mut child = Command::new(program)
            .args(&settings.command[1..])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| RobotFault::NotStarted { program: program.clone(), reason: error.to_string() })?;
        // A queue that a client in a hurry fills, so that it waits and memory does not grow.
        let (sender, lines) = sync_channel(1024);
        if let Some(output) = child.stdout.take() {
            std::thread::spawn(move || read_lines(output, &sender));
        }
        let last_words = Arc::new(Mutex::new(Vec::new()));
        if let Some(errors) = child.stderr.take() {
            let words = Arc::clone(&last_words);
            std::thread::spawn(move || read_last_words(errors, &words));
        }
        let input = child.stdin.take();
        let mut client = Self {
            child,
            input,
            lines,
            last_words,
            limits: settings.limits.clone(),
            places: Vec::new(),
            run_ends: None,
        };
        let hello = client.receive("hello", settings.limits.hello_s)?;
        let ToHost::Hello { protocol, joints: found, modes, .. } = hello else {
            return Err(RobotFault::OutOfTurn { found: hello.kind().to_owned(), expected: "hello".to_owned() });
        };
        if protocol != PROTOCOL {
            return Err(RobotFault::Protocol { found: protocol, expected: PROTOCOL.to_owned() });
        }
        let wanted = match settings.mode {
            ProcessMode::Run => "run",
            ProcessMode::Step => "step",
        };
        if !modes.iter().any(|mode| mode == wanted) {
            let expected = format!("the mode {wanted}");
            return Err(RobotFault::Protocol { found: format!("the modes {}", modes.join(", ")), expected });
        }
        let places: Option<Vec<usize>> =
            joints.iter().map(|joint| found.iter().position(|other| other == joint)).collect();
        client.places = places
            .filter(|_| found.len() == joints.len())
            .ok_or(RobotFault::OtherJoints { expected: joints.to_vec(), found })?;
        Ok(client)
    }

    pub(super) fn send(&mut self, message: &ToClient, waiting_for: &'static str) -> Result<(), RobotFault> {
        let sent = serde_json::to_string(message).ok().and_then(|mut text| {
            text.push('\n');
            let input = self.input.as_mut()?;
            input.write_all(text.as_bytes()).and_then(|()| input.flush()).ok()
        });
        sent.ok_or(()).map_err(|()| self.died(waiting_for))
    }

    /// The next message, in time.
    pub(super) fn next(&mut self, waiting_for: &'static str) -> Result<ToHost, RobotFault> {
        self.receive(waiting_for, self.limits.message_s)
    }

    fn receive(&mut self, waiting_for: &'static str, limit_s: f64) -> Result<ToHost, RobotFault> {
        let mut wait = (Duration::from_secs_f64(limit_s), limit_s);
        if let Some((ends, run_s)) = self.run_ends {
            let left = ends.saturating_duration_since(Instant::now());
            if left < wait.0 {
                wait = (left, run_s);
            }
        }
        match self.lines.recv_timeout(wait.0) {
            Ok(Ok(line)) => message(&line)
                .map_err(|error| RobotFault::Garbage { line: shortened(&line), reason: error.to_string() }),
            Ok(Err(error)) => Err(RobotFault::Garbage { line: String::new(), reason: error.to_string() }),
            Err(RecvTimeoutError::Timeout) => {
                Err(RobotFault::Hung { waiting_for: waiting_for.to_owned(), limit_s: wait.1 })
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.died(waiting_for)),
        }
    }

    fn died(&mut self, waiting_for: &'static str) -> RobotFault {
        // Its output is closed: it has ended, is about to, or has closed it on purpose.
        let exit = match wait_until(&mut self.child, Duration::from_millis(500)) {
            Some(status) => status.to_string(),
            None => "its standard output is closed".to_owned(),
        };
        // The other thread may still be reading what was written last.
        std::thread::sleep(Duration::from_millis(20));
        let words = self.last_words.lock().map(|words| String::from_utf8_lossy(&words).trim().to_owned());
        let said = words.ok().filter(|words| !words.is_empty()).map(|words| format!("; it said: {words}"));
        RobotFault::Died { waiting_for: waiting_for.to_owned(), exit, said: said.unwrap_or_default() }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.send(&ToClient::Bye {}, "end");
        self.input = None;
        if wait_until(&mut self.child, Duration::from_secs_f64(self.limits.bye_s)).is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The child's exit status, if it ends within the time.
fn wait_until(child: &mut Child, limit: Duration) -> Option<std::process::ExitStatus> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if start.elapsed() < limit => std::thread::sleep(Duration::from_millis(5)),
            _ => return None,
        }
    }
}

fn read_lines(output: impl Read, sender: &SyncSender<Line>) {
    let mut reader = BufReader::new(output);
    loop {
        let mut bytes = Vec::new();
        let read = reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut bytes);
        let line = match read {
            Ok(0) | Err(_) => return,
            Ok(count) if count as u64 >= LONGEST_LINE => Err(LineError::TooLong),
            Ok(_) => String::from_utf8(bytes).map_err(|_| LineError::NotText),
        };
        if line.as_ref().is_ok_and(|line| line.trim().is_empty()) {
            continue;
        }
        let last = line.is_err();
        // Nobody listens any more: the robot was given up.
        if sender.send(line).is_err() || last {
            return;
        }
    }
}

fn read_last_words(mut errors: impl Read, words: &Mutex<Vec<u8>>) {
    let mut buffer = [0; 512];
    while let Ok(count) = errors.read(&mut buffer) {
        if count == 0 {
            return;
        }
        let Ok(mut words) = words.lock() else { return };
        words.extend_from_slice(&buffer[..count]);
        let excess = words.len().saturating_sub(LAST_WORDS);
        words.drain(..excess);
    }
}

/// A message. JSON has no NaN and no infinity, but many programs write them: they are read as missing numbers, so that
/// the verdict can name the sample.
fn message(line: &str) -> Result<ToHost, serde_json::Error> {
    serde_json::from_str(line).or_else(|error| {
        let fixed = line.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
        if fixed == line { Err(error) } else { serde_json::from_str(&fixed) }
    })
}

fn shortened(line: &str) -> String {
    line.trim().chars().take(200).collect()
}
