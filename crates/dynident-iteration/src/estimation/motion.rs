use crate::setup::error::IterationError;
use crate::setup::leg::Leg;
use crate::setup::settings::RunIdentificationSettings;
use crate::signals::rests::StictionBand;
use core::ops::Range;
use dynident_identification::MotionRecord;
use dynident_recording::log::JointSamples;
use dynident_recording::{
    Derivatives, Differentiator, DifferentiatorSettings, FilterError, Log, MotionBlock, Place, RecordingError, cutoff,
};
use dynident_simulation::Record;
use std::sync::Arc;

/// Largest relative deviation of the time steps of a record with uniform times.
const UNIFORM_STEP_TOLERANCE: f64 = 1e-6;

/// Differentiates a record along trajectory `leg`. If the record's times are not uniform, positions and torques are
/// interpolated linearly. If torque is held constant from sample to sample, it is replaced by the mean of the values
/// before and after the sample, minus a twelfth of its second difference: the acceleration jumps at the sample, and
/// positions contain the effect of both values. Torque of joints with an entry in `margins` (joints with dry
/// friction) is excluded while the joint is closer to rest than the margin, because static friction is undetermined
/// there.
///
/// # Errors
/// A record with other joints or too few samples, a differentiator that does not exist at its rate or lacks an input.
pub fn measured_motion(
    record: &Record,
    leg: &Leg,
    settings: &RunIdentificationSettings,
    margins: &[Option<StictionBand>],
) -> Result<MotionRecord, IterationError> {
    let joints = record.joints.len();
    let wrong = |problem: String| IterationError::Record { joints: record.joints.clone(), problem };
    if joints != leg.reference().joints() {
        return Err(wrong(format!("the trajectory has {} joints", leg.reference().joints())));
    }
    if record.samples < 4 {
        return Err(wrong(format!("{} samples are too few to differentiate", record.samples)));
    }
    let [q, tau] = [&record.q, &record.tau].map(|values| on_uniform_clock(record, values));
    let (samples, first_time_s) = (record.samples, record.times_s[0]);
    let rate_hz = rate_of(record).ok_or_else(|| wrong("its times do not increase".to_owned()))?;
    let chosen = differentiator(&settings.differentiator, &q, joints, rate_hz);
    let built;
    let (differentiator, cutoff_hz) = if let Some(own) = leg.differentiator() {
        (own, None)
    } else {
        built = chosen.build_following(0.1 * rate_hz, Some(leg.commanded()))?;
        (&*built, chosen.cutoff_hz())
    };
    let smoothing = cutoff_hz.map_or(0, |cutoff_hz| (rate_hz / cutoff_hz).ceil() as usize);
    if samples < differentiator.minimum_samples() {
        return Err(wrong(format!(
            "{samples} samples are too few for {}, which needs {}",
            differentiator.name(),
            differentiator.minimum_samples()
        )));
    }
    let mut motion = MotionBlock { rate_hz, first_time_s, rows: samples, joints, ..zeros(joints * samples) };
    let mut all_usable = vec![true; samples];
    for joint in 0..joints {
        let own = joint * samples..(joint + 1) * samples;
        for sample in differentiated(differentiator, &q[own.clone()], joint, &mut motion)?.into_iter().flatten() {
            all_usable[sample] = false;
        }
        let (from, to) = (&tau[own.clone()], &mut motion.tau[own.clone()]);
        to.copy_from_slice(from);
        if settings.held_torque {
            for sample in 2..samples - 1 {
                to[sample] = held_torque(from, sample);
            }
        }
        if let Some(margin) = margins.get(joint).copied().flatten() {
            set_rests_aside(&mut motion, joint, margin, smoothing);
        }
    }
    if settings.held_torque {
        // Samples that do not have both neighbours.
        for sample in [0, 1, samples - 1] {
            all_usable[sample] = false;
        }
    }
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    if [&motion.q, &motion.dq, &motion.ddq, &motion.tau].into_iter().any(|values| !finite(values)) {
        return Err(wrong("it contains numbers that are not finite".to_owned()));
    }
    let raw = (!settings.estimation.estimator.is_plain()).then(|| raw_samples(record, rate_hz, first_time_s, q, tau));
    Ok(MotionRecord {
        label: format!("record of joints {}", record.joints.join(", ")),
        motion: Arc::new(motion),
        usable: all_usable,
        windows: leg.windows().map(<[_]>::to_vec),
        raw: raw.transpose()?,
    })
}

/// Sampling rate of a record, Hz; `None` if its times do not increase. If the times agree with the nominal rate, this
/// is the nominal rate, so that rounding of times has no effect.
fn rate_of(record: &Record) -> Option<f64> {
    let samples = record.samples;
    let rate_hz = (samples - 1) as f64 / (record.times_s[samples - 1] - record.times_s[0]);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return None;
    }
    Some(if (rate_hz / record.rate_hz - 1.0).abs() < UNIFORM_STEP_TOLERANCE { record.rate_hz } else { rate_hz })
}

fn zeros(count: usize) -> MotionBlock {
    let zeros = || vec![0.0; count];
    MotionBlock { q: zeros(), dq: zeros(), ddq: zeros(), tau: zeros(), ..MotionBlock::default() }
}

fn set_rests_aside(motion: &mut MotionBlock, joint: usize, margin: StictionBand, smoothing: usize) {
    let own = joint * motion.rows..(joint + 1) * motion.rows;
    for rest in margin.samples(&motion.dq[own.clone()], smoothing) {
        motion.set_aside.resize(motion.joints * motion.rows, false);
        motion.set_aside[own.start + rest.start..own.start + rest.end].fill(true);
    }
}

/// Writes a joint's motion from the positions `q`; returns the samples to which the differentiator does not apply.
fn differentiated(
    differentiator: &dyn Differentiator,
    q: &[f64],
    joint: usize,
    motion: &mut MotionBlock,
) -> Result<Vec<Range<usize>>, FilterError> {
    let own = joint * motion.rows..(joint + 1) * motion.rows;
    let place = Place { rate_hz: motion.rate_hz, joint, first_time_s: motion.first_time_s };
    let out = Derivatives { q: &mut motion.q[own.clone()], dq: &mut motion.dq[own.clone()], ddq: &mut motion.ddq[own] };
    differentiator.differentiate_at(place, q, out)
}

/// The record's samples at uniform times, for estimators that smooth or simulate.
fn raw_samples(
    record: &Record,
    rate_hz: f64,
    first_time_s: f64,
    q: Vec<f64>,
    tau: Vec<f64>,
) -> Result<Log, IterationError> {
    let samples = record.samples;
    let joints = |values: Vec<f64>| values.chunks_exact(samples).map(<[f64]>::to_vec).collect::<Vec<_>>();
    let times = (0..samples).map(|sample| first_time_s + sample as f64 / rate_hz).collect();
    let wrong =
        |error: RecordingError| IterationError::Record { joints: record.joints.clone(), problem: error.to_string() };
    JointSamples::at_times(times, joints(q), joints(tau)).into_log("record", &record.joints).map_err(wrong)
}

/// Torque at a sample that corresponds to the smooth curve through the positions, if the torques u are held from each
/// sample to the next.
///
/// The motion satisfies I q̈ + G(q) = u with step length h. Second differences of the positions contain the mean `ū`
/// of the two torque values, and G weighted by a triangle over both steps: `I δ²q/h² + G + h² G''/12 = ū`. With
/// `δ²q/h² = q̈ + h² q⁗/12` this gives `ū - h²/12 (I q⁗ + G'') = ū - δ²ū/12`, exact to h⁴. Without this correction
/// the error for a planar two-joint arm at 1 kHz is 2e-6.
fn held_torque(u: &[f64], sample: usize) -> f64 {
    (13.0 * (u[sample - 1] + u[sample]) - u[sample - 2] - u[sample + 1]) / 24.0
}

/// The settings with a cut-off frequency from the data, if they do not define one.
fn differentiator(settings: &DifferentiatorSettings, q: &[f64], joints: usize, rate_hz: f64) -> DifferentiatorSettings {
    if !settings.wants_cutoff() {
        return settings.clone();
    }
    let columns: Vec<&[f64]> = q.chunks_exact(q.len() / joints.max(1)).collect();
    settings.clone().with_cutoff(cutoff(&columns, rate_hz).cutoff_hz)
}

/// Interpolates the values at equal steps from the first to the last time.
pub(crate) fn on_uniform_clock(record: &Record, values: &[f64]) -> Vec<f64> {
    let (samples, times) = (record.samples, &record.times_s);
    let step = (times[samples - 1] - times[0]) / (samples - 1) as f64;
    let uniform =
        times.iter().enumerate().all(|(k, t)| (t - times[0] - k as f64 * step).abs() <= UNIFORM_STEP_TOLERANCE * step);
    if uniform {
        return values.to_vec();
    }
    let mut out = Vec::with_capacity(values.len());
    for own in values.chunks_exact(samples) {
        let mut before = 0;
        for k in 0..samples {
            let time = times[0] + k as f64 * step;
            while before + 2 < samples && times[before + 1] <= time {
                before += 1;
            }
            let share = ((time - times[before]) / (times[before + 1] - times[before])).clamp(0.0, 1.0);
            out.push(own[before] + share * (own[before + 1] - own[before]));
        }
    }
    out
}
