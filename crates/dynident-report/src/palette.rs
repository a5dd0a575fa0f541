//! Colours of the bodies in the view of the robot in three dimensions.

/// The page's palette in light colours; the last is the grey of bodies without a class.
pub(crate) const PALETTE: [[f64; 3]; 8] = [
    [86.0, 180.0, 233.0],
    [230.0, 145.0, 56.0],
    [52.0, 168.0, 132.0],
    [204.0, 121.0, 167.0],
    [214.0, 178.0, 60.0],
    [120.0, 150.0, 215.0],
    [160.0, 120.0, 210.0],
    [150.0, 156.0, 163.0],
];
