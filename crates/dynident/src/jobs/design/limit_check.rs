//! Check of a motion against its limits, with a diagnosis of violations.

use super::setup::DesignSetup;
use crate::error::Error;
use dynident_excitation::check::{LimitReport, VIOLATION, check_limits, check_limits_until};
use dynident_excitation::limits::{LimitSet, Relaxation, diagnose_until};
use dynident_excitation::{Motion, grid};
use std::path::Path;

/// Sampling rate of the diagnosis for an arm of 1.2 m, Hz.
const DIAGNOSIS_RATE_HZ: f64 = 1000.0;

/// Both sampling rates are divided by this after a stop request.
const STOPPED_RATE_DIVISOR: f64 = 10.0;

pub(super) struct LimitCheck {
    /// For every limit, the ratio of value to limit at the worst instant of the motion.
    pub(super) reports: Vec<LimitReport>,
    pub(super) rate_hz: f64,
    pub(super) of: &'static str,
    /// Reasons for violated limits, as sentences; empty without violations.
    pub(super) diagnosis: Vec<String>,
}

/// Search for single limit changes that would make another motion feasible, and a stop request.
pub(super) type SingleChanges<'a> = (&'a dyn Fn() -> Result<Vec<Relaxation>, Error>, &'a dyn Fn() -> bool);

impl LimitCheck {
    /// Checks the motion at `rate_hz`, or at a tenth of it after a stop request. If a limit is violated, `single`
    /// searches for changes of single limits that would make another motion feasible.
    ///
    /// # Errors
    /// Invalid limits for the robot.
    pub(super) fn of(
        setup: &DesignSetup,
        study_path: &Path,
        duration_s: f64,
        rate_hz: f64,
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
            let rate_hz = rate_hz / STOPPED_RATE_DIVISOR;
            let reports = check_limits(&setup.limits, model, duration_s, rate_hz, motion_at);
            (reports.map_err(in_limits)?, rate_hz)
        };
        let broken = reports.iter().any(|report| report.violated);
        let diagnosis =
            if broken { sentences(&setup.set, duration_s, &reports, motion_at, single()?, stop) } else { Vec::new() };
        Ok(Self { reports, rate_hz, of, diagnosis })
    }

    pub(super) fn is_kept(&self) -> bool {
        self.diagnosis.is_empty() && self.reports.iter().all(|report| !report.violated)
    }

    /// Adds the check of a later piece, which starts at `after_s`: for each limit the worse report is kept.
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

fn sentences(
    set: &LimitSet,
    duration_s: f64,
    reports: &[LimitReport],
    motion_at: &dyn Fn(&[f64], &mut Motion),
    single: Vec<Relaxation>,
    stop: &dyn Fn() -> bool,
) -> Vec<String> {
    let rate_hz = set.model().characteristic_scale().round_hertz(DIAGNOSIS_RATE_HZ)
        / if stop() { STOPPED_RATE_DIVISOR } else { 1.0 };
    let times = grid(duration_s, (duration_s * rate_hz).ceil() as usize + 1);
    let mut motion = Motion::default();
    motion_at(&times, &mut motion);
    let mut diagnosis = diagnose_until(set, &times, &motion, stop);
    diagnosis.take_single(single);
    let sentences = diagnosis.sentences();
    if !sentences.is_empty() {
        return sentences;
    }
    // The violation is between the samples of the diagnosis.
    let broken = reports.iter().filter(|report| report.violated).map(|report| {
        let excess = 100.0 * (report.worst_ratio - 1.0).max(VIOLATION);
        format!("The {} limit of `{}` is exceeded by {excess:.4} % at {:.4} s.", report.kind, report.joint, report.at_s)
    });
    broken.collect()
}
