//! Grippers: their names, and positions that are logged as a share of their range.

use dynident_model::{Joint, JointKind};

/// Parts of the names of joints that are often logged as a percentage or share of their range.
const GRIPPERS: [&str; 4] = ["gripper", "jaw", "finger", "claw"];

/// Whether this is the name of a gripper or of a part of it.
pub(super) fn is_gripper(name: &str) -> bool {
    let name = name.to_lowercase();
    GRIPPERS.iter().any(|gripper| name.contains(gripper))
}

/// Logged position of an open gripper, if it is logged as a share of its range: 1, or 100 for percent.
const FULL_RANGES: [f64; 2] = [1.0, 100.0];
/// Largest amount by which a logged share can exceed the full range, as a part of the full range.
const MAX_EXCESS: f64 = 0.1;
/// Degrees in rad.
pub(super) const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// A range of logged positions as a share of the range of a gripper.
pub(super) struct Share {
    /// Value of the full range in the log: 1 or 100.
    pub(super) full: f64,
    /// Position limits, rad or m.
    pub(super) limits: [f64; 2],
    /// Whether the logged positions are also within the limits in rad (m).
    pub(super) is_inside: bool,
}

impl Share {
    /// Whether the full range is 1, so that positions can also be radians.
    pub(super) fn is_of_one(&self) -> bool {
        self.full == FULL_RANGES[0]
    }

    /// The position, rad or m, that belongs to a logged one.
    pub(super) fn position(&self, logged: f64) -> f64 {
        let [low, high] = self.limits;
        low + logged / self.full * (high - low)
    }
}

/// The positions from `low` to `high` of a gripper as a share of its range; `None` for other joints, unknown limits,
/// and positions outside of both full ranges.
pub(super) fn share_of_range(joint: &Joint, [low, high]: [f64; 2]) -> Option<Share> {
    let limits = [joint.limits.lower?, joint.limits.upper?];
    let is_share = |full: &f64| low >= -MAX_EXCESS * full && high <= (1.0 + MAX_EXCESS) * full;
    let full = FULL_RANGES.into_iter().find(is_share)?;
    let is_inside = low >= limits[0] && high <= limits[1];
    (is_gripper(&joint.name) && limits[0] < limits[1]).then_some(Share { full, limits, is_inside })
}

/// The share of the range of a gripper whose logged positions exceed its limits in rad, deg, m and mm.
pub(super) fn unclear_gripper(joint: &Joint, [low, high]: [f64; 2]) -> Option<Share> {
    let factor = if joint.kind == JointKind::Prismatic { 1e-3 } else { DEGREE };
    let share = share_of_range(joint, [low, high]).filter(|share| !share.is_inside)?;
    let [from, to] = share.limits;
    (low * factor < from || high * factor > to).then_some(share)
}
