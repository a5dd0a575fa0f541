//! The drive of one joint: a position controller, a motor and a gear with friction.

/// Drive of one joint, in SI units at the joint. With the delayed set point `r`, the measured position `q` and the
/// velocity `v`, the law of the drive is
///
/// ```text
/// set point r    follows the command with limited acceleration and speed (`profile.rs`)
/// motor torque   clip(stiffness (r - q), ±torque_limit) - damping v
/// friction       at most coulomb + load_friction |load| + stribeck exp(-(v / stribeck_speed)²)
/// ```
///
/// `load` is the torque of the arm's weight and velocity that the gear carries. The friction law follows Rhoban's servo
/// models, M4 in arXiv 2410.08650.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Position gain, Nm/rad (N/m).
    pub stiffness: f64,
    /// Torque per velocity, Nm s/rad (N s/m): sum of the velocity gain of the controller, viscous friction and
    /// back-EMF.
    pub damping: f64,
    /// Inertia of rotor and gear at the joint, kg m² (kg).
    pub armature: f64,
    /// Coulomb friction without load, Nm (N).
    pub coulomb: f64,
    /// Increase of friction per torque that the gear carries, without unit.
    pub load_friction: f64,
    /// Difference between friction at rest and friction in motion (Stribeck effect), Nm (N).
    pub stribeck: f64,
    /// Velocity at which most of the Stribeck effect has disappeared, rad/s (m/s).
    pub stribeck_speed: f64,
    /// Largest torque of the position controller, Nm (N); infinite without limit.
    pub torque_limit: f64,
    /// Largest acceleration of the set point, rad/s² (m/s²); infinite without limit. Servos call it "acceleration" or
    /// "profile acceleration".
    pub profile_acceleration: f64,
    /// Largest speed of the set point, rad/s (m/s); infinite without limit.
    pub profile_speed: f64,
    /// Delay from a command to its effect, s.
    pub delay_s: f64,
    /// Delay from a time stamp of the log to the measurement of the position, s.
    pub read_delay_s: f64,
    /// Position of the model minus the measured position, rad (m).
    pub zero: f64,
}
