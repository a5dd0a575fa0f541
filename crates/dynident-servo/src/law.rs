//! How a simulator computes the torque of a drive.

/// How a simulator computes the torque of a drive in a time step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveLaw {
    /// As [`Drive`](crate::Drive): the limit applies to the position controller, not to the damping; smooth parts by
    /// the midpoint rule.
    #[default]
    Identified,
    /// A drive that a physics engine solves together with the motion (PhysX): spring and damper act at the end of the
    /// step, and the limit applies to their sum.
    Implicit,
    /// A controller that is evaluated once at the beginning of each step (Isaac Lab's explicit actuators): its torque
    /// `clip(stiffness (r - q) - damping v, ±torque_limit)` is held during the step.
    Explicit,
}

impl DriveLaw {
    /// Weight of the velocity at the end of a step in its mean velocity: physics engines move joints with the new
    /// velocity.
    pub(crate) fn end_weight(self) -> f64 {
        match self {
            Self::Identified => 0.5,
            Self::Implicit | Self::Explicit => 1.0,
        }
    }
}
