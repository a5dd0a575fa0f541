//! The quantities of a drive and of a body that a fit can change.

use serde::{Deserialize, Serialize};

/// A quantity of one joint's drive, or of one body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Position gain `kp`, Nm/rad (N/m).
    Stiffness,
    /// Torque per velocity, Nm s/rad (N s/m): sum of the velocity gain of the controller, viscous friction and
    /// back-EMF.
    Damping,
    /// Inertia of rotor and gear at the joint, kg m² (kg).
    Armature,
    /// Coulomb friction without load, Nm (N).
    Coulomb,
    /// Increase of friction per torque that the gear carries, without unit.
    LoadFriction,
    /// Difference between friction at rest and friction in motion (Stribeck effect), Nm (N).
    Stribeck,
    /// Largest torque of the position controller, Nm (N).
    TorqueLimit,
    /// Largest acceleration of the set point, rad/s² (m/s²).
    ProfileAcceleration,
    /// Largest speed of the set point, rad/s (m/s).
    ProfileSpeed,
    /// Delay from a command to its effect, s.
    Delay,
    /// Delay from a time stamp of the log to the measurement of the position, s.
    ReadDelay,
    /// Position of the model minus the measured position, rad (m).
    Zero,
    /// Height of the floor, m.
    FloorHeight,
    /// Mass of a body, kg. The inertia about the centre of mass changes in proportion.
    Mass,
    /// Centre of mass of a body along one axis of its frame, m.
    Centre(Axis),
}

/// Axis of a body's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// First axis.
    X,
    /// Second axis.
    Y,
    /// Third axis.
    Z,
}

impl Quantity {
    /// Name of the quantity in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::Armature => "armature",
            Self::Coulomb => "Coulomb friction",
            Self::LoadFriction => "friction per load",
            Self::Stribeck => "extra friction at rest",
            Self::TorqueLimit => "torque limit",
            Self::ProfileAcceleration => "acceleration of the set point",
            Self::ProfileSpeed => "speed of the set point",
            Self::Delay => "delay",
            Self::ReadDelay => "read delay",
            Self::Zero => "zero",
            Self::FloorHeight => "height of the floor",
            Self::Mass => "mass",
            Self::Centre(Axis::X) => "centre of mass, x",
            Self::Centre(Axis::Y) => "centre of mass, y",
            Self::Centre(Axis::Z) => "centre of mass, z",
        }
    }

    /// Unit for a rotary joint or for a slide; empty for a quantity without unit.
    pub fn unit(self, is_rotary: bool) -> &'static str {
        match (self, is_rotary) {
            (Self::Stiffness, true) => "Nm/rad",
            (Self::Stiffness, false) => "N/m",
            (Self::Damping, true) => "Nm s/rad",
            (Self::Damping, false) => "N s/m",
            (Self::Armature, true) => "kg m²",
            (Self::Armature, false) | (Self::Mass, _) => "kg",
            (Self::Coulomb | Self::Stribeck | Self::TorqueLimit, true) => "Nm",
            (Self::Coulomb | Self::Stribeck | Self::TorqueLimit, false) => "N",
            (Self::ProfileAcceleration, true) => "rad/s²",
            (Self::ProfileAcceleration, false) => "m/s²",
            (Self::ProfileSpeed, true) => "rad/s",
            (Self::ProfileSpeed, false) => "m/s",
            (Self::LoadFriction, _) => "",
            (Self::Delay | Self::ReadDelay, _) => "s",
            (Self::Zero, true) => "rad",
            (Self::Zero, false) | (Self::FloorHeight | Self::Centre(_), _) => "m",
        }
    }

    /// Whether the quantity belongs to a drive.
    pub fn is_of_drive(self) -> bool {
        !matches!(self, Self::Mass | Self::Centre(_) | Self::FloorHeight)
    }

    /// Whether the quantity is a torque, an inertia or a mass. Positions determine these only up to one common factor.
    pub fn has_scale(self) -> bool {
        matches!(
            self,
            Self::Stiffness
                | Self::Damping
                | Self::Armature
                | Self::Coulomb
                | Self::Stribeck
                | Self::TorqueLimit
                | Self::Mass
        )
    }
}
