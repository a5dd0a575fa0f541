//! Desired motion and tracking error of a run, from its log.

use dynident_iteration::IterationStore;
use dynident_iteration::robot::read_log_table;
use dynident_simulation::Reference;

/// A trajectory of a run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct RunName {
    pub(crate) run: usize,
    /// Number of the trajectory, if the run has several.
    pub(crate) leg: Option<usize>,
    /// Index of the trajectory within the run.
    pub(crate) place: usize,
}

/// Desired motion and tracking error of a run.
pub(crate) struct RunTrace {
    pub(crate) name: RunName,
    /// Sample times of the trajectory, s.
    pub(crate) times_s: Vec<f64>,
    /// Desired position of each joint, rad (m).
    pub(crate) desired: Vec<Vec<f64>>,
    /// Desired minus measured position of each joint, rad (m); NaN after the end of the run.
    pub(crate) error: Vec<Vec<f64>>,
}

impl RunTrace {
    /// Reads the log of the run. If the log is unreadable, the plot is empty, so that the page can still be written.
    pub(crate) fn new(name: RunName, store: &IterationStore, reference: &Reference, joints: &[String]) -> Self {
        let log = if name.place == 0 { "log.csv".to_owned() } else { format!("log_{}.csv", name.place + 1) };
        let (motion, rate_hz) = (reference.motion(), reference.rate_hz());
        let times_s: Vec<f64> = (0..motion.samples).map(|sample| sample as f64 / rate_hz).collect();
        let record = read_log_table(&store.run_folder(name.run).join(log), joints, rate_hz).ok();
        let error = (0..joints.len()).map(|joint| {
            let target = &motion.q[motion.of(joint)];
            let Some(record) = &record else { return vec![f64::NAN; motion.samples] };
            let own = &record.q[record.of(joint)];
            let measured = times_s.iter().map(|time_s| between(&record.times_s, own, *time_s));
            target.iter().zip(measured).map(|(target, measured)| target - measured).collect()
        });
        let desired = (0..joints.len()).map(|joint| motion.q[motion.of(joint)].to_vec());
        Self { name, desired: desired.collect(), error: error.collect(), times_s }
    }
}

/// Linear interpolation; NaN after the last sample.
fn between(times_s: &[f64], values: &[f64], time_s: f64) -> f64 {
    let after = times_s.partition_point(|time| *time < time_s);
    match (after, times_s.get(after)) {
        // Tolerance for rounding of the last sample time.
        (_, None) => times_s.last().filter(|last| time_s - **last < 1e-9).map_or(f64::NAN, |_| values[after - 1]),
        (0, Some(_)) => values[0],
        (_, Some(next)) => {
            let share = (time_s - times_s[after - 1]) / (next - times_s[after - 1]);
            values[after - 1] + share * (values[after] - values[after - 1])
        }
    }
}
