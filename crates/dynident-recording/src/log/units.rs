//! Conversion of log units to SI.

use serde::{Deserialize, Serialize};

/// Physical quantity of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Quantity {
    /// Joint or motor position (rad, m).
    Position,
    /// Velocity (rad/s, m/s).
    Velocity,
    /// Acceleration (rad/s², m/s²).
    Acceleration,
    /// Torque or force (N m, N), or a current that `scale` converts to a torque.
    Torque,
    /// Temperature, °C.
    Temperature,
    /// Commanded position of a joint or its servo (rad, m).
    Command,
}

impl Quantity {
    /// All quantities, in the order of a log's channel groups.
    pub(crate) const ALL: [Self; 6] =
        [Self::Position, Self::Velocity, Self::Acceleration, Self::Torque, Self::Temperature, Self::Command];

    /// Key of the quantity's channel group in a [`LogFormat`](crate::LogFormat); also its name in reports.
    pub fn key(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Torque => "torque",
            Self::Temperature => "temperature",
            Self::Command => "command",
        }
    }
}

/// The quantity that has the same units: a commanded position has the units of a position.
fn dimension(quantity: Quantity) -> Quantity {
    if quantity == Quantity::Command { Quantity::Position } else { quantity }
}

/// Units with name, quantity and factor to SI units.
const UNITS: &[(&str, Quantity, f64)] = &[
    ("rad", Quantity::Position, 1.0),
    ("mrad", Quantity::Position, 1e-3),
    ("deg", Quantity::Position, core::f64::consts::PI / 180.0),
    ("rev", Quantity::Position, core::f64::consts::TAU),
    ("m", Quantity::Position, 1.0),
    ("mm", Quantity::Position, 1e-3),
    ("count", Quantity::Position, 1.0),
    ("rad/s", Quantity::Velocity, 1.0),
    ("deg/s", Quantity::Velocity, core::f64::consts::PI / 180.0),
    ("rpm", Quantity::Velocity, core::f64::consts::TAU / 60.0),
    ("m/s", Quantity::Velocity, 1.0),
    ("mm/s", Quantity::Velocity, 1e-3),
    ("rad/s^2", Quantity::Acceleration, 1.0),
    ("deg/s^2", Quantity::Acceleration, core::f64::consts::PI / 180.0),
    ("m/s^2", Quantity::Acceleration, 1.0),
    ("mm/s^2", Quantity::Acceleration, 1e-3),
    ("N m", Quantity::Torque, 1.0),
    ("Nm", Quantity::Torque, 1.0),
    ("mN m", Quantity::Torque, 1e-3),
    ("N cm", Quantity::Torque, 1e-2),
    ("N mm", Quantity::Torque, 1e-3),
    ("kN m", Quantity::Torque, 1e3),
    ("kgf cm", Quantity::Torque, 0.098_066_5),
    ("lbf in", Quantity::Torque, 0.112_984_829_027_616_7),
    ("lbf ft", Quantity::Torque, 1.355_817_948_331_400_4),
    ("N", Quantity::Torque, 1.0),
    ("A", Quantity::Torque, 1.0),
    ("mA", Quantity::Torque, 1e-3),
    ("%", Quantity::Torque, 1e-2),
    ("raw", Quantity::Torque, 1.0),
    ("degC", Quantity::Temperature, 1.0),
];

/// Factor from `unit` to SI: rad, m, their rates, N m, N, °C, and A (times `scale` in N m/A). `None` if `unit` is not a
/// unit of `quantity`.
pub fn si_factor(unit: &str, quantity: Quantity) -> Option<f64> {
    UNITS.iter().find(|(name, of, _)| *name == unit && *of == dimension(quantity)).map(|(_, _, factor)| *factor)
}

/// The units of `quantity`, for messages.
pub fn unit_names(quantity: Quantity) -> Vec<&'static str> {
    UNITS.iter().filter(|(_, of, _)| *of == dimension(quantity)).map(|(name, _, _)| *name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_those_of_the_si_brochure() {
        assert_eq!(si_factor("deg", Quantity::Position).map(|f| f * 180.0), Some(core::f64::consts::PI));
        assert_eq!(si_factor("rpm", Quantity::Velocity).map(|f| f * 60.0), Some(core::f64::consts::TAU));
        assert_eq!(si_factor("deg", Quantity::Torque), None);
        assert_eq!(si_factor("deg", Quantity::Command), si_factor("deg", Quantity::Position));
        assert!(unit_names(Quantity::Torque).contains(&"A"));
    }
}
