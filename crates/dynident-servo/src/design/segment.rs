//! Random commands of one segment: rests, reversals, steps and sines, which together separate friction, stiffness,
//! damping, delay and weight.

use dynident_model::sample::Random;

/// Share of a segment's duration for the transition to the centre of its motion, and again for the transition to its
/// end.
const WAY: f64 = 0.15;
/// Share of a segment's duration at rest at its end, so that the next segment begins at rest.
const REST: f64 = 0.08;
/// Smallest and largest amplitude, relative to half of the joint's range.
const AMPLITUDES: [f64; 2] = [0.08, 0.6];
/// Lowest frequency of a sweep, Hz.
const LOWEST_HZ: f64 = 0.3;
/// Shortest and longest time at one level of a sequence of steps, s.
const LEVEL_S: [f64; 2] = [0.35, 1.2];
/// Share of the speed limit that the commands use, because the servo overshoots.
const SPEED_PART: f64 = 0.7;

/// Permitted range and speed of one joint's commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandRange {
    /// Smallest position, rad (m).
    pub least: f64,
    /// Largest position, rad (m).
    pub greatest: f64,
    /// Highest speed, rad/s (m/s).
    pub speed: f64,
}

impl CommandRange {
    fn half(&self) -> f64 {
        0.5 * (self.greatest - self.least)
    }
}

/// Number of samples, sample rate and highest frequency of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct SegmentClock {
    pub(super) samples: usize,
    pub(super) rate_hz: f64,
    pub(super) highest_hz: f64,
}

/// Shape of one joint's motion around the centre of a segment, with values from -1 to 1.
enum Shape {
    /// The joint rests while other joints move.
    Still,
    /// Slow back-and-forth motion at constant speed, for friction in both directions.
    Reversals { cycles: f64 },
    /// Steps between levels with rests, each level reached from both sides, for friction at rest, stiffness and step
    /// responses.
    Levels { ends_s: Vec<f64>, levels: Vec<f64> },
    /// A sine with rising or falling frequency, for damping, armature and delay.
    Sweep { from_hz: f64, to_hz: f64 },
}

impl Shape {
    fn random(random: &mut Random, duration_s: f64, highest_hz: f64) -> Self {
        match random.uniform(0.0, 8.0) as usize {
            0 => Self::Still,
            1 | 2 => Self::Reversals { cycles: random.uniform(1.0, 3.999).floor() },
            3..=5 => {
                let (mut ends_s, mut levels, mut at) = (Vec::new(), Vec::new(), 0.0);
                let with_centre = random.uniform(0.0, 1.0) < 0.5;
                let mut sign = if random.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
                while at < duration_s {
                    at += random.uniform(LEVEL_S[0], LEVEL_S[1]);
                    ends_s.push(at);
                    let is_centre = with_centre && levels.len() % 2 == 1;
                    levels.push(if is_centre { 0.0 } else { sign * random.uniform(0.3, 1.0) });
                    if !is_centre {
                        sign = -sign;
                    }
                }
                Self::Levels { ends_s, levels }
            }
            _ => {
                let ends = [LOWEST_HZ.min(highest_hz), highest_hz].map(f64::ln);
                let [from_hz, to_hz] = [(); 2].map(|()| random.uniform(ends[0], ends[1]).exp());
                Self::Sweep { from_hz, to_hz }
            }
        }
    }

    /// Position at time `t` of the shape, which lasts `duration_s`. The amplitude is reduced where the motion would
    /// exceed `speed`. For steps it is not, because the servo limits the speed.
    fn at(&self, t: f64, duration_s: f64, amplitude: f64, speed: f64) -> f64 {
        match self {
            Self::Still => 0.0,
            Self::Reversals { cycles } => {
                let phase = (cycles * t / duration_s + 0.25).rem_euclid(1.0);
                let triangle = 1.0 - 4.0 * (phase - 0.5).abs();
                amplitude.min(speed * duration_s / (4.0 * cycles)) * triangle
            }
            Self::Levels { ends_s, levels } => {
                let level = ends_s.iter().position(|end| t < *end).unwrap_or(levels.len() - 1);
                amplitude * levels[level]
            }
            Self::Sweep { from_hz, to_hz } => sweep(t, duration_s, [*from_hz, *to_hz], [amplitude, speed]),
        }
    }
}

/// A sine whose frequency changes exponentially from `from_hz` to `to_hz`, with smooth ends. The amplitude is reduced
/// where the sine would exceed `speed` (rad/s or m/s).
pub(super) fn sweep(t: f64, duration_s: f64, [from_hz, to_hz]: [f64; 2], [amplitude, speed]: [f64; 2]) -> f64 {
    use core::f64::consts::TAU;
    let ratio = (to_hz / from_hz).ln();
    let part = t / duration_s;
    let hz = from_hz * (ratio * part).exp();
    let cycles = if ratio.abs() < 1e-6 { from_hz * t } else { duration_s / ratio * (hz - from_hz) };
    let soft = (t.min(duration_s - t) / (0.1 * duration_s)).clamp(0.0, 1.0);
    amplitude.min(speed / (TAU * hz)) * soft * (TAU * cycles).sin()
}

/// Smooth transition from 0 to 1 with zero velocity at both ends.
fn smooth(part: f64) -> f64 {
    let part = part.clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// Random commands of all joints from the posture `start` to `end`, or to a random posture. `size` scales all
/// amplitudes and the distances from `start`; with 1 the whole range is used.
pub(super) fn random_segment(
    ranges: &[CommandRange],
    (start, end): (&[f64], Option<&[f64]>),
    clock: SegmentClock,
    size: f64,
    random: &mut Random,
) -> Vec<Vec<f64>> {
    let duration_s = clock.samples as f64 / clock.rate_hz;
    let middle_s = duration_s * (1.0 - 2.0 * WAY - REST);
    let mut of_joint = |joint: usize| {
        let range = &ranges[joint];
        let from = start[joint];
        let amplitude = size * range.half() * random.uniform(AMPLITUDES[0], AMPLITUDES[1]);
        let place = |random: &mut Random, amplitude: f64| {
            let inner = [range.least + amplitude, range.greatest - amplitude];
            let away = random.uniform(inner[0], inner[1].max(inner[0]));
            (from + size * (away - from)).clamp(inner[0], inner[1].max(inner[0]))
        };
        let centre = place(random, amplitude);
        let to = end.map_or_else(|| place(random, 0.0), |end| end[joint]);
        let shape = Shape::random(random, middle_s, clock.highest_hz);
        let speed = SPEED_PART * range.speed;
        let command = |sample: usize| {
            let t = sample as f64 / clock.rate_hz;
            let way_s = WAY * duration_s;
            let out = smooth(t / way_s);
            let back = smooth((t - way_s - middle_s) / way_s);
            let inner = if (way_s..way_s + middle_s).contains(&t) {
                shape.at(t - way_s, middle_s, amplitude, speed)
            } else {
                0.0
            };
            let way = (1.0 - back) * (from + out * (centre - from)) + back * to;
            (way + inner).clamp(range.least, range.greatest)
        };
        (0..clock.samples).map(command).collect()
    };
    (0..ranges.len()).map(&mut of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_keep_their_range_and_ends() {
        let ranges = [CommandRange { least: -1.0, greatest: 2.0, speed: 3.0 }; 3];
        let clock = SegmentClock { samples: 300, rate_hz: 50.0, highest_hz: 5.0 };
        let (start, end) = ([0.5, -1.0, 2.0], [0.0, 2.0, -1.0]);
        let mut random = Random::new(7);
        for _ in 0..200 {
            let commands = random_segment(&ranges, (&start, Some(&end)), clock, 1.0, &mut random);
            for (joint, commands) in commands.iter().enumerate() {
                assert!(commands.iter().all(|c| (-1.0..=2.0).contains(c)));
                assert_eq!(commands[0], start[joint]);
                // At rest at the end for the next segment.
                assert!(commands[285..].iter().all(|c| (c - end[joint]).abs() < 1e-12), "{:?}", &commands[285..]);
            }
        }
    }

    #[test]
    fn a_sweep_keeps_its_speed_and_frequencies() {
        let (duration_s, h) = (20.0, 1e-4);
        let at = |t: f64| sweep(t, duration_s, [0.2, 5.0], [0.4, 1.5]);
        let (mut crossings, mut fastest) = (Vec::new(), 0.0_f64);
        for k in 0..200_000 {
            let t = h * f64::from(k);
            if at(t) < 0.0 && at(t + h) > 0.0 {
                crossings.push(t);
            }
            fastest = fastest.max((at(t + h) - at(t)).abs() / h);
        }
        assert!(fastest < 1.6, "{fastest}");
        let last = crossings.len() - 1;
        let hz = 1.0 / (crossings[last] - crossings[last - 1]);
        assert!((4.5..5.1).contains(&hz), "{hz}");
    }
}
