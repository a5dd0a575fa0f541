//! Thresholds of the assumptions about limits.

use super::super::error::LimitError;
use super::super::numbers::{not_negative, positive};

/// Thresholds of the assumed limits. Shares refer to the arm's length unless stated otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct AssumptionThresholds {
    /// Minimum distance of links from each other and from the floor, as a share of the arm's length. Default 0.01.
    pub clearance_share: f64,
    /// Angle within which a revolute joint reaches its full speed, rad. Default 0.2.
    pub run_up_rad: f64,
    /// Distance within which a prismatic joint reaches its full speed, as a share of its position range. Default 0.1.
    pub run_up_stroke_share: f64,
    /// Largest sine of the angle between gravity and the base's -z axis at which the base plane is assumed to be a
    /// floor. Default 0.17 (10 degrees).
    pub max_gravity_tilt: f64,
    /// Depth below the base in the neutral posture, as a share of the arm's length. A machine that extends deeper is
    /// assumed to hang. Default 0.25.
    pub max_depth_below_base: f64,
    /// Largest accepted share of random postures in which the hulls of two links violate the clearance although their
    /// meshes do not. Above it the meshes are cut into convex pieces. A smaller share hardly restricts the search.
    /// Default 0.05.
    pub max_hull_only_share: f64,
}

impl Default for AssumptionThresholds {
    fn default() -> Self {
        Self {
            clearance_share: 0.01,
            run_up_rad: 0.2,
            run_up_stroke_share: 0.1,
            max_gravity_tilt: 0.17,
            max_depth_below_base: 0.25,
            max_hull_only_share: 0.05,
        }
    }
}

impl AssumptionThresholds {
    /// Checks the thresholds.
    ///
    /// # Errors
    /// A threshold that is not finite or negative, or a run-up that is not positive.
    pub fn validate(&self) -> Result<(), LimitError> {
        positive("run_up_rad", self.run_up_rad)?;
        positive("run_up_stroke_share", self.run_up_stroke_share)?;
        not_negative("clearance_share", self.clearance_share)?;
        not_negative("max_gravity_tilt", self.max_gravity_tilt)?;
        not_negative("max_depth_below_base", self.max_depth_below_base)?;
        not_negative("max_hull_only_share", self.max_hull_only_share)
    }
}
