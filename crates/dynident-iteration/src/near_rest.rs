//! A joint whose torque near rest does not count in a run, and what was left of it there.

use crate::rests::RestMargin;
use serde::{Deserialize, Serialize};

/// A joint whose torque near rest does not count, and what was left of it there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NearRest {
    /// How far from rest its torque has to be to count.
    pub margin: RestMargin,
    /// Share of the joint's samples that is set aside beside those of rests.
    pub share: f64,
    /// Root mean square of what a fit to all rows leaves of the torque near rest, Nm (N), about.
    pub residual_nm: f64,
    /// The dry friction found, under the root mean square of the joint's torque as its load, Nm (N): what holds a joint
    /// at rest is at most that.
    pub dry_friction_nm: f64,
}

impl NearRest {
    /// Standard deviation of what is left of a joint's torque where that near rest is more than its dry friction
    /// explains, Nm (N), of all rows; `sigma` is that of the rows that count.
    pub(crate) fn unexplained_nm(&self, sigma: f64) -> Option<f64> {
        let all = (1.0 - self.share) * sigma * sigma + self.share * self.residual_nm * self.residual_nm;
        (self.residual_nm > self.dry_friction_nm).then(|| all.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_friction_cannot_hold_is_unexplained() {
        let margin = RestMargin { speed_share: 0.2, smoothing_periods: 1.0 };
        let near_rest = |residual_nm| NearRest { margin, share: 0.25, residual_nm, dry_friction_nm: 2.0 };
        assert_eq!(near_rest(1.9).unexplained_nm(0.1), None);
        // A quarter of the rows with 3 Nm, the others with 0.1.
        let all = near_rest(3.0).unexplained_nm(0.1).unwrap_or(0.0);
        assert!((all - (0.75 * 0.01 + 0.25 * 9.0_f64).sqrt()).abs() < 1e-12, "{all}");
    }
}
