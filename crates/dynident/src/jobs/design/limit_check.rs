//! Whether a motion keeps its limits, and why not.

use super::setup::DesignSetup;
use crate::error::Error;
use dynident_excitation::check::{LimitReport, VIOLATION, check_limits, check_limits_until};
use dynident_excitation::limits::{LimitSet, Relaxation, diagnose_until};
use dynident_excitation::{Motion, grid};
use std::path::Path;

/// Rate of the diagnosis, Hz of a usual arm.
const DIAGNOSIS_RATE_HZ: f64 = 1000.0;

/// Divisor of both rates after a stop was requested.
const COARSER: f64 = 10.0;

/// Every limit as a motion uses it.
pub(super) struct LimitCheck {
    /// Every limit at the motion's worst moment.
    pub(super) reports: Vec<LimitReport>,
    /// Samples a second that were looked at.
    pub(super) rate_hz: f64,
    /// What was looked at.
    pub(super) of: &'static str,
    /// Why limits are broken, in sentences; empty if none is.
    pub(super) diagnosis: Vec<String>,
}

/// A search for changes of one limit that would make another motion possible, and whether it has to stop.
pub(super) type SingleChanges<'a> = (&'a dyn Fn() -> Result<Vec<Relaxation>, Error>, &'a dyn Fn() -> bool);

impl LimitCheck {
    /// Looks at the motion `rate_hz` times a second, ten times more rarely once `stop` says so. If it breaks a limit,
    /// `single` looks for changes of one limit that would make another motion possible.
    ///
    /// # Errors
    /// Limits that make no sense for the robot.
    pub(super) fn of(
        setup: &DesignSetup,
        study_path: &Path,
        (duration_s, rate_hz): (f64, f64),
        of: &'static str,
        motion_at: &dyn Fn(&[f64], &mut Motion),
        (single, stop): SingleChanges<'_>,
    ) -> Result<Self, Error> {
        let model = &setup.loaded;
        let in_limits = |error| Error::section(study_path, "design.limits")(error);
        let whole =
            check_limits_until(&setup.limits, model, duration_s, rate_hz, motion_at, stop).map_err(in_limits)?;
        let (reports, rate_hz) = if let Some(reports) = whole {
            (reports, rate_hz)
        } else {
            let rate_hz = rate_hz / COARSER;
            let reports = check_limits(&setup.limits, model, duration_s, rate_hz, motion_at);
            (reports.map_err(in_limits)?, rate_hz)
        };
        let broken = reports.iter().any(|report| report.violated);
        let diagnosis =
            if broken { sentences(&setup.set, duration_s, &reports, motion_at, single()?, stop) } else { Vec::new() };
        Ok(Self { reports, rate_hz, of, diagnosis })
    }

    /// Whether every limit is kept.
    pub(super) fn kept(&self) -> bool {
        self.diagnosis.is_empty() && self.reports.iter().all(|report| !report.violated)
    }

    /// Takes in the check of a later piece, which begins `after_s` into the whole: of each limit the worse report
    /// stays.
    pub(super) fn append(&mut self, later: Self, after_s: f64) {
        let first = self.reports.is_empty();
        for (place, mut report) in later.reports.into_iter().enumerate() {
            report.at_s += after_s;
            if first {
                self.reports.push(report);
            } else if report.worst_ratio > self.reports[place].worst_ratio {
                self.reports[place] = report;
            }
        }
        self.diagnosis.extend(later.diagnosis);
    }
}

/// Why the motion is not feasible.
fn sentences(
    set: &LimitSet,
    duration_s: f64,
    reports: &[LimitReport],
    motion_at: &dyn Fn(&[f64], &mut Motion),
    single: Vec<Relaxation>,
    stop: &dyn Fn() -> bool,
) -> Vec<String> {
    let rate_hz = set.model().own_scale().round_hertz(DIAGNOSIS_RATE_HZ) / if stop() { COARSER } else { 1.0 };
    let times = grid(duration_s, (duration_s * rate_hz).ceil() as usize + 1);
    let mut motion = Motion::default();
    motion_at(&times, &mut motion);
    let mut diagnosis = diagnose_until(set, &times, &motion, stop);
    diagnosis.take_single(single);
    let sentences = diagnosis.sentences();
    if !sentences.is_empty() {
        return sentences;
    }
    // Broken between the diagnosis' samples only.
    let broken = reports.iter().filter(|report| report.violated).map(|report| {
        let excess = 100.0 * (report.worst_ratio - 1.0).max(VIOLATION);
        format!("The {} limit of `{}` is exceeded by {excess:.4} % at {:.4} s.", report.kind, report.joint, report.at_s)
    });
    broken.collect()
}
