use super::client::{Client, Received};
use super::protocol::{EndStatus, ToClient, ToHost, WayFiles};
use super::recorder::Recorder;
use super::stop_reason::Stopping;
use super::stream_watch::StreamWatch;
use super::{RobotFault, RobotStatus, RunRequest, handover};
use dynident_simulation::Record;
use dynident_simulation::ReferenceSample;
use dynident_simulation::controllers::Measured;
use std::path::Path;
use std::time::Instant;

/// Maximum ratio of recorded samples to samples of the reference.
const MAX_SAMPLE_RATIO: usize = 100;

/// Mode `run`: the robot program runs the controller and sends its samples.
pub(super) fn run(
    client: &mut Client,
    request: &RunRequest<'_>,
    joints: &[String],
    folder: &Path,
    recorder: &mut Recorder<'_>,
) -> Result<RobotStatus, RobotFault> {
    if request.ways.is_some() && !client.runs_ways {
        return Err(RobotFault::NoWays);
    }
    send_run(client, request, joints, folder)?;
    let reference = request.reference;
    let all = request.ways.map_or(0, |ways| ways.approach.samples() + ways.back.samples()) + reference.samples();
    let most = MAX_SAMPLE_RATIO * all + 1000;
    let mut stream = StreamWatch::new(client.silence_s());
    let whole_s = recorder.left_s();
    loop {
        // Samples can arrive after the motion, so the remaining time of the run is added.
        let longest_s = client.message_s() + recorder.left_s();
        let silence_s = stream.limit_s().filter(|limit_s| *limit_s < longest_s && !recorder.is_at_end_of_part());
        let heard = client.next("sample", silence_s.unwrap_or(longest_s)).map_err(|fault| match (fault, silence_s) {
            (RobotFault::Hung { limit_s, .. }, Some(own_s)) if limit_s == own_s => RobotFault::Silent { limit_s },
            (fault, _) => fault,
        });
        match heard? {
            Received::StopRequested => {
                let stopping = stopped(client, recorder, most, INTERRUPTED);
                return Ok(RobotStatus::Interrupted { stopping });
            }
            Received::Message(ToHost::Sample { part, t_s, q, dq, tau }) => {
                if recorder.samples() >= most {
                    return Err(RobotFault::TooMuch { most, duration_s: reference.duration_s() });
                }
                recorder.enter(part)?;
                let (places, torque_per_unit) = (&client.places, &client.torque_per_unit);
                let dq = keep_sample(places, torque_per_unit, recorder.record(), t_s, &q, dq.as_deref(), &tau)?;
                stream.arrived(Instant::now(), whole_s - recorder.left_s());
                if let Some(status) = stopped_if_unsafe(client, recorder, dq.as_deref(), most) {
                    return Ok(status);
                }
            }
            Received::Message(ToHost::End { status: EndStatus::Stopped, reason }) => {
                return Ok(RobotStatus::Stopped { reason });
            }
            Received::Message(ToHost::End { status: EndStatus::Done, .. }) => {
                recorder.require_whole()?;
                return Ok(RobotStatus::Done);
            }
            Received::Message(other) => {
                return Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "sample".to_owned() });
            }
        }
    }
}

fn send_run(client: &mut Client, request: &RunRequest<'_>, joints: &[String], folder: &Path) -> Result<(), RobotFault> {
    let [trajectory, controller] = handover::write(request, joints, folder)?;
    let paths = handover::write_ways(request, folder)?;
    let reference = request.reference;
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let home = request.ways.zip(paths).map(|(ways, [approach, back])| WayFiles {
        approach: text(&approach),
        approach_s: ways.approach.duration_s(),
        back: text(&back),
        return_s: ways.back.duration_s(),
    });
    client.send(
        &ToClient::Run {
            run: request.run,
            rate_hz: reference.rate_hz(),
            duration_s: reference.duration_s(),
            trajectory: text(&trajectory),
            controller: text(&controller),
            envelope: request.envelope.map(|envelope| envelope.in_order(&client.places)),
            home,
        },
        "sample",
    )
}

/// Stops the program if the newest sample leaves the safety envelope or the motion oscillates; returns the status of
/// the run. `most` is the maximum number of stored samples.
fn stopped_if_unsafe(
    client: &mut Client,
    recorder: &mut Recorder<'_>,
    dq: Option<&[f64]>,
    most: usize,
) -> Option<RobotStatus> {
    if let Some(breach) = recorder.look(dq) {
        let stopping = stopped(client, recorder, most, &breach.to_string());
        return Some(RobotStatus::LeftEnvelope { breach, stopping });
    }
    let oscillation = recorder.look_for_oscillation()?;
    let stopping = stopped(client, recorder, most, &oscillation.to_string());
    Some(RobotStatus::Oscillated { oscillation, stopping })
}

/// Reason in the stop message if a person requested the stop.
const INTERRUPTED: &str = "interrupted";

/// Stops a program. Samples that it still sends are stored as long as they are valid.
fn stopped(client: &mut Client, recorder: &mut Recorder<'_>, most: usize, reason: &str) -> Stopping {
    let order = (client.places.clone(), client.torque_per_unit.clone());
    let mut fine = true;
    client.stop(reason, &mut |message| {
        if let ToHost::Sample { part, t_s, q, dq, tau } = &message
            && fine
            && recorder.samples() < most
        {
            fine = recorder.enter(*part).is_ok()
                && keep_sample(&order.0, &order.1, recorder.record(), *t_s, q, dq.as_deref(), tau).is_ok();
        }
    })
}

fn keep_sample(
    places: &[usize],
    torque_per_unit: &[f64],
    record: &mut Record,
    t_s: Option<f64>,
    q: &[Option<f64>],
    dq: Option<&[Option<f64>]>,
    tau: &[Option<f64>],
) -> Result<Option<Vec<f64>>, RobotFault> {
    let sample = record.samples;
    let time_s = time(t_s, sample, record.times_s.last())?;
    let (q, tau) = (vector(places, q, "q", sample)?, vector(places, tau, "tau", sample)?);
    let dq = dq.map(|dq| vector(places, dq, "dq", sample)).transpose()?;
    record.times_s.push(time_s);
    record.q.extend(q);
    record.tau.extend(tau.iter().zip(places).map(|(tau, &place)| tau * torque_per_unit[place]));
    record.samples += 1;
    Ok(dq)
}

/// Mode `step`: Dynident runs the controller, sample by sample.
pub(super) fn steps(
    client: &mut Client,
    request: &RunRequest<'_>,
    recorder: &mut Recorder<'_>,
) -> Result<RobotStatus, RobotFault> {
    // This was already checked with the request.
    let Ok(reference) = request.whole() else {
        return Ok(RobotStatus::Stopped {
            reason: "the paths from and to home do not belong to the motion".to_owned(),
        });
    };
    let reference = &*reference;
    let joints = reference.joints();
    let Ok(mut controller) = request.controller.build(joints, request.model) else {
        return Ok(RobotStatus::Stopped { reason: "the controller cannot be built".to_owned() });
    };
    let mut target = ReferenceSample::new(joints);
    target.take(reference, 0);
    let own_order = |values: &[f64]| in_client_order(client, values);
    let begin = ToClient::Begin {
        run: request.run,
        rate_hz: reference.rate_hz(),
        samples: reference.samples(),
        q: own_order(target.target().q),
        dq: own_order(target.target().dq),
        envelope: request.envelope.map(|envelope| envelope.in_order(&client.places)),
    };
    client.send(&begin, "state")?;
    let mut before_s = None;
    let mut tau = vec![0.0; joints];
    for sample in 0..reference.samples() {
        let (time_s, q, dq) = match client.next("state", client.message_s())? {
            Received::Message(ToHost::State { t_s, q, dq }) => (
                time(t_s, sample, before_s.as_ref())?,
                vector(&client.places, &q, "q", sample)?,
                vector(&client.places, &dq, "dq", sample)?,
            ),
            Received::Message(ToHost::End { reason, .. }) => return Ok(RobotStatus::Stopped { reason }),
            Received::Message(other) => {
                return Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "state".to_owned() });
            }
            Received::StopRequested => {
                let stopping = stopped(client, recorder, 0, INTERRUPTED);
                return Ok(RobotStatus::Interrupted { stopping });
            }
        };
        target.take(reference, sample);
        let due_s = sample as f64 / reference.rate_hz();
        controller.torque(due_s, target.target(), Measured { q: &q, dq: &dq }, &mut tau);
        if tau.iter().any(|tau| !tau.is_finite()) {
            return Err(RobotFault::Torque { sample });
        }
        before_s = Some(time_s);
        let time_s = recorder.time_of_next(time_s);
        let record = recorder.record();
        record.times_s.push(time_s);
        record.q.extend(q);
        record.tau.extend_from_slice(&tau);
        record.samples += 1;
        // The check comes before sending: a torque beyond the safety envelope is never sent.
        if let Some(status) = stopped_if_unsafe(client, recorder, Some(&dq), 0) {
            return Ok(status);
        }
        let message = if sample + 1 < reference.samples() {
            ToClient::Torque { tau: in_client_order(client, &tau) }
        } else {
            ToClient::Finish {}
        };
        client.send(&message, "state")?;
    }
    ended(client, recorder)
}

fn ended(client: &mut Client, recorder: &mut Recorder<'_>) -> Result<RobotStatus, RobotFault> {
    match client.next("end", client.message_s())? {
        Received::Message(ToHost::End { status: EndStatus::Done, .. }) => Ok(RobotStatus::Done),
        Received::Message(ToHost::End { reason, .. }) => Ok(RobotStatus::Stopped { reason }),
        Received::Message(other) => {
            Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "end".to_owned() })
        }
        Received::StopRequested => {
            let stopping = stopped(client, recorder, 0, INTERRUPTED);
            Ok(RobotStatus::Interrupted { stopping })
        }
    }
}

fn in_client_order(client: &Client, values: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; values.len()];
    for (value, &place) in values.iter().zip(&client.places) {
        out[place] = *value;
    }
    out
}

fn time(t_s: Option<f64>, sample: usize, before: Option<&f64>) -> Result<f64, RobotFault> {
    let not_a_number = || RobotFault::NotANumber { sample, what: "t_s".to_owned() };
    let time_s = t_s.filter(|t| t.is_finite()).ok_or_else(not_a_number)?;
    match before {
        Some(&before_s) if time_s <= before_s => Err(RobotFault::Time { sample, time_s, before_s }),
        _ => Ok(time_s),
    }
}

/// Sorts a vector of the program into the order of the model's joints.
fn vector(places: &[usize], values: &[Option<f64>], what: &'static str, sample: usize) -> Result<Vec<f64>, RobotFault> {
    let expected = places.len();
    if values.len() != expected {
        return Err(RobotFault::WrongJoints { sample, what: what.to_owned(), expected, found: values.len() });
    }
    let one = |&place: &usize| {
        let not_a_number = || RobotFault::NotANumber { sample, what: format!("{what}[{place}]") };
        values[place].filter(|x| x.is_finite()).ok_or_else(not_a_number)
    };
    places.iter().map(one).collect()
}
