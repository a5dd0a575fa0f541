use crate::estimation::estimate::RunEstimate;
use crate::estimation::forecast::{KnownInformation, MotionForecast};
use crate::estimation::run_motion::RunMotion;
use crate::evidence::torque_of_all::{LargestTorque, largest_torque};
use crate::planning::planner::{BeforeRun, MotionPlanner, PlannedMotion};
use crate::robot::StopSignal;
use crate::setup::error::IterationError;
use crate::setup::leg::Leg;
use crate::setup::run_information::{RunNoise, run_information};
use core::ops::ControlFlow;
use dynident_dynamics::{ParametricModel, Workspace, inverse_dynamics};
use dynident_excitation::check::{CHECK_RATE_HZ, check_limits};
use dynident_excitation::criteria::{Criterion, KieferPhiP};
use dynident_excitation::families::{FamilyError, WithStartPosture};
use dynident_excitation::limits::{JointLimit, KnownTorque, LimitError, LimitSet, Limits};
use dynident_excitation::optimisers::OptimiserError;
use dynident_excitation::{Design, DesignSettings, DesignTask, Family, Information, Motion, design};
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Model};
use dynident_simulation::{Reference, SimulationError, require};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Order p of the Kiefer criterion for the variances along the directions with the widest error bars (1 is their
/// mean, infinity the largest). On the UR10 of the examples, after its D-optimal motion, two further runs at order 1,
/// 2 and 4 reduce the ten widest error bars to 65, 63 and 61 % of their size after repeating the motion (root mean
/// squares).
const CRITERION_ORDER: f64 = 4.0;

/// Number and seed of the random states over the workspace.
const STATES: usize = 2_000;
const STATES_SEED: u64 = 1;

/// Maximum number of searches. Each search has lower torque limits than the previous one, until all models keep the
/// limits.
const MAX_SEARCHES: usize = 4;

/// The limits of the next search are reduced by this factor times the torque excess of the last search.
const TORQUE_REDUCTION_FACTOR: f64 = 1.1;

/// Tolerance within which a motion ends where it begins, rad (m).
const RETURN_TOLERANCE: f64 = 1e-6;

/// Settings of the redesign of motions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RedesignSettings {
    /// Minimum forecast reduction of the widest error bars, in percent, for which an iteration that has otherwise
    /// converged makes another run. Default 20: the second run of the same motion reduces them by 29 %, the third by
    /// 18 %.
    pub least_gain_percent: f64,
}

impl Default for RedesignSettings {
    fn default() -> Self {
        Self { least_gain_percent: 20.0 }
    }
}

impl RedesignSettings {
    /// Checks the number.
    ///
    /// # Errors
    /// A percentage out of range.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let percent = self.least_gain_percent;
        require(
            percent > 0.0 && percent <= 100.0,
            "motion.least_gain_percent",
            percent,
            "give more than 0, at most 100",
        )
    }
}

#[derive(Clone, Debug, PartialEq, Error)]
enum NotRedesigned {
    /// The iteration keeps its motion, because the limits permit no other. The text after the colon has the cause.
    #[error("no motion within the limits: {0}")]
    Limits(#[from] LimitError),
    /// The iteration keeps its motion, because the search for a better one failed. The text after the colon has the
    /// cause.
    #[error("the search found no motion: {0}")]
    Search(#[from] OptimiserError),
    /// The iteration keeps its motion, because every better one exceeds a limit. More search time under
    /// `[design.search]` may help.
    #[error("the best motion that was found exceeds the limit of {what} by {percent:.2} %")]
    Broken { what: String, percent: f64 },
    /// The iteration keeps its motion, because a better one could exceed the torque limit of this joint if the model is
    /// slightly wrong. It may change after the next run.
    #[error(
        "every motion that was found needs up to {torque:.3} Nm at joint {joint} for some model within the uncertainty, and the limit is {limit:.3} Nm"
    )]
    Torque { joint: String, torque: f64, limit: f64 },
    /// The present motion ends where it begins, so a new one must do so as well, and this one does not. The iteration
    /// keeps its motion. Choose a family that returns, such as `fourier`.
    #[error("the motion does not end at its start position at joint {joint}: use a family that returns")]
    Ends { joint: String },
    /// The command was stopped while it searched. The iteration keeps its motion.
    #[error("the search was interrupted")]
    Interrupted,
    /// The iteration keeps its motion, because a new one would gain too little. No action is needed.
    #[error("the best other motion reduces the error bars by only {percent:.0} %")]
    NoBetter { percent: f64 },
    #[error("{0}")]
    Numbers(#[from] SimulationError),
}

/// Designs the next motion from the current estimate. The information of the new motion is added to that of all good
/// runs, `D = Σ Wᵀ Σ⁻¹ W` (regressor W, covariance Σ of the estimated noise), and the criterion is [`KieferPhiP`] of
/// the sum. Directions in the parameter space are scaled by the torque error that they cause over random states
/// within the limits of position, velocity and acceleration, in units of the joint noise. The torque limits hold for
/// every model within the uncertainty (95 % ellipsoid of the parameters). The search uses the estimated bodies,
/// friction and drives, with limits reduced by the effect of the uncertainty. The result is checked with all models;
/// if one exceeds a limit, the search is repeated with lower limits. The motion begins where the first motion began.
#[derive(Debug)]
pub struct Redesign {
    family: WithStartPosture,
    rate_hz: f64,
    returns: bool,
    limits: Limits,
    search: DesignSettings,
    settings: RedesignSettings,
}

impl Redesign {
    /// Creates a planner for motions of a family within limits, which replace the trajectory `leg` (the only one of
    /// the task).
    ///
    /// # Errors
    /// Settings out of range, or a family with other joints.
    pub fn new(
        family: Box<dyn Family>,
        limits: Limits,
        search: DesignSettings,
        settings: RedesignSettings,
        leg: &Leg,
    ) -> Result<Self, SimulationError> {
        settings.validate()?;
        let (reference, motion) = (leg.reference(), leg.reference().motion());
        let start = |joint: usize| motion.q[joint * motion.samples];
        let end = |joint: usize| motion.q[(joint + 1) * motion.samples - 1];
        let returns = (0..motion.joints).all(|joint| (end(joint) - start(joint)).abs() <= RETURN_TOLERANCE);
        let posture = (0..motion.joints).map(|joint| Some(start(joint))).collect();
        let family =
            WithStartPosture::new(family, posture).map_err(|error: FamilyError| SimulationError::Family(error))?;
        Ok(Self { family, rate_hz: reference.rate_hz(), returns, limits, search, settings })
    }

    fn search(
        &self,
        before: &BeforeRun<'_>,
        information: &KnownInformation,
        noise: &RunNoise,
        repeated: &LargestTorque,
    ) -> Result<(Reference, LargestTorque), NotRedesigned> {
        let model = found_bodies(before.robot, before.known)?;
        let names = before.robot.joint_names();
        let torque_limits = self.torque_limits(before, &names);
        let known = self.known_torque(before);
        let stopped = || before.stop.is_some_and(StopSignal::is_requested);
        // First estimate of the effect of the uncertainty: its value along the previous motion.
        let mut taken_off = repeated.beyond_search.clone();
        let mut last = None;
        for _ in 0..MAX_SEARCHES {
            let limits = self.with_torque(&names, &torque_limits, &known, &taken_off);
            let set = LimitSet::new(&limits, &model)?;
            let found = self.designed(before, information, noise, &set)?;
            if stopped() {
                return Err(NotRedesigned::Interrupted);
            }
            let reference = Reference::of_family(&self.family, &found.parameters, self.rate_hz, None)?;
            self.check(&limits, &model, &found, &reference, &names)?;
            let searched = |motion: &Motion| searched_torque(&model, &known, motion);
            let torque = largest_torque(before.robot, before.known, &reference, &searched);
            let beyond = |joint: usize| torque.of_all[joint] - torque_limits[joint];
            let worst = (0..names.len()).max_by(|&a, &b| beyond(a).total_cmp(&beyond(b)));
            let Some(worst) = worst.filter(|&joint| beyond(joint) > 0.0) else { return Ok((reference, torque)) };
            for (joint, taken_off) in taken_off.iter_mut().enumerate() {
                *taken_off += TORQUE_REDUCTION_FACTOR * beyond(joint).max(0.0);
            }
            let (joint, torque, limit) = (names[worst].clone(), torque.of_all[worst], torque_limits[worst]);
            last = Some(NotRedesigned::Torque { joint, torque, limit });
        }
        Err(last.unwrap_or(NotRedesigned::Search(OptimiserError::Start)))
    }

    fn torque_limits(&self, before: &BeforeRun<'_>, names: &[String]) -> Vec<f64> {
        let of_design = |name: &String| {
            let limit = self.limits.of(name);
            limit.and_then(|limit| Some(limit.torque? * (1.0 - limit.torque_margin))).unwrap_or(f64::INFINITY)
        };
        let of_drive = |joint: usize| before.torque_limits.map_or(f64::INFINITY, |limits| limits[joint]);
        names.iter().enumerate().map(|(joint, name)| of_design(name).min(of_drive(joint))).collect()
    }

    /// Torque of friction and drives that the search uses: estimated, or nominal before the first run.
    fn known_torque(&self, before: &BeforeRun<'_>) -> KnownTorque {
        let Some(all) = &before.known.possible else { return self.limits.known_torque.clone() };
        let values = &all[before.robot.model().inertial_count()..];
        KnownTorque::new(before.robot.terms().iter().cloned().zip(values.iter().copied()))
    }

    fn with_torque(&self, names: &[String], torque_limits: &[f64], known: &KnownTorque, taken_off: &[f64]) -> Limits {
        let mut limits = Limits { known_torque: known.clone(), ..self.limits.clone() };
        for ((name, limit), taken_off) in names.iter().zip(torque_limits).zip(taken_off) {
            if limit.is_finite() && limits.of(name).is_none() {
                limits.joints.push(JointLimit { joint: name.clone(), ..JointLimit::default() });
            }
            let Some(own) = limits.joints.iter_mut().find(|own| own.joint == *name) else { continue };
            own.torque = limit.is_finite().then_some(limit - taken_off);
            own.torque_margin = 0.0;
        }
        limits
    }

    fn designed(
        &self,
        before: &BeforeRun<'_>,
        information: &KnownInformation,
        noise: &RunNoise,
        set: &LimitSet,
    ) -> Result<Design, NotRedesigned> {
        let criterion = KieferPhiP::new(information.units.clone(), CRITERION_ORDER);
        let criteria: [&dyn Criterion; 1] = [&criterion];
        let task = DesignTask {
            family: &self.family,
            criteria: &criteria,
            limits: set,
            layout: before.robot.layout(),
            torque_std_nm: &noise.joint_sigma,
            prior: Some(&information.total),
        };
        // Each run has different random starts; the sampling rate is that of the estimates' rows.
        let seed = self.search.seed.wrapping_add(before.run as u64);
        let settings = DesignSettings { seed, rate_hz: noise.rows_per_s, ..self.search.clone() };
        let stopped = || before.stop.is_some_and(StopSignal::is_requested);
        let watch = |_: &_| if stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        Ok(design(&task, &settings, watch)?)
    }

    /// Random states over the workspace, with independent joints. Positions are within their limits and at most half
    /// a turn (0.5 m) from zero. Velocities and accelerations are within their limits, or at most the maxima of the
    /// earlier motions.
    fn states(&self, before: &BeforeRun<'_>) -> Motion {
        let joints = before.robot.model().joints();
        let mut random = Random::new(STATES_SEED);
        let mut states = Motion::default();
        states.reset(joints.len(), STATES);
        for (place, joint) in joints.iter().enumerate() {
            let limit = self.limits.of(&joint.name);
            let highest = |of: fn(&Motion) -> &[f64]| {
                let own = before.good.iter().map(|run| run.legs[0].reference().motion());
                let values = own.flat_map(|motion| &of(motion)[motion.of(place)]);
                values.fold(0.0_f64, |most, value| most.max(value.abs()))
            };
            let free = if joint.is_rotary() { core::f64::consts::PI } else { 0.5 };
            let [lower, upper] = limit.and_then(|limit| limit.position).unwrap_or([-free, free]);
            // A position range that does not overlap that interval is used unchanged.
            let overlaps = lower < free && upper > -free;
            let [lower, upper] = if overlaps { [lower.max(-free), upper.min(free)] } else { [lower, upper] };
            let speed = limit.and_then(|limit| limit.speed).unwrap_or_else(|| highest(|motion| &motion.dq));
            let rate = limit.and_then(|limit| limit.acceleration).unwrap_or_else(|| highest(|motion| &motion.ddq));
            for place in states.of(place) {
                states.q[place] = random.uniform(lower, upper);
                states.dq[place] = random.uniform(-speed, speed);
                states.ddq[place] = random.uniform(-rate, rate);
            }
        }
        states
    }

    /// Checks every limit with an implementation that is independent of the search, and the end of the motion.
    fn check(
        &self,
        limits: &Limits,
        model: &Model,
        found: &Design,
        reference: &Reference,
        names: &[String],
    ) -> Result<(), NotRedesigned> {
        let motion_at = |times: &[f64], out: &mut Motion| self.family.motion(&found.parameters, times, out);
        let rate_hz = model.characteristic_scale().round_hertz(CHECK_RATE_HZ);
        let reports = check_limits(limits, model, self.family.duration_s(), rate_hz, motion_at)?;
        let worst = reports.iter().filter(|report| report.violated);
        if let Some(worst) = worst.max_by(|a, b| a.worst_ratio.total_cmp(&b.worst_ratio)) {
            let what = format!("{} ({})", worst.kind, worst.joint);
            return Err(NotRedesigned::Broken { what, percent: 100.0 * (worst.worst_ratio - 1.0) });
        }
        let motion = reference.motion();
        let away = |joint: &usize| {
            let own = &motion.q[motion.of(*joint)];
            (own[own.len() - 1] - own[0]).abs() > RETURN_TOLERANCE
        };
        match (0..names.len()).find(away) {
            Some(joint) if self.returns => Err(NotRedesigned::Ends { joint: names[joint].clone() }),
            _ => Ok(()),
        }
    }
}

impl MotionPlanner for Redesign {
    fn plan(&self, before: &BeforeRun<'_>) -> Result<PlannedMotion, IterationError> {
        let Some(last) = before.good.last() else {
            let problem = "no good run is available to plan the next motion".to_owned();
            return Err(IterationError::Planning { run: before.run, problem });
        };
        let several =
            before.good.iter().any(|run| run.legs.len() != 1 || run.legs.iter().any(|leg| leg.windows().is_some()));
        if several {
            let problem = "the redesign of motions needs runs with a single leg and without windows".to_owned();
            return Err(IterationError::Planning { run: before.run, problem });
        }
        let count = before.robot.layout().columns().len();
        let mut total = DMatrix::zeros(count, count);
        for run in before.good {
            let reference = run.legs[0].reference();
            total += run_information(before.robot, reference, &noise_of(run.estimate, reference));
        }
        let repeated = last.legs[0].reference();
        let noise = noise_of(last.estimate, repeated);
        let mut needed = Information::new(before.robot.model(), before.robot.layout(), &noise.joint_sigma, None);
        let needed = needed.of(&self.states(before), 1.0 / STATES as f64);
        let information = KnownInformation::new(total, &needed);
        let expected =
            |reference: &Reference| information.after(&run_information(before.robot, reference, &noise), before.known);
        let again = expected(repeated);
        let repeat_gain_percent = again.gain_percent();
        let model = found_bodies(before.robot, before.known)?;
        let searched = |motion: &Motion| searched_torque(&model, &self.known_torque(before), motion);
        let torque = largest_torque(before.robot, before.known, repeated, &searched);
        let found = self.search(before, &information, &noise, &torque).and_then(|(reference, torque)| {
            let other = expected(&reference);
            let percent = other.gain_percent();
            if percent > repeat_gain_percent {
                Ok((reference, torque, other))
            } else {
                Err(NotRedesigned::NoBetter { percent })
            }
        });
        let (motion, reason, torque, expected) = match found {
            Ok((reference, torque, other)) => (Some(RunMotion::new(vec![reference])), None, torque, other),
            Err(reason) => (None, Some(reason.to_string()), torque, again),
        };
        let gain_percent = expected.gain_percent();
        let forecast = MotionForecast {
            redesigned: motion.is_some(),
            reason,
            gain_percent,
            repeat_gain_percent,
            worth_a_run: gain_percent >= self.settings.least_gain_percent,
            directions: expected.directions,
            std: expected.std,
            largest_torque: torque.of_all,
        };
        Ok(PlannedMotion { motion, forecast })
    }
}

fn noise_of(estimate: &RunEstimate, reference: &Reference) -> RunNoise {
    RunNoise::new(&estimate.joint_sigma, estimate.rows, reference.duration_s())
}

fn found_bodies(robot: &ParametricModel, known: &RunEstimate) -> Result<Model, SimulationError> {
    let Some(all) = &known.possible else { return Ok(robot.model().clone()) };
    let of_body = |own: &[f64]| InertialParameters(core::array::from_fn(|k| own[k]));
    let bodies: Vec<InertialParameters> = all[..robot.model().inertial_count()].chunks_exact(10).map(of_body).collect();
    Ok(robot.model().with_inertials(&bodies)?)
}

/// Largest torque magnitude along a motion, computed with the model of the search, joint-major, Nm (N).
fn searched_torque(model: &Model, known: &KnownTorque, motion: &Motion) -> Vec<f64> {
    let dof = motion.joints;
    let mut workspace = Workspace::new(model);
    let mut tau = vec![0.0; dof * motion.samples];
    let [mut q, mut dq, mut ddq, mut low, mut high] = [(); 5].map(|()| vec![0.0; dof]);
    for sample in 0..motion.samples {
        for joint in 0..dof {
            let at = joint * motion.samples + sample;
            (q[joint], dq[joint], ddq[joint]) = (motion.q[at], motion.dq[at], motion.ddq[at]);
        }
        let rigid = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq);
        known.range(rigid, [&q, &dq, &ddq], &mut low, &mut high);
        for joint in 0..dof {
            tau[joint * motion.samples + sample] = high[joint].max(-low[joint]);
        }
    }
    tau
}
