//! A running robot program: exchanges lines with it, with time limits, until it ends or is killed.

use super::RobotFault;
use super::process_settings::{ProcessLimits, ProcessMode, ProcessSettings};
use super::protocol::{LoggedTorque, PROTOCOL, ToClient, ToHost};
use super::stop_reason::Stopping;
use super::stop_signal::{Listening, StopSignal};
use dynident_system::{PermittedProgram, Pipes, ProcessGroup};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::ChildStdin;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Maximum length of a line, bytes: about ten times a sample of a thousand joints.
const MAX_LINE_BYTES: u64 = 1 << 20;
const QUEUE_LINES: usize = 1024;
const STDERR_TAIL_BYTES: usize = 2000;
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Name of the capability that a program runs the approach and return paths of a run.
const HOME_CAPABILITY: &str = "home";

#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
enum LineError {
    /// The program of the robot wrote a line above the size limit, probably without line ends. End each message with a
    /// newline.
    #[error("the line is longer than a megabyte")]
    TooLong,
    /// The program of the robot wrote binary data to standard output, which is reserved for messages. Write messages as
    /// UTF-8 text.
    #[error("the line is not UTF-8 text")]
    NotText,
}

type Line = Result<String, LineError>;

#[derive(Debug)]
enum Event {
    Line(Line),
    Closed,
    /// A stop was requested; this event only wakes the reader.
    Woken,
}

#[derive(Debug)]
pub(super) enum Received {
    Message(ToHost),
    StopRequested,
}

#[derive(Debug)]
pub(super) enum Started {
    Ready(Box<Client>),
    StopRequested,
}

/// The running program. It is killed with its process group when dropped, if it does not end by itself.
#[derive(Debug)]
pub(super) struct Client {
    group: ProcessGroup,
    input: Option<ChildStdin>,
    events: Receiver<Event>,
    waker: SyncSender<Event>,
    last_words: Arc<Mutex<Vec<u8>>>,
    limits: ProcessLimits,
    /// Index in the program's vectors of each joint of the model.
    pub(super) places: Vec<usize>,
    /// Torque per logged unit for each joint of the program, Nm (N) per unit.
    pub(super) torque_per_unit: Vec<f64>,
    pub(super) runs_ways: bool,
    run_ends: Option<(Instant, f64)>,
    stop: Option<StopSignal>,
    listening: Option<Listening>,
    moving: bool,
    stop_sent: bool,
}

impl Client {
    pub(super) fn start(
        program: &PermittedProgram,
        settings: &ProcessSettings,
        joints: &[String],
        stop: Option<&StopSignal>,
    ) -> Result<Started, RobotFault> {
        let mut group = ProcessGroup::start(program, Pipes::ALL).map_err(|error| RobotFault::NotStarted {
            program: program.name().to_owned(),
            reason: error.to_string(),
        })?;
        // The queue is bounded: a program that is too fast waits, and memory does not grow.
        let (sender, events) = sync_channel(QUEUE_LINES);
        let waker = sender.clone();
        let child = group.program();
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
            group,
            input,
            events,
            waker,
            last_words,
            limits: settings.limits.clone(),
            places: Vec::new(),
            torque_per_unit: Vec::new(),
            runs_ways: false,
            run_ends: None,
            stop: None,
            listening: None,
            moving: false,
            stop_sent: false,
        };
        client.follow(stop);
        let hello = match client.next("hello", settings.limits.hello_s)? {
            Received::Message(message) => message,
            Received::StopRequested => return Ok(Started::StopRequested),
        };
        let ToHost::Hello { protocol, joints: found, modes, logs, capabilities, .. } = hello else {
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
        client.torque_per_unit = torque_per_unit(&logs, joints.len())?;
        client.runs_ways = capabilities.iter().any(|own| own == HOME_CAPABILITY);
        Ok(Started::Ready(Box::new(client)))
    }

    pub(super) fn follow(&mut self, stop: Option<&StopSignal>) {
        let (waker, id) = (self.waker.clone(), self.group.id());
        // If the queue is full, the reader wakes anyway.
        let wake = move || drop(waker.try_send(Event::Woken));
        self.listening = stop.map(|stop| stop.listen(Box::new(wake), Box::new(move || id.kill())));
        self.stop = stop.cloned();
    }

    /// Sets the end time of the run and its time limit, s.
    pub(super) fn limit_run(&mut self, run_ends: Option<(Instant, f64)>) {
        self.run_ends = run_ends;
    }

    pub(super) fn message_s(&self) -> f64 {
        self.limits.message_s
    }

    pub(super) fn silence_s(&self) -> Option<f64> {
        self.limits.silence_s
    }

    pub(super) fn send(&mut self, message: &ToClient, waiting_for: &'static str) -> Result<(), RobotFault> {
        match message {
            ToClient::Run { .. } | ToClient::Begin { .. } => (self.moving, self.stop_sent) = (true, false),
            ToClient::Stop { .. } => self.stop_sent = true,
            ToClient::Torque { .. } | ToClient::Finish {} | ToClient::Bye {} => {}
        }
        let sent = dynident_text::json::to_string(message).ok().and_then(|mut text| {
            text.push('\n');
            let input = self.input.as_mut()?;
            input.write_all(text.as_bytes()).and_then(|()| input.flush()).ok()
        });
        sent.ok_or(()).map_err(|()| self.died(waiting_for))
    }

    /// Sends a stop and reads until the program's end message, which confirms that the robot is at rest. Samples
    /// received meanwhile are passed to `keep`.
    pub(super) fn stop(&mut self, reason: &str, keep: &mut dyn FnMut(ToHost)) -> Stopping {
        let stop = ToClient::Stop { reason: reason.to_owned() };
        let ends = Instant::now() + Duration::from_secs_f64(self.limits.stop_s);
        self.run_ends = None;
        let left = || ends.saturating_duration_since(Instant::now());
        let mut listens = self.send(&stop, "end").is_ok();
        while listens {
            match self.next("end", left().as_secs_f64()) {
                Ok(Received::Message(ToHost::End { .. })) => return Stopping::Confirmed,
                Ok(Received::Message(message)) => keep(message),
                // Invalid lines before the end message are ignored.
                Ok(Received::StopRequested) | Err(RobotFault::Garbage { .. }) => {}
                Err(_) => listens = false,
            }
        }
        // The program may be stopping the robot although it no longer sends messages.
        if self.group.exit_within(left()).is_some() {
            return Stopping::Unknown;
        }
        self.limits.bye_s = 0.0;
        Stopping::Unanswered
    }

    /// Stops the program after a fault during a motion; `None` if no motion was running.
    pub(super) fn stop_after(&mut self, fault: &RobotFault) -> Option<Stopping> {
        if let (RobotFault::Short { .. }, false) = (fault, self.moving) {
            // The program reported the end of the run, so no answer is expected. If the robot still moves, the
            // program has the usual time to stop it.
            let _ = self.send(&ToClient::Stop { reason: fault.to_string() }, "end");
            self.limits.bye_s = self.limits.bye_s.max(self.limits.stop_s);
            return Some(Stopping::Unknown);
        }
        (self.moving && !self.stop_sent).then(|| self.stop(&fault.to_string(), &mut |_| {}))
    }

    /// Waits for the next message within the time limit, or for a stop request if no stop was sent.
    pub(super) fn next(&mut self, waiting_for: &'static str, limit_s: f64) -> Result<Received, RobotFault> {
        let begin = Instant::now();
        let mut limit = (Duration::from_secs_f64(limit_s), limit_s);
        if let Some((ends, run_s)) = self.run_ends {
            let left = ends.saturating_duration_since(begin);
            if left < limit.0 {
                limit = (left, run_s);
            }
        }
        let mut seen_dead = false;
        loop {
            if !self.stop_sent && self.stop.as_ref().is_some_and(StopSignal::is_requested) {
                return Ok(Received::StopRequested);
            }
            let left = limit.0.saturating_sub(begin.elapsed());
            match self.events.recv_timeout(left.min(POLL_INTERVAL)) {
                Ok(Event::Line(line)) => return self.heard(line).map(Received::Message),
                Ok(Event::Closed) | Err(RecvTimeoutError::Disconnected) => return Err(self.died(waiting_for)),
                // A child process may hold the pipe open. The last lines can still arrive after the program was first
                // seen to have ended.
                Err(RecvTimeoutError::Timeout) if self.group.exit().is_some() => {
                    if seen_dead {
                        return Err(self.died(waiting_for));
                    }
                    seen_dead = true;
                }
                Err(RecvTimeoutError::Timeout) if left.is_zero() => {
                    return Err(RobotFault::Hung { waiting_for: waiting_for.to_owned(), limit_s: limit.1 });
                }
                Ok(Event::Woken) | Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    fn heard(&mut self, line: Line) -> Result<ToHost, RobotFault> {
        let line = line.map_err(|error| RobotFault::Garbage { line: String::new(), reason: error.to_string() })?;
        let message = message(&line)
            .map_err(|error| RobotFault::Garbage { line: shortened(&line), reason: error.to_string() })?;
        if matches!(message, ToHost::End { .. }) {
            self.moving = false;
        }
        Ok(message)
    }

    fn died(&mut self, waiting_for: &'static str) -> RobotFault {
        // The program's output is closed: the program has ended, is ending, or has closed the output deliberately.
        let exit = self.group.exit_within(Duration::from_millis(500));
        let exit = exit.unwrap_or_else(|| "its standard output is closed".to_owned());
        // The reader thread may still be reading the last lines.
        std::thread::sleep(Duration::from_millis(20));
        let words = self.last_words.lock().map(|words| String::from_utf8_lossy(&words).trim().to_owned());
        let said = words.ok().filter(|words| !words.is_empty()).map(|words| format!("; it said: {words}"));
        RobotFault::Died { waiting_for: waiting_for.to_owned(), exit, said: said.unwrap_or_default() }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if self.moving && !self.stop_sent {
            // The run was abandoned during a motion, so the program has to stop the robot.
            let _ = self.send(&ToClient::Stop { reason: "the run was given up".to_owned() }, "end");
        }
        let _ = self.send(&ToClient::Bye {}, "end");
        self.input = None;
        let grace = Duration::from_secs_f64(self.limits.bye_s);
        self.group.exit_within(grace);
        self.group.end(grace);
        // From here on the process id may be reused.
        self.listening = None;
    }
}

fn torque_per_unit(logs: &LoggedTorque, joints: usize) -> Result<Vec<f64>, RobotFault> {
    let fault = |what: String, fix: &str| RobotFault::LoggedTorque { what, fix: fix.to_owned() };
    match logs {
        LoggedTorque::Drive => Ok(vec![1.0; joints]),
        LoggedTorque::Current { torque_per_ampere } => {
            if torque_per_ampere.len() != joints || torque_per_ampere.iter().any(|k| !k.is_finite() || *k == 0.0) {
                let fix = "set torque_per_ampere at the joint (torque constant times gear ratio) for each joint";
                return Err(fault(
                    format!("as currents with {} factors for {joints} joints", torque_per_ampere.len()),
                    fix,
                ));
            }
            Ok(torque_per_ampere.clone())
        }
        LoggedTorque::Reduced { without } => {
            let fix = "the missing part belongs to the identified robot; log the complete torque of the drives (a \
                       Franka's tau_J, not tau_J_d), or add the missing part before sending";
            Err(fault(format!("without {}", without.join(" and ")), fix))
        }
    }
}

fn read_lines(output: impl Read, sender: &SyncSender<Event>) {
    pass_lines(output, sender);
    let _ = sender.send(Event::Closed);
}

fn pass_lines(output: impl Read, sender: &SyncSender<Event>) {
    let mut reader = BufReader::new(output);
    loop {
        let mut bytes = Vec::new();
        let read = reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut bytes);
        let unfinished = bytes.len() as u64 >= MAX_LINE_BYTES && bytes.last() != Some(&b'\n');
        let line = match read {
            Ok(0) | Err(_) => return,
            Ok(count) if count as u64 >= MAX_LINE_BYTES => Err(LineError::TooLong),
            Ok(_) => String::from_utf8(bytes).map_err(|_| LineError::NotText),
        };
        if line.as_ref().is_ok_and(|line| line.trim().is_empty()) {
            continue;
        }
        if sender.send(Event::Line(line)).is_err() {
            return;
        }
        // Skip the rest of a line that is too long; the next line may be the answer to a stop.
        if unfinished && reader.skip_until(b'\n').is_err() {
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
        let excess = words.len().saturating_sub(STDERR_TAIL_BYTES);
        words.drain(..excess);
    }
}

/// Parses a message. JSON has no NaN or infinity, but many programs write them; they are read as missing numbers, so
/// that the error can name the sample.
fn message(line: &str) -> Result<ToHost, serde_json::Error> {
    serde_json::from_str(line).or_else(|error| {
        let fixed = line.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
        if fixed == line { Err(error) } else { serde_json::from_str(&fixed) }
    })
}

fn shortened(line: &str) -> String {
    line.trim().chars().take(200).collect()
}
