//! Detection of samples that are contained in two logs although their files differ: values with fewer digits, a part
//! whose time starts at zero, or every second row.
//!
//! Because of noise, the values of two different runs differ. Therefore, if successive rows of two logs agree in every
//! position and torque to within the resolution of the coarser log, they are the same samples.

use super::{Log, LogReader, RawBlock};
use crate::error::RecordingError;

const MAX_ROWS: usize = 400_000;
/// Number of rows of the second log that are searched for in the first log.
const SEARCHED_PLACES: usize = 12;
/// Number of successive rows that must agree.
const MATCHED_ROWS: usize = 100;
/// Minimum number of such rows for short logs.
const MIN_MATCHED_ROWS: usize = 20;
/// Ratios between the sample rates of both logs that are tested.
const STRIDES: [usize; 5] = [1, 2, 4, 5, 10];
/// Tolerance in resolution steps of the coarser log: half a step, and a margin for rounded numbers.
const STEP_TOLERANCE: f64 = 0.51;
/// Tolerance for numbers in single precision, as a share of the channel's range.
const RANGE_TOLERANCE: f64 = 1e-6;

/// A row in each of two logs; from these rows on, both logs contain the same samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedSamples {
    /// Data row in the file of the first log, from 0.
    pub row: u64,
    /// Data row in the file of the other log, from 0.
    pub other_row: u64,
}

/// Positions, torques and commands of all rows of a log, for the comparison with another log.
#[derive(Clone, Debug)]
pub struct LogSamples {
    row: Vec<u64>,
    /// Positions of all joints, then torques and commands if the log has them.
    values: Vec<Vec<f64>>,
    joints: Vec<String>,
}

impl LogSamples {
    /// Reads a log; `None` if it has more than 400,000 rows.
    ///
    /// # Errors
    /// If the log cannot be read.
    pub fn read(log: &Log) -> Result<Option<Self>, RecordingError> {
        if log.source().estimated_rows().is_some_and(|rows| rows > 2 * MAX_ROWS as u64) {
            return Ok(None);
        }
        let groups = 1 + usize::from(log.format.torque.is_some()) + usize::from(log.format.command.is_some());
        let values = vec![Vec::new(); groups * log.joints.len()];
        let mut all = Self { row: Vec::new(), values, joints: log.joints.clone() };
        let (mut reader, mut block) = (LogReader::open(log)?, RawBlock::default());
        while reader.next_block(&mut block)? {
            all.row.extend_from_slice(&block.row);
            for (to, from) in all.values.iter_mut().zip(block.q.iter().chain(&block.tau).chain(&block.command)) {
                to.extend_from_slice(from);
            }
            if all.row.len() > MAX_ROWS {
                return Ok(None);
            }
        }
        Ok(Some(all))
    }

    /// Number of values in memory.
    pub fn values(&self) -> usize {
        self.row.len() * self.values.len()
    }

    /// First samples that both logs contain; `None` if there are none or the joints differ. Joints at rest are ignored,
    /// because a constant position repeats.
    pub fn shared_with(&self, other: &Self) -> Option<SharedSamples> {
        if self.joints != other.joints || self.values.len() != other.values.len() {
            return None;
        }
        // Rows of the shorter log are searched for in the longer log.
        let [row, other_row] = if self.row.len() < other.row.len() {
            let [other_row, row] = other.rows_shared_with(self)?;
            [row, other_row]
        } else {
            self.rows_shared_with(other)?
        };
        Some(SharedSamples { row: self.row[row], other_row: other.row[other_row] })
    }

    /// A row of each log from which on both contain the same samples.
    fn rows_shared_with(&self, other: &Self) -> Option<[usize; 2]> {
        let tolerance: Vec<f64> = self.values.iter().zip(&other.values).map(|(a, b)| agreement(a, b)).collect();
        let mut places = (0..SEARCHED_PLACES).map(|place| place * other.row.len() / SEARCHED_PLACES);
        let of_place = |from: usize| {
            // The comparison starts where the robot moves.
            let moving =
                (from..other.row.len().saturating_sub(MIN_MATCHED_ROWS)).find(|&row| other.moves(row, &tolerance))?;
            let agrees = |row: usize, at: usize| {
                let mut channels = self.values.iter().zip(&other.values).zip(&tolerance);
                channels.all(|((a, b), tolerance)| (a[row] - b[at]).abs() <= *tolerance)
            };
            let follows = |row: usize, [step, other_step]: [usize; 2]| {
                let rows = (self.row.len() - row).div_ceil(step);
                let rows = rows.min((other.row.len() - moving).div_ceil(other_step)).min(MATCHED_ROWS);
                rows >= MIN_MATCHED_ROWS && (1..rows).all(|k| agrees(row + k * step, moving + k * other_step))
            };
            let steps = || STRIDES.into_iter().flat_map(|stride| [[stride, 1], [1, stride]]);
            let found =
                (0..self.row.len()).find(|&row| agrees(row, moving) && steps().any(|steps| follows(row, steps)));
            found.map(|row| [row, moving])
        };
        places.find_map(of_place)
    }

    /// Whether a joint moves after a row by more than ten times the tolerance.
    fn moves(&self, row: usize, tolerance: &[f64]) -> bool {
        let to = row + MIN_MATCHED_ROWS;
        (0..self.joints.len()).any(|joint| {
            let q = &self.values[joint][row..=to];
            let [low, high] = range(q);
            high - low > 10.0 * tolerance[joint]
        })
    }
}

/// Maximum difference between values of the same sample in both logs: half a resolution step of the coarser log.
fn agreement(a: &[f64], b: &[f64]) -> f64 {
    let [low, high] = range(a);
    STEP_TOLERANCE * step(a).max(step(b)) + RANGE_TOLERANCE * (high - low)
}

/// Smallest usual step between rows: the resolution of the channel, or less if the channel has more digits than its
/// noise requires.
fn step(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    let least = steps.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::JointSamples;

    /// Two joints that swing; `run` selects the noise.
    fn swing(run: u64, rows: usize) -> [Vec<Vec<f64>>; 2] {
        let mut state = run.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut noise = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut q = vec![Vec::new(); 2];
        let mut tau = vec![Vec::new(); 2];
        for row in 0..rows {
            let t = row as f64 * 0.01;
            for joint in 0..2 {
                let phase = t * (1.0 + 0.7 * joint as f64);
                q[joint].push(phase.sin() + 1e-4 * noise());
                tau[joint].push(5.0 * phase.cos() + 0.05 * noise());
            }
        }
        [q, tau]
    }

    fn log([q, tau]: [Vec<Vec<f64>>; 2]) -> LogSamples {
        let log = JointSamples::at_rate(100.0, q, tau).into_log("a test", &["a".to_owned(), "b".to_owned()]).unwrap();
        LogSamples::read(&log).unwrap().unwrap()
    }

    fn each(samples: &[Vec<Vec<f64>>; 2], change: impl Fn(&[f64]) -> Vec<f64>) -> [Vec<Vec<f64>>; 2] {
        samples.clone().map(|joints| joints.iter().map(|values| change(values)).collect())
    }

    #[test]
    fn shared_samples_are_found_for_any_way_of_saving() {
        let samples = swing(1, 1500);
        let rounded =
            |digits: f64| move |values: &[f64]| values.iter().map(|v| (v * digits).round() / digits).collect();
        let saved = [
            ("as they are", each(&samples, <[f64]>::to_vec)),
            ("single precision", each(&samples, |v| v.iter().map(|v| f64::from(*v as f32)).collect())),
            ("three digits", each(&samples, rounded(1e3))),
            ("a piece", each(&samples, |v| v[400..900].to_vec())),
            ("a piece with three digits", each(&samples, |v| rounded(1e3)(&v[437..800]))),
            ("every second row", each(&samples, |v| v.iter().step_by(2).copied().collect())),
            ("half of it, behind another run", {
                let other = swing(2, 700);
                [0, 1].map(|of| {
                    let joint = |joint: usize| [&other[of][joint][..], &samples[of][joint][..700]].concat();
                    (0..2).map(joint).collect()
                })
            }),
        ];
        let training = log(samples);
        for (name, samples) in saved {
            let held_out = log(samples);
            assert!(training.shared_with(&held_out).is_some(), "{name}");
            assert!(held_out.shared_with(&training).is_some(), "{name}, the other way round");
        }
    }

    #[test]
    fn another_run_of_the_same_motion_shares_no_samples() {
        let rounded = |values: &[f64]| values.iter().map(|v| (v * 1e2).round() / 1e2).collect();
        let coarse = |run: u64| log(each(&swing(run, 1500), rounded));
        assert_eq!(log(swing(1, 1500)).shared_with(&log(swing(2, 1500))), None);
        // Quantisation steps as large as the noise.
        assert_eq!(coarse(1).shared_with(&coarse(2)), None);
    }

    #[test]
    fn a_robot_at_rest_shares_no_samples() {
        let rest = |rows: usize| log([vec![vec![0.3; rows], vec![0.1; rows]], vec![vec![1.0; rows], vec![2.0; rows]]]);
        assert_eq!(rest(500).shared_with(&rest(300)), None);
    }
}
