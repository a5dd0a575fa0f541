//! The two ways of a run with a robot program.

use super::client::{Client, Heard};
use super::envelope::EnvelopeWatch;
use super::protocol::{EndStatus, ToClient, ToHost};
use super::stop_reason::Stopping;
use super::{RobotFault, RobotStatus, RunRequest, handover};
use dynident_simulation::Record;
use dynident_simulation::ReferenceSample;
use dynident_simulation::controllers::Measured;
use std::path::Path;

/// Samples that are taken for each of the reference: a log may be finer, but not without end.
const FINEST: usize = 100;

/// A record to be filled sample by sample: until [`joint_major`] its arrays are sample-major.
pub(super) fn empty_record(joints: &[String], rate_hz: f64) -> Record {
    Record { joints: joints.to_vec(), rate_hz, samples: 0, times_s: Vec::new(), q: Vec::new(), tau: Vec::new() }
}

/// From sample-major to joint-major.
pub(super) fn joint_major(mut record: Record) -> Record {
    let (joints, samples) = (record.joints.len(), record.samples);
    for values in [&mut record.q, &mut record.tau] {
        *values = (0..joints * samples).map(|at| values[at % samples * joints + at / samples]).collect();
    }
    record
}

/// The client runs by itself and streams what it records.
pub(super) fn run(
    client: &mut Client,
    request: &RunRequest<'_>,
    joints: &[String],
    folder: &Path,
    record: &mut Record,
) -> Result<RobotStatus, RobotFault> {
    let [trajectory, controller] = handover::write(request, joints, folder)?;
    let reference = request.reference;
    let text = |path: &Path| path.to_string_lossy().into_owned();
    client.send(
        &ToClient::Run {
            run: request.run,
            rate_hz: reference.rate_hz(),
            duration_s: reference.duration_s(),
            trajectory: text(&trajectory),
            controller: text(&controller),
            envelope: request.envelope.map(|envelope| envelope.in_order(&client.places)),
        },
        "sample",
    )?;
    let most = FINEST * reference.samples() + 1000;
    let mut watch = EnvelopeWatch::new(request.envelope, reference);
    loop {
        // Samples may come afterwards: what is left of the motion counts as well.
        let left_s = (reference.duration_s() - record.times_s.last().copied().unwrap_or(0.0)).max(0.0);
        match client.next("sample", client.message_s() + left_s)? {
            Heard::StopRequested => {
                let stopping = stopped(client, record, most, INTERRUPTED);
                return Ok(RobotStatus::Interrupted { stopping });
            }
            Heard::Message(ToHost::Sample { t_s, q, dq, tau }) => {
                if record.samples >= most {
                    return Err(RobotFault::TooMuch { most, duration_s: reference.duration_s() });
                }
                let dq = keep_sample(client, record, (t_s, &q, dq.as_deref(), &tau))?;
                if let Some(breach) = watch.look(record, dq.as_deref()) {
                    let stopping = stopped(client, record, most, &breach.to_string());
                    return Ok(RobotStatus::LeftEnvelope { breach, stopping });
                }
            }
            Heard::Message(ToHost::End { status: EndStatus::Stopped, reason }) => {
                return Ok(RobotStatus::Stopped { reason });
            }
            Heard::Message(ToHost::End { status: EndStatus::Done, .. }) => {
                let (end_s, duration_s) = (record.times_s.last().copied().unwrap_or(0.0), reference.duration_s());
                // Up to two samples of the slower of the two clocks may be missing, or a hundredth of the run.
                if end_s < 0.99 * duration_s - 2.0 / reference.rate_hz() || record.samples == 0 {
                    return Err(RobotFault::Short { end_s, duration_s });
                }
                return Ok(RobotStatus::Done);
            }
            Heard::Message(other) => {
                return Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "sample".to_owned() });
            }
        }
    }
}

/// What a client's stop message says where a person asked for it.
const INTERRUPTED: &str = "interrupted";

/// Stops a client. Samples that it still sends are kept as long as they are such.
fn stopped(client: &mut Client, record: &mut Record, most: usize, reason: &str) -> Stopping {
    let order = (client.places.clone(), client.torque_per_unit.clone());
    let mut fine = true;
    client.stop(reason, &mut |message| {
        if let ToHost::Sample { t_s, q, dq, tau } = &message
            && fine
            && record.samples < most
        {
            fine = keep_sample_of((&order.0, &order.1), record, (*t_s, q, dq.as_deref(), tau)).is_ok();
        }
    })
}

/// A sample's time, positions, velocities and torques as a client sends them.
type SentSample<'a> = (Option<f64>, &'a [Option<f64>], Option<&'a [Option<f64>]>, &'a [Option<f64>]);

fn keep_sample(client: &Client, record: &mut Record, sent: SentSample<'_>) -> Result<Option<Vec<f64>>, RobotFault> {
    keep_sample_of((&client.places, &client.torque_per_unit), record, sent)
}

/// Appends a sample to the record; its velocities, if it has them.
fn keep_sample_of(
    (places, torque_per_unit): (&[usize], &[f64]),
    record: &mut Record,
    (t_s, q, dq, tau): SentSample<'_>,
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

/// The host runs the controller, sample by sample.
pub(super) fn steps(
    client: &mut Client,
    request: &RunRequest<'_>,
    record: &mut Record,
) -> Result<RobotStatus, RobotFault> {
    let reference = request.reference;
    let joints = reference.joints();
    // Checked with the request.
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
    let mut watch = EnvelopeWatch::new(request.envelope, reference);
    let mut tau = vec![0.0; joints];
    for sample in 0..reference.samples() {
        let (time_s, q, dq) = match client.next("state", client.message_s())? {
            Heard::Message(ToHost::State { t_s, q, dq }) => (
                time(t_s, sample, record.times_s.last())?,
                vector(&client.places, &q, "q", sample)?,
                vector(&client.places, &dq, "dq", sample)?,
            ),
            Heard::Message(ToHost::End { reason, .. }) => return Ok(RobotStatus::Stopped { reason }),
            Heard::Message(other) => {
                return Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "state".to_owned() });
            }
            Heard::StopRequested => {
                let stopping = stopped(client, record, 0, INTERRUPTED);
                return Ok(RobotStatus::Interrupted { stopping });
            }
        };
        target.take(reference, sample);
        let due_s = sample as f64 / reference.rate_hz();
        controller.torque(due_s, target.target(), Measured { q: &q, dq: &dq }, &mut tau);
        if tau.iter().any(|tau| !tau.is_finite()) {
            return Err(RobotFault::Torque { sample });
        }
        record.times_s.push(time_s);
        record.q.extend(q);
        record.tau.extend_from_slice(&tau);
        record.samples += 1;
        // Before the torque is sent: one beyond the envelope never is.
        if let Some(breach) = watch.look(record, Some(&dq)) {
            let stopping = stopped(client, record, 0, &breach.to_string());
            return Ok(RobotStatus::LeftEnvelope { breach, stopping });
        }
        let message = if sample + 1 < reference.samples() {
            ToClient::Torque { tau: in_client_order(client, &tau) }
        } else {
            ToClient::Finish {}
        };
        client.send(&message, "state")?;
    }
    match client.next("end", client.message_s())? {
        Heard::Message(ToHost::End { status: EndStatus::Done, .. }) => Ok(RobotStatus::Done),
        Heard::Message(ToHost::End { reason, .. }) => Ok(RobotStatus::Stopped { reason }),
        Heard::Message(other) => {
            Err(RobotFault::OutOfTurn { found: other.kind().to_owned(), expected: "end".to_owned() })
        }
        Heard::StopRequested => {
            let stopping = stopped(client, record, 0, INTERRUPTED);
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

/// A client's vector in the model's order.
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
