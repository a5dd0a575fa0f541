//! What is recorded of a run as it goes: part after part, each watched along its own way.

use super::envelope::EnvelopeWatch;
use super::oscillation_watch::RunOscillations;
use super::stop_reason::{Breach, JointOscillation};
use super::ways::{RunPart, WayRecords};
use super::{RobotFault, RobotRun, RobotStatus, RunRequest};
use dynident_simulation::{Record, Reference};

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

/// One part of a run.
#[derive(Debug)]
struct Part<'a> {
    which: RunPart,
    reference: &'a Reference,
    /// Samples of it by the controller's count: those that it shares with the motion are the motion's.
    samples: usize,
    /// Sample-major.
    record: Record,
    watch: EnvelopeWatch<'a>,
    oscillations: RunOscillations,
}

/// What is recorded of a run, part after part.
#[derive(Debug)]
pub(super) struct Recorder<'a> {
    parts: Vec<Part<'a>>,
    /// The part that samples belong to now.
    at: usize,
    /// By the controller's count: the time of the sample from which those of the part count, by the robot's clock.
    zero_s: f64,
    joints: Vec<String>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(request: &RunRequest<'a>, joints: &[String]) -> Self {
        let part = |which: RunPart, reference: &'a Reference| Part {
            which,
            reference,
            samples: reference.samples() - usize::from(which != RunPart::Motion),
            record: empty_record(joints, reference.rate_hz()),
            watch: EnvelopeWatch::new(request.envelope, reference),
            oscillations: RunOscillations::new(request.oscillation),
        };
        let mut parts = vec![part(RunPart::Motion, request.reference)];
        if let Some(ways) = request.ways {
            parts.insert(0, part(RunPart::Approach, &ways.approach));
            parts.push(part(RunPart::Return, &ways.back));
        }
        Self { parts, at: 0, zero_s: 0.0, joints: joints.to_vec() }
    }

    /// The record of the part that is run now, sample-major.
    pub(super) fn record(&mut self) -> &mut Record {
        &mut self.parts[self.at].record
    }

    /// Samples of all parts so far.
    pub(super) fn samples(&self) -> usize {
        self.parts.iter().map(|part| part.record.samples).sum()
    }

    /// What is left of the run, s.
    pub(super) fn left_s(&self) -> f64 {
        let last = |part: &Part<'_>| part.record.times_s.last().copied().unwrap_or(0.0);
        self.parts[self.at..].iter().map(|part| (part.reference.duration_s() - last(part)).max(0.0)).sum()
    }

    /// Whether the part that is run now is recorded to its end: no further sample of it is due.
    pub(super) fn is_at_end_of_part(&self) -> bool {
        self.require_end().is_ok()
    }

    /// Samples from here on are of this part.
    ///
    /// # Errors
    /// A part that this run has not, or one before; one of which the end is not there.
    pub(super) fn enter(&mut self, part: RunPart) -> Result<(), RobotFault> {
        let expected = self.parts[self.at].which;
        let place = self.parts.iter().position(|own| own.which == part).filter(|place| *place >= self.at);
        let Some(place) = place else {
            return Err(RobotFault::OutOfTurn {
                found: format!("sample of the {}", part.name()),
                expected: format!("one of the {}", expected.name()),
            });
        };
        while self.at < place {
            self.require_end()?;
            self.at += 1;
        }
        Ok(())
    }

    /// That every part was recorded to its end.
    ///
    /// # Errors
    /// Which was not.
    pub(super) fn require_whole(&mut self) -> Result<(), RobotFault> {
        loop {
            self.require_end()?;
            if self.at + 1 == self.parts.len() {
                return Ok(());
            }
            self.at += 1;
        }
    }

    /// Up to two samples of the slower of the two clocks may be missing, or a hundredth of the part.
    fn require_end(&self) -> Result<(), RobotFault> {
        let Part { which, reference, record, .. } = &self.parts[self.at];
        let (end_s, duration_s) = (record.times_s.last().copied().unwrap_or(0.0), reference.duration_s());
        let none = record.samples == 0 && *which == RunPart::Motion;
        if none || end_s < 0.99 * duration_s - 2.0 / reference.rate_hz() {
            return Err(RobotFault::Short { end_s, duration_s, part: *which });
        }
        Ok(())
    }

    /// Where the robot's clock says `time_s` at the controller's next sample: the time within its part, which is
    /// entered. The robot runs approach, motion and return as one.
    pub(super) fn time_of_next(&mut self, time_s: f64) -> f64 {
        while self.parts[self.at].record.samples >= self.parts[self.at].samples && self.at + 1 < self.parts.len() {
            // The return counts from the last sample of the motion, which it shares.
            let last_s = self.parts[self.at].record.times_s.last().copied();
            let shared_s = last_s.filter(|_| self.parts[self.at].which == RunPart::Motion);
            self.zero_s = shared_s.map_or(time_s, |shared_s| self.zero_s + shared_s);
            self.at += 1;
        }
        // Before the first part nothing is taken off, not even a zero.
        if self.at == 0 { time_s } else { time_s - self.zero_s }
    }

    /// How the newest sample leaves the envelope, if it does; `dq` are measured velocities, where there are any.
    pub(super) fn look(&mut self, dq: Option<&[f64]>) -> Option<Breach> {
        let Part { which, record, watch, .. } = &mut self.parts[self.at];
        watch.look(record, dq).map(|breach| Breach { part: *which, ..breach })
    }

    /// The joint that oscillates up to the newest sample, if one does.
    pub(super) fn look_for_oscillation(&mut self) -> Option<JointOscillation> {
        let Part { which, reference, record, oscillations, .. } = &mut self.parts[self.at];
        let last = record.samples.checked_sub(1)?;
        let q = &record.q[last * record.joints.len()..];
        let (joint, found) = oscillations.look(reference, record.times_s[last], q)?;
        Some(JointOscillation { joint: record.joints[joint].clone(), part: *which, ..found })
    }

    /// The run, with what was recorded of it.
    pub(super) fn into_run(self, status: RobotStatus) -> RobotRun {
        let (mut approach, mut motion, mut back) = (None, None, None);
        for own in self.parts {
            let place = match own.which {
                RunPart::Approach => &mut approach,
                RunPart::Motion => &mut motion,
                RunPart::Return => &mut back,
            };
            *place = Some(joint_major(own.record));
        }
        RobotRun {
            status,
            record: motion.unwrap_or_else(|| empty_record(&self.joints, 0.0)),
            truth: None,
            ways: approach.zip(back).map(|(approach, back)| WayRecords { approach, back }),
            note: None,
        }
    }
}
