//! Content of the live page: the current motion with a bounded number of samples, and the history of runs.

use dynident::MotionObserver;
use dynident::iteration::robot::{ExpectedTorque, ObservedSample, RunPart, SampleObserver};
use dynident::iteration::{BegunMotion, NextMotion, RobotRun, RunPurpose, RunRecord, StopSignal};
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Number of samples of a motion that are kept, evenly spaced in time; at most twice as many.
const KEPT_SAMPLES: usize = 1500;
const MAX_SAMPLES: usize = 2 * KEPT_SAMPLES;
/// Number of points of a desired motion.
const DESIRED_POINTS: usize = 600;
/// Number of runs of the history that are kept.
const MAX_RUNS: usize = 500;
/// Time without a request of the page after which it is treated as closed.
const OPEN_PAGE: Duration = Duration::from_secs(2);
/// Time for an open page to show the end of the iteration.
const LAST_LOOK: Duration = Duration::from_millis(1500);

/// State of the iteration, shared between the run and the server.
#[derive(Debug)]
pub(crate) struct LiveState {
    name: String,
    stop: StopSignal,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    status: String,
    ended: bool,
    /// Number of the motion, from 1; 0 before the first.
    motion: u64,
    begun: Option<Motion>,
    history: VecDeque<RunLine>,
    asked: Option<Instant>,
}

#[derive(Debug)]
struct Motion {
    head: Head,
    began: Instant,
    part: &'static str,
    is_moving: bool,
    /// Time between kept samples, s.
    step_s: f64,
    /// Each row: time, positions, torques.
    rows: Vec<Vec<f64>>,
}

/// The data of a motion except its samples; they are sent only once.
#[derive(Clone, Debug, Serialize)]
struct Head {
    joints: Vec<String>,
    words: String,
    controller: String,
    /// Duration of the motion, and duration with the paths from and to the home posture, s.
    duration_s: f64,
    whole_s: f64,
    desired: Desired,
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<Expected>,
}

#[derive(Clone, Debug, Serialize)]
struct Desired {
    t: Vec<f64>,
    q: Vec<Vec<f64>>,
}

#[derive(Clone, Debug, Serialize)]
struct Expected {
    t: Vec<f64>,
    tau: Vec<Vec<f64>>,
    half: Vec<Vec<f64>>,
}

#[derive(Clone, Debug, Serialize)]
struct RunLine {
    run: usize,
    accepted: bool,
    controller: String,
    outcome: String,
    /// Largest tracking error of all joints, rad (m).
    tracking: f64,
}

#[derive(Serialize)]
struct Answer<'a> {
    schema: &'static str,
    name: &'a str,
    status: String,
    ended: bool,
    stop_requested: bool,
    motion: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    head: Option<Head>,
    part: &'static str,
    is_moving: bool,
    elapsed_s: f64,
    left_s: f64,
    /// Index of the first of `rows`.
    from: usize,
    rows: Vec<Vec<f64>>,
    history: Vec<RunLine>,
}

impl LiveState {
    pub(crate) fn new(name: String, stop: StopSignal) -> Self {
        let inner = Inner { status: "preparing the first run".to_owned(), ..Inner::default() };
        Self { name, stop, inner: Mutex::new(inner) }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests that the robot and the iteration stop.
    pub(crate) fn stop(&self) {
        self.stop.request();
    }

    /// Adds a finished run.
    pub(crate) fn made(&self, record: &RunRecord) {
        let tracking = record.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
        let line = RunLine {
            run: record.run,
            accepted: record.accepted,
            controller: record.controller.name.clone(),
            outcome: record.reason.clone().unwrap_or_else(|| record.outcome.clone()),
            tracking,
        };
        let mut inner = self.inner();
        inner.history.push_back(line);
        if inner.history.len() > MAX_RUNS {
            inner.history.pop_front();
        }
        inner.status = format!("run {} is complete", record.run);
    }

    /// Shows that the iteration ended, and gives an open page time to show it.
    pub(crate) fn end(&self, status: String) {
        let is_open = {
            let mut inner = self.inner();
            (inner.status, inner.ended) = (status, true);
            inner.asked.is_some_and(|asked| asked.elapsed() < OPEN_PAGE)
        };
        if is_open {
            std::thread::sleep(LAST_LOOK);
        }
    }

    /// The state as JSON. `known` contains the numbers of the motion and of samples that the page already has; then
    /// only newer samples are included.
    pub(crate) fn json(&self, known: Option<(u64, u64)>) -> String {
        let answer = {
            let mut inner = self.inner();
            inner.asked = Some(Instant::now());
            self.answer(&inner, known)
        };
        // The text is made after the lock is released, so that the robot's thread never waits for it.
        dynident_text::json::to_string(&answer).unwrap_or_else(|_| "{}".to_owned())
    }

    fn answer(&self, inner: &Inner, known: Option<(u64, u64)>) -> Answer<'_> {
        let motion = inner.begun.as_ref();
        let from = known.filter(|(motion, _)| *motion == inner.motion).map(|(_, from)| from as usize);
        let elapsed_s = motion.map_or(0.0, |motion| {
            if motion.is_moving {
                motion.began.elapsed().as_secs_f64().min(motion.head.whole_s)
            } else {
                motion.head.whole_s
            }
        });
        let first = motion.map_or(0, |motion| from.unwrap_or(0).min(motion.rows.len()));
        Answer {
            schema: "dynident/live/1",
            name: &self.name,
            status: inner.status.clone(),
            ended: inner.ended,
            stop_requested: self.stop.is_requested(),
            motion: inner.motion,
            head: motion.filter(|_| from.is_none()).map(|motion| motion.head.clone()),
            part: motion.map_or("", |motion| motion.part),
            is_moving: motion.is_some_and(|motion| motion.is_moving),
            elapsed_s,
            left_s: motion.map_or(0.0, |motion| motion.head.whole_s - elapsed_s),
            from: first,
            rows: motion.map_or_else(Vec::new, |motion| motion.rows[first..].to_vec()),
            history: inner.history.iter().cloned().collect(),
        }
    }
}

impl SampleObserver for LiveState {
    fn sample(&self, sample: &ObservedSample<'_>) {
        let mut inner = self.inner();
        let Some(motion) = &mut inner.begun else { return };
        motion.part = sample.part.name();
        if sample.part == RunPart::Motion {
            motion.keep(sample.time_s, sample.q.iter().chain(sample.tau).copied());
        }
    }
}

impl MotionObserver for LiveState {
    fn begins(&self, begun: &BegunMotion<'_>) {
        let head = Head::of(begun);
        let mut inner = self.inner();
        inner.motion += 1;
        inner.status = format!("{} is in progress", head.words);
        let step_s = head.duration_s / KEPT_SAMPLES as f64;
        inner.begun = Some(Motion { head, began: Instant::now(), part: "", is_moving: true, step_s, rows: Vec::new() });
    }

    fn ended(&self, run: &RobotRun) {
        let mut inner = self.inner();
        let Some(motion) = &mut inner.begun else { return };
        motion.is_moving = false;
        let record = &run.record;
        // A robot that does not send samples during the run, such as the simulator, delivers all of them at its end.
        if motion.rows.is_empty() {
            for (sample, time_s) in record.times_s.iter().enumerate() {
                let of = |values: &[f64]| -> Vec<f64> {
                    (0..record.joints.len()).map(|joint| values[record.of(joint)][sample]).collect()
                };
                motion.keep(*time_s, of(&record.q).into_iter().chain(of(&record.tau)));
            }
        }
        inner.status = if run.status.is_done() {
            "the motion is complete; Dynident identifies the model".to_owned()
        } else {
            format!("the motion ended early: {}", run.status)
        };
    }
}

impl Motion {
    /// Keeps a sample unless it is close to the last one that was kept.
    fn keep(&mut self, time_s: f64, values: impl Iterator<Item = f64>) {
        let last = self.rows.last().and_then(|row| row.first()).copied();
        if self.rows.len() < MAX_SAMPLES && last.is_none_or(|last| time_s - last >= self.step_s) {
            self.rows.push(core::iter::once(time_s).chain(values).map(rounded).collect());
        }
    }
}

impl Head {
    fn of(begun: &BegunMotion<'_>) -> Self {
        let BegunMotion { motion, reference, expected } = *begun;
        let ways_s = motion.ways.as_ref().map_or(0.0, |ways| ways.approach_s + ways.return_s);
        let step = reference.samples().div_ceil(DESIRED_POINTS).max(1);
        let whole = reference.motion();
        let kept = |values: &[f64]| values.iter().step_by(step).copied().map(rounded).collect::<Vec<f64>>();
        Self {
            joints: motion.largest_speed.iter().map(|(joint, _)| joint.clone()).collect(),
            words: words(motion),
            controller: motion.controller.clone(),
            duration_s: reference.duration_s(),
            whole_s: reference.duration_s() + ways_s,
            desired: Desired {
                t: (0..whole.samples)
                    .step_by(step)
                    .map(|sample| rounded(sample as f64 / reference.rate_hz()))
                    .collect(),
                q: (0..whole.joints).map(|joint| kept(&whole.q[whole.of(joint)])).collect(),
            },
            expected: expected.map(Expected::of),
        }
    }
}

impl Expected {
    fn of(expected: &ExpectedTorque) -> Self {
        let short = |rows: &[Vec<f64>]| rows.iter().map(|row| row.iter().copied().map(rounded).collect()).collect();
        Self {
            t: expected.times_s.iter().copied().map(rounded).collect(),
            tau: short(&expected.torque),
            half: short(&expected.half_width_95),
        }
    }
}

fn words(motion: &NextMotion) -> String {
    let (leg, legs) = motion.leg;
    let of_leg = if legs > 1 { format!(", leg {} of {legs}", leg + 1) } else { String::new() };
    match motion.purpose {
        RunPurpose::WarmUp { pass, of } => format!("warm-up {pass} of {of} before run {}{of_leg}", motion.run),
        RunPurpose::HeldOut => format!("held-out motion after run {}", motion.run),
        RunPurpose::Run if motion.speed < 1.0 => {
            format!("run {} at {:.0} % of its speed{of_leg}", motion.run, 100.0 * motion.speed)
        }
        RunPurpose::Run => format!("run {}{of_leg}", motion.run),
    }
}

/// Six significant digits, which are enough for a plot.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
