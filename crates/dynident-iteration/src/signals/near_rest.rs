use crate::signals::rests::StictionBand;
use serde::{Deserialize, Serialize};

/// A joint whose rows near rest (zero velocity) are excluded from a run, and its residual there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SamplesNearRest {
    /// Distance from rest above which the joint's rows are used.
    pub margin: StictionBand,
    /// Share of the joint's samples that is excluded, in addition to samples at rest.
    pub share: f64,
    /// Approximate root mean square of the residual near rest in a fit to all rows, Nm (N).
    pub residual_nm: f64,
    /// Estimated dry friction, Nm (N): the largest stiction. Load-dependent friction is evaluated at the root mean
    /// square of the joint's torque.
    pub dry_friction_nm: f64,
}

impl SamplesNearRest {
    /// Standard deviation of the residual of all rows of a joint, Nm (N), if the residual near rest is larger than
    /// its dry friction. `sigma` is the standard deviation over the rows that are used.
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
        let margin = StictionBand { speed_share: 0.2, smoothing_periods: 1.0 };
        let near_rest = |residual_nm| SamplesNearRest { margin, share: 0.25, residual_nm, dry_friction_nm: 2.0 };
        assert_eq!(near_rest(1.9).unexplained_nm(0.1), None);
        // A quarter of the rows with 3 Nm, the others with 0.1 Nm.
        let all = near_rest(3.0).unexplained_nm(0.1).unwrap_or(0.0);
        assert!((all - (0.75 * 0.01 + 0.25 * 9.0_f64).sqrt()).abs() < 1e-12, "{all}");
    }
}
