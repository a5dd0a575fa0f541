//! Mistakes in a recording, found by comparison with the commanded motion: units, signs, columns, time stamps.
//!
//! The relation of the time stamps to the motion is determined first, by the correlation of recorded and commanded
//! positions, which is independent of unit, offset and sign. Positions are then compared joint by joint, and torques
//! with the torques of a model along the motion.

use super::envelope::target_at;
use core::fmt;
use dynident_simulation::{Record, Reference};

/// Thresholds for mistakes in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogMistakeSettings {
    /// Minimum correlation of recorded with commanded positions for a reliable comparison. Default 0.95: apart from
    /// delay and scale, the tracking error is then a third of the motion's standard deviation (`1/√(1 + 0.33²)`).
    pub min_correlation: f64,
    /// Longest delay that the robot can cause, s; for shorter delays, time stamps are not changed. Default 0.25.
    pub max_lag_s: f64,
    /// Largest relative deviation of a ratio from the ratio of two units. Default 0.15.
    pub ratio_tolerance: f64,
    /// The torque unit is wrong if the ratio of recorded to predicted torque of every joint is above this value (or
    /// below its reciprocal). Default 300: errors of a robot description are much smaller, and a factor of 1000 is
    /// detected for any robot.
    pub torque_ratio: f64,
}

impl Default for LogMistakeSettings {
    fn default() -> Self {
        Self { min_correlation: 0.95, max_lag_s: 0.25, ratio_tolerance: 0.15, torque_ratio: 300.0 }
    }
}

/// A mistake that has to be corrected in the file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LogMistake {
    /// Time stamps in another unit.
    TimeUnit {
        /// Name of the unit.
        unit: &'static str,
        /// Length of the unit in seconds.
        seconds: f64,
    },
    /// Positions in another unit.
    PositionUnit {
        /// Names of the joints.
        joints: Vec<String>,
        /// Ratio of the recorded to the commanded range of positions.
        ratio: f64,
        /// Likely unit.
        unit: &'static str,
    },
    /// Positions with the opposite sign.
    PositionSign {
        /// Names of the joints.
        joints: Vec<String>,
    },
    /// Position columns that contain the motion of other joints.
    ExchangedPositions {
        /// For each column, the joint in its name and the joint whose motion it contains.
        columns: Vec<(String, String)>,
    },
    /// Torques in another unit.
    TorqueUnit {
        /// Median over the joints of the ratio of recorded to predicted torque.
        ratio: f64,
        /// The likely unit.
        unit: &'static str,
    },
}

impl fmt::Display for LogMistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TimeUnit { unit, seconds } => {
                write!(f, "the time stamps are {unit}: multiply column t_s by {seconds:e}")
            }
            Self::PositionUnit { joints, ratio, unit } => write!(
                f,
                "the positions of {} are {ratio:.4} times the commanded motion ({unit}): write radians (metres)",
                joints.join(", ")
            ),
            Self::PositionSign { joints } => {
                write!(
                    f,
                    "the positions of {} have the opposite sign: reverse it, and check the sign of the torque",
                    joints.join(", ")
                )
            }
            Self::ExchangedPositions { columns } => {
                let each = columns.iter().map(|(name, holds)| format!("that of {name} contains the motion of {holds}"));
                write!(
                    f,
                    "columns of positions are exchanged ({}): name both q and tau in the robot's order",
                    each.collect::<Vec<_>>().join(", ")
                )
            }
            Self::TorqueUnit { ratio, unit } => {
                write!(f, "the torques are {ratio:.3e} times those that the model predicts ({unit}): write Nm (N)")
            }
        }
    }
}

/// A recording after the comparison with its motion.
#[derive(Clone, Debug, PartialEq)]
pub struct ExaminedLog {
    /// The recording, with times relative to the start of the motion.
    pub record: Record,
    /// Description of the change of the time stamps; `None` if they were not changed.
    pub note: Option<String>,
    /// Mistakes that have to be corrected in the file.
    pub mistakes: Vec<LogMistake>,
}

/// Units of time stamps, and their length in seconds.
const TIME_UNITS: [(&str, f64); 3] = [("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)];
/// Units of positions, and the number of units per radian (metre).
const POSITION_UNITS: [(&str, f64); 4] = [
    ("degrees", 180.0 / core::f64::consts::PI),
    ("milliradians or millimetres", 1000.0),
    ("revolutions", 0.5 / core::f64::consts::PI),
    ("converted from degrees although they were radians", core::f64::consts::PI / 180.0),
];

/// Maximum number of compared points, and of tested delays.
const MAX_POINTS: usize = 300;
const MAX_DELAYS: usize = 4000;
/// Largest share of the motion that can be missing in a recording.
const MAX_MISSING_SHARE: f64 = 0.01;
/// A joint is not compared if its range is below this share of the largest range of a joint.
const MIN_RANGE_SHARE: f64 = 0.01;
/// Difference below which two correlations are treated as equal.
const CORRELATION_TOLERANCE: f64 = 0.01;

/// Compares a recording with the commanded motion. `torque` contains the model torque at every sample of the reference,
/// joint by joint, if there is a model.
///
/// A constant offset of the time stamps and an early start of the recorder are corrected, because they do not affect
/// the result. Other mistakes are reported and not corrected. A recording that does not resemble the motion is
/// returned unchanged, without a mistake.
pub fn examine_log(
    record: Record,
    reference: &Reference,
    torque: Option<&[f64]>,
    settings: &LogMistakeSettings,
) -> ExaminedLog {
    let untouched = |record| ExaminedLog { record, note: None, mistakes: Vec::new() };
    let Some(comparison) = Comparison::new(&record, reference) else { return untouched(record) };
    let certain = |found: &Clock| found.correlation >= settings.min_correlation;
    let as_it_is = comparison.clock(&record, 1.0, settings).filter(certain);
    let in_unit = |(unit, seconds): (&'static str, f64)| {
        let clock = comparison.clock(&record, seconds, settings).filter(certain)?;
        Some((clock, Some(LogMistake::TimeUnit { unit, seconds })))
    };
    let found = as_it_is.map(|clock| (clock, None)).or_else(|| TIME_UNITS.into_iter().find_map(in_unit));
    let Some((clock, time_unit)) = found else { return untouched(record) };
    let mut mistakes: Vec<LogMistake> = time_unit.into_iter().collect();
    mistakes.extend(comparison.position_mistakes(&record, &clock, settings));
    if let Some(torque) = torque {
        mistakes.extend(torque_unit(&record, reference, &clock, torque, settings));
    }
    let (record, note) = if mistakes.is_empty() { clock.applied(record, reference) } else { (record, None) };
    ExaminedLog { record, note, mistakes }
}

/// Relation of the time stamps to the motion: time in the motion = stamp · seconds − start.
struct Clock {
    seconds: f64,
    start_s: f64,
    /// Whether the recording begins before the motion.
    early: bool,
    correlation: f64,
}

impl Clock {
    /// Returns the recording with times relative to the start of the motion, and a note about the change.
    fn applied(&self, mut record: Record, reference: &Reference) -> (Record, Option<String>) {
        if self.start_s == 0.0 {
            return (record, None);
        }
        let (first, start) = (record.times_s[0], self.start_s);
        record.times_s.iter_mut().for_each(|time| *time -= start);
        if !self.early {
            return (record, Some(format!("the time stamps begin at {first} s; this offset was removed")));
        }
        let half = 0.5 / reference.rate_hz();
        let (from, to) = (-half, reference.duration_s() + half);
        let begin = record.times_s.partition_point(|time| *time < from);
        let end = record.times_s.partition_point(|time| *time <= to);
        let cut = |values: &[f64]| -> Vec<f64> {
            values.chunks_exact(record.samples).flat_map(|own| &own[begin..end]).copied().collect()
        };
        let (q, tau) = (cut(&record.q), cut(&record.tau));
        record.times_s = record.times_s[begin..end].to_vec();
        (record.q, record.tau, record.samples) = (q, tau, end - begin);
        let before = start - first;
        (record, Some(format!("the recording begins {before:.3} s before the motion; these rows were removed")))
    }
}

/// The commanded motion at some times, joint by joint, and the indices of the joints that move.
struct Comparison<'a> {
    reference: &'a Reference,
    times_s: Vec<f64>,
    targets: Vec<Vec<f64>>,
    moving: Vec<usize>,
}

impl<'a> Comparison<'a> {
    fn new(record: &Record, reference: &'a Reference) -> Option<Self> {
        let duration_s = reference.duration_s();
        if record.samples < 10 || record.joints.len() != reference.joints() || duration_s <= 0.0 {
            return None;
        }
        let points = MAX_POINTS.min(reference.samples());
        let times_s: Vec<f64> = (0..points).map(|k| duration_s * k as f64 / (points - 1).max(1) as f64).collect();
        let of_joint = |joint| times_s.iter().map(|time| target_at(reference, joint, *time)).collect();
        let targets: Vec<Vec<f64>> = (0..reference.joints()).map(of_joint).collect();
        let ranges: Vec<f64> = targets.iter().map(|own| range(own)).collect();
        let largest = ranges.iter().copied().fold(0.0, f64::max);
        let moving: Vec<usize> =
            (0..ranges.len()).filter(|&joint| largest > 0.0 && ranges[joint] > MIN_RANGE_SHARE * largest).collect();
        (!moving.is_empty()).then_some(Self { reference, times_s, targets, moving })
    }

    fn recorded(&self, record: &Record, joint: usize, seconds: f64, start_s: f64) -> Vec<f64> {
        let own = &record.q[record.of(joint)];
        self.times_s.iter().map(|time| interpolated(&record.times_s, own, (time + start_s) / seconds)).collect()
    }

    /// Mean over the moving joints of the largest absolute correlation between a recorded position and the commanded
    /// motion of any joint.
    fn correlation(&self, record: &Record, seconds: f64, start_s: f64) -> f64 {
        let best = |&joint: &usize| {
            let own = self.recorded(record, joint, seconds, start_s);
            let of = |&other: &usize| correlation(&own, &self.targets[other]).abs();
            self.moving.iter().map(of).fold(0.0, f64::max)
        };
        self.moving.iter().map(best).sum::<f64>() / self.moving.len() as f64
    }

    /// Finds the relation of the time stamps with the largest correlation, for stamps in a unit of `seconds`; `None`
    /// if the recording would then be shorter than the motion.
    fn clock(&self, record: &Record, seconds: f64, settings: &LogMistakeSettings) -> Option<Clock> {
        let duration_s = self.reference.duration_s();
        let (first, last) = (record.times_s[0] * seconds, record.times_s[record.samples - 1] * seconds);
        let missing = MAX_MISSING_SHARE * duration_s + 2.0 / self.reference.rate_hz();
        let latest = last - duration_s + missing;
        let earliest = first - missing;
        if latest < earliest {
            return None;
        }
        // The step is a small part of the shortest period of the motion; long recordings use larger steps.
        let step = (duration_s / MAX_POINTS as f64).min(0.02).max((latest - earliest) / MAX_DELAYS as f64);
        let steps = ((latest - earliest) / step).ceil() as usize;
        let at = |start_s: f64| self.correlation(record, seconds, start_s);
        let coarse = (0..=steps).map(|k| earliest + step * k as f64);
        let best = coarse.map(|start| (at(start), start)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let fine = (-10..=10).map(|k| best.1 + step * f64::from(k) / 10.0);
        let (correlation, start_s) = fine.map(|start| (at(start), start)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        // Unchanged time stamps are preferred, then those of a recording that begins with the motion: the robot
        // itself can lag behind the motion.
        let covers = |start: f64| start >= earliest && start <= latest;
        let is_equivalent = |start: f64| {
            covers(start)
                && ((start_s - start).abs() <= settings.max_lag_s || at(start) >= correlation - CORRELATION_TOLERANCE)
        };
        let (start_s, early) = if is_equivalent(0.0) {
            (0.0, false)
        } else if is_equivalent(first) {
            (first, false)
        } else {
            (start_s, true)
        };
        Some(Clock { seconds, start_s, early, correlation })
    }

    fn position_mistakes(&self, record: &Record, clock: &Clock, settings: &LogMistakeSettings) -> Vec<LogMistake> {
        let name = |joint: usize| record.joints[joint].clone();
        let mut mistakes = Vec::new();
        let mut exchanged = Vec::new();
        let mut reversed = Vec::new();
        let mut in_unit: Vec<(usize, f64, Vec<String>)> = Vec::new();
        for &joint in &self.moving {
            let own = self.recorded(record, joint, clock.seconds, clock.start_s);
            let of = |other: usize| correlation(&own, &self.targets[other]);
            let likest = self.moving.iter().copied().max_by(|&a, &b| of(a).abs().total_cmp(&of(b).abs()));
            let Some(holds) = likest.filter(|&other| of(other).abs() >= settings.min_correlation) else { continue };
            // Several joints can have the same commanded motion.
            let holds = if of(joint).abs() >= of(holds).abs() - CORRELATION_TOLERANCE { joint } else { holds };
            if holds != joint {
                exchanged.push((name(joint), name(holds)));
            }
            if of(holds) < 0.0 {
                reversed.push(name(joint));
            }
            let ratio = range(&own) / range(&self.targets[holds]);
            let unit =
                POSITION_UNITS.iter().position(|(_, factor)| (ratio / factor - 1.0).abs() <= settings.ratio_tolerance);
            if let Some(unit) = unit {
                match in_unit.iter_mut().find(|(known, ..)| *known == unit) {
                    Some((_, _, joints)) => joints.push(name(joint)),
                    None => in_unit.push((unit, ratio, vec![name(joint)])),
                }
            }
        }
        if !exchanged.is_empty() {
            mistakes.push(LogMistake::ExchangedPositions { columns: exchanged });
        }
        mistakes.extend(in_unit.into_iter().map(|(unit, ratio, joints)| LogMistake::PositionUnit {
            joints,
            ratio,
            unit: POSITION_UNITS[unit].0,
        }));
        if !reversed.is_empty() {
            mistakes.push(LogMistake::PositionSign { joints: reversed });
        }
        mistakes
    }
}

/// Reports a wrong torque unit if the torques of all joints differ from the prediction by the same large factor.
/// `predicted` contains the torques at the reference's samples, joint by joint.
fn torque_unit(
    record: &Record,
    reference: &Reference,
    clock: &Clock,
    predicted: &[f64],
    settings: &LogMistakeSettings,
) -> Option<LogMistake> {
    let samples = reference.samples();
    if predicted.len() != samples * record.joints.len() {
        return None;
    }
    let norm = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>().sqrt();
    let largest = predicted.chunks_exact(samples).map(norm).fold(0.0, f64::max);
    let mut ratios = Vec::new();
    for (joint, predicted) in predicted.chunks_exact(samples).enumerate() {
        let size = norm(predicted);
        if size == 0.0 || size < 0.1 * largest {
            continue;
        }
        let own = &record.tau[record.of(joint)];
        let at = |k: usize| (k as f64 / reference.rate_hz() + clock.start_s) / clock.seconds;
        let recorded: Vec<f64> = (0..samples).map(|k| interpolated(&record.times_s, own, at(k))).collect();
        let product: f64 = recorded.iter().zip(predicted).map(|(a, b)| a * b).sum();
        // If most of a joint's torque is friction, the prediction is not meaningful.
        if product.abs() < 0.5 * size * norm(&recorded) {
            continue;
        }
        ratios.push(norm(&recorded) / size);
    }
    ratios.sort_unstable_by(f64::total_cmp);
    let (least, most) = (*ratios.first()?, *ratios.last()?);
    let ratio = ratios[ratios.len() / 2];
    if least >= settings.torque_ratio {
        Some(LogMistake::TorqueUnit { ratio, unit: "are they in mNm, or currents in mA?" })
    } else if most <= 1.0 / settings.torque_ratio {
        Some(LogMistake::TorqueUnit { ratio, unit: "are they in kNm, or shares of the rated torque?" })
    } else {
        None
    }
}

fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    high - low
}

fn interpolated(times: &[f64], values: &[f64], time: f64) -> f64 {
    let next = times.partition_point(|known| *known <= time).clamp(1, times.len() - 1);
    let (from, to) = (times[next - 1], times[next]);
    let share = ((time - from) / (to - from)).clamp(0.0, 1.0);
    values[next - 1] + share * (values[next] - values[next - 1])
}

/// Pearson correlation; 0 if one of the signals is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - mean_a, y - mean_b);
        (aa, bb, ab) = (aa + x * x, bb + y * y, ab + x * y);
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_excitation::Motion;

    const RATE_HZ: f64 = 200.0;
    const DURATION_S: f64 = 6.0;

    fn reference() -> Reference {
        let samples = (DURATION_S * RATE_HZ) as usize + 1;
        let mut motion = Motion::default();
        motion.reset(2, samples);
        for k in 0..samples {
            let time = k as f64 / RATE_HZ;
            let fade = (core::f64::consts::PI * time / DURATION_S).sin().powi(2);
            motion.q[k] = 0.8 * fade * (2.1 * time).sin();
            motion.q[samples + k] = 0.4 + 0.5 * fade * (3.3 * time + 1.0).cos();
        }
        Reference::new(RATE_HZ, motion).unwrap()
    }

    /// A robot with a lag of 20 ms; its torque is that of a spring.
    fn recorded(from_s: f64, to_s: f64) -> Record {
        let reference = reference();
        let samples = ((to_s - from_s) * RATE_HZ).round() as usize + 1;
        let times_s: Vec<f64> = (0..samples).map(|k| from_s + k as f64 / RATE_HZ).collect();
        let column = |joint| times_s.iter().map(|time| target_at(&reference, joint, time - 0.02)).collect::<Vec<_>>();
        let q = [column(0), column(1)].concat();
        let tau = q.iter().map(|q| 20.0 * q).collect();
        Record { joints: vec!["a".to_owned(), "b".to_owned()], rate_hz: RATE_HZ, samples, times_s, q, tau }
    }

    fn examined(record: Record) -> ExaminedLog {
        let reference = reference();
        let predicted: Vec<f64> = reference.motion().q.iter().map(|q| 15.0 * q).collect();
        examine_log(record, &reference, Some(&predicted), &LogMistakeSettings::default())
    }

    #[test]
    fn a_recording_that_is_right_stays_as_it_is() {
        let record = recorded(0.0, DURATION_S);
        let found = examined(record.clone());
        assert_eq!(found, ExaminedLog { record, note: None, mistakes: Vec::new() });
        // Another motion is not explained by units.
        let mut other = recorded(0.0, DURATION_S);
        other.q.iter_mut().enumerate().for_each(|(k, q)| *q = (k as f64 * 0.37).sin());
        assert_eq!(examined(other.clone()), ExaminedLog { record: other, note: None, mistakes: Vec::new() });
    }

    #[test]
    fn harmless_differences_of_the_clock_are_removed_and_stated() {
        let right = recorded(0.0, DURATION_S);
        for offset in [1_700_000_000.25, 0.7, -3.0] {
            let mut shifted = right.clone();
            shifted.times_s.iter_mut().for_each(|time| *time += offset);
            let found = examined(shifted);
            assert!(found.mistakes.is_empty() && found.note.unwrap().contains("offset"), "{offset}");
            let error = found.record.times_s.iter().zip(&right.times_s).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-6 && found.record.q == right.q, "{offset}: {error}");
        }
        // The recorder starts 0.7 s early and continues for 2 s, with its own clock.
        let mut early = recorded(-0.7, DURATION_S + 2.0);
        early.times_s.iter_mut().for_each(|time| *time += 0.7);
        let found = examined(early);
        assert!(found.mistakes.is_empty());
        let note = found.note.unwrap();
        assert!(note.contains("before the motion"), "{note}");
        let (first, last) = (found.record.times_s[0], found.record.times_s[found.record.samples - 1]);
        // Accurate to the delay of the robot, which cannot be distinguished from that of the recorder.
        assert!(first.abs() < 0.03 && (last - DURATION_S).abs() < 0.03, "{first} {last}");
    }

    #[test]
    fn units_signs_and_columns_are_named() {
        let right = recorded(0.0, DURATION_S);
        let scaled = |factor: f64, what: fn(&mut Record) -> &mut Vec<f64>| {
            let mut record = right.clone();
            for value in what(&mut record) {
                *value *= factor;
            }
            record
        };
        let samples = right.samples;
        let mut exchanged = right.clone();
        exchanged.q.rotate_left(samples);
        let mut reversed = right.clone();
        reversed.q[samples..].iter_mut().for_each(|q| *q = -*q);
        let cases = [
            (scaled(1e3, |record| &mut record.times_s), "milliseconds"),
            (scaled(1e6, |record| &mut record.times_s), "microseconds"),
            (scaled(1e9, |record| &mut record.times_s), "nanoseconds"),
            (scaled(57.295_78, |record| &mut record.q), "(degrees)"),
            (scaled(1e3, |record| &mut record.q), "millimetres"),
            (scaled(1e3, |record| &mut record.tau), "mNm"),
            (scaled(1e-3, |record| &mut record.tau), "kNm"),
            (exchanged, "that of a contains the motion of b, that of b contains the motion of a"),
            (reversed, "positions of b have the opposite sign"),
        ];
        for (record, words) in cases {
            let found = examined(record.clone());
            let message = found.mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            assert!(found.mistakes.len() == 1 && message.contains(words), "{words}: {message}");
            assert_eq!((found.record, found.note), (record, None), "{words}");
        }
        // One joint's torque is mostly friction, which the prediction does not contain.
        let mut rubbing = right.clone();
        let speed = |k: usize| right.q[k + 1] - right.q[k];
        for k in 0..samples - 1 {
            rubbing.tau[k] = 1e3 * (rubbing.tau[k] + 100.0 * speed(k).signum());
            rubbing.tau[samples + k] *= 1e3;
        }
        let found = examined(rubbing).mistakes;
        assert!(found.len() == 1 && found[0].to_string().contains("mNm"), "{found:?}");
        let mut several = scaled(57.295_78, |record| &mut record.q);
        several.times_s.iter_mut().for_each(|time| *time *= 1e3);
        several.tau.iter_mut().for_each(|tau| *tau *= 1e3);
        assert_eq!(examined(several).mistakes.len(), 3);
    }
}
