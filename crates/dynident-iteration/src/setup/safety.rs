use crate::robot::Envelope;
use crate::setup::home::HomeSettings;
use crate::setup::rehearsal::RehearsalSettings;
use crate::signals::oscillation::OscillationSettings;
use dynident_simulation::{SimulationError, require};

/// Safety settings of runs, in addition to the safety functions of the robot.
#[derive(Clone, Debug, Default)]
pub struct SafetySettings {
    /// Whether the robot is external. If a run of an external robot is stopped early, the iteration ends until the
    /// next call, so that a person can check the robot; not if every run needs permission anyway. Default false.
    pub outside: bool,
    /// Limits of every sample. Default none.
    pub envelope: Option<Envelope>,
    /// Oscillations that stop an external run, and that are reported for a log.
    pub oscillation: OscillationSettings,
    /// Rehearsal of every motion before it is commanded. Default none.
    pub rehearsal: Option<RehearsalSettings>,
    /// Shares of the full speed at which the motion is run before the first run, slowest first, until a run was
    /// completed. A share of 1 is the run itself. Default none. Runs at reduced speed are not used for
    /// identification.
    pub speed_steps: Vec<f64>,
    /// Warm-up time before a run, s: the motion is repeated so that friction reaches its working temperature. This is
    /// done before the first run of a call and whenever the robot has been at rest for longer than this time. Default
    /// 0 (no warm-up). Warm-up motions are not used for identification.
    pub warm_up_s: f64,
    /// Home posture between runs: every run moves from there to its motion and back. Default none: the robot has to
    /// be at the beginning of the motion.
    pub home: Option<HomeSettings>,
}

impl SafetySettings {
    /// Checks the settings for `joints` joints.
    ///
    /// # Errors
    /// Shares outside of (0, 1]; [`RehearsalSettings::validate`], [`HomeSettings::validate`].
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
