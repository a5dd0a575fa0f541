//! What comes before a motion is commanded: its rehearsal, and slower ones.

use crate::leg::{IterationTask, Leg};
use crate::model_parameters::ModelParameters;
use crate::policy::RunPlan;
use crate::record::RunRecord;
use crate::rehearsal::{Rehearsal, RehearsalFailure, Rehearsed};
use crate::settings::IterationSettings;
use crate::supervision::NextMotion;
use crate::typical_drives::with_typical_drives;
use dynident_dynamics::ParametricModel;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{Reference, SimulationError};

/// Every leg at each speed step before the first run, then the run itself: place, leg, share of its speed.
pub(crate) fn motions<'a>(
    task: &'a IterationTask,
    settings: &IterationSettings,
    before: &[RunRecord],
) -> Vec<(usize, &'a Leg, f64)> {
    let legs = || task.legs.iter().enumerate();
    let steps = if before.is_empty() { &settings.safety.speed_steps[..] } else { &[] };
    let slow = steps.iter().filter(|&&step| step < 1.0);
    let slow = slow.flat_map(|&step| legs().map(move |(number, leg)| (number, leg, step)));
    slow.chain(legs().map(|(number, leg)| (number, leg, 1.0))).collect()
}

/// What the rehearsal of a plan shows, if there is one. `robot` is with the friction in force.
pub(crate) fn rehearsed(
    task: &IterationTask,
    settings: &IterationSettings,
    robot: &ParametricModel,
    (plan, controller, model): (&RunPlan, &ControllerSettings, Option<&ControllerModel>),
    before: &[RunRecord],
) -> Result<Result<Option<Rehearsal>, RehearsalFailure>, SimulationError> {
    let Some(rehearsal) = &settings.safety.rehearsal else { return Ok(Ok(None)) };
    // What is believed of the whole robot: the controller's own model once runs have shown one, else what they have
    // shown, else the description with typical drives.
    let shown = before.iter().rev().find_map(|record| record.knowledge()?.possible.as_deref());
    let own = match &plan.model {
        Some(ModelParameters::All(values)) => Some(&values[..]).filter(|_| shown.is_some()),
        Some(ModelParameters::Base(_)) | None => None,
    };
    let known = robot.nominal()[..robot.model().inertial_count()].iter().any(|value| *value != 0.0);
    let typical = with_typical_drives(robot).unwrap_or_else(|| robot.nominal().to_vec());
    let rehearsed = Rehearsed {
        robot,
        legs: &task.legs,
        controller,
        model,
        believed: own.or(shown).or(known.then_some(&typical[..])),
        envelope: settings.safety.envelope.as_ref(),
    };
    Ok(rehearsed.run(rehearsal)?.map(Some))
}

/// What somebody who is asked hears of a motion.
pub(crate) fn next_motion(
    task: &IterationTask,
    plan: &RunPlan,
    controller: &ControllerSettings,
    (leg, reference, speed): (usize, &Reference, f64),
) -> NextMotion {
    let motion = reference.motion();
    let largest = |(joint, name): (usize, String)| {
        (name, motion.dq[motion.of(joint)].iter().fold(0.0_f64, |most, dq| most.max(dq.abs())))
    };
    NextMotion {
        run: plan.run,
        leg: (leg, task.legs.len()),
        controller: controller.name().to_owned(),
        model_based: plan.model.is_some(),
        duration_s: reference.duration_s(),
        speed,
        largest_speed: task.robot.joint_names().into_iter().enumerate().map(largest).collect(),
        rehearsal: None,
    }
}
