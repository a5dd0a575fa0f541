//! The last word on limits: every limit looked at again, sample by sample, by code that shares nothing with the
//! optimiser's.
//!
//! Plain loops over the description: names are looked up here, torques come from single-sample inverse dynamics and the
//! exact known torque of friction and drives (the worst case at rest), distances of links from another algorithm than
//! the search's. Only the choice of shapes and their pairs, which is part of what the limit *is*, comes from
//! [`SelfCollision`](crate::limits::SelfCollision).

mod apart;
mod probes;

use crate::limits::{LimitError, LimitKind, Limits};
use crate::motion::Motion;
use dynident_dynamics::{Workspace, body_placements, inverse_dynamics};
use dynident_model::Model;
use probes::{Probe, probes};
use serde::{Deserialize, Serialize};

/// A ratio above 1 by more than this is a violation.
pub const VIOLATION: f64 = 1e-6;

/// The rate that the project checks motions of usual arms at; of others by [`OwnScale::round_hertz`], so that a motion
/// of a watch or a crane is looked at as often.
///
/// [`OwnScale::round_hertz`]: dynident_model::OwnScale::round_hertz
pub const CHECK_RATE_HZ: f64 = 10_000.0;

/// Most samples that a check looks at: a bound on its time (some minutes), not on memory.
const MOST_SAMPLES: f64 = 1e8;

/// Samples asked from the motion at once.
const BLOCK: usize = 1000;

/// How near a motion comes to one limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LimitReport {
    /// What is limited.
    pub kind: LimitKind,
    /// The joint; for places the point, for self-collision the pair of links.
    pub joint: String,
    /// 1 on the limit, above it in violation: `|x - middle| / half range`, `|x| / limit`; for a column `2 - distance /
    /// least`, for two links 1 plus the lack of distance as a share of their radii and clearance (of 5 % of the arm's
    /// length at least), for the floor 1 plus the arm's lengths below it. Infinite if the motion is not finite: in
    /// JSON the largest number, 1.8e308.
    #[serde(serialize_with = "largest_for_infinite", deserialize_with = "infinite_for_largest")]
    #[cfg_attr(feature = "schema", schemars(with = "f64"))]
    pub worst_ratio: f64,
    /// When the ratio is worst, s.
    pub at_s: f64,
    /// True if the limit is broken by more than [`VIOLATION`].
    pub violated: bool,
}

/// A ratio as JSON has it, which knows no infinity.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
fn largest_for_infinite<S: serde::Serializer>(ratio: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(ratio.min(f64::MAX))
}

/// A ratio from JSON; files of earlier versions have null for infinity.
fn infinite_for_largest<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.filter(|ratio| *ratio < f64::MAX).unwrap_or(f64::INFINITY))
}

/// Checks all limits from 0 to `duration_s` at `rate_hz` ([`CHECK_RATE_HZ`]), the end included. `motion` gives the
/// exact motion at a list of times.
///
/// # Errors
/// As [`Limits::validate`]; a duration or rate that is not positive and finite, or more than 10⁸ samples.
pub fn check_limits(
    limits: &Limits,
    model: &Model,
    duration_s: f64,
    rate_hz: f64,
    motion: impl FnMut(&[f64], &mut Motion),
) -> Result<Vec<LimitReport>, LimitError> {
    Ok(check_limits_until(limits, model, duration_s, rate_hz, motion, &|| false)?.unwrap_or_default())
}

/// [`check_limits()`] at duration (s) and rate (Hz), which ends without a report once `stop` is true. `stop` is called
/// every 1000 samples.
///
/// # Errors
/// As [`check_limits()`].
pub fn check_limits_until(
    limits: &Limits,
    model: &Model,
    duration_s: f64,
    rate_hz: f64,
    mut motion: impl FnMut(&[f64], &mut Motion),
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<LimitReport>>, LimitError> {
    let steps = checked_steps(limits, model, duration_s, rate_hz)?;
    let mut check = Check::new(limits, model)?;
    let mut times = Vec::with_capacity(BLOCK);
    for start in (0..=steps).step_by(BLOCK) {
        if stop() {
            return Ok(None);
        }
        times.clear();
        times.extend((start..(start + BLOCK).min(steps + 1)).map(|step| (step as f64 / rate_hz).min(duration_s)));
        motion(&times, &mut check.block);
        check.take_block(&times);
    }
    Ok(Some(check.reports()))
}

/// Steps of a check of valid limits.
fn checked_steps(limits: &Limits, model: &Model, duration_s: f64, rate_hz: f64) -> Result<usize, LimitError> {
    limits.validate(model)?;
    for (what, value) in [("duration", duration_s), ("rate", rate_hz)] {
        if !value.is_finite() || value <= 0.0 {
            return Err(LimitError::NotPositive { what: format!("{what} of the check"), value });
        }
    }
    let steps = (duration_s * rate_hz).ceil();
    if steps >= MOST_SAMPLES {
        let what = "number of samples of the check".to_owned();
        return Err(LimitError::OutOfRange { what, value: steps, at_least: 1.0, below: MOST_SAMPLES });
    }
    Ok(steps as usize)
}

/// A check in progress: the largest ratio of each limit up to now, and work arrays.
struct Check<'a> {
    limits: &'a Limits,
    model: &'a Model,
    probes: Vec<(Probe, LimitReport)>,
    /// The motion at the samples of one block.
    block: Motion,
    dynamics: Workspace,
    kinematics: Workspace,
    state: Vec<Vec<f64>>,
    torque: [Vec<f64>; 2],
}

impl<'a> Check<'a> {
    fn new(limits: &'a Limits, model: &'a Model) -> Result<Self, LimitError> {
        let dof = model.dof();
        Ok(Self {
            limits,
            model,
            probes: probes(limits, model)?,
            block: Motion::default(),
            dynamics: Workspace::new(model),
            kinematics: Workspace::new(model),
            state: vec![vec![0.0; dof]; 4],
            torque: [vec![0.0; dof], vec![0.0; dof]],
        })
    }

    /// Compares the samples of the block, which are at `times`, with all limits.
    fn take_block(&mut self, times: &[f64]) {
        let Self { limits, model, probes, block, dynamics, kinematics, state, torque } = self;
        for (sample, &at_s) in times.iter().enumerate() {
            for (state, from) in state.iter_mut().zip([&block.q, &block.dq, &block.ddq, &block.dddq]) {
                for (joint, to) in state.iter_mut().enumerate() {
                    *to = from[joint * times.len() + sample];
                }
            }
            let rigid = inverse_dynamics(model, dynamics, &state[0], &state[1], &state[2]);
            let [low, high] = &mut *torque;
            limits.known_torque.range(rigid, [&state[0], &state[1], &state[2]], low, high);
            let placements = body_placements(model, kinematics, &state[0]);
            for (probe, report) in &mut *probes {
                let ratio = probe.ratio(state, torque, placements, report.worst_ratio);
                let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
                if ratio > report.worst_ratio {
                    (report.worst_ratio, report.at_s) = (ratio, at_s);
                }
            }
        }
    }

    fn reports(self) -> Vec<LimitReport> {
        let finish = |(_, mut report): (Probe, LimitReport)| {
            report.violated = report.worst_ratio > 1.0 + VIOLATION;
            report
        };
        self.probes.into_iter().map(finish).collect()
    }
}
