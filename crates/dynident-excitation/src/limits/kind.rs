//! Kinds of limits, and normalised constraint values.

use core::fmt;
use serde::{Deserialize, Serialize};

/// Limited quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LimitKind {
    /// Joint position.
    Position,
    /// Joint velocity.
    Speed,
    /// Joint acceleration.
    Acceleration,
    /// Joint jerk.
    Jerk,
    /// Joint torque computed with the prior model.
    Torque,
    /// Mechanical power of a joint.
    Power,
    /// A box in the base frame.
    Box,
    /// The floor.
    Floor,
    /// The column around the base.
    Column,
    /// The distance between two links.
    SelfCollision,
}

impl LimitKind {
    /// Whether the limit changes when the same path is run slower.
    pub(crate) fn depends_on_time(self) -> bool {
        matches!(self, Self::Speed | Self::Acceleration | Self::Jerk | Self::Torque | Self::Power)
    }

    /// Whether the limit concerns the place of points of the arm in space, which depends on several joints.
    pub(crate) fn is_place(self) -> bool {
        matches!(self, Self::Box | Self::Floor | Self::Column | Self::SelfCollision)
    }

    pub(crate) fn is_clearance(self) -> bool {
        matches!(self, Self::Floor | Self::Column | Self::SelfCollision)
    }
}

impl fmt::Display for LimitKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Torque => "torque",
            Self::Power => "power",
            Self::Box => "box",
            Self::Floor => "floor",
            Self::Column => "column",
            Self::SelfCollision => "self-collision",
        })
    }
}

/// One limit: a row of constraint values over the samples.
///
/// The constraint value `c` is at most 0 if the limit is kept. It is `|x - middle| / size - 1` for magnitudes and
/// ranges, `1 - distance / size` for a column, `(clearance - distance) / size` between links (at least -0.25). For
/// the floor it is `(height + radius - z) / size`, where size is the arm's length.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Kind of the limit.
    pub kind: LimitKind,
    /// Joint, point of a link, or pair of links.
    pub subject: String,
    /// Middle of the range; zero for magnitudes and a column, the height for the floor, the clearance between links.
    pub middle: f64,
    /// Half width of the range, maximum magnitude, or minimum distance. It scales `c`.
    pub size: f64,
    /// Unit of middle and size.
    pub unit: &'static str,
}

impl Constraint {
    /// The quantity at a constraint value `c`: magnitude, offset from the middle of the range, distance, or height
    /// above the floor.
    pub fn quantity(&self, c: f64) -> f64 {
        match self.kind {
            LimitKind::Floor | LimitKind::SelfCollision => self.middle - c * self.size,
            kind if kind.is_clearance() => (1.0 - c) * self.size,
            _ => (1.0 + c) * self.size,
        }
    }
}
