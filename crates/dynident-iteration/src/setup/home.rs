//! The home posture between runs, and the approach and return paths between the home posture and a motion.

use crate::robot::{ApproachPaths, Envelope};
use dynident_excitation::Motion;
use dynident_excitation::check::{CHECK_RATE_HZ, LimitReport, check_limits};
use dynident_excitation::limits::{LimitError, LimitKind, LimitSet, Limits};
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_simulation::{Reference, SimulationError, require, require_length};
use thiserror::Error;

/// Maximum number of random via postures, and of pairs of them, that are tested if the direct path violates a limit.
const POSTURES_TRIED: usize = 500;
const PAIRS_TRIED: usize = 5000;

/// Fixed seed of the via postures, so that a resumed iteration finds the same paths.
const SEED: u64 = 1;

/// Number of samples of a straight segment in the quick check before the full check.
const QUICK_CHECK_SAMPLES: usize = 60;

/// An end of the motion is at rest if braking from its velocity at the motion's highest acceleration takes at most
/// this number of samples: the last sample need not be the exact end of the trajectory.
const MAX_BRAKING_SAMPLES: f64 = 2.0;

/// Numbers of samples of a path are multiples of this number, so that a log at a lower rate has a sample where the
/// motion begins.
const PATH_LENGTH_MULTIPLE: f64 = 100.0;

/// The home posture and how the robot moves between it and a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct HomeSettings {
    /// Home posture, rad (m), in the joint order of the model.
    pub posture: Vec<f64>,
    /// Share of the velocity and acceleration limits that the paths use; see [`ways`](Self::ways). Default in studies
    /// 0.2.
    pub speed: f64,
    /// Limits of the paths: joints, floor, distances between links. Torques are those of the nominal model.
    pub limits: Limits,
    /// Uncertainty of the nominal torque, percent; the torque limits are reduced by it.
    pub uncertainty_percent: f64,
}

/// Why no path exists.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HomeError {
    /// Dynident plans the path from home to the start, and needs the velocity limit of each joint that moves. Add it to
    /// the entry of the joint in `joints` under `[design.limits]`.
    #[error(
        "no velocity limit for joint {joint}, which has to move from home (the motion does not move it): add one to [design.limits]"
    )]
    NoSpeed {
        /// The joint.
        joint: String,
    },
    /// The path from home ends at rest, so the motion must begin at rest (and end at rest for the path back). Choose
    /// another trajectory family, or repeat the design.
    #[error(
        "the motion {} at {speed:.3} rad/s (m/s) of joint {joint}, but paths from and to home are from rest to rest: use a motion that begins and ends at rest",
        if *.begins { "begins" } else { "ends" }
    )]
    NotAtRest {
        /// The joint.
        joint: String,
        /// Velocity of the joint there, rad/s (m/s).
        speed: f64,
        /// True at the beginning of the motion, false at its end.
        begins: bool,
    },
    /// The home posture or the start of the motion is outside a limit, so that no path can reach it. Change the posture
    /// or the limit.
    #[error("{posture} itself breaks the limit of {kind} of {subject} (ratio {ratio:.3}, 1 is the limit): {fix}")]
    Posture {
        /// Which posture violates the limit.
        posture: &'static str,
        /// Kind of limit.
        kind: LimitKind,
        /// Joint, point or pair of links.
        subject: String,
        /// Ratio of value to limit.
        ratio: f64,
        /// Suggested fix.
        fix: &'static str,
    },
    /// The straight path in joint space, and all detours that were tried, hit a limit, for example of the workspace.
    /// Choose another `home` under `[iteration]`.
    #[error(
        "no clear path between home and {posture}: the direct path breaks the limit of {kind} of {subject} at {:.0} % of its length (ratio {ratio:.3}, 1 is the limit), and so do all paths through one or two of {tried} random postures; use another home, or a start_posture in [design] that is nearer",
        100.0 * .share
    )]
    NotClear {
        /// Which posture is at the other end of the path.
        posture: &'static str,
        /// Kind of limit.
        kind: LimitKind,
        /// Joint, point or pair of links.
        subject: String,
        /// Place on the direct path from the home posture, as a share from 0 to 1.
        share: f64,
        /// Ratio of value to limit.
        ratio: f64,
        /// Number of random postures that were tried.
        tried: usize,
    },
    /// The command was stopped, for example by Ctrl-C, while it planned the paths. Run it again.
    #[error("the search for the paths from and to home was interrupted")]
    Interrupted,
    /// Invalid limits.
    #[error("{0}")]
    Limits(#[from] LimitError),
    /// Invalid numbers.
    #[error("{0}")]
    Numbers(#[from] SimulationError),
}

/// The paths to a motion and back, with their via postures.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundPaths {
    /// The paths.
    pub ways: ApproachPaths,
    /// Via postures of each path, rad (m), in order from the home posture; empty for a direct path.
    pub over: [Vec<Vec<f64>>; 2],
}

impl HomeSettings {
    /// Checks the settings for `joints` joints.
    ///
    /// # Errors
    /// A posture with another number of joints, or a speed outside of 0 to 1.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        require_length("home", joints, self.posture.len())?;
        for &q in &self.posture {
            require(q.is_finite(), "home", q, "give finite positions, rad (m)")?;
        }
        let speed = self.speed;
        require(speed > 0.0 && speed <= 1.0, "approach_speed", speed, "give a share of the limits: above 0, at most 1")
    }

    /// Plans the paths from the home posture to the beginning of `motion`, and from its end to the home posture. Each
    /// path is a quintic polynomial in joint space from rest to rest, with zero acceleration at both ends. Every
    /// joint uses at most the share [`speed`](Self::speed) of its velocity and acceleration limits (and of the
    /// velocity limit of the safety envelope); without a limit, of the maximum in the motion. If the direct path
    /// violates a limit, the path goes through one or two random via postures (at most 500 are tested, with a fixed
    /// seed), at rest in each. All limits are checked by [`check_limits`]. If the robot is already there, the path
    /// has one sample.
    ///
    /// # Errors
    /// No path exists; nothing has moved.
    pub fn ways(
        &self,
        model: &Model,
        motion: &Reference,
        envelope: Option<&Envelope>,
    ) -> Result<FoundPaths, HomeError> {
        self.ways_until(model, motion, envelope, &|| false)
    }

    /// Like [`ways`](Self::ways), but the search ends with [`HomeError::Interrupted`] once `stop` returns true.
    ///
    /// # Errors
    /// Same as for [`ways`](Self::ways).
    pub fn ways_until(
        &self,
        model: &Model,
        motion: &Reference,
        envelope: Option<&Envelope>,
        stop: &dyn Fn() -> bool,
    ) -> Result<FoundPaths, HomeError> {
        self.validate(model.dof())?;
        require_length("joints of the motion", model.dof(), motion.joints())?;
        let planner = Planner::new(self, model, motion, envelope, stop)?;
        let samples = motion.samples();
        let posture = |sample: usize| -> Vec<f64> {
            (0..motion.joints()).map(|joint| motion.motion().q[joint * samples + sample]).collect()
        };
        planner.at_rest(motion, 0)?;
        planner.at_rest(motion, samples - 1)?;
        planner.clear_posture(
            &self.posture,
            "home",
            "use another home, or correct the obstacles in [design] (limits; defaults such as floor = false)",
        )?;
        let (first, last) = (posture(0), posture(samples - 1));
        let (there, over_there) = planner.way(&first, "the motion's first posture")?;
        let (home, over_home) = if last == first {
            (there.clone(), over_there.clone())
        } else {
            planner.way(&last, "the motion's last posture")?
        };
        let approach = Reference::new(motion.rate_hz(), there)?;
        let back = Reference::new(motion.rate_hz(), backwards(&home))?;
        Ok(FoundPaths { ways: ApproachPaths { approach, back }, over: [over_there, over_home] })
    }
}

fn backwards(motion: &Motion) -> Motion {
    let turned = |values: &[f64], sign: f64| -> Vec<f64> {
        values
            .chunks_exact(motion.samples.max(1))
            .flat_map(|own| own.iter().rev().map(move |value| sign * value))
            .collect()
    };
    Motion {
        samples: motion.samples,
        joints: motion.joints,
        q: turned(&motion.q, 1.0),
        dq: turned(&motion.dq, -1.0),
        ddq: turned(&motion.ddq, 1.0),
        dddq: turned(&motion.dddq, -1.0),
    }
}

struct Planner<'a> {
    home: &'a HomeSettings,
    model: &'a Model,
    rate_hz: f64,
    /// Highest velocity and acceleration of each joint on a path; `None` if unknown.
    fastest: Vec<Option<[f64; 2]>>,
    /// Limits, with torques reduced by the uncertainty of the nominal model.
    limits: Limits,
    set: LimitSet,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> Planner<'a> {
    fn new(
        home: &'a HomeSettings,
        model: &'a Model,
        motion: &Reference,
        envelope: Option<&Envelope>,
        stop: &'a dyn Fn() -> bool,
    ) -> Result<Self, HomeError> {
        let mut limits = home.limits.clone();
        for limit in &mut limits.joints {
            limit.torque = limit.torque.map(|torque| torque / (1.0 + 0.01 * home.uncertainty_percent));
        }
        let own = motion.motion();
        let highest = |values: &[f64], joint: usize| {
            values[own.of(joint)].iter().fold(0.0_f64, |most, value| most.max(value.abs()))
        };
        let some = |value: f64| Some(value).filter(|value| *value > 0.0);
        let fastest = model.joints().iter().enumerate().map(|(place, joint)| {
            let limit = limits.of(&joint.name);
            let stated = limit.and_then(|limit| limit.speed);
            let watched = envelope.and_then(|envelope| envelope.speed[place]);
            let speed = stated.into_iter().chain(watched).reduce(f64::min);
            let acceleration = limit.and_then(|limit| limit.acceleration);
            let speed = speed.or_else(|| some(highest(&own.dq, place)))?;
            // Default of the design: full velocity after 0.2 rad (m) from rest.
            let acceleration = acceleration.or_else(|| some(highest(&own.ddq, place))).unwrap_or(2.5 * speed * speed);
            Some([home.speed * speed, home.speed * acceleration])
        });
        let fastest = fastest.collect();
        let set = LimitSet::new(&limits, model)?;
        Ok(Self { home, model, rate_hz: motion.rate_hz(), fastest, limits, set, stop })
    }

    fn at_rest(&self, motion: &Reference, sample: usize) -> Result<(), HomeError> {
        let own = motion.motion();
        for (place, joint) in self.model.joints().iter().enumerate() {
            let hardest = own.ddq[own.of(place)].iter().fold(0.0_f64, |most, ddq| most.max(ddq.abs()));
            let speed = own.dq[own.of(place)][sample].abs();
            if speed > MAX_BRAKING_SAMPLES * hardest / self.rate_hz {
                return Err(HomeError::NotAtRest { joint: joint.name.clone(), speed, begins: sample == 0 });
            }
        }
        Ok(())
    }

    fn check_stop(&self) -> Result<(), HomeError> {
        if (self.stop)() { Err(HomeError::Interrupted) } else { Ok(()) }
    }

    fn clear_posture(&self, q: &[f64], posture: &'static str, fix: &'static str) -> Result<(), HomeError> {
        let standing = self.piece(q, q)?;
        if let Some(broken) = self.broken(&standing)? {
            let LimitReport { kind, joint: subject, worst_ratio: ratio, .. } = broken;
            return Err(HomeError::Posture { posture, kind, subject, ratio, fix });
        }
        Ok(())
    }

    fn way(&self, to: &[f64], posture: &'static str) -> Result<(Motion, Vec<Vec<f64>>), HomeError> {
        let fix = "the motion breaks it, too: use another motion, or correct the obstacles in [design] (limits; defaults such as floor = false)";
        self.clear_posture(to, posture, fix)?;
        let from = &self.home.posture;
        let straight = self.piece(from, to)?;
        let Some(broken) = self.broken(&straight)? else { return Ok((straight, Vec::new())) };
        // Postures that are reachable directly from the home posture, or from the other end. A path uses one posture
        // that is in both lists, or one of each.
        let (mut from_home, mut to_end): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        let mut random = Random::new(SEED);
        let mut pairs = 0;
        for tried in 0..POSTURES_TRIED {
            let middle = self.between(from, to, tried, &mut random);
            let ends = [self.sees(from, &middle)?, self.sees(&middle, to)?];
            let mut over = Vec::new();
            match ends {
                [true, true] => over.push(vec![middle.clone()]),
                [true, false] => over.extend(to_end.iter().map(|last| vec![middle.clone(), last.clone()])),
                [false, true] => over.extend(from_home.iter().map(|first| vec![first.clone(), middle.clone()])),
                [false, false] => {}
            }
            for over in over {
                if let [first, last] = &over[..] {
                    pairs += 1;
                    if pairs > PAIRS_TRIED || !self.sees(first, last)? {
                        continue;
                    }
                }
                let way = self.over(from, &over, to)?;
                if self.broken(&way)?.is_none() {
                    return Ok((way, over));
                }
            }
            if ends[0] {
                from_home.push(middle);
            } else if ends[1] {
                to_end.push(middle);
            }
        }
        let LimitReport { kind, joint: subject, worst_ratio: ratio, at_s, .. } = broken;
        let share = at_s * self.rate_hz / (straight.samples - 1).max(1) as f64;
        Err(HomeError::NotClear { posture, kind, subject, share, ratio, tried: POSTURES_TRIED })
    }

    fn over(&self, from: &[f64], over: &[Vec<f64>], to: &[f64]) -> Result<Motion, HomeError> {
        let mut way = self.piece(from, from)?;
        let mut last = from;
        for next in over.iter().map(Vec::as_slice).chain([to]) {
            way = joined(&way, &self.piece(last, next)?);
            last = next;
        }
        Ok(way)
    }

    fn sees(&self, from: &[f64], to: &[f64]) -> Result<bool, HomeError> {
        self.check_stop()?;
        Ok(self.looks_clear(&self.piece(from, to)?))
    }

    /// A random via posture: first near the direct path, then farther away. It is within the position limits; without
    /// limits, within half a turn (1 m) beyond the path.
    fn between(&self, from: &[f64], to: &[f64], tried: usize, random: &mut Random) -> Vec<f64> {
        let reach = (tried + 1) as f64 / POSTURES_TRIED as f64;
        let joints = self.model.joints().iter().enumerate();
        let one = |(place, joint): (usize, &dynident_model::Joint)| {
            let free = if joint.is_rotary() { core::f64::consts::PI } else { 1.0 };
            let position = self.limits.of(&joint.name).and_then(|limit| limit.position);
            let [low, high] = [from[place].min(to[place]), from[place].max(to[place])];
            let [lowest, highest] = position.unwrap_or([low - free, high + free]);
            let (low, high) = (low - reach * (low - lowest).max(0.0), high + reach * (highest - high).max(0.0));
            random.uniform(low, high)
        };
        joints.map(one).collect()
    }

    /// A quintic polynomial from rest to rest; one sample if nothing moves.
    fn piece(&self, from: &[f64], to: &[f64]) -> Result<Motion, HomeError> {
        let mut duration_s = 0.0_f64;
        for (place, joint) in self.model.joints().iter().enumerate() {
            let way = (to[place] - from[place]).abs();
            if way == 0.0 {
                continue;
            }
            let Some([speed, acceleration]) = self.fastest[place] else {
                return Err(HomeError::NoSpeed { joint: joint.name.clone() });
            };
            duration_s = duration_s
                .max(QUINTIC_MAX_VELOCITY * way / speed)
                .max((QUINTIC_MAX_ACCELERATION * way / acceleration).sqrt());
            if let Some(jerk) = self.limits.of(&joint.name).and_then(|limit| limit.jerk) {
                duration_s = duration_s.max((60.0 * way / (self.home.speed * jerk)).cbrt());
            }
        }
        let periods = (duration_s * self.rate_hz / PATH_LENGTH_MULTIPLE).ceil() * PATH_LENGTH_MULTIPLE;
        require(periods < 1e8, "length of the way home, samples", periods, "give a larger approach_speed")?;
        let periods = periods as usize;
        let mut motion = Motion::default();
        motion.reset(from.len(), periods + 1);
        for joint in 0..from.len() {
            for sample in 0..=periods {
                let at = joint * (periods + 1) + sample;
                let x = sample as f64 / periods.max(1) as f64;
                let [share, first, second, third] = quintic(x);
                let (way, per_s) = (to[joint] - from[joint], self.rate_hz / periods.max(1) as f64);
                // The positions at both ends are set exactly.
                motion.q[at] = if sample == periods { to[joint] } else { from[joint] + share * way };
                motion.dq[at] = first * way * per_s;
                motion.ddq[at] = second * way * per_s * per_s;
                motion.dddq[at] = third * way * per_s.powi(3);
            }
        }
        Ok(motion)
    }

    /// Checks the limits at a few samples of a segment; this is only a necessary condition.
    fn looks_clear(&self, piece: &Motion) -> bool {
        let mut some = Motion::default();
        some.reset(piece.joints, QUICK_CHECK_SAMPLES);
        for joint in 0..piece.joints {
            for place in 0..QUICK_CHECK_SAMPLES {
                let sample = place * (piece.samples - 1) / (QUICK_CHECK_SAMPLES - 1);
                let (to, from) = (joint * QUICK_CHECK_SAMPLES + place, joint * piece.samples + sample);
                (some.q[to], some.dq[to]) = (piece.q[from], piece.dq[from]);
                (some.ddq[to], some.dddq[to]) = (piece.ddq[from], piece.dddq[from]);
            }
        }
        let mut values = Vec::new();
        self.set.values(&mut self.set.workspace(), &some, &mut values);
        values.iter().all(|value| *value <= 0.0)
    }

    /// Returns the worst violated limit of a path, if any. The rate of the check is that for motions, scaled by the
    /// speed of the path, but at least the sampling rate.
    fn broken(&self, way: &Motion) -> Result<Option<LimitReport>, HomeError> {
        self.check_stop()?;
        let check_hz = self.home.speed * self.model.characteristic_scale().round_hertz(CHECK_RATE_HZ);
        let rate_hz = check_hz.max(self.rate_hz);
        // A path of a single posture is checked once.
        let duration_s = ((way.samples - 1) as f64 / self.rate_hz).max(1.0 / rate_hz);
        let at = |times: &[f64], out: &mut Motion| {
            out.reset(way.joints, times.len());
            for (place, time_s) in times.iter().enumerate() {
                let sample = (time_s * self.rate_hz).clamp(0.0, (way.samples - 1) as f64);
                let (from, share) = (sample.floor() as usize, sample.fract());
                let next = (from + 1).min(way.samples - 1);
                for joint in 0..way.joints {
                    let (to, of) = (joint * times.len() + place, joint * way.samples);
                    let between = |values: &[f64]| values[of + from] + share * (values[of + next] - values[of + from]);
                    (out.q[to], out.dq[to]) = (between(&way.q), between(&way.dq));
                    (out.ddq[to], out.dddq[to]) = (between(&way.ddq), between(&way.dddq));
                }
            }
        };
        let reports = check_limits(&self.limits, self.model, duration_s, rate_hz, at)?;
        let broken = reports.into_iter().filter(|report| report.violated);
        Ok(broken.max_by(|a, b| a.worst_ratio.total_cmp(&b.worst_ratio)))
    }
}

/// Highest velocity and acceleration of the quintic polynomial for unit distance and unit time.
const QUINTIC_MAX_VELOCITY: f64 = 1.875;
const QUINTIC_MAX_ACCELERATION: f64 = 5.773_502_691_896_258;

/// `10 x³ - 15 x⁴ + 6 x⁵` with its first three derivatives: from 0 to 1, with zero velocity and acceleration at both
/// ends.
fn quintic(x: f64) -> [f64; 4] {
    let y = 1.0 - x;
    [
        x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x),
        30.0 * x * x * y * y,
        60.0 * x * y * (y - x),
        60.0 * (1.0 - 6.0 * x + 6.0 * x * x),
    ]
}

/// Concatenates two segments; the common posture appears once.
fn joined(first: &Motion, second: &Motion) -> Motion {
    let mut both = Motion::default();
    both.reset(first.joints, first.samples + second.samples - 1);
    let parts = [
        (&first.q, &second.q, &mut both.q),
        (&first.dq, &second.dq, &mut both.dq),
        (&first.ddq, &second.ddq, &mut both.ddq),
        (&first.dddq, &second.dddq, &mut both.dddq),
    ];
    let samples = both.samples;
    for (one, two, out) in parts {
        for joint in 0..first.joints {
            let own = &mut out[joint * samples..(joint + 1) * samples];
            own[..first.samples].copy_from_slice(&one[joint * first.samples..(joint + 1) * first.samples]);
            own[first.samples..].copy_from_slice(&two[joint * second.samples + 1..(joint + 1) * second.samples]);
        }
    }
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The highest velocity is in the middle, the highest acceleration at (3 - √3) / 6; compared with central
    /// differences.
    #[test]
    fn the_quintic_and_its_peaks() {
        assert_eq!(quintic(0.0)[..3], [0.0; 3]);
        assert!(quintic(1.0).iter().zip([1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-15));
        assert!((quintic(0.5)[1] - QUINTIC_MAX_VELOCITY).abs() < 1e-15);
        assert!((quintic((3.0 - 3.0_f64.sqrt()) / 6.0)[2] - QUINTIC_MAX_ACCELERATION).abs() < 1e-12);
        for k in 1..20 {
            let (x, h) = (f64::from(k) / 20.0, 1e-5);
            for order in 0..3 {
                let slope = (quintic(x + h)[order] - quintic(x - h)[order]) / (2.0 * h);
                assert!((slope - quintic(x)[order + 1]).abs() < 1e-6, "{x}, {order}");
            }
        }
    }
}
