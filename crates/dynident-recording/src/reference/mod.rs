//! The commanded motion, for differentiators that need it.
//!
//! [`Reference`] gives the commanded motion at any time, from samples or from the closed form of [`LogisticPath`]s. It
//! also contains its [`Stroke`]s, the parts of the motion between rests. [`ReferenceSettings`] contains its settings in
//! a study file.

mod logistic_path;
mod settings;
mod stroke;

pub use logistic_path::LogisticPath;
pub use settings::ReferenceSettings;
pub use stroke::Stroke;

use crate::error::{FilterError, RecordingError};
use crate::log::{
    ChannelGroup, ClockRule, ColumnRef, Columns, Header, Log, LogFormat, LogReader, RawBlock, TimeColumn,
};
use std::path::Path;
use stroke::{between, share_rests, strokes_of};

const MAX_SAMPLES: usize = 10_000_000;
/// Maximum velocity and maximum acceleration of a joint at rest, as shares of their peaks.
const MAX_REST_SHARES: [f64; 2] = [1e-3, 1e-2];

/// Commanded position, velocity and acceleration of every joint at any time: from samples (the `trajectory.csv` of
/// `design`), or from the closed form of logistic strokes ([`LogisticPath`]).
#[derive(Clone, Debug)]
pub struct Reference {
    joints: Vec<JointReference>,
    start_s: f64,
}

#[derive(Clone, Debug)]
struct JointReference {
    path: JointPath,
    /// Maximum velocity and acceleration.
    peak: [f64; 2],
    strokes: Vec<Stroke>,
}

#[derive(Clone, Debug)]
enum JointPath {
    Sampled(ReferenceTable),
    Logistic(LogisticPath),
}

/// Samples of one joint, interpolated by the quintic polynomial with the position, velocity and acceleration of both
/// neighbouring samples.
#[derive(Clone, Debug)]
struct ReferenceTable {
    times_s: std::sync::Arc<[f64]>,
    /// Position q, velocity dq and acceleration ddq of each sample.
    values: Vec<[f64; 3]>,
}

impl Reference {
    /// Creates a commanded motion from samples: `joints[j]` contains position q, velocity dq and acceleration ddq of
    /// joint j at the increasing times `times_s` (rad, rad/s, rad/s²; m for prismatic joints).
    ///
    /// Between samples, a quintic polynomial with the q, dq and ddq of both neighbouring samples is used. For a smooth
    /// motion with the step h, its error is `h⁶/46080` times the sixth derivative. Before the first and after the last
    /// sample the joint is at rest.
    ///
    /// # Errors
    /// [`FilterError::Reference`] for fewer than two samples, lists of unequal length, times that do not increase, or
    /// values that are not finite.
    pub fn sampled(times_s: &[f64], joints: &[[Vec<f64>; 3]]) -> Result<Self, FilterError> {
        let wrong = |problem: String| FilterError::Reference { problem };
        if times_s.len() < 2 || times_s.len() > MAX_SAMPLES || joints.is_empty() {
            return Err(wrong(format!(
                "{} samples of {} joints: give two samples or more",
                times_s.len(),
                joints.len()
            )));
        }
        if times_s.windows(2).any(|pair| pair[1] <= pair[0]) || times_s.iter().any(|t| !t.is_finite()) {
            return Err(wrong("the times do not increase from row to row".to_owned()));
        }
        let times: std::sync::Arc<[f64]> = times_s.into();
        let joints = joints
            .iter()
            .enumerate()
            .map(|(joint, columns)| {
                if columns.iter().any(|column| column.len() != times.len() || column.iter().any(|x| !x.is_finite())) {
                    return Err(wrong(format!(
                        "joint {joint} (0-based): q, dq and ddq need one finite number per time"
                    )));
                }
                let [q, dq, ddq] = columns;
                let values: Vec<[f64; 3]> = (0..times.len()).map(|i| [q[i], dq[i], ddq[i]]).collect();
                let largest = |order: usize| values.iter().fold(0.0_f64, |max, value| max.max(value[order].abs()));
                let peak = [largest(1), largest(2)];
                let resting: Vec<bool> = values.iter().map(|value| rests(value, peak)).collect();
                let strokes = strokes_of(&times, &values, &resting);
                Ok(JointReference {
                    path: JointPath::Sampled(ReferenceTable { times_s: times.clone(), values }),
                    peak,
                    strokes,
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { joints, start_s: 0.0 })
    }

    /// Creates a commanded motion from spliced logistic functions, one for each joint.
    ///
    /// # Errors
    /// [`FilterError::Reference`] for an invalid path ([`LogisticPath::validate`]).
    pub fn logistic(paths: &[LogisticPath]) -> Result<Self, FilterError> {
        let joints = paths
            .iter()
            .map(|path| {
                path.validate()?;
                let peak = path.peaks();
                Ok(JointReference { path: JointPath::Logistic(*path), peak, strokes: path.strokes() })
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        Ok(Self { joints, start_s: 0.0 })
    }

    /// Reads a table in the format that `design` writes: columns `t_s`, `q1..`, `dq1..`, `ddq1..`, with numbers from 1
    /// to `joints`, SI units. Time is relative to its first row.
    ///
    /// # Errors
    /// As [`LogReader`], and as [`sampled`](Self::sampled).
    pub fn read(file: &Path, joints: usize) -> Result<Self, RecordingError> {
        let columns = |name: &str| {
            ChannelGroup::new(Columns::List((1..=joints).map(|j| ColumnRef::Name(format!("{name}{j}"))).collect()))
        };
        let time = TimeColumn::seconds(ColumnRef::Name("t_s".to_owned()));
        let format = LogFormat {
            header: Header::Present,
            velocity: Some(columns("dq")),
            acceleration: Some(columns("ddq")),
            clock: ClockRule::Stamps,
            max_gap_steps: 1000.0,
            bridge_gaps: false,
            // A log needs a torque. The positions are used as torque, because a reference has none.
            ..LogFormat::with_time(time, columns("q"), columns("q"))
        };
        let names: Vec<String> = (1..=joints).map(|j| format!("joint {j}")).collect();
        let mut reader = LogReader::open(&Log::file(file, format, &names))?;
        let (mut times, mut block) = (Vec::new(), RawBlock::default());
        let mut table = vec![[Vec::new(), Vec::new(), Vec::new()]; joints];
        while reader.next_block(&mut block)? {
            times.extend_from_slice(&block.time_s);
            for (joint, columns) in table.iter_mut().enumerate() {
                for (column, values) in columns.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
                    column.extend_from_slice(&values[joint]);
                }
            }
            if times.len() > MAX_SAMPLES {
                break;
            }
        }
        Self::sampled(&times, &table).map_err(|source| match source {
            FilterError::Reference { problem } => RecordingError::Reference { file: file.to_owned(), problem },
            other => RecordingError::Filter(other),
        })
    }

    /// Sets the start of the motion, s after the first row of the log.
    #[must_use]
    pub fn starting_at(mut self, start_s: f64) -> Self {
        self.start_s = start_s;
        self
    }

    /// Defines the strokes by successive times `boundaries_s` (s after the start of the motion), for motions that
    /// reverse without a rest. Joints that never move have no strokes.
    ///
    /// # Errors
    /// [`FilterError::Reference`] for fewer than two boundaries, or boundaries that are not finite or do not increase.
    pub fn with_boundaries(mut self, boundaries_s: &[f64]) -> Result<Self, FilterError> {
        check_boundaries(boundaries_s)?;
        let start_s = core::mem::take(&mut self.start_s);
        for joint in 0..self.joints.len() {
            if self.joints[joint].peak[0] > 0.0 {
                let stroke = |ends: &[f64]| between(ends[0], ends[1], |t| (self.at(joint, t)[1], self.rests(joint, t)));
                let mut strokes: Vec<Stroke> = boundaries_s.windows(2).map(stroke).collect();
                share_rests(&mut strokes);
                self.joints[joint].strokes = strokes;
            }
        }
        self.start_s = start_s;
        Ok(self)
    }

    /// Reorders the joints: joint `j` of the new reference is joint `order[j]` of this one; `None` for an invalid
    /// index.
    pub fn reordered(&self, order: &[usize]) -> Option<Self> {
        let joints = order.iter().map(|&joint| self.joints.get(joint).cloned()).collect::<Option<Vec<_>>>()?;
        Some(Self { joints, start_s: self.start_s })
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Period of a repeated motion, s: the duration of the table, or the period of all closed forms; `None` if their
    /// periods differ.
    pub fn period_s(&self) -> Option<f64> {
        let period = |joint: &JointReference| match &joint.path {
            JointPath::Sampled(sampled) => sampled.times_s[sampled.times_s.len() - 1] - sampled.times_s[0],
            JointPath::Logistic(path) => path.period_s,
        };
        let first = self.joints.first().map(period)?;
        self.joints.iter().all(|joint| period(joint) == first).then_some(first)
    }

    /// Start of the motion, s after the first row of the log.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Position q, velocity dq and acceleration ddq of a joint at a time, s after the first row of the log.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn at(&self, joint: usize, time_s: f64) -> [f64; 3] {
        let time_s = time_s - self.start_s;
        match &self.joints[joint].path {
            JointPath::Sampled(sampled) => sampled.at(time_s),
            JointPath::Logistic(path) => path.at(time_s),
        }
    }

    /// Whether the joint is at rest: velocity at most 1e-3 and acceleration at most 1e-2 of their peaks.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn rests(&self, joint: usize, time_s: f64) -> bool {
        rests(&self.at(joint, time_s), self.joints[joint].peak)
    }

    /// The strokes of the joint from rest to rest; times in s after the first row of the log. A joint that never rests
    /// has one stroke; a joint that never moves has none.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn strokes(&self, joint: usize) -> Vec<Stroke> {
        let moved = |stroke: &Stroke| stroke.later_by(self.start_s);
        self.joints[joint].strokes.iter().map(moved).collect()
    }

    /// Maximum velocity of the joint, rad/s or m/s.
    pub(crate) fn peak_velocity(&self, joint: usize) -> f64 {
        self.joints[joint].peak[0]
    }

    /// Whether a joint with a closed form moves there (not back) at this time; see [`LogisticPath::goes_there`].
    pub fn goes_there(&self, joint: usize, time_s: f64) -> bool {
        self.logistic_path(joint).is_some_and(|path| path.goes_there(time_s - self.start_s))
    }

    /// The closed form of a joint's motion, if available.
    pub fn logistic_path(&self, joint: usize) -> Option<&LogisticPath> {
        match &self.joints[joint].path {
            JointPath::Logistic(path) => Some(path),
            JointPath::Sampled(_) => None,
        }
    }

    /// Whether the motion is known at this time (s after the log's first row): within its samples, or beyond an end at
    /// which the joint is at rest.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn covers(&self, joint: usize, time_s: f64) -> bool {
        let time_s = time_s - self.start_s;
        let JointReference { path, peak, .. } = &self.joints[joint];
        let JointPath::Sampled(sampled) = path else { return true };
        let last = sampled.values.len() - 1;
        (time_s >= sampled.times_s[0] || rests(&sampled.values[0], *peak))
            && (time_s <= sampled.times_s[last] || rests(&sampled.values[last], *peak))
    }
}

pub(crate) fn check_boundaries(boundaries_s: &[f64]) -> Result<(), FilterError> {
    let finite = boundaries_s.iter().all(|t| t.is_finite());
    if boundaries_s.len() >= 2 && finite && boundaries_s.windows(2).all(|pair| pair[1] > pair[0]) {
        return Ok(());
    }
    Err(FilterError::Reference { problem: "strokes_s needs two or more increasing times in seconds".to_owned() })
}

fn rests(value: &[f64; 3], peak: [f64; 2]) -> bool {
    value[1].abs() <= MAX_REST_SHARES[0] * peak[0] && value[2].abs() <= MAX_REST_SHARES[1] * peak[1]
}

impl ReferenceTable {
    fn at(&self, time_s: f64) -> [f64; 3] {
        let last = self.times_s.len() - 1;
        if time_s <= self.times_s[0] || time_s.is_nan() {
            return if time_s == self.times_s[0] { self.values[0] } else { [self.values[0][0], 0.0, 0.0] };
        }
        if time_s >= self.times_s[last] {
            return if time_s == self.times_s[last] { self.values[last] } else { [self.values[last][0], 0.0, 0.0] };
        }
        let after = self.times_s.partition_point(|t| *t <= time_s);
        let (from, to) = (self.times_s[after - 1], self.times_s[after]);
        quintic(&self.values[after - 1], &self.values[after], to - from, (time_s - from) / (to - from))
    }
}

/// Position, velocity and acceleration of the quintic polynomial with the given states `a` and `b` at the ends of a
/// step `h`, at the fraction `u` of the step (0 to 1).
fn quintic(a: &[f64; 3], b: &[f64; 3], h: f64, u: f64) -> [f64; 3] {
    // p = q0 + v0 u + (a0/2) u² + c3 u³ + c4 u⁴ + c5 u⁵ with velocities and accelerations per step; the three
    // conditions at u = 1 determine c3, c4 and c5.
    let (v0, a0, v1, a1) = (a[1] * h, a[2] * h * h, b[1] * h, b[2] * h * h);
    let distance = b[0] - a[0] - v0 - 0.5 * a0;
    let (speed, bend) = (v1 - v0 - a0, a1 - a0);
    let c3 = 10.0 * distance - 4.0 * speed + 0.5 * bend;
    let c4 = -15.0 * distance + 7.0 * speed - bend;
    let c5 = 6.0 * distance - 3.0 * speed + 0.5 * bend;
    [
        a[0] + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5)))),
        (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h,
        (a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(n: usize, step_s: f64, w: f64) -> (Vec<f64>, [Vec<f64>; 3]) {
        let times: Vec<f64> = (0..n).map(|i| i as f64 * step_s).collect();
        let q = times.iter().map(|t| (w * t).sin()).collect();
        let dq = times.iter().map(|t| w * (w * t).cos()).collect();
        let ddq = times.iter().map(|t| -w * w * (w * t).sin()).collect();
        (times, [q, dq, ddq])
    }

    #[test]
    fn the_quintic_follows_a_sine_to_its_order() {
        let (w, h) = (2.0, 0.05);
        let (times, columns) = sine(101, h, w);
        let reference = Reference::sampled(&times, &[columns]).unwrap().starting_at(1.0);
        for i in 0..500 {
            let t = f64::from(i) * 0.01;
            let [q, dq, ddq] = reference.at(0, t + 1.0);
            // h⁶ω⁶/46080 = 2e-11 in q; errors of order h⁵ in dq and h⁴ in ddq, with constants below 1/1000 and 1/100.
            assert!((q - (w * t).sin()).abs() < 5e-11, "{t}");
            assert!((dq - w * (w * t).cos()).abs() < 2e-8, "{t}");
            assert!((ddq + w * w * (w * t).sin()).abs() < 5e-6, "{t}");
        }
        // The motion beyond both ends is unknown, because the joint moves there.
        assert!(!reference.covers(0, 0.5) && reference.covers(0, 1.0) && !reference.covers(0, 6.5));
    }

    #[test]
    fn given_boundaries_make_strokes_of_a_motion_that_never_rests() {
        let w = core::f64::consts::PI;
        let (times, columns) = sine(401, 0.01, w);
        let reference = Reference::sampled(&times, &[columns]).unwrap();
        assert_eq!(reference.strokes(0).len(), 1);
        // The sine turns at 0.5, 1.5, ..: it is monotone in between.
        let cut = reference.clone().with_boundaries(&[0.5, 1.5, 2.5]).unwrap().starting_at(2.0);
        let strokes = cut.strokes(0);
        assert_eq!(
            strokes.iter().map(|s| (s.from_s, s.to_s, s.monotone)).collect::<Vec<_>>(),
            [(2.5, 3.5, true), (3.5, 4.5, true)]
        );
        assert_eq!(strokes[0].owns_to_s, 3.5);
        assert!(!reference.clone().with_boundaries(&[0.0, 1.0]).unwrap().strokes(0)[0].monotone);
        assert!(reference.with_boundaries(&[1.0, 1.0]).is_err());
    }

    #[test]
    fn bad_samples_are_refused() {
        let column = || [vec![0.0; 3], vec![0.0; 3], vec![0.0; 3]];
        assert!(Reference::sampled(&[0.0, 1.0, 2.0], &[column()]).is_ok());
        assert!(Reference::sampled(&[0.0, 1.0, 1.0], &[column()]).is_err());
        assert!(Reference::sampled(&[0.0, f64::NAN, 1.0], &[column()]).is_err());
        assert!(Reference::sampled(&[0.0, 1.0], &[column()]).is_err());
        assert!(Reference::sampled(&[0.0, 1.0, 2.0], &[]).is_err());
        let mut with_nan = column();
        with_nan[2][1] = f64::NAN;
        assert!(Reference::sampled(&[0.0, 1.0, 2.0], &[with_nan]).is_err());
    }

    #[test]
    fn a_table_of_two_joints_is_read_and_reordered() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "t_s,q1,q2,dq1,dq2,ddq1,ddq2\n0,1,2,0,0,0,0\n0.5,1,2.5,0,1,0,0\n1,1,3,0,1,0,0\n")
            .unwrap();
        let reference = Reference::read(file.path(), 2).unwrap().reordered(&[1, 0]).unwrap();
        assert_eq!(reference.at(0, 1.0), [3.0, 1.0, 0.0]);
        assert_eq!(reference.at(1, 0.3), [1.0, 0.0, 0.0]);
        assert!(reference.reordered(&[2]).is_none());
        assert!(reference.strokes(1).is_empty());
        assert_eq!((reference.period_s(), reference.clone().starting_at(2.0).start_s()), (Some(1.0), 2.0));
        assert!(Reference::read(file.path(), 3).is_err());
    }
}
