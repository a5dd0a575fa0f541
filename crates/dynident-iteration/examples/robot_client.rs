//! A robot program behind the line protocol, `docs/src/robot-protocol.md`: the simulator, served on standard input and
//! output. What a program for a real robot looks like, and what the tests speak to.
//!
//!     robot_client ROBOT.urdf [--fault KIND] [--at SAMPLE]
//!
//! With `--fault` it misbehaves at the given sample (default 50): die, hang, garbage, nan, null, joints, backwards,
//! flood, megabyte, stop, short, turn; or at its hello: deaf, protocol, names, modes.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "speaking is what this program is for")]

use dynident_excitation::Motion;
use dynident_model::load_robot;
use dynident_simulation::{ControllerSettings, Integrator, LoopSettings, Plant, Reference, closed_loop};
use serde_json::{Value, json};
use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Duration;

type Result<T> = core::result::Result<T, Box<dyn Error>>;

struct Client {
    plant: Plant,
    joints: Vec<String>,
    fault: String,
    at: usize,
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give the robot's URDF file")?;
    let (mut fault, mut at) = (String::new(), 50);
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or("an option without a value")?;
        match name.as_str() {
            "--fault" => fault = value,
            "--at" => at = value.parse()?,
            _ => return Err(format!("unknown option {name}").into()),
        }
    }
    let model = load_robot(path)?.model;
    // The other way round than the model: vectors follow the names of the hello.
    let joints: Vec<String> = model.joints().iter().rev().map(|joint| joint.name.clone()).collect();
    let plant = Plant::new(&model, &[], &[])?;
    let mut client = Client { plant, joints, fault, at };
    client.hello()?;
    let mut lines = std::io::stdin().lock().lines();
    while let Some(line) = lines.next() {
        let message: Value = serde_json::from_str(&line?)?;
        match message["type"].as_str() {
            Some("run") => client.run(&message)?,
            Some("begin") => client.steps(&message, &mut lines)?,
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

/// A vector in the other order.
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
        });
        send(&hello)
    }

    /// Misbehaves, if it is time for it. True if the run is over.
    fn misbehave(&self, sample: usize, time_s: f64) -> Result<bool> {
        if sample != self.at {
            return Ok(false);
        }
        let zeros = vec![0.0; self.joints.len()];
        let message = |t_s: f64, q: Value| json!({ "type": "sample", "t_s": t_s, "q": q, "tau": zeros });
        match self.fault.as_str() {
            "die" => {
                eprintln!("the brake is on fire");
                std::process::exit(3);
            }
            "hang" => std::thread::sleep(Duration::from_secs(3600)),
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
        Ok(false)
    }

    /// Runs the controller by itself, from the files.
    fn run(&mut self, message: &Value) -> Result<()> {
        let file = |key: &str| std::fs::read_to_string(message[key].as_str().unwrap_or_default());
        let controller: Value = serde_json::from_str(&file("controller")?)?;
        let settings: ControllerSettings = serde_json::from_value(controller["controller"].clone())?;
        let dof = self.plant.dof();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for line in file("trajectory")?.lines().skip(1) {
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
        let rate_hz = message["rate_hz"].as_f64().ok_or("no rate")?;
        let reference = Reference::new(rate_hz, motion)?;
        let mut controller = settings.build(dof, None)?;
        let run = closed_loop(&mut self.plant, controller.as_mut(), &reference, &LoopSettings::default())?;
        for sample in 0..run.samples {
            let of =
                |values: &[f64]| -> Vec<f64> { (0..dof).rev().map(|j| values[j * run.samples + sample]).collect() };
            if self.misbehave(sample, run.time_s(sample))? {
                return Ok(());
            }
            send(&json!({ "type": "sample", "t_s": run.time_s(sample), "q": of(&run.q), "tau": of(&run.tau) }))?;
        }
        if run.status.is_done() {
            send(&json!({ "type": "end", "status": "done" }))
        } else {
            send(&json!({ "type": "end", "status": "stopped", "reason": run.status.to_string() }))
        }
    }

    /// Holds the torques that it is sent.
    fn steps(&mut self, begin: &Value, lines: &mut impl Iterator<Item = std::io::Result<String>>) -> Result<()> {
        self.plant.set_state(0.0, &turned(&numbers(&begin["q"])?), &turned(&numbers(&begin["dq"])?));
        let rate_hz = begin["rate_hz"].as_f64().ok_or("no rate")?;
        let mut sample = 0;
        loop {
            let time_s = f64::from(sample) / rate_hz;
            if self.misbehave(sample as usize, time_s)? {
                return Ok(());
            }
            let (q, dq) = (turned(self.plant.q()), turned(self.plant.dq()));
            send(&json!({ "type": "state", "t_s": time_s, "q": q, "dq": dq }))?;
            let message: Value = serde_json::from_str(&lines.next().ok_or("the host has gone")??)?;
            if message["type"] == "finish" {
                return send(&json!({ "type": "end", "status": "done" }));
            }
            self.plant.advance(&turned(&numbers(&message["tau"])?), 1.0 / rate_hz, Integrator::default())?;
            sample += 1;
        }
    }
}
