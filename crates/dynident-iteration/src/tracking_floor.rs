//! How well a run could follow its trajectory at best: what noise, friction and delay explain of a tracking error.
//!
//! A delay between the encoders and the controller stands in no log by itself: positions and torques of one instant
//! show none. The tracking error does: a controller that sees the joint `d` seconds late takes it for being behind and
//! pushes it ahead by about `d q̇`. So the delay is what brings the simulated errors nearest to those of the run.

use crate::dry_steps::{with_dry_steps, with_sticking_joints};
use crate::rests::highest_speeds;
use dynident_dynamics::ParametricModel;
use dynident_identification::friction::JointFriction;
use dynident_model::InertialParameters;
use dynident_model::terms::TorqueTerm;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{Integrator, LoopSettings, Plant, Record, Reference, Run, SensorSettings, closed_loop};

/// Seed of the noise: a floor is the same for the same run.
const SEED: u64 = 17;
/// Longest delay of the feedback that is looked for, seconds of a usual arm.
const LONGEST_S: f64 = 10e-3;
/// What is left of the squared tracking errors with a delay that explains them, at most: more than half of an error is
/// then the delay's.
const LEFT: f64 = 0.25;
/// The log's clock is the controller's to this share.
const SAME_CLOCK: f64 = 1e-3;

/// What is known of the loop.
pub(crate) struct KnownLoop<'a> {
    /// Joints and terms.
    pub(crate) robot: &'a ParametricModel,
    /// All parameters of the robot that was found.
    pub(crate) parameters: &'a [f64],
    /// The friction that runs chose, with what is known of its constants; empty where it was stated.
    pub(crate) friction: &'a [JointFriction],
    pub(crate) controller: &'a ControllerSettings,
    /// Noise of each position, rad (m).
    pub(crate) position_noise: &'a [f64],
    /// How late positions are in the log, s.
    pub(crate) delay_s: f64,
}

/// What is explained of a run's tracking error.
pub(crate) struct TrackingFloor {
    /// Per joint the largest distance from the reference, rad (m).
    pub(crate) floor: Vec<f64>,
    /// The delay of the feedback that explains more than half of the error, s; none where no delay does.
    pub(crate) feedback_delay_s: Option<f64>,
}

/// Per joint the largest distance from the reference in a simulated run of the robot that was found, under the same
/// controller with that very robot as its model, with the log's noise of positions, their measured delay and the
/// feedback's, and with narrow steps of friction as dry friction; where joints may [stick](with_sticking_joints) with
/// more of it, the larger one of both. `None` where it cannot be simulated, or does not get to its end.
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

/// The floor of a robot that has these terms with their parameters.
fn floor_with(
    friction: (&[TorqueTerm], &[f64]),
    reference: &Reference,
    record: &Record,
    known: &KnownLoop<'_>,
    fastest: &[f64],
) -> Option<TrackingFloor> {
    let samples = |delay_s: f64| (delay_s * reference.rate_hz()).round() as usize;
    let explained = |run: &Run| -> Vec<f64> {
        // What the log shows late, it shows beside the trajectory.
        run.max_error.iter().zip(fastest).map(|(error, fastest)| error + known.delay_s * fastest).collect()
    };
    // What the log shows late the controller may see late, too. Drives that close their own loop do not: where it could
    // not bear that delay, the run that was made did not have it.
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
        .filter(|late| *late <= samples(known.robot.model().own_scale().seconds(LONGEST_S)));
    if let Some(late) = late
        && let Some(run) = simulated(reference, known, friction.0, friction.1, of_log + late)
        && left(record, &run) <= LEFT * left(record, &plain)
    {
        let feedback_delay_s = Some(late as f64 / reference.rate_hz());
        return Some(TrackingFloor { floor: explained(&run), feedback_delay_s });
    }
    Some(TrackingFloor { floor: explained(&plain), feedback_delay_s: None })
}

/// A run of the robot that was found with a feedback that is so many samples late.
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

/// Whether samples of the log stand where those of a simulated run do.
fn has_same_clock(reference: &Reference, record: &Record) -> bool {
    (record.rate_hz / reference.rate_hz() - 1.0).abs() < SAME_CLOCK && record.samples > 0
}

/// The positions of a joint in the log, and in a run.
fn positions<'a>(record: &'a Record, run: &'a Run) -> impl Iterator<Item = (&'a [f64], &'a [f64])> {
    let samples = record.samples.min(run.samples);
    (0..run.joints.len()).map(move |joint| {
        let (logged, simulated) = (record.of(joint).start, run.of(joint).start);
        (&record.q[logged..logged + samples], &run.q[simulated..simulated + samples])
    })
}

/// The delay by which the log's positions are nearest to simulated ones, in samples: least squares with what one
/// sample's delay changes, `Σ (q - q₀)(q₁ - q₀) / Σ (q₁ - q₀)²`.
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

/// The sum of squares of what the log's positions are away from simulated ones.
fn left(record: &Record, run: &Run) -> f64 {
    let pairs = positions(record, run).flat_map(|(logged, simulated)| logged.iter().zip(simulated));
    pairs.map(|(logged, simulated)| (logged - simulated) * (logged - simulated)).sum()
}
