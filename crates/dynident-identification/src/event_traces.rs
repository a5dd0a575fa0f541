//! Torque around the events of a log, for plots in the report.

use crate::examination::EventTrace;
use dynident_events::{EventSearch, LogEvent};

/// Maximum number of events of one log with a plot. A log with more events has the same event many times.
const MAX_TRACES: usize = 12;
/// Minimum time that is shown before and after an event, s.
const MIN_MARGIN_S: f64 = 1.0;
/// Time that is shown before and after a long event, relative to its duration.
const MARGIN_SHARE: f64 = 0.5;

/// Measured and predicted torque around each event, for one joint each. `joints` are the names of the model's joints.
pub fn event_traces(search: &EventSearch, joints: &[String]) -> Vec<EventTrace> {
    search.events.iter().take(MAX_TRACES).filter_map(|event| trace(search, joints, event)).collect()
}

fn trace(search: &EventSearch, joints: &[String], event: &LogEvent) -> Option<EventTrace> {
    let margin_s = MIN_MARGIN_S.max(MARGIN_SHARE * (event.to_s - event.from_s));
    let within = |from_s: f64, to_s: f64| {
        let first = search.time_s.partition_point(|time_s| *time_s < from_s);
        first..search.time_s.partition_point(|time_s| *time_s <= to_s).max(first)
    };
    let (inside, shown) = (within(event.from_s, event.to_s), within(event.from_s - margin_s, event.to_s + margin_s));
    let is_of_event = |joint: &usize| event.joints.contains(&joints[*joint]);
    let size = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64;
    let strength = |joint: usize| {
        let residuals = &search.residuals[joint];
        size(&residuals[inside.clone()]) / size(residuals).max(f64::MIN_POSITIVE)
    };
    let joint = (0..joints.len()).filter(is_of_event).max_by(|a, b| strength(*a).total_cmp(&strength(*b)))?;
    let measured_nm = search.measured[joint][shown.clone()].to_vec();
    let predicted =
        measured_nm.iter().zip(&search.residuals[joint][shown.clone()]).map(|(measured, residual)| measured - residual);
    Some(EventTrace {
        event: event.clone(),
        joint: joints[joint].clone(),
        time_s: search.time_s[shown].to_vec(),
        predicted_nm: predicted.collect(),
        measured_nm,
    })
}
