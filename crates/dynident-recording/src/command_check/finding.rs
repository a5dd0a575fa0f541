//! Findings of the check of commanded motions.

use crate::report::Level;

/// Fault in the time stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StampFault {
    /// All stamps are equal.
    Equal,
    /// Stamps change only once per second, although there are several samples in each second.
    WholeSeconds,
}

/// Limit of a joint's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Side {
    /// The lowest position.
    Lower,
    /// The highest position.
    Upper,
}

/// Channels that are in degrees although the study states radians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UnitOf {
    /// The commands.
    Commands,
    /// The measured positions.
    Positions,
    /// Commands and positions: the positions exceed the limits of the robot description.
    Both,
}

/// A finding of [`check_commands`](super::check_commands). Joints are indices in the order of the log.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CommandFinding {
    /// The time stamps do not give the time of each sample.
    Stamps {
        /// The fault.
        fault: StampFault,
    },
    /// The columns of commands and of measured positions are exchanged: the commands follow the positions.
    Exchanged {
        /// Time by which the columns of "commands" are later than those of "positions", s: median over the joints.
        lag_s: f64,
        /// Number of joints that show this.
        joints: usize,
    },
    /// The recorder stamps the commands late: they follow the positions, which have the steps of an encoder.
    Late {
        /// Time by which the commands follow the positions, s: median over the joints.
        lag_s: f64,
        /// Number of joints that show it.
        joints: usize,
    },
    /// Degrees where the study states radians.
    Degrees {
        /// The channels in degrees.
        of: UnitOf,
        /// The joints.
        joints: Vec<usize>,
        /// Ratio of position changes to command changes, median of these joints.
        ratio: f64,
    },
    /// The position moves in the opposite direction of the command.
    Sign {
        /// The joint.
        joint: usize,
        /// Correlation of command and position; negative.
        correlation: f64,
    },
    /// Command and position have different zeros.
    Offset {
        /// The joint.
        joint: usize,
        /// Median of position minus command, rad or m.
        offset: f64,
    },
    /// The command moves, and the position does not follow.
    NoEffect {
        /// The joint.
        joint: usize,
        /// Range of the command, rad or m.
        command_range: f64,
        /// Range of the position, rad or m.
        position_range: f64,
        /// The joint whose command the position follows instead.
        follows: Option<usize>,
    },
    /// The servo limits the command to its range, but the log contains the command before this limit.
    Clamped {
        /// The joint.
        joint: usize,
        /// Which end of the range.
        side: Side,
        /// Position at the limit, rad or m.
        limit: f64,
        /// Command that is farthest beyond the limit, rad or m.
        command: f64,
        /// Total time with commands beyond the limit, s.
        total_s: f64,
    },
    /// The position jumps as no motion could.
    Jumps {
        /// The joint.
        joint: usize,
        /// Number of jumps.
        count: usize,
        /// Time of the largest jump, s after the first data row.
        time_s: f64,
        /// Size of the largest jump, rad or m.
        size: f64,
        /// Whether the largest jump is a whole turn, within 5 %.
        is_turn: bool,
    },
}

impl CommandFinding {
    /// Severity: a problem makes an identification wrong, a warning may make it wrong.
    pub fn level(&self) -> Level {
        match self {
            Self::Stamps { .. }
            | Self::Exchanged { .. }
            | Self::Late { .. }
            | Self::Degrees { .. }
            | Self::Sign { .. }
            | Self::Jumps { is_turn: true, .. } => Level::Problem,
            Self::Offset { .. } | Self::NoEffect { .. } | Self::Clamped { .. } | Self::Jumps { .. } => Level::Warning,
        }
    }

    /// Description, with the names of the log's joints.
    pub fn what(&self, joints: &[String]) -> String {
        let name = |joint: usize| joints.get(joint).map_or("?", String::as_str);
        match self {
            Self::Stamps { fault: StampFault::Equal } => "all time stamps are equal".to_owned(),
            Self::Stamps { fault: StampFault::WholeSeconds } => "the time stamps are whole seconds".to_owned(),
            Self::Exchanged { .. } => "command and measured position are exchanged".to_owned(),
            Self::Late { .. } => "the commands are recorded late".to_owned(),
            Self::Degrees { of, joints: those, .. } => {
                let what = match of {
                    UnitOf::Commands => "the commands",
                    UnitOf::Positions => "the positions",
                    UnitOf::Both => "the positions and commands",
                };
                let names: Vec<&str> = those.iter().map(|&joint| name(joint)).collect();
                format!("{what} of {} are in degrees", names.join(", "))
            }
            Self::Sign { joint, .. } => format!("command and position of {} have opposite signs", name(*joint)),
            Self::Offset { joint, .. } => format!("command and position of {} have different zeros", name(*joint)),
            Self::NoEffect { joint, .. } => format!("the command of {} has no effect", name(*joint)),
            Self::Clamped { joint, .. } => format!("the command of {} is clamped by the servo", name(*joint)),
            Self::Jumps { joint, .. } => format!("the encoder of {} jumps", name(*joint)),
        }
    }

    /// Evidence with numbers, and advice if no key corrects the fault.
    pub fn evidence(&self, joints: &[String]) -> String {
        match self {
            Self::Stamps { fault: StampFault::Equal } => {
                "they do not determine the time of a sample; name another time column, or give rate_hz".to_owned()
            }
            Self::Stamps { fault: StampFault::WholeSeconds } => {
                "several samples have the same stamp; name a finer time column, or give rate_hz".to_owned()
            }
            Self::Exchanged { lag_s, joints } => format!(
                "the column named as command follows the column named as position by {lag_s:.2} s, for {joints} joints; exchange the columns of both"
            ),
            Self::Late { lag_s, joints } => format!(
                "the commands follow the measured positions, which have the steps of an encoder, by {lag_s:.2} s, for {joints} joints; a servo moves after its command, so they are late by at least this time. `identify` states the rest"
            ),
            Self::Degrees { of: UnitOf::Both, .. } => {
                "the positions are far outside of the limits of the robot description, and inside as degrees".to_owned()
            }
            Self::Degrees { ratio, .. } => format!("a change of the position is {ratio:.3} of that of the command"),
            Self::Sign { correlation, .. } => format!("their correlation is {correlation:.2}"),
            Self::Offset { offset, .. } => format!(
                "position minus command is {offset:+.3} rad (m) in the median, more than the sag of a servo; correct the zero of one of them"
            ),
            Self::NoEffect { command_range, position_range, follows, .. } => {
                let instead = follows.map_or_else(
                    || "check that its servo is on and has this column".to_owned(),
                    |other| {
                        let name = joints.get(other).map_or("?", String::as_str);
                        format!("it follows the command of {name}: check the order of the columns")
                    },
                );
                format!(
                    "the command moves over {command_range:.3} rad (m), the position over {position_range:.3}; {instead}"
                )
            }
            Self::Clamped { side, limit, command, total_s, .. } => {
                let side = match side {
                    Side::Lower => "lowest",
                    Side::Upper => "highest",
                };
                format!(
                    "the position remains at {limit:.3} rad (m) for {total_s:.1} s while the command goes to {command:.3}; the {side} position is the limit of the servo; leave this time out with drop_time_s, or record within the range"
                )
            }
            Self::Jumps { count, time_s, size, is_turn, .. } => {
                let turn = if *is_turn { ", a whole turn" } else { "" };
                format!(
                    "{count} steps that neither motion nor command explain, the largest of {size:.3} rad (m){turn} at {time_s:.2} s; leave this time out with drop_time_s"
                )
            }
        }
    }
}
