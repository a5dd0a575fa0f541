use super::envelope::target_at;
use super::stop_reason::JointOscillation;
use super::ways::RunPart;
use crate::signals::oscillation::{OscillationLimits, OscillationWatch, growing_oscillation};
use crate::signals::rests::highest_speeds;
use dynident_simulation::{Record, Reference};

/// Number of samples from which the rate of a log is computed.
const RATE_SAMPLES: usize = 32;
/// Substitute for the speed of a joint that does not move in a trajectory, as a share of the fastest joint's speed.
const REST_SPEED_SHARE: f64 = 0.1;

/// Highest speed of each joint in a trajectory, rad/s (m/s), with a substitute for joints that do not move.
fn reference_speeds(reference: &Reference) -> Vec<f64> {
    let highest = highest_speeds([reference]);
    let fastest = highest.iter().copied().fold(0.0, f64::max);
    highest.into_iter().map(|own| if own > 0.0 { own } else { REST_SPEED_SHARE * fastest }).collect()
}

#[derive(Debug)]
pub(crate) struct RunOscillations {
    limits: Option<OscillationLimits>,
    /// Time of the first sample, s, and the number of samples.
    begin: (f64, usize),
    /// The newest sample: time, s, and tracking error of each joint, rad (m).
    newest: (f64, Vec<f64>),
    joints: Vec<Option<OscillationWatch>>,
}

impl RunOscillations {
    pub(crate) fn new(limits: Option<OscillationLimits>) -> Self {
        Self { limits, begin: (0.0, 0), newest: (0.0, Vec::new()), joints: Vec::new() }
    }

    /// Adds a sample along a trajectory: time, s, and positions, rad (m). Returns the index of an oscillating joint,
    /// with frequency and amplitude.
    pub(crate) fn look(&mut self, reference: &Reference, time_s: f64, q: &[f64]) -> Option<(usize, JointOscillation)> {
        let limits = self.limits?;
        let distance = |(joint, q): (usize, &f64)| q - target_at(reference, joint, time_s);
        let distances: Vec<f64> = q.iter().enumerate().map(distance).collect();
        let (before_s, before) = core::mem::replace(&mut self.newest, (time_s, distances));
        self.begin.1 += 1;
        let samples = self.begin.1;
        if samples == 1 {
            self.begin.0 = time_s;
            return None;
        }
        if samples == RATE_SAMPLES {
            let rate_hz = (samples - 1) as f64 / (time_s - self.begin.0);
            let watch = |speed: f64| {
                let least = limits.speed_share * speed;
                (least > 0.0).then(|| OscillationWatch::new(rate_hz, limits.lowest_hz, least)).flatten()
            };
            self.joints = reference_speeds(reference).into_iter().map(watch).collect();
        }
        let step_s = time_s - before_s;
        let pairs = self.newest.1.iter().zip(&before).map(|(new, old)| (new - old) / step_s);
        let found = self
            .joints
            .iter_mut()
            .zip(pairs)
            .enumerate()
            .find_map(|(joint, (watch, deviation))| Some((joint, watch.as_mut()?.add(deviation)?)));
        found.map(|(joint, own)| {
            let (frequency_hz, amplitude) = (own.frequency_hz, own.amplitude);
            (joint, JointOscillation { joint: String::new(), frequency_hz, amplitude, time_s, part: RunPart::Motion })
        })
    }

    pub(crate) fn first(
        limits: Option<OscillationLimits>,
        reference: &Reference,
        q: &[f64],
        samples: usize,
        names: &[String],
    ) -> Option<JointOscillation> {
        limits?;
        let mut watch = Self::new(limits);
        (0..samples).find_map(|sample| {
            let now: Vec<f64> = q.chunks_exact(samples).map(|own| own[sample]).collect();
            let (joint, found) = watch.look(reference, sample as f64 / reference.rate_hz(), &now)?;
            Some(JointOscillation { joint: names[joint].clone(), ..found })
        })
    }
}

/// When a run was stopped: the joint with the largest oscillation relative to its speed in the trajectory. The record
/// is joint-major.
pub(super) fn oscillation_at_end(reference: &Reference, record: &Record, lowest_hz: f64) -> Option<JointOscillation> {
    let times_s = &record.times_s[..record.samples];
    let (begin_s, end_s) = (*times_s.first()?, *times_s.last()?);
    let rate_hz = (record.samples - 1) as f64 / (end_s - begin_s);
    let of_joint = |(joint, speed): (usize, f64)| {
        let q = &record.q[record.of(joint)];
        let distances = q.iter().zip(times_s).map(|(q, time_s)| q - target_at(reference, joint, *time_s));
        let distances: Vec<f64> = distances.collect();
        let deviations: Vec<f64> = distances.windows(2).map(|two| (two[1] - two[0]) * rate_hz).collect();
        let own = growing_oscillation(&deviations, rate_hz, lowest_hz)?;
        Some((own.amplitude / speed.max(f64::MIN_POSITIVE), joint, own))
    };
    let all = reference_speeds(reference).into_iter().enumerate().filter_map(of_joint);
    let (_, joint, own) = all.max_by(|one, other| one.0.total_cmp(&other.0))?;
    Some(JointOscillation {
        joint: record.joints[joint].clone(),
        frequency_hz: own.frequency_hz,
        amplitude: own.amplitude,
        time_s: end_s,
        part: RunPart::Motion,
    })
}
