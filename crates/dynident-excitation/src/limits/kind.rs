//! The kinds of limit, and how much of one a motion uses.

use core::fmt;
use serde::{Deserialize, Serialize};

/// What is limited.
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
    /// Joint torque by the prior model.
    Torque,
    /// Mechanical power of a joint.
    Power,
    /// A box in the base frame.
    Box,
    /// The floor.
    Floor,
    /// The column about the base.
    Column,
    /// The distance between two links.
    SelfCollision,
}

impl LimitKind {
    /// True for limits that change when the same path is run slower.
    pub(crate) fn depends_on_time(self) -> bool {
        matches!(self, Self::Speed | Self::Acceleration | Self::Jerk | Self::Torque | Self::Power)
    }

    /// True for limits on where points of the arm are, which no single joint decides.
    pub(crate) fn is_place(self) -> bool {
        matches!(self, Self::Box | Self::Floor | Self::Column | Self::SelfCollision)
    }

    /// True where the limit is a least distance and not a largest magnitude.
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
/// Its value `c` is at most 0 when the limit holds: `|x - middle| / size - 1` for magnitudes and ranges, `1 - distance
/// / size` for a column, `(clearance - distance) / size` between links (at least -0.25), and for the floor `(height +
/// radius - z) / 1 m`, or per arm's length for shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// What is limited.
    pub kind: LimitKind,
    /// Where: a joint, a point of a link, or a pair of links.
    pub subject: String,
    /// Middle of the range; zero for magnitudes and a column, the height for the floor, the clearance between links.
    pub middle: f64,
    /// Half width of the range, largest magnitude, or least distance: what `c` is measured by.
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
