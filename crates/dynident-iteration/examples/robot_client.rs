//! A robot program with the line protocol, `docs/src/robot-protocol.md`: the simulator, served on standard input and
//! output. An example for programs of real robots, and the counterpart of the tests.
//!
//!     robot_client ROBOT.urdf [--fault KIND] [--part PART] [--at SAMPLE] [--marker FILE] [--unwatched yes]
//!         [--brakes MS] [--paced yes]
//!
//! A stop message, or the end of its input, stops the robot at the next sample; so does a sample outside of the
//! envelope of a motion, unless it is `--unwatched`. With `--fault` it fails at the given sample (default 50) of the
//! part (default motion), after writing a word to the marker file: die, hang, wait (for a message), ignore (a stop),
//! pause (a second), orphan (dies while a child process holds its output), garbage, nan, null, joints, backwards,
//! flood, megabyte, stop, short, turn; or it sends all samples `afterwards`; or it fails at its hello: deaf, protocol,
//! names, modes, homeless (without the capability `home`). With `--paced` it runs in real time.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "speaking is what this program is for")]

use dynident_excitation::Motion;
use dynident_model::load_robot;
use dynident_simulation::controllers::Measured;
use dynident_simulation::{ControllerSettings, Integrator, Plant, Reference, ReferenceSample};
use serde_json::{Value, json};
use std::error::Error;
use std::io::{BufRead, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

type Result<T> = core::result::Result<T, Box<dyn Error>>;

struct Client {
    plant: Plant,
    joints: Vec<String>,
    fault: String,
    at: usize,
    /// The part of the run in which it fails.
    part: String,
    marker: String,
    watched: bool,
    /// Time to stop after its failure, ms; its marker file is then updated.
    brakes: u64,
    /// Whether a sample in mode `run` is sent when it is due instead of at once.
    paced: bool,
    /// Messages of the host, read in a thread, so that a stop is received during a motion.
    messages: Receiver<Value>,
}

/// Why a motion ended early.
const INTERRUPTED: &str = "the host asked for it";

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give the robot's URDF file")?;
    let (mut fault, mut at, mut marker, mut watched) = (String::new(), 50, String::new(), true);
    let (mut brakes, mut paced) = (0, false);
    let mut part = "motion".to_owned();
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or("an option without a value")?;
        match name.as_str() {
            "--fault" => fault = value,
            "--at" => at = value.parse()?,
            "--part" => part = value,
            "--marker" => marker = value,
            "--unwatched" => watched = false,
            "--brakes" => brakes = value.parse()?,
            "--paced" => paced = true,
            _ => return Err(format!("unknown option {name}").into()),
        }
    }
    let model = load_robot(path)?.model;
    // Opposite order to the model: vectors follow the names of the hello.
    let joints: Vec<String> = model.joints().iter().rev().map(|joint| joint.name.clone()).collect();
    let plant = Plant::new(&model, &[], &[])?;
    let (sender, messages) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(core::result::Result::ok) {
            let Ok(message) = serde_json::from_str(&line) else { return };
            if sender.send(message).is_err() {
                return;
            }
        }
    });
    let mut client = Client { plant, joints, fault, at, part, marker, watched, brakes, paced, messages };
    client.hello()?;
    while let Ok(message) = client.messages.recv() {
        match message["type"].as_str() {
            Some("run") => client.run(&message)?,
            Some("begin") => client.steps(&message)?,
            // It is at rest already.
            Some("stop") => {}
            Some("bye") => break,
            other => return Err(format!("unknown message {other:?}").into()),
        }
    }
    Ok(())
}

fn send(message: &Value) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{message}")?;
    Ok(out.flush()?)
}

fn numbers(value: &Value) -> Result<Vec<f64>> {
    Ok(serde_json::from_value(value.clone())?)
}

fn turned(values: &[f64]) -> Vec<f64> {
    values.iter().rev().copied().collect()
}

impl Client {
    fn hello(&mut self) -> Result<()> {
        match self.fault.as_str() {
            "deaf" => std::thread::sleep(Duration::from_secs(3600)),
            "names" => self.joints[0].push_str("_x"),
            _ => {}
        }
        let protocol = if self.fault == "protocol" { "dynident-robot/9" } else { "dynident-robot/1" };
        let modes = if self.fault == "modes" { json!([]) } else { json!(["run", "step"]) };
        let hello = json!({
            "type": "hello", "protocol": protocol, "name": "simulator", "joints": self.joints, "modes": modes,
            "capabilities": if self.fault == "homeless" { json!([]) } else { json!(["home"]) },
        });
        send(&hello)
    }

    /// Writes a word to the marker file, completely or not at all.
    fn mark(&self, word: &str) -> Result<()> {
        if self.marker.is_empty() {
            return Ok(());
        }
        let unfinished = format!("{}.unfinished", self.marker);
        std::fs::write(&unfinished, word)?;
        Ok(std::fs::rename(unfinished, &self.marker)?)
    }

    fn stop_asked(&self) -> bool {
        match self.messages.try_recv() {
            Ok(message) => message["type"] == "stop",
            Err(TryRecvError::Empty) => false,
            Err(TryRecvError::Disconnected) => true,
        }
    }

    /// The breach of the envelope in the message, joints in the client's order; null limits are inactive.
    fn breach(&self, envelope: &Value, q: &[f64], dq: &[f64], tau: &[f64], target: &[f64]) -> Option<String> {
        if !self.watched {
            return None;
        }
        (0..q.len()).find_map(|joint| {
            let limit = |key: &str| envelope[key][joint].as_f64();
            let beyond = |key: &str, value: f64| {
                let limit = limit(key).filter(|limit| value.abs() > *limit)?;
                Some(format!("{key} of {} is {value:.4}, its limit {limit:.4}", self.joints[joint]))
            };
            let place = |key: &str, is_beyond: fn(f64, f64) -> bool| {
                let limit = limit(key).filter(|limit| is_beyond(q[joint], *limit))?;
                Some(format!("position of {} is {:.4}, its limit {limit:.4}", self.joints[joint], q[joint]))
            };
            place("lower", |q, limit| q < limit)
                .or_else(|| place("upper", |q, limit| q > limit))
                .or_else(|| beyond("speed", dq[joint]))
                .or_else(|| beyond("torque", tau[joint]))
                .or_else(|| beyond("tracking_error", target[joint] - q[joint]))
        })
    }

    /// Fails, if it is time. Returns true if the run is over.
    fn misbehave(&self, part: &str, sample: usize, time_s: f64) -> Result<bool> {
        if sample != self.at || part != self.part {
            return Ok(false);
        }
        let zeros = vec![0.0; self.joints.len()];
        let message = |t_s: f64, q: Value| json!({ "type": "sample", "t_s": t_s, "q": q, "tau": zeros });
        match self.fault.as_str() {
            "die" => {
                eprintln!("the brake is on fire");
                std::process::exit(3);
            }
            "hang" => {
                self.mark(&std::process::id().to_string())?;
                std::thread::sleep(Duration::from_secs(3600));
            }
            "orphan" => {
                let child = Command::new("sleep").arg("3600").stdin(Stdio::null()).spawn()?;
                self.mark(&child.id().to_string())?;
                eprintln!("left alone");
                std::process::exit(4);
            }
            "wait" => {
                self.mark(&std::process::id().to_string())?;
                let message = self.messages.recv()?;
                send(&json!({ "type": "end", "status": "stopped", "reason": message["type"] }))?;
                return Ok(true);
            }
            "ignore" => {
                self.mark(&std::process::id().to_string())?;
                self.messages.recv()?;
                std::thread::sleep(Duration::from_secs(3600));
            }
            "pause" => std::thread::sleep(Duration::from_secs(1)),
            "garbage" => println!("Segmentation fault (core dumped)"),
            "nan" => println!("{}", message(time_s, json!("Q")).to_string().replace("\"Q\"", "[NaN, 0.0]")),
            "null" => send(&message(time_s, json!([null, 0.0])))?,
            "joints" => send(&message(time_s, json!([0.0, 0.0, 0.0])))?,
            "backwards" => send(&message(0.0, json!(zeros)))?,
            "flood" => (0..1_000_000).try_for_each(|k| send(&message(time_s + f64::from(k) * 1e-6, json!(zeros))))?,
            "megabyte" => println!("{}", "x".repeat(3 << 20)),
            "turn" => send(&json!({ "type": "state", "t_s": time_s, "q": zeros, "dq": zeros }))?,
            "stop" => {
                send(&json!({ "type": "end", "status": "stopped", "reason": "protective stop" }))?;
                return Ok(true);
            }
            "short" => {
                send(&json!({ "type": "end", "status": "done" }))?;
                return Ok(true);
            }
            _ => {}
        }
        if self.brakes > 0 {
            let message = self.messages.recv()?;
            std::thread::sleep(Duration::from_millis(self.brakes));
            self.mark("stands")?;
            send(&json!({ "type": "end", "status": "stopped", "reason": message["type"] }))?;
            return Ok(true);
        }
        Ok(false)
    }

    fn run(&mut self, message: &Value) -> Result<()> {
        let file = |key: &str| std::fs::read_to_string(message[key].as_str().unwrap_or_default());
        let controller: Value = serde_json::from_str(&file("controller")?)?;
        let settings: ControllerSettings = serde_json::from_value(controller["controller"].clone())?;
        let dof = self.plant.dof();
        let message_envelope = message["envelope"].clone();
        let rate_hz = message["rate_hz"].as_f64().ok_or("no rate")?;
        // One controller runs through all parts without a pause.
        let mut parts = vec![("motion", table(&file("trajectory")?, dof, rate_hz)?)];
        if let Value::Object(home) = &message["home"] {
            let way =
                |key: &str| table(&std::fs::read_to_string(home[key].as_str().unwrap_or_default())?, dof, rate_hz);
            parts.insert(0, ("approach", way("approach")?));
            parts.push(("return", way("return")?));
        }
        let mut controller = settings.build(dof, None)?;
        let start = parts[0].1.motion().clone();
        self.plant.set_state(0.0, &first(&start.q, start.samples), &first(&start.dq, start.samples));
        controller.reset();
        let mut due = 0;
        let last = parts.len() - 1;
        let mut target = ReferenceSample::new(dof);
        let mut tau = vec![0.0; dof];
        let mut kept = Vec::new();
        let begin = Instant::now();
        for (place, (part, reference)) in parts.iter().enumerate() {
            // The samples that a path shares with the motion belong to the motion.
            let samples = match *part {
                "approach" => 0..reference.samples() - 1,
                "return" => 1..reference.samples(),
                _ => 0..reference.samples(),
            };
            for sample in samples {
                let time_s = sample as f64 / rate_hz;
                let due_s = f64::from(due) / rate_hz;
                due += 1;
                if self.paced {
                    std::thread::sleep(Duration::from_secs_f64(due_s).saturating_sub(begin.elapsed()));
                }
                self.plant.set_time_s(due_s);
                target.take(reference, sample);
                let measured = Measured { q: self.plant.q(), dq: self.plant.dq() };
                controller.torque(due_s, target.target(), measured, &mut tau);
                let (q, dq) = (turned(self.plant.q()), turned(self.plant.dq()));
                let (own, path) = (turned(&tau), turned(target.target().q));
                if self.misbehave(part, sample, time_s)? {
                    return Ok(());
                }
                let mut message = json!({ "type": "sample", "t_s": time_s, "q": q, "tau": own });
                if *part != "motion" {
                    message["part"] = json!(part);
                }
                if self.fault == "afterwards" {
                    kept.push(message);
                } else {
                    send(&message)?;
                }
                let why = if self.stop_asked() { Some(INTERRUPTED.to_owned()) } else { None };
                if let Some(reason) = why.or_else(|| self.breach(&message_envelope, &q, &dq, &own, &path)) {
                    self.mark(&format!("stopped in the {part} at {sample}"))?;
                    return send(&json!({ "type": "end", "status": "stopped", "reason": reason }));
                }
                if place < last || sample + 1 < reference.samples() {
                    self.plant.advance(&tau, 1.0 / rate_hz, Integrator::default())?;
                }
            }
        }
        if !kept.is_empty() {
            // Longer than a message may take, shorter than that plus the motion.
            std::thread::sleep(Duration::from_secs_f64(0.75 * message["duration_s"].as_f64().ok_or("no duration")?));
        }
        kept.iter().try_for_each(send)?;
        send(&json!({ "type": "end", "status": "done" }))
    }

    fn steps(&mut self, begin: &Value) -> Result<()> {
        self.plant.set_state(0.0, &turned(&numbers(&begin["q"])?), &turned(&numbers(&begin["dq"])?));
        let rate_hz = begin["rate_hz"].as_f64().ok_or("no rate")?;
        let mut sample = 0;
        loop {
            let time_s = f64::from(sample) / rate_hz;
            if self.misbehave(&self.part, sample as usize, time_s)? {
                return Ok(());
            }
            let (q, dq) = (turned(self.plant.q()), turned(self.plant.dq()));
            send(&json!({ "type": "state", "t_s": time_s, "q": q, "dq": dq }))?;
            let message = self.messages.recv()?;
            match message["type"].as_str() {
                Some("torque") => {}
                Some("finish") => return send(&json!({ "type": "end", "status": "done" })),
                _ => {
                    let reason = format!("{INTERRUPTED}, after {sample} torques");
                    self.mark(&reason)?;
                    return send(&json!({ "type": "end", "status": "stopped", "reason": reason }));
                }
            }
            self.plant.advance(&turned(&numbers(&message["tau"])?), 1.0 / rate_hz, Integrator::default())?;
            sample += 1;
        }
    }
}

fn table(text: &str, dof: usize, rate_hz: f64) -> Result<Reference> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for line in text.lines().skip(1) {
        rows.push(line.split(',').map(str::parse).collect::<core::result::Result<_, _>>()?);
    }
    let mut motion = Motion::default();
    motion.reset(dof, rows.len());
    for (sample, row) in rows.iter().enumerate() {
        for joint in 0..dof {
            let at = joint * motion.samples + sample;
            motion.q[at] = row[1 + joint];
            motion.dq[at] = row[1 + dof + joint];
            motion.ddq[at] = row[1 + 2 * dof + joint];
        }
    }
    Ok(Reference::new(rate_hz, motion)?)
}

fn first(values: &[f64], samples: usize) -> Vec<f64> {
    values.chunks(samples).map(|own| own[0]).collect()
}
