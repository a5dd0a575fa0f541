//! Measured and predicted torque over time, for plots in the report.

use super::motion_trace::MotionTrace;
use dynident_events::LogEvent;
use dynident_rows::{JointRows, RawSamples, RegressorModel, Role, predicted_torque};

/// Maximum number of rows of one joint; enough for a plot, and it limits the memory.
const MAX_ROWS: usize = 100_000;

/// Torque of one joint over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointTrace {
    /// Measured torque after the filter of the fit, Nm (N); NaN in gaps and for unused rows.
    pub measured_nm: Vec<f64>,
    /// Torque that the base parameters predict, Nm (N); NaN in gaps and for unused rows.
    pub predicted_nm: Vec<f64>,
}

/// Torque of one joint around an event, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct EventTrace {
    /// The event.
    pub event: LogEvent,
    /// Name of the joint with the largest residual in the interval, relative to its usual residual.
    pub joint: String,
    /// Time, s after the first data row of the file.
    pub time_s: Vec<f64>,
    /// Measured torque, Nm or N, averaged over bins.
    pub measured_nm: Vec<f64>,
    /// Torque that a model of the rest of the log predicts, Nm or N.
    pub predicted_nm: Vec<f64>,
}

/// Measured and predicted torque of the first samples of one log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogTrace {
    /// The log.
    pub log: String,
    /// Role of the log.
    pub role: Role,
    /// Rate of the rows, Hz.
    pub rate_hz: f64,
    /// Time of each row, s after the first data row of the file. Rows at the ends of a segment are missing.
    pub time_s: Vec<f64>,
    /// Whether the log has later rows that are omitted.
    pub cut: bool,
    /// Torque of each joint, in the order of the model.
    pub joints: Vec<JointTrace>,
    /// Motion of the first minute.
    pub motion: MotionTrace,
    /// Torque around the events of the log.
    pub events: Vec<EventTrace>,
}

/// Collects a [`LogTrace`].
#[derive(Debug)]
pub(crate) struct TraceConsumer<'a> {
    model: &'a RegressorModel,
    theta: &'a [f64],
    trace: LogTrace,
    segment: Option<usize>,
    /// For each segment, the index and the time (s) of its first row.
    starts: Vec<(usize, f64)>,
    buffer: Vec<f64>,
    max_rows: usize,
}

impl<'a> TraceConsumer<'a> {
    pub(crate) fn new(model: &'a RegressorModel, theta: &'a [f64]) -> Self {
        let dof = model.model().dof();
        let (joints, motion) = (vec![JointTrace::default(); dof], MotionTrace::new(dof));
        let trace = LogTrace { joints, motion, ..LogTrace::default() };
        Self { model, theta, trace, segment: None, starts: Vec::new(), buffer: Vec::new(), max_rows: MAX_ROWS }
    }

    /// Keeps all rows, for an estimate from them.
    pub(crate) fn with_all_rows(self) -> Self {
        Self { max_rows: usize::MAX, ..self }
    }

    pub(crate) fn raw(&mut self, samples: &RawSamples<'_>) {
        self.trace.motion.add(self.model, self.theta, samples, &mut self.buffer);
        if self.segment != Some(samples.segment) {
            self.segment = Some(samples.segment);
            for JointTrace { measured_nm, predicted_nm } in &mut self.trace.joints {
                if measured_nm.last().is_some_and(|value| !value.is_nan()) {
                    measured_nm.push(f64::NAN);
                    predicted_nm.push(f64::NAN);
                }
            }
            let first = self.trace.joints.first().map_or(0, |joint| joint.measured_nm.len());
            self.starts.push((first, samples.first_time_s + samples.reach as f64 / samples.rate_hz));
        }
    }

    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>) {
        let columns = self.model.layout().joint_columns(rows.joint);
        let JointTrace { measured_nm, predicted_nm } = &mut self.trace.joints[rows.joint];
        let kept = rows.rows.min(self.max_rows.saturating_sub(measured_nm.len()));
        self.trace.cut |= kept < rows.rows;
        if kept > 0 {
            predicted_torque(rows.panel, rows.rows, columns, self.theta, &mut self.buffer);
            let counts = |row: usize| if rows.counts(row) { 1.0 } else { f64::NAN };
            let measured = &rows.panel[columns.len() * rows.rows..];
            predicted_nm.extend((0..kept).map(|row| counts(row) * self.buffer[row]));
            measured_nm.extend((0..kept).map(|row| counts(row) * measured[row]));
        }
    }

    pub(crate) fn finished(self, log: String, role: Role, rate_hz: f64) -> LogTrace {
        let rows = self.trace.joints.iter().map(|joint| joint.measured_nm.len()).min().unwrap_or(0);
        let mut time_s = Vec::with_capacity(rows);
        for (place, &(first, start_s)) in self.starts.iter().enumerate() {
            let end = self.starts.get(place + 1).map_or(rows, |next| next.0).min(rows);
            time_s.extend((first..end).map(|row| start_s + (row - first) as f64 / rate_hz));
        }
        LogTrace { log, role, rate_hz, time_s, ..self.trace }
    }
}
