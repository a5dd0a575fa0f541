//! Units that columns are mistaken for, as factors.

use core::f64::consts::{PI, TAU};

/// Units of time.
pub(super) const UNITS_OF_TIME: [f64; 8] = [1e-3, 1e-6, 1e-9, 1e-2, 1e3, 1e6, 1e9, 1e2];
/// Rates that are mistaken for one another: every second sample, a decimal place, minutes.
pub(super) const OTHER_RATES: [f64; 5] = [0.5, 2.0, 0.1, 10.0, 60.0];
/// Distances between joints: by halves, a diameter for a radius, the other way. What lies between is found from these.
pub(super) const OTHER_LENGTHS: [f64; 3] = [0.5, 2.0, -1.0];
/// What positions in other units have to be multiplied by: degrees, revolutions and what somebody converted twice, half
/// revolutions, gears of about a hundred, milliradians, counts of encoders. Gears and counts between these are found
/// from the nearest.
pub(super) const UNITS_OF_POSITIONS: [f64; 10] =
    [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// The same of one joint, which may also be counted twice or by halves.
pub(super) const UNITS_OF_ONE_POSITION: [f64; 8] = [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, 0.5, 2.0, 1e-3, 1e-4];
/// The same of one joint that slides.
pub(super) const UNITS_OF_ONE_LENGTH: [f64; 4] = [1e-3, 1e3, 0.5, 2.0];
/// What the torque of one joint may be short of: the other units of a table, a gear, a motor of two. What lies between
/// is found from these: a motor constant of another drive.
pub(super) const UNITS_OF_ONE_TORQUE: [f64; 16] =
    [0.77, 1.3, 0.6, 1.6, 0.5, 2.0, 0.2, 5.0, 0.1, 10.0, 0.03, 30.0, 0.01, 100.0, 1e-3, 1e3];

/// Whether a factor of time is that of a unit, and not of another rate.
pub(super) fn is_unit_of_time(factor: f64) -> bool {
    UNITS_OF_TIME.contains(&factor)
}

/// Whether a factor of positions is that of a unit, and not of a gear or of an encoder's counts.
pub(super) fn is_unit_of_position(factor: f64) -> bool {
    [PI / 180.0, TAU, 180.0 / PI, 1.0 / TAU, PI, 0.5, 2.0, 1e-3].contains(&factor)
}

/// Whether a factor of one torque is that of a unit or of a pair of motors, and not of a gear or a motor constant.
pub(super) fn is_unit_of_torque(factor: f64) -> bool {
    [0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 1e-3, 1e3].contains(&factor)
}
