//! Intervals of a log that no single model of the robot explains.
//!
//! Each log is searched separately, so that different tools or days do not matter. Every joint gets a separate linear
//! model: base parameters of the bodies, offset, friction, drive inertia. The first fit uses the most consistent 60 %
//! of the log. An interval is an event if its rows clearly increase the sum of squared errors (SSE) of the fit:
//!
//! ```text
//! excess = (SSE(rest + interval) - SSE(rest)) / bins of the interval
//! ```
//!
//! Unusual motion alone does not increase the residuals of a joint's fit, but torque of another origin does. `excess`
//! is compared with the usual residual variance of the joint in the same state of motion. It is also compared with the
//! largest `excess` of other intervals of the same length, which accounts for model errors and for the number of tested
//! intervals.

#![forbid(unsafe_code)]

mod classify;
mod contact;
mod found;
mod holes;
mod kind;
mod noise;
mod normal;
mod overflow;
mod quiet;
mod robust;
mod rows;
mod scan;
mod settings;
mod trend;

pub use kind::{EventKind, LogEvent};
pub use settings::{
    BinSettings, DrivesOffSettings, EventChoice, EventSettings, EventSettingsError, FilledHoleSettings,
    IntervalSettings, KindSettings, OverflowSettings, RobustFitSettings, StopSettings, TrendSettings,
    UsualResidualSettings,
};

use dynident_dynamics::ParametricModel;
use dynident_rows::{LogError, LogPass};
use found::{of_filled_hole, of_interval, of_overflow, of_trend};
use holes::straight_lines;
use overflow::overflows;
use rows::LogRows;
use scan::scan;
use trend::{Trend, trends};

/// Events of one log, and the residuals in which they were found.
#[derive(Clone, Debug, Default)]
pub struct EventSearch {
    /// Events in order of time; slow changes last.
    pub events: Vec<LogEvent>,
    /// Length of a bin of the residuals, s.
    pub bin_s: f64,
    /// Centre of each bin, s after the first data row of the file.
    pub time_s: Vec<f64>,
    /// Measured torque of each joint in each bin, Nm or N.
    pub measured: Vec<Vec<f64>>,
    /// Residual of each joint in each bin, from the model that fits the bins outside all events, Nm or N.
    pub residuals: Vec<Vec<f64>>,
}

/// Searches one log for events. The result is empty if the log is shorter than
/// [`min_duration_s`](EventSettings::min_duration_s) or has too few rows.
///
/// # Errors
/// The log cannot be read.
pub fn find_events(
    pass: &LogPass<'_>,
    robot: &ParametricModel,
    settings: &EventSettings,
) -> Result<EventSearch, LogError> {
    let Some(mut rows) = LogRows::read(pass, robot, settings)? else { return Ok(EventSearch::default()) };
    let duration_s = rows.len() as f64 * rows.bin_s;
    let parameters = rows.width.iter().copied().max().unwrap_or(0);
    if duration_s < settings.min_duration_s || rows.len() < settings.bins.min_bins_per_parameter * parameters {
        return Ok(EventSearch::default());
    }
    let lines = straight_lines(&rows.samples, &settings.filled_hole);
    rows.leave_out(&lines, settings.filled_hole.margin_s);
    let overflows = overflows(&rows);
    for one in &overflows {
        rows.leave_out(&one.times_s, settings.overflow.margin_bins * rows.bin_s);
    }
    let plain = rows.without_presliding();
    let Some(scan) = scan(&plain, &rows) else { return Ok(EventSearch::default()) };
    let mut events: Vec<LogEvent> = scan.intervals.iter().map(|one| of_interval(&rows, robot, &scan, one)).collect();
    let names = robot.joint_names();
    events.extend(lines.iter().map(|&times_s| of_filled_hole(&rows, &scan, &names, times_s)));
    for one in &overflows {
        let share: f64 = one.times_s.iter().map(|[from_s, to_s]| to_s - from_s).sum::<f64>() / duration_s;
        let is_clear = share <= settings.max_share;
        events.extend(one.times_s.iter().map(|&times_s| of_overflow(one, times_s, &names, is_clear, duration_s)));
    }
    events.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    let trends = [&plain, &rows].map(|rows| trends(rows, &scan));
    let is_confirmed = |one: &&Trend| trends[1].iter().any(|other| (other.joint, other.kind) == (one.joint, one.kind));
    events.extend(trends[0].iter().filter(is_confirmed).map(|trend| of_trend(&rows, trend, &names)));
    let LogRows { bin_s, time_s, tau, .. } = rows;
    Ok(EventSearch { events, bin_s, time_s, measured: tau, residuals: scan.residuals })
}
