//! Rows and fits that result from the choices made so far.

use super::choices::{Choices, Drives, FrictionChoice};
use crate::error::IdentificationError;
use crate::estimators::{Estimation, InstrumentSource, estimate};
use crate::lag::LagFit;
use crate::less_noise::{Fit, take_estimator, with_less_noise};
use crate::payload::KnownArm;
use crate::settings::IdentificationSettings;
use crate::task::IdentificationTask;
use crate::training::training_rows;
use dynident_rows::{Execution, Logs};

pub(crate) enum Job<'w> {
    Model(Option<&'w mut (dyn InstrumentSource + 'w)>),
    Payload(&'w KnownArm),
}

impl<'w> Job<'w> {
    /// The same job with a shorter lifetime, so that it can be combined with local data.
    pub(crate) fn shorter<'s>(self) -> Job<'s>
    where
        'w: 's,
    {
        match self {
            Self::Model(Some(source)) => Job::Model(Some(source)),
            Self::Model(None) => Job::Model(None),
            Self::Payload(arm) => Job::Payload(arm),
        }
    }

    pub(crate) fn arm(&self) -> Option<&'w KnownArm> {
        match self {
            Self::Model(_) => None,
            Self::Payload(arm) => Some(*arm),
        }
    }

    /// Whether this is a model without external instruments, which can be fitted repeatedly.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(self, Self::Model(None))
    }
}

pub(crate) struct Workspace<'a, 'w> {
    pub(super) task: &'a IdentificationTask,
    pub(super) training: &'w [usize],
    /// Settings of the task with the lag that is currently compensated.
    pub(super) settings: IdentificationSettings,
    pub(super) choices: Choices,
    /// Fit with the choices made so far; `None` until it is needed.
    pub(super) fit: Option<Fit<'a>>,
    /// Lags in the rows of the fit, after the lag was decided.
    pub(super) lag_fit: Option<LagFit>,
    pub(super) is_lag_free: bool,
    pub(crate) logs_s: f64,
    job: Job<'w>,
    execution: Execution<'a>,
    /// Logs with the currently compensated lag, one entry for each cut-off. The first entry has the cut-off from the
    /// spectra.
    logs: Vec<Logs<'a>>,
}

impl<'a, 'w> Workspace<'a, 'w> {
    pub(crate) fn new(
        task: &'a IdentificationTask,
        training: &'w [usize],
        execution: Execution<'a>,
        job: Job<'w>,
        choices: Option<Choices>,
    ) -> Self {
        let is_lag_free = task.settings.motion.torque_lag_s.is_none() && job.is_plain();
        let mut choices = choices.unwrap_or_else(|| Choices::open(task.settings.lags));
        choices.has_lag_before_friction |= !is_lag_free;
        choices.has_cutoff_of_friction |= !job.is_plain();
        let mut work = Self {
            task,
            training,
            settings: task.settings.clone(),
            choices,
            fit: None,
            lag_fit: None,
            is_lag_free,
            logs_s: 0.0,
            job,
            execution,
            logs: Vec::new(),
        };
        work.take_lag();
        work
    }

    pub(super) fn trial(&self, choices: Choices) -> Workspace<'a, 'w> {
        let mut trial = Workspace::new(self.task, self.training, self.execution, Job::Model(None), Some(choices));
        if trial.settings.motion.torque_lag_s == self.settings.motion.torque_lag_s {
            trial.logs.clone_from(&self.logs);
        }
        trial
    }

    /// Takes the choices of a trial: its lag is compensated, and its grid friction is the start for the selection.
    pub(super) fn adopt(&mut self, trial: Self) {
        let Workspace { mut choices, logs, .. } = trial;
        if let FrictionChoice::Grid(grid) = core::mem::replace(&mut choices.friction, FrictionChoice::Open) {
            choices.grid = Some(grid);
        }
        choices.has_lag_before_friction = true;
        (self.choices, self.logs, self.fit) = (choices, logs, None);
        self.take_lag();
    }

    fn take_lag(&mut self) {
        if self.is_lag_free {
            self.settings.motion.torque_lag_s = self.choices.lag.torque_lag_s();
        }
    }

    pub(super) fn revise_lag(&mut self) {
        self.take_lag();
        self.logs.clear();
        self.fit = None;
        self.choices.reopen();
    }

    pub(super) fn arm(&self) -> Option<&KnownArm> {
        self.job.arm()
    }

    /// Choice of drive inertia, and the robot with it; the robot as stated while the choice is open.
    pub(super) fn drives(&self) -> Drives {
        let stated = || Drives { robot: self.task.robot.clone(), choice: None };
        self.choices.drives.clone().unwrap_or_else(stated)
    }

    /// The logs with this cut-off, or with the cut-off from the spectra. A motion in memory is not read again.
    pub(super) fn logs_at(&mut self, cutoff_hz: Option<f64>) -> Result<Logs<'a>, IdentificationError> {
        if self.logs.is_empty() {
            let of_arm_hz = self.job.arm().and_then(KnownArm::cutoff_hz);
            let (model, rows) = (self.task.robot.model(), self.settings.row_settings());
            self.logs.push(Logs::new(model, &self.task.recordings, rows, self.training, of_arm_hz, self.execution)?);
        }
        let logs = self.logs[0].clone().with_chosen_cutoff(&self.settings.motion, cutoff_hz);
        if let Some(known) = self.logs.iter().find(|known| known.motion == logs.motion) {
            return Ok(logs.with_motion_of(known));
        }
        self.logs.push(logs.clone());
        Ok(logs)
    }

    pub(super) fn fit(&mut self) -> Result<&Fit<'a>, IdentificationError> {
        let fit = match self.fit.take() {
            Some(fit) => fit,
            None => self.new_fit()?,
        };
        Ok(self.fit.insert(fit))
    }

    fn new_fit(&mut self) -> Result<Fit<'a>, IdentificationError> {
        let cutoff_hz = self.choices.cutoff().map(|choice| choice.cutoff_hz);
        let logs = self.logs_at(cutoff_hz)?;
        let (settings, training, payloads) = (&self.settings, self.training, &self.task.payloads);
        let refit = self.job.arm().map(KnownArm::refit);
        let robot = self.drives().robot;
        let (model, joints) = match self.choices.friction() {
            Some(friction) => (friction.model, friction.joints),
            None => (robot.clone().into(), Vec::new()),
        };
        let mut rows = training_rows(&logs, settings, model, training, payloads, refit)?;
        rows.friction_choice = joints;
        self.logs_s += rows.timings_s[0];
        let estimation = match &mut self.job {
            Job::Payload(arm) => {
                Estimation::plain(arm.estimate(&rows.model, &rows.columns, &rows.problem, &settings.estimation)?)
            }
            Job::Model(source) => match &rows.gains {
                Some((found, _)) => Estimation::plain(found.clone()),
                None => estimate(&rows.rows(&logs, settings, training), source.take())?,
            },
        };
        let mut fit = Fit { logs, training: rows, estimation, settings: settings.clone() };
        if matches!(self.choices.friction, FrictionChoice::Grid(_)) {
            // A later fit replaces this one, so the effect of position noise on it is acceptable.
            take_estimator(&mut fit);
            return Ok(fit);
        }
        with_less_noise(self.task, &robot, training, fit)
    }

    pub(crate) fn choices(&self) -> &Choices {
        &self.choices
    }

    pub(crate) fn finish(&mut self) -> Result<(), IdentificationError> {
        self.fit().map(|_| ())
    }

    /// The choices, the last fit, the lags in its rows, and whether the lag is automatic.
    pub(crate) fn into_parts(mut self) -> Result<(Choices, Fit<'a>, Option<LagFit>, bool), IdentificationError> {
        let fit = match self.fit.take() {
            Some(fit) => fit,
            None => self.new_fit()?,
        };
        Ok((self.choices, fit, self.lag_fit, self.is_lag_free))
    }
}
