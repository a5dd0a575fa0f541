//! A constant torque: sensor bias, unmodelled spring, asymmetric friction. `τ = τ_0`.

/// Constant torque of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Offset {
    /// The joint.
    pub joint: usize,
}

impl Offset {
    #[allow(clippy::unused_self, reason = "all laws are asked in the same way")]
    pub(super) fn column(self, out: &mut [f64]) {
        out.fill(1.0);
    }
}
