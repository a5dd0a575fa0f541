//! Set point of a drive over time: the command, held between time stamps, or a motion profile that follows the command.

use crate::drive::Drive;
use crate::profile::{Profile, profile};

/// Commands of one joint at increasing times; each command is held until the next.
#[derive(Debug)]
pub(crate) struct HeldCommand<'a> {
    times_s: &'a [f64],
    values: &'a [f64],
    /// Index of the command at the end of the last step.
    at: usize,
}

impl<'a> HeldCommand<'a> {
    pub(crate) fn held(times_s: &'a [f64], values: &'a [f64]) -> Self {
        Self { times_s, values, at: 0 }
    }

    /// Mean command from `start_s` to `end_s` (exact, because commands are piecewise constant), and its derivative by a
    /// shift of both times. The first command also applies before its time stamp. The times of successive calls must
    /// increase.
    ///
    /// If the command changes during the step and is beyond the reach of the controller for a part of it only, the end
    /// of the reach replaces the command in this part: the mean of the limited torque differs from the limited torque
    /// of the mean command.
    pub(crate) fn mean(&mut self, start_s: f64, end_s: f64, reach: Reach) -> StepCommand {
        while self.at + 1 < self.times_s.len() && self.times_s[self.at + 1] <= start_s {
            self.at += 1;
        }
        let all = self.sum(start_s, end_s, Reach::UNLIMITED);
        if all.changes && reach.half.is_finite() {
            let limited = self.sum(start_s, end_s, reach);
            let [below, above] = limited.command.beyond;
            if below.max(above) < 1.0 {
                return limited.command;
            }
        }
        all.command
    }

    /// The mean of the commands within the reach, from the command at `at`.
    fn sum(&self, start_s: f64, end_s: f64, reach: Reach) -> HeldSum {
        let span = end_s - start_s;
        let (mut at, mut from, mut mean, mut beyond) = (self.at, start_s, 0.0, [0.0; 2]);
        let [low, high] = [reach.centre - reach.half, reach.centre + reach.half];
        let mut add = |at: usize, to: f64| {
            let (value, part) = (self.values[at], (to - from) / span);
            from = to;
            mean += part * value.clamp(low, high);
            beyond[0] += if value < low { part } else { 0.0 };
            beyond[1] += if value > high { part } else { 0.0 };
        };
        while at + 1 < self.times_s.len() && self.times_s[at + 1] < end_s {
            add(at, self.times_s[at + 1]);
            at += 1;
        }
        add(at, end_s);
        let [first, last] = [self.at, at].map(|at| self.values[at].clamp(low, high));
        let command = StepCommand { mean, rate: (last - first) / span, beyond, ..StepCommand::default() };
        HeldSum { command, changes: at > self.at }
    }
}

/// Commands at which the controller is not at its torque limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Expected position in the middle of the step, rad (m).
    pub(crate) centre: f64,
    /// Torque limit over stiffness, rad (m).
    pub(crate) half: f64,
}

impl Reach {
    /// A controller without a limit.
    pub(crate) const UNLIMITED: Self = Self { centre: 0.0, half: f64::INFINITY };
}

/// Mean of held commands, and whether they change.
struct HeldSum {
    command: StepCommand,
    changes: bool,
}

/// Relative change of a limit for the central difference that gives the derivative of a profile. With a smaller change,
/// the discrete steps of the profile cause errors.
const LIMIT_CHANGE: f64 = 0.01;

/// The set point of one joint during a run.
#[derive(Debug)]
pub(crate) enum SetPoint<'a> {
    /// The command itself.
    Held(HeldCommand<'a>),
    /// A profile.
    Profile(Box<ProfileSetPoint>),
}

/// A motion profile, and its derivatives by the logarithms of the limits of acceleration and speed, where a limit is
/// finite and its derivative is needed.
#[derive(Debug)]
pub(crate) struct ProfileSetPoint {
    own: Profile,
    /// For each limit, the profiles with a larger and with a smaller limit.
    by_log: [Option<[Profile; 2]>; 2],
}

/// Mean set point of one time step, with its derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepCommand {
    /// Mean set point, rad (m).
    pub(crate) mean: f64,
    /// Derivative of the mean set point by a shift of the times.
    pub(crate) rate: f64,
    /// Derivatives of the mean set point by the logarithms of the profile's limits of acceleration and of speed.
    pub(crate) by_log: [f64; 2],
    /// Parts of the step in which the lower and the upper end of the reach replace the command.
    pub(crate) beyond: [f64; 2],
}

impl<'a> SetPoint<'a> {
    pub(crate) fn new(times_s: &'a [f64], values: &'a [f64], drive: &Drive, with_derivatives: bool) -> Self {
        let limits = [drive.profile_acceleration, drive.profile_speed];
        if limits.iter().all(|limit| limit.is_infinite()) {
            return Self::Held(HeldCommand::held(times_s, values));
        }
        let by_log = |which: usize| {
            let changed = |sign: f64| {
                let mut limits = limits;
                limits[which] *= (sign * LIMIT_CHANGE).exp();
                profile(times_s, values, limits)
            };
            (with_derivatives && limits[which].is_finite()).then(|| [changed(1.0), changed(-1.0)])
        };
        Self::Profile(Box::new(ProfileSetPoint {
            own: profile(times_s, values, limits),
            by_log: [by_log(0), by_log(1)],
        }))
    }

    /// Set point from `start_s` to `end_s` of a controller with this reach. The times of successive calls must
    /// increase.
    pub(crate) fn during(&mut self, start_s: f64, end_s: f64, reach: Reach) -> StepCommand {
        match self {
            Self::Held(command) => command.mean(start_s, end_s, reach),
            Self::Profile(set_point) => {
                let ProfileSetPoint { own, by_log } = &**set_point;
                let difference = |[above, below]: &[Profile; 2]| {
                    (above.mean(start_s, end_s) - below.mean(start_s, end_s)) / (2.0 * LIMIT_CHANGE)
                };
                StepCommand {
                    mean: own.mean(start_s, end_s),
                    rate: (own.at(end_s) - own.at(start_s)) / (end_s - start_s),
                    by_log: by_log.each_ref().map(|limits| limits.as_ref().map_or(0.0, difference)),
                    // A profile has no steps.
                    beyond: [0.0; 2],
                }
            }
        }
    }
}
