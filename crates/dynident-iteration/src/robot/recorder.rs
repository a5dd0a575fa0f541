use super::envelope::EnvelopeWatch;
use super::observer::{ObservedSample, SampleObserver};
use super::oscillation_watch::RunOscillations;
use super::stop_reason::{Breach, JointOscillation};
use super::ways::{RunPart, WayRecords};
use super::{RobotFault, RobotRun, RobotStatus, RunRequest};
use dynident_simulation::{Record, Reference};

/// An empty record; its arrays are sample-major until [`joint_major`].
pub(super) fn empty_record(joints: &[String], rate_hz: f64) -> Record {
    Record { joints: joints.to_vec(), rate_hz, samples: 0, times_s: Vec::new(), q: Vec::new(), tau: Vec::new() }
}

pub(super) fn joint_major(mut record: Record) -> Record {
    let (joints, samples) = (record.joints.len(), record.samples);
    for values in [&mut record.q, &mut record.tau] {
        *values = (0..joints * samples).map(|at| values[at % samples * joints + at / samples]).collect();
    }
    record
}

#[derive(Debug)]
struct Part<'a> {
    which: RunPart,
    reference: &'a Reference,
    /// Number of samples of the part by the controller's count. Samples at the border between a path and the motion
    /// belong to the motion.
    samples: usize,
    record: Record,
    watch: EnvelopeWatch<'a>,
    oscillations: RunOscillations,
}

#[derive(Debug)]
pub(super) struct Recorder<'a> {
    parts: Vec<Part<'a>>,
    at: usize,
    /// Time at which the current part begins, by the robot's clock, s.
    zero_s: f64,
    joints: Vec<String>,
    observer: Option<&'a dyn SampleObserver>,
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
        Self { parts, at: 0, zero_s: 0.0, joints: joints.to_vec(), observer: request.observer }
    }

    pub(super) fn record(&mut self) -> &mut Record {
        &mut self.parts[self.at].record
    }

    pub(super) fn samples(&self) -> usize {
        self.parts.iter().map(|part| part.record.samples).sum()
    }

    /// Remaining time of the run, s.
    pub(super) fn left_s(&self) -> f64 {
        let last = |part: &Part<'_>| part.record.times_s.last().copied().unwrap_or(0.0);
        self.parts[self.at..].iter().map(|part| (part.reference.duration_s() - last(part)).max(0.0)).sum()
    }

    pub(super) fn is_at_end_of_part(&self) -> bool {
        self.require_end().is_ok()
    }

    /// Begins a part of the run; later samples belong to it.
    ///
    /// # Errors
    /// A part that this run does not have, or an earlier one; an incomplete current part.
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

    /// Checks that every part was recorded to its end.
    pub(super) fn require_whole(&mut self) -> Result<(), RobotFault> {
        loop {
            self.require_end()?;
            if self.at + 1 == self.parts.len() {
                return Ok(());
            }
            self.at += 1;
        }
    }

    /// At the end of a part, two samples of the slower of the two clocks may be missing, or a hundredth of the part.
    fn require_end(&self) -> Result<(), RobotFault> {
        let Part { which, reference, record, .. } = &self.parts[self.at];
        let (end_s, duration_s) = (record.times_s.last().copied().unwrap_or(0.0), reference.duration_s());
        let none = record.samples == 0 && *which == RunPart::Motion;
        if none || end_s < 0.99 * duration_s - 2.0 / reference.rate_hz() {
            return Err(RobotFault::Short { end_s, duration_s, part: *which });
        }
        Ok(())
    }

    /// Time, within its part, of the controller's next sample at `time_s` of the robot's clock; begins a new part if
    /// necessary. In this mode the robot runs approach, motion and return as one motion.
    pub(super) fn time_of_next(&mut self, time_s: f64) -> f64 {
        while self.parts[self.at].record.samples >= self.parts[self.at].samples && self.at + 1 < self.parts.len() {
            // The return begins at the last sample of the motion, which both parts share.
            let last_s = self.parts[self.at].record.times_s.last().copied();
            let shared_s = last_s.filter(|_| self.parts[self.at].which == RunPart::Motion);
            self.zero_s = shared_s.map_or(time_s, |shared_s| self.zero_s + shared_s);
            self.at += 1;
        }
        // In the first part not even zero is subtracted, so that times are bit-identical.
        if self.at == 0 { time_s } else { time_s - self.zero_s }
    }

    /// Passes the newest sample to the observer, and returns the violation of the envelope by this sample, if any;
    /// `dq` are the measured velocities, if available.
    pub(super) fn look(&mut self, dq: Option<&[f64]>) -> Option<Breach> {
        let Part { which, record, watch, .. } = &mut self.parts[self.at];
        if let (Some(observer), Some(last)) = (self.observer, record.samples.checked_sub(1)) {
            let from = last * record.joints.len();
            let (q, tau) = (&record.q[from..], &record.tau[from..]);
            observer.sample(&ObservedSample { part: *which, time_s: record.times_s[last], q, tau });
        }
        watch.look(record, dq).map(|breach| Breach { part: *which, ..breach })
    }

    pub(super) fn look_for_oscillation(&mut self) -> Option<JointOscillation> {
        let Part { which, reference, record, oscillations, .. } = &mut self.parts[self.at];
        let last = record.samples.checked_sub(1)?;
        let q = &record.q[last * record.joints.len()..];
        let (joint, found) = oscillations.look(reference, record.times_s[last], q)?;
        Some(JointOscillation { joint: record.joints[joint].clone(), part: *which, ..found })
    }

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
