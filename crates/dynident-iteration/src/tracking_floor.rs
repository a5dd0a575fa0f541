//! How well a run could follow its trajectory at best: what noise, friction and delay explain of a tracking error.

use crate::rests::{highest_speeds, with_dry_steps};
use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{Integrator, LoopSettings, Plant, Reference, SensorSettings, closed_loop};

/// Seed of the noise: a floor is the same for the same run.
const SEED: u64 = 17;

/// What is known of the loop.
pub(crate) struct KnownLoop<'a> {
    /// Joints and terms.
    pub(crate) robot: &'a ParametricModel,
    /// All parameters of the robot that was found.
    pub(crate) parameters: &'a [f64],
    pub(crate) controller: &'a ControllerSettings,
    /// Noise of each position, rad (m).
    pub(crate) position_noise: &'a [f64],
    /// How late positions are, s.
    pub(crate) delay_s: f64,
}

/// Per joint the largest distance from the reference in a simulated run of the robot that was found, under the same
/// controller with that very robot as its model, with the log's noise of positions and their measured delay, and with
/// narrow steps of friction as dry friction. `None` where it cannot be simulated, or does not get to its end.
pub(crate) fn tracking_floor(reference: &Reference, known: &KnownLoop<'_>) -> Option<Vec<f64>> {
    let (robot, dof) = (known.robot, known.robot.dof());
    let bodies: Vec<InertialParameters> = known.parameters[..10 * dof]
        .chunks_exact(10)
        .map(|own| InertialParameters(core::array::from_fn(|k| own[k])))
        .collect();
    let model = robot.model().with_inertials(&bodies).ok()?;
    let fastest = highest_speeds([reference]);
    let terms = with_dry_steps(robot.terms(), &fastest);
    let mut plant = Plant::new(&model, &terms, &known.parameters[10 * dof..]).ok()?;
    let sensors = SensorSettings {
        position_std: known.position_noise.to_vec().into(),
        feedback_delay_samples: (known.delay_s * reference.rate_hz()).round() as usize,
        seed: SEED,
        ..SensorSettings::default()
    };
    let settings =
        LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 2 }, sensors, ..LoopSettings::default() };
    let of_controller = ControllerModel::from_parameters(robot.model(), robot.terms(), known.parameters).ok()?;
    let mut controller = known.controller.build(dof, Some(&of_controller)).ok()?;
    let run = closed_loop(&mut plant, controller.as_mut(), reference, &settings).ok()?;
    // What the log shows late, it shows beside the trajectory.
    let errors = run.max_error.iter().enumerate();
    run.status.is_done().then(|| errors.map(|(joint, error)| error + known.delay_s * fastest[joint]).collect())
}
