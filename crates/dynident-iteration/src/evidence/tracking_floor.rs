//! The tracking floor: the tracking error that noise, friction and delay explain.
//!
//! A delay between the encoders and the controller is not visible in the log, because logged positions and torques
//! have the same time. But it causes a tracking error: a controller that receives positions `d` seconds late pushes
//! the joint ahead by about `d q̇`. So the delay is estimated by matching simulated tracking errors to those of the
//! run.

use crate::signals::dry_steps::{with_dry_steps, with_sticking_joints};
use crate::signals::rests::highest_speeds;
use dynident_dynamics::ParametricModel;
use dynident_identification::friction::JointFriction;
use dynident_model::InertialParameters;
use dynident_model::terms::TorqueTerm;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{Integrator, LoopSettings, Plant, Record, Reference, Run, SensorSettings, closed_loop};

/// Seed of the noise, so that the floor of a run is reproducible.
const SEED: u64 = 17;
/// Longest feedback delay, s, for an arm of 1.2 m.
const MAX_FEEDBACK_DELAY_S: f64 = 10e-3;
/// Largest ratio of the sums of squared tracking errors with and without a delay, for the delay to be accepted: it
/// then explains more than half of the error.
const MAX_SQUARED_ERROR_RATIO: f64 = 0.25;
/// Largest relative deviation of the log's rate from the controller's.
const MAX_RATE_DEVIATION: f64 = 1e-3;

pub(crate) struct KnownLoop<'a> {
    pub(crate) robot: &'a ParametricModel,
    pub(crate) parameters: &'a [f64],
    /// The selected friction, with the uncertainty of its constants; empty if friction was not selected.
    pub(crate) friction: &'a [JointFriction],
    pub(crate) controller: &'a ControllerSettings,
    /// Standard deviation of the noise of each joint's position, rad (m).
    pub(crate) position_noise: &'a [f64],
    /// Delay of the positions in the log, s.
    pub(crate) delay_s: f64,
}

pub(crate) struct TrackingFloor {
    /// Largest tracking error of each joint that is explained, rad (m).
    pub(crate) floor: Vec<f64>,
    /// The feedback delay, s, if it explains more than half of the error.
    pub(crate) feedback_delay_s: Option<f64>,
}

/// Largest tracking error of each joint in a simulation of the estimated robot, with the same controller, whose model
/// is the estimated robot. The simulation includes the position noise of the log, the measured delay and the feedback
/// delay. Narrow smoothed sign functions of friction are simulated as dry friction. If joints may
/// [stick](with_sticking_joints) with more friction, the larger error of both simulations is used. `None` if the run
/// cannot be simulated or is not completed.
pub(crate) fn tracking_floor(reference: &Reference, record: &Record, known: &KnownLoop<'_>) -> Option<TrackingFloor> {
    let fastest = highest_speeds([reference]);
    let terms = known.robot.terms();
    let parameters = &known.parameters[known.robot.model().inertial_count()..];
    let names = known.robot.joint_names();
    let sticking = with_sticking_joints(terms, parameters, &names, known.friction, &fastest);
    let found = floor_with((&with_dry_steps(terms, &fastest), parameters), reference, record, known, &fastest)?;
    let sticking =
        sticking.and_then(|(terms, parameters)| floor_with((&terms, &parameters), reference, record, known, &fastest));
    Some(match sticking {
        None => found,
        Some(sticking) => TrackingFloor {
            floor: found.floor.iter().zip(&sticking.floor).map(|(one, other)| one.max(*other)).collect(),
            feedback_delay_s: found.feedback_delay_s.or(sticking.feedback_delay_s),
        },
    })
}

fn floor_with(
    friction: (&[TorqueTerm], &[f64]),
    reference: &Reference,
    record: &Record,
    known: &KnownLoop<'_>,
    fastest: &[f64],
) -> Option<TrackingFloor> {
    let samples = |delay_s: f64| (delay_s * reference.rate_hz()).round() as usize;
    let explained = |run: &Run| -> Vec<f64> {
        // A delay of the positions in the log appears as a tracking error.
        run.max_error.iter().zip(fastest).map(|(error, fastest)| error + known.delay_s * fastest).collect()
    };
    // The controller may receive positions with the delay of the log, but drives with an internal position loop do
    // not. If the loop is unstable with this delay, the actual run did not have it.
    let late_by_log = samples(known.delay_s);
    let (of_log, plain) = match simulated(reference, known, friction.0, friction.1, late_by_log) {
        Some(run) => (late_by_log, run),
        None if late_by_log > 0 => (0, simulated(reference, known, friction.0, friction.1, 0)?),
        None => return None,
    };
    let one_late = || simulated(reference, known, friction.0, friction.1, of_log + 1);
    let late = has_same_clock(reference, record)
        .then(one_late)
        .flatten()
        .and_then(|one_late| delay_in_samples(record, &plain, &one_late))
        .filter(|late| *late <= samples(known.robot.model().characteristic_scale().seconds(MAX_FEEDBACK_DELAY_S)));
    if let Some(late) = late
        && let Some(run) = simulated(reference, known, friction.0, friction.1, of_log + late)
        && squared_error(record, &run) <= MAX_SQUARED_ERROR_RATIO * squared_error(record, &plain)
    {
        let feedback_delay_s = Some(late as f64 / reference.rate_hz());
        return Some(TrackingFloor { floor: explained(&run), feedback_delay_s });
    }
    Some(TrackingFloor { floor: explained(&plain), feedback_delay_s: None })
}

/// Simulates a run of the estimated robot with a feedback delay of `late` samples.
fn simulated(
    reference: &Reference,
    known: &KnownLoop<'_>,
    terms: &[TorqueTerm],
    of_terms: &[f64],
    late: usize,
) -> Option<Run> {
    let robot = known.robot;
    let of_bodies = &known.parameters[..robot.model().inertial_count()];
    let bodies: Vec<InertialParameters> =
        of_bodies.chunks_exact(10).map(|own| InertialParameters(core::array::from_fn(|k| own[k]))).collect();
    let model = robot.model().with_inertials(&bodies).ok()?;
    let mut plant = Plant::new(&model, terms, of_terms).ok()?;
    let sensors = SensorSettings {
        position_std: known.position_noise.to_vec().into(),
        feedback_delay_samples: late,
        seed: SEED,
        ..SensorSettings::default()
    };
    let settings =
        LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 2 }, sensors, ..LoopSettings::default() };
    let of_controller = ControllerModel::from_parameters(robot.model(), robot.terms(), known.parameters).ok()?;
    let mut controller = known.controller.build(robot.dof(), Some(&of_controller)).ok()?;
    let run = closed_loop(&mut plant, controller.as_mut(), reference, &settings).ok()?;
    run.status.is_done().then_some(run)
}

/// Whether the samples of the log have the same times as those of a simulated run.
fn has_same_clock(reference: &Reference, record: &Record) -> bool {
    (record.rate_hz / reference.rate_hz() - 1.0).abs() < MAX_RATE_DEVIATION && record.samples > 0
}

fn positions<'a>(record: &'a Record, run: &'a Run) -> impl Iterator<Item = (&'a [f64], &'a [f64])> {
    let samples = record.samples.min(run.samples);
    (0..run.joints.len()).map(move |joint| {
        let (logged, simulated) = (record.of(joint).start, run.of(joint).start);
        (&record.q[logged..logged + samples], &run.q[simulated..simulated + samples])
    })
}

/// The delay, in samples, that minimises the squared difference between the log's positions q and simulated ones:
/// least squares with the positions q₀ without delay and q₁ with one sample of delay, `Σ (q - q₀)(q₁ - q₀) / Σ (q₁ -
/// q₀)²`.
fn delay_in_samples(record: &Record, plain: &Run, one_late: &Run) -> Option<usize> {
    let (mut across, mut square) = (0.0, 0.0);
    for ((logged, without), (_, with)) in positions(record, plain).zip(positions(record, one_late)) {
        for ((logged, without), with) in logged.iter().zip(without).zip(with) {
            across += (logged - without) * (with - without);
            square += (with - without) * (with - without);
        }
    }
    let late = (across / square).round();
    (late.is_finite() && late >= 1.0).then_some(late as usize)
}

/// Sum of the squared differences between the log's positions and simulated ones.
fn squared_error(record: &Record, run: &Run) -> f64 {
    let pairs = positions(record, run).flat_map(|(logged, simulated)| logged.iter().zip(simulated));
    pairs.map(|(logged, simulated)| (logged - simulated) * (logged - simulated)).sum()
}
