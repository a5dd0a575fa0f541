/// Columns of a log that a mistake concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// Positions alone.
    Position,
    /// Torques alone.
    Torque,
    /// Positions and torques.
    Both,
}

impl Channels {
    pub(super) fn each(self) -> impl Iterator<Item = Self> {
        [Self::Position, Self::Torque].into_iter().filter(move |one| self == Self::Both || self == *one)
    }

    /// Torque for position and position for torque; `None` for both.
    pub(super) fn other(self) -> Option<Self> {
        match self {
            Self::Position => Some(Self::Torque),
            Self::Torque => Some(Self::Position),
            Self::Both => None,
        }
    }

    /// Name of the channels in a sentence.
    pub fn text(self) -> &'static str {
        match self {
            Self::Position => "the position",
            Self::Torque => "the torque",
            Self::Both => "position and torque",
        }
    }
}
