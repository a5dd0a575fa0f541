//! One way from recordings to an estimate: drives, cut-off, friction, factors, parameters, with a lag of the torque
//! that is known or none.

use crate::bandwidth::{CutoffByError, choose_cutoff};
use crate::bars::ErrorBars;
use crate::between_logs::BetweenLogs;
use crate::chosen_friction::{
    ChosenFriction, GridFriction, GridTerms, choose_friction, constants_of_all_rows, friction_by_grid,
    friction_with_cutoff,
};
use crate::drive_inertia::{DriveInertiaChoice, choose_drive_inertia};
use crate::error::IdentificationError;
use crate::estimators::{Estimation, InstrumentSource, estimate};
use crate::execution::Execution;
use crate::friction::{ConstantsError, JointFriction};
use crate::lag::LagChoice;
use crate::less_noise::{Estimated, take_estimator, with_less_noise};
use crate::logs::Logs;
use crate::payload::{KnownArm, Payload};
use crate::regressor_model::RegressorModel;
use crate::settings::IdentificationSettings;
use crate::task::IdentificationTask;
use crate::training::{Training, TrainingPasses, training_rows};
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use std::time::Instant;

/// Where the time went, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// From logs to factors.
    pub logs_s: f64,
    /// From factors to parameters.
    pub estimation_s: f64,
    /// Delays, traces and held-out recordings.
    pub examination_s: f64,
}

impl StageTimes {
    /// The sum of both.
    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            logs_s: self.logs_s + other.logs_s,
            estimation_s: self.estimation_s + other.estimation_s,
            examination_s: self.examination_s + other.examination_s,
        }
    }
}

/// What is looked for.
pub(crate) enum Job<'a, 's> {
    Model(Option<&'s mut dyn InstrumentSource>),
    Payload(&'a KnownArm),
}

impl Job<'_, '_> {
    pub(crate) fn arm(&self) -> Option<&KnownArm> {
        match self {
            Self::Model(_) => None,
            Self::Payload(arm) => Some(arm),
        }
    }

    /// A model without instruments from outside, which can be fitted more than once.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(self, Self::Model(None))
    }
}

/// Rows and estimate, and what was chosen on the way.
pub(crate) struct Fitted<'a> {
    pub(crate) logs: Logs<'a>,
    pub(crate) training: Training,
    pub(crate) estimation: Estimation,
    /// The task's, with the estimator that `auto` took and the lag that was taken off.
    pub(crate) settings: IdentificationSettings,
    pub(crate) cutoff: Option<CutoffByError>,
    /// The task's robot, with the drive inertia that was seen and friction as stated.
    pub(crate) robot: ParametricModel,
    /// Whether drive inertia was seen; none where terms state it.
    pub(crate) drive_inertia: Option<DriveInertiaChoice>,
    /// Rows and fit with friction as stated, where it was chosen.
    pub(crate) stated_friction: Option<(Training, Estimate)>,
    /// The model with the friction that was chosen, whatever noise made of it afterwards, and how it was chosen.
    pub(crate) friction: (RegressorModel, Vec<JointFriction>),
    /// The cut-off at which it was chosen, where the data chose both.
    pub(crate) friction_hz: Option<f64>,
    /// What a look for a lag beside friction of all terms found of it.
    pub(crate) of_grid: Option<GridFriction>,
    /// The cut-off that was chosen here before friction.
    pub(crate) before_friction: Option<CutoffByError>,
    /// What the constants of chosen friction add to the bars.
    pub(crate) constants_error: Option<ConstantsError>,
    pub(crate) lag: LagChoice,
    /// None for a single log.
    pub(crate) between_logs: Option<BetweenLogs>,
    /// Terms of the estimate's covariance beyond the noise.
    pub(crate) bars: ErrorBars,
    pub(crate) times: StageTimes,
}

/// What was chosen: everything that takes more than one pass over the recordings.
pub(crate) struct Choices {
    pub(crate) robot: ParametricModel,
    pub(crate) drive_inertia: Option<DriveInertiaChoice>,
    pub(crate) cutoff: Option<CutoffByError>,
    /// The cut-off of the torque's motion band, where the fit has another.
    pub(crate) motion_hz: Option<f64>,
    pub(crate) friction: ChosenFriction,
    /// Whether its constants are to be moved to where all rows have them.
    pub(crate) is_of_excerpt: bool,
    pub(crate) lag: LagChoice,
    /// How long it took.
    pub(crate) times: StageTimes,
}

/// What is known before logs are read.
#[derive(Clone, Copy)]
pub(crate) enum Known<'k, 'a> {
    Nothing,
    /// A lag is still to be found: friction of a grid tells it, of these terms. Drives and the cut-off before friction
    /// are those of a fit to the same recordings with the same lag taken off, where there was one.
    Look(GridTerms, Option<&'k Fitted<'a>>),
    /// Choices that were made by an excerpt, or with friction of another cut-off.
    Choices(&'k Choices),
    /// A fit to the same recordings with the same lag taken off, which differs only in how its friction was chosen.
    Alike(&'k Fitted<'a>),
}

/// One way from logs to an estimate, with the lag of the settings taken off; with choices where they are made.
pub(crate) fn fitted_once<'a>(
    task: &'a IdentificationTask,
    settings: &IdentificationSettings,
    chosen: &[usize],
    known: Known<'_, 'a>,
    execution: Execution<'a>,
    job: &mut Job<'_, '_>,
) -> Result<Fitted<'a>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, .. } = task;
    let cutoff_hz = job.arm().and_then(KnownArm::cutoff_hz);
    let logs = Logs::new(robot.model(), recordings, settings.row_settings(), chosen, cutoff_hz, execution)?;

    // Drives, filters and friction, by the logs where they are left to them.
    let started = Instant::now();
    let Chosen { robot, drive_inertia, logs, before_friction, cutoff, friction, friction_hz, of_grid } = match known {
        Known::Choices(choices) => chosen_before(logs, settings, choices, chosen, payloads)?,
        known => chosen_here(logs, settings, robot, chosen, payloads, job, known)?,
    };
    let choice_s = started.elapsed().as_secs_f64();

    // Factors, then the estimate. Where noise in the regressor biases least squares, both once more with less of it.
    let refit = job.arm().map(KnownArm::refit);
    let mut training = training_rows(&logs, settings, friction.model.clone(), chosen, payloads, refit)?;
    training.friction_choice.clone_from(&friction.joints);
    let logs_s = training.timings_s[0];
    let before_s = training.timings_s[1] + choice_s;
    let started = Instant::now();
    let estimation = match job {
        Job::Payload(arm) => {
            let (model, columns) = (&training.model, &training.columns);
            Estimation::plain(arm.estimate(model, columns, &training.problem, &settings.estimation)?)
        }
        Job::Model(source) => match &training.gains {
            Some((found, _)) => Estimation::plain(found.clone()),
            None => estimate(&training.rows(&logs, settings, chosen), source.take())?,
        },
    };
    let mut found = Estimated { logs, training, estimation, settings: settings.clone() };
    if matches!(known, Known::Look(..)) {
        // What the noise of the positions biases tells no lag, and a later fit is made for it.
        take_estimator(&mut found);
    } else {
        found = with_less_noise(task, &robot, chosen, found)?;
    }
    let Estimated { logs, training, estimation, settings } = found;
    let estimation_s = before_s + started.elapsed().as_secs_f64();
    Ok(Fitted {
        logs,
        training,
        estimation,
        settings,
        cutoff,
        robot,
        drive_inertia,
        stated_friction: friction.stated,
        friction: (friction.model, friction.joints),
        friction_hz,
        of_grid,
        before_friction,
        constants_error: friction.constants_error,
        lag: LagChoice::default(),
        between_logs: None,
        bars: ErrorBars::default(),
        times: StageTimes { logs_s, estimation_s, examination_s: 0.0 },
    })
}

/// Drives, filters and friction.
struct Chosen<'a> {
    robot: ParametricModel,
    drive_inertia: Option<DriveInertiaChoice>,
    logs: Logs<'a>,
    /// The cut-off before friction was chosen, where it was chosen here.
    before_friction: Option<CutoffByError>,
    cutoff: Option<CutoffByError>,
    friction: ChosenFriction,
    /// The cut-off at which friction was chosen, where the data chose both.
    friction_hz: Option<f64>,
    of_grid: Option<GridFriction>,
}

/// Drives, filters and friction by the logs where they are left to them; drives and the first cut-off as a fit that is
/// alike chose them, friction of a grid while a lag is to be found.
fn chosen_here<'a>(
    logs: Logs<'a>,
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    chosen: &[usize],
    payloads: &[Payload],
    job: &Job<'_, '_>,
    known: Known<'_, 'a>,
) -> Result<Chosen<'a>, IdentificationError> {
    let alike = match known {
        Known::Alike(found) => Some(found),
        Known::Look(_, found) => found,
        Known::Nothing | Known::Choices(_) => None,
    };
    let (robot, drive_inertia) = match (job.arm(), alike) {
        (Some(_), _) => (robot.clone(), None),
        (None, Some(alike)) => (alike.robot.clone(), alike.drive_inertia.clone()),
        (None, None) => choose_drive_inertia(&logs, settings, robot, chosen, payloads)?,
    };
    let first = RegressorModel::from(robot.clone());
    let cutoff = match alike.and_then(|alike| alike.before_friction.clone()) {
        Some(cutoff) => Some(cutoff),
        None => choose_cutoff(&logs, settings, &first, chosen)?,
    };
    let before_friction = cutoff.clone();
    let (mut friction_hz, mut of_grid) = (None, None);
    let (logs, cutoff, friction) = if settings.friction.is_empty() {
        let logs = logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz));
        let friction = choose_friction(&logs, settings, &robot, chosen, payloads)?;
        (logs, cutoff, friction)
    } else {
        friction_hz = cutoff.as_ref().map(CutoffByError::highest_alike_hz);
        let (of_friction, friction) = if let Known::Look(terms, _) = known {
            let logs = logs.clone().with_chosen_cutoff(&settings.motion, friction_hz);
            let found = friction_by_grid(&TrainingPasses::of_logs(&logs, settings, chosen, payloads), &robot, terms)?;
            let friction = found.as_ref().map_or_else(|| ChosenFriction::as_stated(first), GridFriction::as_chosen);
            of_grid = found.filter(|_| terms == GridTerms::All);
            (None, friction)
        } else {
            let of_grid = alike.and_then(|found| found.of_grid.clone());
            friction_with_cutoff(&logs, settings, &robot, chosen, payloads, friction_hz, of_grid)?
        };
        let cutoff = of_friction.or(cutoff);
        (logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz)), cutoff, friction)
    };
    let logs = match alike {
        Some(alike) => logs.with_motion_of(&alike.logs),
        None => logs,
    };
    Ok(Chosen { robot, drive_inertia, logs, before_friction, cutoff, friction, friction_hz, of_grid })
}

/// The same as it was chosen before; where an excerpt chose, with the constants of friction by all rows.
fn chosen_before<'a>(
    logs: Logs<'a>,
    settings: &IdentificationSettings,
    choices: &Choices,
    chosen: &[usize],
    payloads: &[Payload],
) -> Result<Chosen<'a>, IdentificationError> {
    let Choices { robot, drive_inertia, cutoff, motion_hz, friction, .. } = choices;
    let logs = logs.with_chosen_cutoff(&settings.motion, cutoff.as_ref().map(|choice| choice.cutoff_hz));
    let logs = logs.with_motion_band(*motion_hz);
    let friction = if choices.is_of_excerpt {
        let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
        constants_of_all_rows(&of_constants, settings, robot, friction, chosen, payloads)?
    } else {
        friction.clone()
    };
    let (robot, drive_inertia) = (robot.clone(), drive_inertia.clone());
    Ok(Chosen {
        robot,
        drive_inertia,
        logs,
        before_friction: None,
        cutoff: cutoff.clone(),
        friction,
        friction_hz: None,
        of_grid: None,
    })
}
