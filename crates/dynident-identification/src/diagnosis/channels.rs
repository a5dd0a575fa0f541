//! Columns of a log that a mistake concerns.

/// Which columns of a log a mistake is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// Positions alone.
    Position,
    /// Torques alone.
    Torque,
    /// Both.
    Both,
}

impl Channels {
    /// Position and torque, where each is included.
    pub(super) fn each(self) -> impl Iterator<Item = Self> {
        [Self::Position, Self::Torque].into_iter().filter(move |one| self == Self::Both || self == *one)
    }

    /// The other one of position and torque; none of both.
    pub(super) fn other(self) -> Option<Self> {
        match self {
            Self::Position => Some(Self::Torque),
            Self::Torque => Some(Self::Position),
            Self::Both => None,
        }
    }

    /// The channels in a sentence.
    pub fn text(self) -> &'static str {
        match self {
            Self::Position => "the position",
            Self::Torque => "the torque",
            Self::Both => "position and torque",
        }
    }
}
