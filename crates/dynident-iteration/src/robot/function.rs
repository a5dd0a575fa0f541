use super::envelope::EnvelopeWatch;
use super::oscillation_watch::RunOscillations;
use super::recorder::{empty_record, joint_major};
use super::ways::{RunPart, WayRecords};
use super::{
    Breach, Envelope, JointOscillation, Robot, RobotFault, RobotRun, RobotStatus, RunRequest, StopSignal, Stopping,
};
use dynident_simulation::controllers::{Controller, Measured};
use dynident_simulation::{Record, Reference, ReferenceSample, SimulationError};

/// A controlled run, with which a user's function drives its robot. The function requests the torque of each sample,
/// and the samples form the record.
#[derive(Debug)]
pub struct ControlledRun {
    run: usize,
    reference: Reference,
    controller: Box<dyn Controller>,
    envelope: Option<Envelope>,
    oscillations: RunOscillations,
    stop: Option<StopSignal>,
    target: ReferenceSample,
    tau: Vec<f64>,
    /// Numbers of samples before the motion and in the motion, if the run has paths from and to the home posture.
    parts: Option<[usize; 2]>,
    /// Time of the first sample by the robot's clock, s.
    first_s: Option<f64>,
    /// Record of the whole run, by the robot's clock from its first sample.
    record: Record,
    /// The newest sample, on which the envelope is checked.
    now: Record,
    end: Option<RunEnd>,
}

/// Longest step between two samples, in sampling periods. A longer step indicates a clock with another unit: with
/// milliseconds, the steps are a thousand times too long.
const MAX_STEP_PERIODS: f64 = 500.0;

/// Why a function ended its run early.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FunctionStop {
    /// The robot stopped, for example by a protective stop. The run is evaluated if it has begun.
    Robot {
        /// The reason.
        reason: String,
    },
    /// The function failed, for example in the driver of the robot. The run is not evaluated; the next call repeats
    /// it.
    Function {
        /// The reason.
        reason: String,
    },
}

#[derive(Debug)]
enum RunEnd {
    Interrupted,
    Breach(Breach),
    Oscillation(JointOscillation),
    Fault(RobotFault),
}

impl ControlledRun {
    fn new(request: &RunRequest<'_>, joints: &[String]) -> Result<Self, SimulationError> {
        request.validate(joints.len())?;
        let reference = request.whole()?.into_owned();
        Ok(Self {
            parts: request.ways.map(|ways| [ways.approach.samples() - 1, request.reference.samples()]),
            run: request.run,
            controller: request.controller.build(joints.len(), request.model)?,
            envelope: request.envelope.cloned(),
            oscillations: RunOscillations::new(request.oscillation),
            stop: request.stop.cloned(),
            target: ReferenceSample::new(joints.len()),
            tau: vec![0.0; joints.len()],
            first_s: None,
            record: empty_record(joints, reference.rate_hz()),
            now: Record {
                samples: 1,
                times_s: vec![0.0],
                q: vec![0.0; joints.len()],
                tau: vec![0.0; joints.len()],
                ..empty_record(joints, reference.rate_hz())
            },
            reference,
            end: None,
        })
    }

    /// Number of the run, from 1.
    pub fn run(&self) -> usize {
        self.run
    }

    /// The motion to follow, including the paths from and to the home posture; the robot must start at its first
    /// sample.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Number of recorded samples.
    pub fn samples_done(&self) -> usize {
        self.record.samples
    }

    /// Returns the drive torques, Nm (N), for the next sample, given the position `q` (rad, m) and the velocity `dq`
    /// (rad/s, m/s) at `time_s` (s, by the robot's clock). Returns `None` if the robot has to be stopped immediately:
    /// the sample is outside the envelope, a joint oscillates, a stop was requested, a value is not finite, or the
    /// run is complete. The function must then return.
    pub fn torque(&mut self, time_s: f64, q: &[f64], dq: &[f64]) -> Option<&[f64]> {
        let sample = self.record.samples;
        if self.end.is_some() || sample >= self.reference.samples() {
            return None;
        }
        // The robot's clock can begin at any time.
        let time_s = time_s - *self.first_s.get_or_insert(time_s);
        if let Err(end) = self.check_sample(sample, time_s, q, dq) {
            self.end = Some(end);
            return None;
        }
        self.target.take(&self.reference, sample);
        let due_s = sample as f64 / self.reference.rate_hz();
        self.controller.torque(due_s, self.target.target(), Measured { q, dq }, &mut self.tau);
        if self.tau.iter().any(|tau| !tau.is_finite()) {
            self.end = Some(RunEnd::Fault(RobotFault::Torque { sample }));
            return None;
        }
        self.record.times_s.push(time_s);
        self.record.q.extend_from_slice(q);
        self.record.tau.extend_from_slice(&self.tau);
        self.record.samples += 1;
        // The check comes before the return: a torque beyond the envelope is never returned.
        self.now.times_s[0] = time_s;
        self.now.q.copy_from_slice(q);
        self.now.tau.copy_from_slice(&self.tau);
        if let Some(breach) = EnvelopeWatch::new(self.envelope.as_ref(), &self.reference).look(&self.now, Some(dq)) {
            let (part, zero) = self.part_of(sample);
            let time_s = if zero == 0 { time_s } else { time_s - self.record.times_s[zero] };
            self.end = Some(RunEnd::Breach(Breach { time_s, part, ..breach }));
            return None;
        }
        if let Some((joint, found)) = self.oscillations.look(&self.reference, time_s, q) {
            let (part, zero) = self.part_of(sample);
            let time_s = if zero == 0 { time_s } else { time_s - self.record.times_s[zero] };
            let joint = self.record.joints[joint].clone();
            self.end = Some(RunEnd::Oscillation(JointOscillation { joint, time_s, part, ..found }));
            return None;
        }
        Some(&self.tau)
    }

    /// Description of why the last call of [`torque`](Self::torque) returned `None`; `None` while the run continues.
    pub fn end_reason(&self) -> Option<String> {
        match &self.end {
            Some(RunEnd::Interrupted) => Some("a stop was requested".to_owned()),
            Some(RunEnd::Breach(breach)) => Some(format!("out of the envelope: {breach}")),
            Some(RunEnd::Oscillation(oscillation)) => Some(oscillation.to_string()),
            Some(RunEnd::Fault(fault)) => Some(fault.to_string()),
            None if self.record.samples >= self.reference.samples() => Some("all samples were requested".to_owned()),
            None => None,
        }
    }

    /// The part of the run to which a sample belongs, and the sample at which the time of this part is zero.
    fn part_of(&self, sample: usize) -> (RunPart, usize) {
        match self.parts {
            Some([before, _]) if sample < before => (RunPart::Approach, 0),
            Some([before, motion]) if sample >= before + motion => (RunPart::Return, before + motion - 1),
            Some([before, _]) => (RunPart::Motion, before),
            None => (RunPart::Motion, 0),
        }
    }

    fn recorded(&self, wanted: RunPart) -> Record {
        let own = (0..self.record.samples).filter(|&sample| self.part_of(sample).0 == wanted);
        let (Some(first), joints) = (own.clone().next(), self.record.joints.len()) else {
            return empty_record(&self.record.joints, self.record.rate_hz);
        };
        let range = first..first + own.count();
        let zero = self.part_of(first).1;
        let zero_s = if zero == 0 { 0.0 } else { self.record.times_s[zero] };
        let values = |of: &[f64]| of[range.start * joints..range.end * joints].to_vec();
        joint_major(Record {
            samples: range.len(),
            times_s: self.record.times_s[range.clone()].iter().map(|time_s| time_s - zero_s).collect(),
            q: values(&self.record.q),
            tau: values(&self.record.tau),
            ..empty_record(&self.record.joints, self.record.rate_hz)
        })
    }

    fn check_sample(&self, sample: usize, time_s: f64, q: &[f64], dq: &[f64]) -> Result<(), RunEnd> {
        if self.stop.as_ref().is_some_and(StopSignal::is_requested) {
            return Err(RunEnd::Interrupted);
        }
        let expected = self.tau.len();
        for (what, values) in [("q", q), ("dq", dq)] {
            if values.len() != expected {
                let (what, found) = (what.to_owned(), values.len());
                return Err(RunEnd::Fault(RobotFault::WrongJoints { sample, what, expected, found }));
            }
            if let Some(joint) = values.iter().position(|value| !value.is_finite()) {
                return Err(RunEnd::Fault(RobotFault::NotANumber { sample, what: format!("{what}[{joint}]") }));
            }
        }
        match self.record.times_s.last() {
            _ if !time_s.is_finite() => Err(RunEnd::Fault(RobotFault::NotANumber { sample, what: "t_s".to_owned() })),
            Some(&before_s) if (time_s - before_s) * self.reference.rate_hz() > MAX_STEP_PERIODS => {
                let (step_s, period_s) = (time_s - before_s, 1.0 / self.reference.rate_hz());
                Err(RunEnd::Fault(RobotFault::Clock { sample, step_s, period_s }))
            }
            Some(&before_s) if time_s <= before_s => Err(RunEnd::Fault(RobotFault::Time { sample, time_s, before_s })),
            _ => Ok(()),
        }
    }

    fn ended(self, result: Result<(), FunctionStop>) -> RobotRun {
        let (end_s, duration_s) = (self.record.times_s.last().copied().unwrap_or(0.0), self.reference.duration_s());
        let is_whole = self.record.samples == self.reference.samples();
        let record = self.recorded(RunPart::Motion);
        let (part, _) = self.part_of(self.record.samples.saturating_sub(1));
        let ways = self
            .parts
            .map(|_| WayRecords { approach: self.recorded(RunPart::Approach), back: self.recorded(RunPart::Return) });
        let status = match (self.end, result) {
            (Some(RunEnd::Interrupted), _) => RobotStatus::Interrupted { stopping: Stopping::Confirmed },
            (Some(RunEnd::Breach(breach)), _) => RobotStatus::LeftEnvelope { breach, stopping: Stopping::Confirmed },
            (Some(RunEnd::Oscillation(oscillation)), _) => {
                RobotStatus::Oscillated { oscillation, stopping: Stopping::Confirmed }
            }
            (Some(RunEnd::Fault(fault)), _) => RobotStatus::Failed { fault, stopping: None },
            (None, Err(FunctionStop::Robot { reason })) => RobotStatus::Stopped { reason },
            (None, Err(FunctionStop::Function { reason })) => {
                let fault = RobotFault::Function { sample: self.record.samples, reason };
                RobotStatus::Failed { fault, stopping: None }
            }
            (None, Ok(())) if is_whole => RobotStatus::Done,
            (None, Ok(())) => {
                RobotStatus::Failed { fault: RobotFault::Short { end_s, duration_s, part }, stopping: None }
            }
        };
        RobotRun { status, record, truth: None, ways, note: None }
    }
}

/// A robot that is a function of this process. The function receives the controlled run and moves the robot to the
/// first sample of the reference. It then requests and applies a torque at every sample, and returns after the last
/// sample. If it returns an error, the run ends with that reason ([`FunctionStop`]).
pub struct FunctionRobot<F> {
    joints: Vec<String>,
    function: F,
}

impl<F> FunctionRobot<F>
where
    F: FnMut(ControlledRun) -> (ControlledRun, Result<(), FunctionStop>),
{
    /// Creates a robot with these joints, in the model's order. The function returns the run together with its
    /// outcome, so that the run can be passed to another language during the call.
    pub fn new(joints: Vec<String>, function: F) -> Self {
        Self { joints, function }
    }
}

impl<F> core::fmt::Debug for FunctionRobot<F> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("FunctionRobot").field("joints", &self.joints).finish_non_exhaustive()
    }
}

impl<F> Robot for FunctionRobot<F>
where
    F: FnMut(ControlledRun) -> (ControlledRun, Result<(), FunctionStop>),
{
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        let (run, result) = (self.function)(ControlledRun::new(request, &self.joints)?);
        Ok(run.ended(result))
    }
}
