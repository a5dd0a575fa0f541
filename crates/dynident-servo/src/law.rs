//! Laws by which simulators compute the torque of a drive.

/// Law by which a simulator computes the torque of a drive in a time step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveLaw {
    /// The law of [`Drive`](crate::Drive): the torque limit applies to the position controller, but not to the damping;
    /// smooth parts are integrated by the midpoint rule.
    #[default]
    Identified,
    /// A drive that a physics engine (PhysX) solves together with the motion: spring and damper act at the end of the
    /// step, and the torque limit applies to their sum.
    Implicit,
    /// A controller that is evaluated once at the beginning of each step (Isaac Lab's explicit actuators): its torque
    /// `clip(stiffness (r - q) - damping v, ±torque_limit)` is held during the step.
    Explicit,
}

impl DriveLaw {
    /// Weight of the velocity at the end of a step in the mean velocity of the step. Physics engines move joints with
    /// the velocity at the end.
    pub(crate) fn end_weight(self) -> f64 {
        match self {
            Self::Identified => 0.5,
            Self::Implicit | Self::Explicit => 1.0,
        }
    }
}
