//! Preparation of a motion: slower motions and warm-ups before it, and its rehearsal in simulation.

use crate::policy::next_step::RunPlan;
use crate::policy::record::RunRecord;
use crate::policy::supervision::{NextMotion, NextWays};
use crate::robot::{ApproachPaths, RunPurpose};
use crate::setup::home::{FoundPaths, HomeError};
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::model_parameters::ModelParameters;
use crate::setup::rehearsal::{Rehearsal, RehearsalFailure, Rehearsed};
use crate::setup::settings::IterationSettings;
use crate::setup::typical_drives::{with_light_drives, with_typical_drives};
use dynident_dynamics::ParametricModel;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{Reference, SimulationError};
use std::borrow::Cow;

/// A motion before a run (slow motion, warm-up), or the run itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Commanded<'a> {
    pub(crate) place: usize,
    pub(crate) leg: &'a Leg,
    /// Share of the trajectory's speed.
    pub(crate) speed: f64,
    pub(crate) purpose: RunPurpose,
}

impl<'a> Commanded<'a> {
    /// Returns the commanded reference: that of the trajectory, slowed down to the given share of its speed.
    pub(crate) fn reference(&self) -> Result<Cow<'a, Reference>, SimulationError> {
        let reference = self.leg.reference();
        if self.speed < 1.0 { reference.slowed(self.speed).map(Cow::Owned) } else { Ok(Cow::Borrowed(reference)) }
    }

    pub(crate) fn is_run(&self) -> bool {
        self.speed == 1.0 && !matches!(self.purpose, RunPurpose::WarmUp { .. })
    }

    pub(crate) fn words(&self) -> String {
        match self.purpose {
            RunPurpose::WarmUp { pass, of } => format!("in pass {pass} of {of} of the warm-up"),
            RunPurpose::Run | RunPurpose::HeldOut => format!("at {} of its speed", self.speed),
        }
    }
}

/// The order of motions: each trajectory at each speed step (before the first completed run), each trajectory in each
/// warm-up pass, then the run itself.
pub(crate) fn motions<'a>(
    task: &'a IterationTask,
    settings: &IterationSettings,
    before: &[RunRecord],
    passes: usize,
) -> Vec<Commanded<'a>> {
    let legs = |speed: f64, purpose: RunPurpose| {
        task.legs.iter().enumerate().map(move |(place, leg)| Commanded { place, leg, speed, purpose })
    };
    // A run that was stopped early does not replace the motions at reduced speed.
    let is_first = !before.iter().any(|record| record.done);
    let steps = if is_first { &settings.safety.speed_steps[..] } else { &[] };
    let slow = steps.iter().filter(|&&step| step < 1.0).flat_map(|&step| legs(step, RunPurpose::Run));
    let warm = (1..=passes).flat_map(|pass| legs(1.0, RunPurpose::WarmUp { pass, of: passes }));
    slow.chain(warm).chain(legs(1.0, RunPurpose::Run)).collect()
}

/// Paths from and to the home posture for each trajectory; `None` if there is no home posture.
///
/// # Errors
/// No path to one of the legs.
pub(crate) fn ways_of(
    task: &IterationTask,
    settings: &IterationSettings,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<Option<FoundPaths>>, HomeError> {
    let envelope = settings.safety.envelope.as_ref();
    let of_leg = |leg: &Leg| {
        let home = settings.safety.home.as_ref();
        home.map(|home| home.ways_until(task.robot.model(), leg.reference(), envelope, stop)).transpose()
    };
    task.legs.iter().map(of_leg).collect()
}

/// A planned run with its controller, and the paths from and to the home posture for each leg.
pub(crate) struct Planned<'a> {
    pub(crate) plan: &'a RunPlan,
    pub(crate) controller: &'a ControllerSettings,
    pub(crate) model: Option<&'a ControllerModel>,
    pub(crate) ways: &'a [Option<FoundPaths>],
}

/// Simulates (rehearses) a plan if the settings request it. `robot` includes the selected friction.
pub(crate) fn rehearsed<'a>(
    task: &'a IterationTask,
    settings: &IterationSettings,
    robot: &ParametricModel,
    planned: &Planned<'_>,
    before: &[RunRecord],
    stop: &dyn Fn() -> bool,
) -> Result<Result<Option<Rehearsal>, RehearsalFailure>, SimulationError> {
    let Some(rehearsal) = &settings.safety.rehearsal else { return Ok(Ok(None)) };
    let Planned { plan, controller, model, ways } = *planned;
    // Parameters of the simulated robot, in order of preference: the controller's model after a good run, the newest
    // estimate, the nominal model with typical drives.
    let shown = before.iter().rev().find_map(|record| record.knowledge()?.possible.as_deref());
    let own = match &plan.model {
        Some(ModelParameters::All(values)) => Some(&values[..]).filter(|_| shown.is_some()),
        Some(ModelParameters::Base(_)) | None => None,
    };
    let known = robot.nominal()[..robot.model().inertial_count()].iter().any(|value| *value != 0.0);
    let typical = with_typical_drives(robot).unwrap_or_else(|| robot.nominal().to_vec());
    let lightest = rehearsal.lightest_drive();
    let light = (lightest < 1.0).then(|| with_light_drives(robot, lightest)).flatten();
    let whole = |(leg, found): (&'a Leg, &Option<FoundPaths>)| {
        let reference = leg.reference();
        let around = found.as_ref().map(|found| found.ways.around(reference)).transpose()?;
        Ok(around.map_or(Cow::Borrowed(reference), Cow::Owned))
    };
    let references: Vec<Cow<'_, Reference>> =
        task.legs.iter().zip(ways).map(whole).collect::<Result<_, SimulationError>>()?;
    let rehearsed = Rehearsed {
        robot,
        references: &references,
        controller,
        model,
        believed: own.or(shown).or(known.then_some(&typical[..])),
        light: light.as_deref().filter(|_| known && own.or(shown).is_none()),
        // The loop rate of the drives is unknown; simulated at the sampling rate of the motion, their loop could
        // oscillate.
        oscillation: match controller {
            ControllerSettings::PositionLoop(_) => None,
            _ => settings.safety.oscillation.limits(robot.model()),
        },
        envelope: settings.safety.envelope.as_ref(),
    };
    Ok(rehearsed.run(rehearsal, stop)?.map(Some))
}

pub(crate) fn next_motion(
    task: &IterationTask,
    plan: &RunPlan,
    controller: &ControllerSettings,
    motion: &Commanded<'_>,
    reference: &Reference,
    ways: Option<(&ApproachPaths, &FoundPaths)>,
) -> NextMotion {
    let largest = |of: &[&Reference]| -> Vec<(String, f64)> {
        let names = task.robot.joint_names().into_iter().enumerate();
        let highest = |joint: usize| {
            let all = of.iter().flat_map(|reference| &reference.motion().dq[reference.motion().of(joint)]);
            all.fold(0.0_f64, |most, dq| most.max(dq.abs()))
        };
        names.map(|(joint, name)| (name, highest(joint))).collect()
    };
    NextMotion {
        run: plan.run,
        leg: (motion.place, task.legs.len()),
        controller: controller.name().to_owned(),
        model_based: plan.model.is_some(),
        duration_s: reference.duration_s(),
        speed: motion.speed,
        purpose: motion.purpose,
        largest_speed: largest(&[reference]),
        rehearsal: None,
        ways: ways.map(|(ways, found)| NextWays {
            approach_s: ways.approach.duration_s(),
            return_s: ways.back.duration_s(),
            largest_speed: largest(&[&ways.approach, &ways.back]),
            over_postures: [0, 1].map(|way| found.over[way].len()),
        }),
    }
}
