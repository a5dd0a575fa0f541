use super::client::{Client, Started};
use super::process_settings::{ProcessMode, ProcessSettings};
use super::recorder::Recorder;
use super::stop_reason::Stopping;
use super::{Robot, RobotFault, RobotRun, RobotStatus, RunRequest, conversation};
use dynident_simulation::SimulationError;
use dynident_system::{PermittedProgram, TemporaryFolder};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A robot behind a program's standard input and output. The program is started with the first run and reused. After
/// a failure it is killed, and the next run starts it again. On Unix the program has a separate process group, which
/// is ended together with this robot.
#[derive(Debug)]
pub struct ProcessRobot {
    settings: ProcessSettings,
    joints: Vec<String>,
    program: PermittedProgram,
    client: Option<Client>,
    temporary: Option<TemporaryFolder>,
}

impl ProcessRobot {
    /// Creates the robot of a program, with the model's joints. `program` is the permitted command of the settings
    /// ([`ProcessSettings::permitted`]).
    ///
    /// # Errors
    /// Same as for [`ProcessSettings::validate`].
    pub fn new(
        settings: ProcessSettings,
        joints: Vec<String>,
        program: PermittedProgram,
    ) -> Result<Self, SimulationError> {
        settings.validate()?;
        Ok(Self { settings, joints, program, client: None, temporary: None })
    }

    fn folder(&mut self, name: &str) -> Result<PathBuf, RobotFault> {
        let file = |path: PathBuf| move |error: std::io::Error| RobotFault::File { path, reason: error.to_string() };
        let base = if let Some(folder) = &self.settings.folder {
            folder.clone()
        } else {
            if self.temporary.is_none() {
                self.temporary = Some(TemporaryFolder::new().map_err(file(std::env::temp_dir()))?);
            }
            self.temporary.as_ref().map(|folder| folder.path().to_owned()).unwrap_or_default()
        };
        let folder = base.join(name);
        std::fs::create_dir_all(&folder).map_err(file(folder.clone()))?;
        std::path::absolute(&folder).map_err(file(folder))
    }

    fn converse(&mut self, request: &RunRequest<'_>, recorder: &mut Recorder<'_>) -> Result<RobotStatus, RobotFault> {
        let not_begun = RobotStatus::Interrupted { stopping: Stopping::Confirmed };
        if request.stop_requested() {
            return Ok(not_begun);
        }
        let folder = match self.settings.mode {
            ProcessMode::Run => Some(self.folder(&request.folder_name())?),
            ProcessMode::Step => None,
        };
        let client = match &mut self.client {
            Some(client) => client,
            empty => match Client::start(&self.program, &self.settings, &self.joints, request.stop)? {
                Started::Ready(client) => empty.insert(*client),
                Started::StopRequested => return Ok(not_begun),
            },
        };
        client.follow(request.stop);
        let limit = self.settings.limits.run_s;
        client.limit_run(limit.map(|limit| (Instant::now() + Duration::from_secs_f64(limit), limit)));
        match folder {
            Some(folder) => conversation::run(client, request, &self.joints, &folder, recorder),
            None => conversation::steps(client, request, recorder),
        }
    }
}

impl Robot for ProcessRobot {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        request.validate(self.joints.len())?;
        let mut recorder = Recorder::new(request, &self.joints);
        let status = match self.converse(request, &mut recorder) {
            Ok(status) => {
                if let RobotStatus::Interrupted { stopping }
                | RobotStatus::LeftEnvelope { stopping, .. }
                | RobotStatus::Oscillated { stopping, .. } = &status
                    && stopping.is_open()
                {
                    self.client = None;
                }
                status
            }
            Err(fault) => {
                let stopping = self.client.as_mut().and_then(|client| client.stop_after(&fault));
                // The state of the program is unknown, so the next run starts it again.
                self.client = None;
                RobotStatus::Failed { fault, stopping }
            }
        };
        Ok(recorder.into_run(status))
    }
}
