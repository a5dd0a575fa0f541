//! What keeps runs safe, apart from the robot itself.

use crate::home::HomeSettings;
use crate::oscillation::OscillationSettings;
use crate::rehearsal::RehearsalSettings;
use crate::robot::Envelope;
use dynident_simulation::{SimulationError, require};

/// What keeps runs safe, apart from the robot itself.
#[derive(Clone, Debug, Default)]
pub struct SafetySettings {
    /// Whether the robot is one outside. A run of it that was stopped early ends the iteration until somebody has
    /// looked and calls again, unless every run is allowed one by one anyhow. Default false.
    pub outside: bool,
    /// What no sample may leave. Default none.
    pub envelope: Option<Envelope>,
    /// Thresholds of oscillations: those that stop a run outside, and those that are reported for a log.
    pub oscillation: OscillationSettings,
    /// How every motion is rehearsed before it is commanded. Default not at all.
    pub rehearsal: Option<RehearsalSettings>,
    /// Shares of its speed at which the motion is run before the first run, slowest first, and again as long as no run
    /// got to its end; those of 1 are the run itself. Default none. These runs are not identified.
    pub speed_steps: Vec<f64>,
    /// How long the motion of a run is made over and over before it, s, so that friction is at its working temperature:
    /// before the first run of a call, and again where the robot has stood longer than this. Default 0: not at all.
    /// These passes are not identified.
    pub warm_up_s: f64,
    /// Where the robot waits between runs: every run goes from there to its motion and back. Default nowhere: the robot
    /// has to stand where the motion begins.
    pub home: Option<HomeSettings>,
}

impl SafetySettings {
    /// Checks the numbers for so many joints.
    ///
    /// # Errors
    /// Shares that are not within (0, 1]; [`RehearsalSettings::validate`], [`HomeSettings::validate`].
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        let warm_up_s = self.warm_up_s;
        require((0.0..=1e5).contains(&warm_up_s), "warm_up_s", warm_up_s, "give 0 to 100000 s")?;
        self.home.as_ref().map_or(Ok(()), |home| home.validate(joints))?;
        self.oscillation.validate()?;
        for &step in &self.speed_steps {
            require(step > 0.0 && step <= 1.0, "speed_steps", step, "give shares of the speed: above 0, at most 1")?;
        }
        self.rehearsal.as_ref().map_or(Ok(()), RehearsalSettings::validate)
    }
}
