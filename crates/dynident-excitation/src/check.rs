//! Independent check of all limits, sample by sample, which shares no code with the optimiser.
//!
//! The check looks names up in the robot description, computes torque by single-sample inverse dynamics with the exact
//! torque of friction and drives (the worst case at rest), and computes distances of links with another algorithm than
//! the search. Only the choice of shapes and pairs, which is part of the limit, comes from
//! [`SelfCollision`](crate::limits::SelfCollision).

mod apart;
mod probes;

use crate::limits::{LimitError, LimitKind, Limits};
use crate::motion::Motion;
use dynident_dynamics::{Workspace, body_placements, inverse_dynamics};
use dynident_model::Model;
use probes::{Probe, probes};
use serde::{Deserialize, Serialize};

/// Excess of a ratio above 1 that is a violation.
pub const VIOLATION: f64 = 1e-6;

/// Rate at which motions of an arm of usual size are checked, Hz. For other sizes use
/// [`CharacteristicScale::round_hertz`], so that a very small or very large robot is sampled as densely relative to
/// its motion.
///
/// [`CharacteristicScale::round_hertz`]: dynident_model::CharacteristicScale::round_hertz
pub const CHECK_RATE_HZ: f64 = 10_000.0;

/// Maximum number of samples of a check. It bounds the time (some minutes), not the memory.
const MAX_SAMPLES: f64 = 1e8;

const BLOCK_SAMPLES: usize = 1000;

/// Worst ratio of a motion to one limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LimitReport {
    /// Kind of the limit.
    pub kind: LimitKind,
    /// Name of the joint; for place limits the name of the point, for self-collision the names of both links.
    pub joint: String,
    /// Ratio to the limit: 1 on the limit, larger in violation. For a range it is `|x - middle| / half range`, for a
    /// limit of the magnitude `|x| / limit`, for a column `2 - distance / minimum distance`. For two links it is 1
    /// plus the missing distance divided by their radii and clearance (at least 5 % of the arm's length), for the
    /// floor 1 plus the depth below it in arm lengths. Infinite if the motion is not finite; JSON then contains the
    /// largest number, 1.8e308.
    #[serde(serialize_with = "largest_for_infinite", deserialize_with = "infinite_for_largest")]
    #[cfg_attr(feature = "schema", schemars(with = "f64"))]
    pub worst_ratio: f64,
    /// Time of the worst ratio, s.
    pub at_s: f64,
    /// Whether the ratio exceeds 1 by more than [`VIOLATION`].
    pub violated: bool,
}

/// Writes an infinite ratio as the largest finite number, because JSON cannot represent infinity.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
fn largest_for_infinite<S: serde::Serializer>(ratio: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(ratio.min(f64::MAX))
}

/// Reads a ratio from JSON; files of earlier versions contain null for infinity.
fn infinite_for_largest<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.filter(|ratio| *ratio < f64::MAX).unwrap_or(f64::INFINITY))
}

/// Checks all limits from 0 to `duration_s` at `rate_hz` (usually [`CHECK_RATE_HZ`]), both ends included. `motion`
/// writes the exact motion at a list of times.
///
/// # Errors
/// Errors of [`Limits::validate`]; a duration or rate that is not positive and finite; more than 10⁸ samples.
pub fn check_limits(
    limits: &Limits,
    model: &Model,
    duration_s: f64,
    rate_hz: f64,
    motion: impl FnMut(&[f64], &mut Motion),
) -> Result<Vec<LimitReport>, LimitError> {
    Ok(check_limits_until(limits, model, duration_s, rate_hz, motion, &|| false)?.unwrap_or_default())
}

/// Like [`check_limits()`] with duration (s) and rate (Hz), but ends without a report when `stop` returns true.
/// `stop` is called every 1000 samples.
///
/// # Errors
/// Same as for [`check_limits()`].
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
    let mut times = Vec::with_capacity(BLOCK_SAMPLES);
    for start in (0..=steps).step_by(BLOCK_SAMPLES) {
        if stop() {
            return Ok(None);
        }
        times.clear();
        times.extend(
            (start..(start + BLOCK_SAMPLES).min(steps + 1)).map(|step| (step as f64 / rate_hz).min(duration_s)),
        );
        motion(&times, &mut check.block);
        check.take_block(&times);
    }
    Ok(Some(check.reports()))
}

fn checked_steps(limits: &Limits, model: &Model, duration_s: f64, rate_hz: f64) -> Result<usize, LimitError> {
    limits.validate(model)?;
    for (what, value) in [("duration", duration_s), ("rate", rate_hz)] {
        if !value.is_finite() || value <= 0.0 {
            return Err(LimitError::NotPositive { what: format!("{what} of the check"), value });
        }
    }
    let steps = (duration_s * rate_hz).ceil();
    if steps >= MAX_SAMPLES {
        let what = "number of samples of the check".to_owned();
        return Err(LimitError::OutOfRange { what, value: steps, at_least: 1.0, below: MAX_SAMPLES });
    }
    Ok(steps as usize)
}

/// A check in progress: the largest ratios of the processed samples, and work arrays.
struct Check<'a> {
    limits: &'a Limits,
    model: &'a Model,
    probes: Vec<(Probe, LimitReport)>,
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

    fn take_block(&mut self, times: &[f64]) {
        let Self { limits, model, probes, block, dynamics, kinematics, state, torque } = self;
        for (sample, &at_s) in times.iter().enumerate() {
            for (state, from) in state.iter_mut().zip(block.arrays()) {
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
