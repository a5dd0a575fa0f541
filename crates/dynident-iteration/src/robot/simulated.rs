use super::ways::{WayRecords, cut};
use super::{Robot, RobotRun, RobotStatus, RunPurpose, RunRequest, Stopping};
use dynident_simulation::Plant;
use dynident_simulation::SimulationError;
use dynident_simulation::{LoopSettings, closed_loop};

/// A [`Plant`] with its sensors and limits as a [`Robot`]. The seed of the noise combines the seed of the settings
/// and the number of the run: different runs have different noise, and a repeated run is identical.
#[derive(Debug)]
pub struct SimulatedRobot {
    plant: Plant,
    settings: LoopSettings,
    joints: Vec<String>,
}

impl SimulatedRobot {
    /// Creates a simulated robot.
    ///
    /// # Errors
    /// Same as for [`LoopSettings::validate`].
    pub fn new(plant: Plant, settings: LoopSettings) -> Result<Self, SimulationError> {
        settings.validate(plant.dof())?;
        let joints = plant.model().joints().iter().map(|joint| joint.name.clone()).collect();
        Ok(Self { plant, settings, joints })
    }

    /// Locks the named joints at the position where a run begins, like [`Plant::with_locked`].
    ///
    /// # Errors
    /// A joint that does not exist.
    pub fn with_locked(self, joints: &[String]) -> Result<Self, SimulationError> {
        Ok(Self { plant: self.plant.with_locked(joints)?, ..self })
    }
}

impl Robot for SimulatedRobot {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        request.validate(self.joints.len())?;
        let mut controller = request.controller.build(self.joints.len(), request.model)?;
        let mut settings = self.settings.clone();
        if let Some(envelope) = request.envelope {
            envelope.limit(&mut settings.limits);
        }
        // Multiplication by an odd number distributes neighbouring run numbers over the seeds.
        settings.sensors.seed ^= (request.run as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        settings.sensors.seed ^= match request.purpose {
            RunPurpose::Run => 0,
            RunPurpose::WarmUp { pass, .. } => (pass as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f),
            RunPurpose::HeldOut => 0x1656_67b1_9e37_79f9,
        };
        let run = closed_loop(&mut self.plant, controller.as_mut(), &*request.whole()?, &settings)?;
        let record = settings.sensors.record(self.plant.model(), &run)?;
        // The simulator does not monitor link positions, so they are checked after the run.
        let outside = request.envelope.and_then(|envelope| envelope.outside(&run.q, run.samples, run.rate_hz));
        let status = match &run.status {
            status if status.is_done() && outside.is_none() => RobotStatus::Done,
            verdict => match outside {
                Some(breach) => RobotStatus::LeftEnvelope { breach, stopping: Stopping::SeenAfterwards },
                None => RobotStatus::Simulated { verdict: verdict.clone() },
            },
        };
        let Some(ways) = request.ways else {
            return Ok(RobotRun { status, record, truth: Some(run), ways: None, note: None });
        };
        // Tolerance of half a sample for rounded times.
        let half_s = 0.5 / request.reference.rate_hz();
        let begin_s = ways.approach.duration_s();
        let (from_s, to_s) = (begin_s - half_s, begin_s + request.reference.duration_s() + half_s);
        let end_s = begin_s + request.reference.duration_s();
        let first = ways.approach.samples() - 1;
        let ways = WayRecords {
            approach: cut(&record, [f64::NEG_INFINITY, from_s], 0.0),
            back: cut(&record, [to_s, f64::INFINITY], end_s),
        };
        let record = cut(&record, [from_s, to_s], begin_s);
        let truth = run.of_samples(first..first + request.reference.samples());
        Ok(RobotRun { status, record, truth: Some(truth), ways: Some(ways), note: None })
    }
}
