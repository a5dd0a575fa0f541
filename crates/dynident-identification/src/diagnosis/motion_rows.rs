//! A few hundred instants of a recording, for the comparison of hypotheses.

use super::channels::Channels;
use crate::diagnosis_settings::MotionLimits;
use core::ops::Range;
use dynident_recording::{DecimationSettings, Decimator, MotionBlock};
use dynident_rows::{LogError, Logs, ParallelFilterSettings, RegressorModel, motion_band_hz};

/// Number of instants; more instants do not improve the accuracy.
pub(super) const INSTANTS: usize = 300;

/// Ratio of the standard deviation of a normal distribution to the median of its magnitude.
const NORMAL_DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Variance of the third difference of white noise of variance 1.
const THIRD_DIFFERENCE_VARIANCE: f64 = 20.0;

/// Number of instants to take from log number `log` (from 0) of `logs`, so that all logs together give at most `total`
/// instants. Each log gives the same number. If there are more logs than `total`, one instant is taken from each of
/// `total` evenly spaced logs.
pub(super) fn instants_of_log(total: usize, log: usize, logs: usize) -> usize {
    if logs <= total { total / logs.max(1) } else { (log + 1) * total / logs - log * total / logs }
}

/// Instants of a motion with its torques, in SI units, joints in the order of the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionRows {
    /// Positions (rad, m), one vector for each joint.
    pub q: Vec<Vec<f64>>,
    /// Velocities.
    pub dq: Vec<Vec<f64>>,
    /// Accelerations.
    pub ddq: Vec<Vec<f64>>,
    /// Torques (N m, N).
    pub tau: Vec<Vec<f64>>,
    /// Rate of the recording, Hz.
    pub rate_hz: f64,
    /// Number of independent instants: as many as the rows that a fit to this motion uses.
    pub independent: f64,
}

/// Motion and torque of a recording after the same filter, decimated. Instants are selected from these samples, each
/// with the torque at the same time or with a torque shifted in time.
#[derive(Clone, Debug)]
pub(super) struct MotionSamples {
    rows: MotionRows,
    /// Index of the first row of each uninterrupted piece.
    pieces: Vec<usize>,
    /// Time between rows, s.
    spacing_s: f64,
    /// Number of these samples per row of a fit.
    rows_of_fit: f64,
    /// For each row, the largest interpolated share of a joint's torque; empty if no sample was rejected.
    interpolated: Vec<f64>,
    max_interpolated: f64,
    /// For each row, whether a joint rests that moves in other rows; empty if too few rows would remain.
    resting: Vec<bool>,
}

impl MotionSamples {
    /// Reads the recording with this index, or the excerpt of a long recording.
    pub(super) fn of_recording(
        logs: &Logs<'_>,
        model: &RegressorModel,
        index: usize,
        limits: &MotionLimits,
    ) -> Result<Self, LogError> {
        let pass = logs.pass_for_instants(model, index);
        let recording = pass.recording;
        let places = recording.joint_indices(model.model())?;
        let joints = places.len();
        let mut rows = MotionRows::empty(joints);
        let (mut pieces, mut spacing_s, mut interpolated) = (vec![0], 0.0, Vec::new());
        let mut rows_of_fit = 1.0;
        let mut decimator: Option<Decimator> = None;
        let (mut segment, mut panel, mut out) = (0, Vec::new(), Vec::new());
        let mut take = |block: &MotionBlock| {
            if rows.rate_hz == 0.0 {
                rows.rate_hz = block.rate_hz;
                spacing_s = block.rate_hz.recip();
                let factor_of =
                    |settings: &Option<DecimationSettings>| settings.as_ref().map_or(1, |s| s.factor) as f64;
                let of_fit = logs.filter.decimation(block.rate_hz, motion_band_hz(&logs.motion));
                let settings = instant_filter(logs, block.rate_hz).decimation(block.rate_hz, None);
                let settings = settings.filter(|settings| settings.factor > 1);
                spacing_s *= factor_of(&settings);
                rows_of_fit = factor_of(&of_fit) / factor_of(&settings);
                decimator = settings
                    .map(|settings| Decimator::new(&settings, block.rate_hz, 5 * joints))
                    .transpose()
                    .map_err(|source| LogError::Filter { log: recording.name.clone(), source })?;
            }
            if block.segment != segment {
                segment = block.segment;
                pieces.push(rows.len());
                if let Some(decimator) = &mut decimator {
                    decimator.finish();
                }
            }
            // Rows that depend on extrapolated samples are excluded.
            let [begin, behind] = block.unsettled;
            let settled = begin..block.rows.saturating_sub(behind).max(begin);
            fill_panel(block, &places, &settled, &mut panel);
            let (count, filtered) = match &mut decimator {
                Some(decimator) => {
                    let count = decimator.push(&panel, settled.len(), &mut out);
                    (count, &out)
                }
                None => (settled.len(), &panel),
            };
            let share =
                |row: usize| (0..joints).map(|joint| filtered[(4 * joints + joint) * count + row]).fold(0.0, f64::max);
            interpolated.extend((0..count).map(share));
            for (quantity, to) in rows.quantities_mut().into_iter().enumerate() {
                for (joint, to) in to.iter_mut().enumerate() {
                    to.extend_from_slice(&filtered[(quantity * joints + joint) * count..][..count]);
                }
            }
            Ok(())
        };
        pass.each_block(&mut take)?;
        let (resting, max_interpolated) = (resting(&rows, limits), limits.max_interpolated);
        Ok(Self { rows, pieces, spacing_s, rows_of_fit, interpolated, max_interpolated, resting })
    }

    /// At most `most` of the instants, evenly spaced.
    pub(super) fn instants(&self, most: usize) -> MotionRows {
        let all: Vec<usize> = (0..self.rows.len()).filter(|&row| self.is_usable(row)).collect();
        let count = all.len();
        let chosen: Vec<usize> = if count > most { (0..most).map(|k| all[k * count / most]).collect() } else { all };
        self.selected(&chosen, count)
    }

    /// Standard deviation of the white noise of a joint's torque in these samples, Nm (N), from third differences:
    /// `σ = 1.4826 median |Δ³τ| / √20`. The third differences of a smooth torque are nearly zero, and the median
    /// ignores jumps.
    pub(super) fn torque_noise(&self, joint: usize) -> f64 {
        let difference = |tau: &[f64]| (tau[3] - 3.0 * tau[2] + 3.0 * tau[1] - tau[0]).abs();
        let mut differences: Vec<f64> = self.rows.tau[joint].windows(4).map(difference).collect();
        differences.sort_by(f64::total_cmp);
        let median = differences.get(differences.len() / 2).copied().unwrap_or(0.0);
        NORMAL_DEVIATION_OF_MEDIAN * median / THIRD_DIFFERENCE_VARIANCE.sqrt()
    }

    /// Duration of the longest uninterrupted piece, s.
    pub(super) fn longest_s(&self) -> f64 {
        self.each_piece().map(|piece| piece.len()).max().unwrap_or(0) as f64 * self.spacing_s
    }

    /// At most `most` instants with a lag for each joint: the torque (or the motion, as `channels` states) is taken
    /// `lag_s` seconds later, interpolated linearly. Only instants with samples up to `reach_s` before and after them
    /// are used, so that all lags have the same instants.
    pub(super) fn shifted(&self, channels: Channels, lag_s: &[f64], reach_s: f64, most: usize) -> MotionRows {
        let reach = (reach_s / self.spacing_s).ceil() as usize + 1;
        let inside = |piece: Range<usize>| piece.start + reach..piece.end.saturating_sub(reach);
        let all: Vec<usize> = self.each_piece().flat_map(inside).filter(|&row| self.is_usable(row)).collect();
        let chosen: Vec<usize> = (0..most.min(all.len())).map(|k| all[k * all.len() / most.min(all.len())]).collect();
        let mut rows = self.selected(&chosen, all.len());
        let shift = |to: &mut [Vec<f64>], from: &[Vec<f64>]| {
            for ((to, from), lag_s) in to.iter_mut().zip(from).zip(lag_s).filter(|(_, lag_s)| **lag_s != 0.0) {
                let shift = lag_s / self.spacing_s;
                let (whole, share) = (shift.floor() as isize, shift - shift.floor());
                for (to, &row) in to.iter_mut().zip(&chosen) {
                    let at = row.saturating_add_signed(whole).min(from.len() - 1);
                    let next = (at + 1).min(from.len() - 1);
                    *to = from[at] + share * (from[next] - from[at]);
                }
            }
        };
        if channels == Channels::Torque {
            shift(&mut rows.tau, &self.rows.tau);
        } else {
            shift(&mut rows.q, &self.rows.q);
            shift(&mut rows.dq, &self.rows.dq);
            shift(&mut rows.ddq, &self.rows.ddq);
        }
        rows
    }

    /// The instants with the indices `chosen`; `all` is the number of usable instants.
    fn selected(&self, chosen: &[usize], all: usize) -> MotionRows {
        let independent = (all as f64 / self.rows_of_fit).min(chosen.len() as f64);
        let MotionRows { q, dq, ddq, tau, rate_hz, .. } = &self.rows;
        let take = |of: &[Vec<f64>]| of.iter().map(|values| chosen.iter().map(|&row| values[row]).collect()).collect();
        MotionRows { q: take(q), dq: take(dq), ddq: take(ddq), tau: take(tau), rate_hz: *rate_hz, independent }
    }

    fn is_usable(&self, row: usize) -> bool {
        let is_interpolated = self.interpolated.get(row).is_some_and(|share| *share > self.max_interpolated);
        !is_interpolated && !self.resting.get(row).copied().unwrap_or(false)
    }

    fn each_piece(&self) -> impl Iterator<Item = Range<usize>> {
        let ends = self.pieces.iter().skip(1).copied().chain([self.rows.len()]);
        self.pieces.iter().copied().zip(ends).map(|(from, to)| from..to)
    }
}

/// For each row, whether a joint rests that moves in other rows. Empty for a motion without pauses
/// ([`MotionLimits::min_rest_share`]), and if too few other rows would remain.
fn resting(rows: &MotionRows, limits: &MotionLimits) -> Vec<bool> {
    let mut resting = vec![false; rows.len()];
    for dq in &rows.dq {
        let rms = (dq.iter().map(|speed| speed * speed).sum::<f64>() / dq.len().max(1) as f64).sqrt();
        for (rests, speed) in resting.iter_mut().zip(dq) {
            *rests |= speed.abs() < limits.max_rest_velocity * rms;
        }
    }
    let moving = resting.iter().filter(|rests| !**rests).count();
    let is_continuous = ((rows.len() - moving) as f64) < limits.min_rest_share * rows.len() as f64;
    if moving < limits.min_moving_instants || is_continuous { Vec::new() } else { resting }
}

/// Parallel filter for instants. It gives four times as many rows as the filter of a fit, because short logs would
/// otherwise have too few.
pub(super) fn instant_filter(logs: &Logs<'_>, rate_hz: f64) -> ParallelFilterSettings {
    let of_fit = logs.filter.decimation(rate_hz, motion_band_hz(&logs.motion));
    let factor = of_fit.map_or(1, |settings| settings.factor / 4).max(1);
    ParallelFilterSettings { factor: Some(factor), ..logs.filter.clone() }
}

/// Writes positions, velocities, accelerations, torques and marks, one column for each joint. Rejected samples of the
/// torque are interpolated linearly and have the mark 1.
fn fill_panel(block: &MotionBlock, places: &[usize], settled: &Range<usize>, panel: &mut Vec<f64>) {
    panel.clear();
    for values in [&block.q, &block.dq, &block.ddq] {
        for &place in places {
            panel.extend_from_slice(&block.joint(values, place)[settled.clone()]);
        }
    }
    let mut marks = Vec::with_capacity(places.len() * settled.len());
    for &place in places {
        let tau = &block.joint(&block.tau, place)[settled.clone()];
        let marked = block.set_aside.get(place * block.rows..(place + 1) * block.rows).unwrap_or_default();
        let marked = marked.get(settled.clone()).unwrap_or_default();
        panel.extend(interpolated_torque(tau, marked));
        marks.extend((0..tau.len()).map(|row| f64::from(u8::from(marked.get(row).copied().unwrap_or(false)))));
    }
    panel.extend_from_slice(&marks);
}

/// A torque with its `marked` samples interpolated linearly.
fn interpolated_torque(tau: &[f64], marked: &[bool]) -> Vec<f64> {
    let mut out = tau.to_vec();
    let is_marked = |row: usize| marked.get(row).copied().unwrap_or(false);
    let mut row = 0;
    while row < tau.len() {
        if !is_marked(row) {
            row += 1;
            continue;
        }
        let to = (row..tau.len()).find(|&row| !is_marked(row)).unwrap_or(tau.len());
        let before = row.checked_sub(1).map(|at| tau[at]).or(tau.get(to).copied()).unwrap_or(0.0);
        let after = tau.get(to).copied().unwrap_or(before);
        for at in row..to {
            out[at] = before + (after - before) * (at + 1 - row) as f64 / (to + 1 - row) as f64;
        }
        row = to;
    }
    out
}

impl MotionRows {
    /// Storage for `joints` joints without any instant.
    pub fn empty(joints: usize) -> Self {
        let none = || vec![Vec::new(); joints];
        Self { q: none(), dq: none(), ddq: none(), tau: none(), rate_hz: 0.0, independent: 0.0 }
    }

    /// Positions, velocities and accelerations of all joints at the instant with index `row`.
    pub(super) fn at(&self, row: usize) -> [Vec<f64>; 3] {
        [&self.q, &self.dq, &self.ddq].map(|values| values.iter().map(|values| values[row]).collect())
    }

    /// Number of instants.
    pub fn len(&self) -> usize {
        self.q.first().map_or(0, Vec::len)
    }

    /// Whether there are no instants.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the instants of `other`.
    pub fn append(&mut self, other: &Self) {
        self.rate_hz = other.rate_hz;
        self.independent += other.independent;
        let from = [&other.q, &other.dq, &other.ddq, &other.tau];
        for (to, from) in self.quantities_mut().into_iter().zip(from) {
            for (to, from) in to.iter_mut().zip(from) {
                to.extend_from_slice(from);
            }
        }
    }

    /// The values of these channels; the position channel includes velocity and acceleration.
    pub(super) fn of_mut(&mut self, channels: Channels) -> impl Iterator<Item = &mut Vec<Vec<f64>>> {
        let is_of = move |k: usize| channels == Channels::Both || (k == 3) == (channels == Channels::Torque);
        self.quantities_mut().into_iter().enumerate().filter(move |(k, _)| is_of(*k)).map(|(_, columns)| columns)
    }

    fn quantities_mut(&mut self) -> [&mut Vec<Vec<f64>>; 4] {
        [&mut self.q, &mut self.dq, &mut self.ddq, &mut self.tau]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_shared_by_any_number_of_logs() {
        for logs in [1, 2, 7, 299, 300] {
            assert!((0..logs).all(|place| instants_of_log(300, place, logs) == 300 / logs));
        }
        for logs in [301, 450, 1000, 12_345] {
            let shares: Vec<usize> = (0..logs).map(|place| instants_of_log(300, place, logs)).collect();
            assert_eq!(shares.iter().sum::<usize>(), 300, "{logs}");
            assert!(shares.iter().all(|&share| share <= 1));
        }
    }

    #[test]
    fn rejected_samples_are_interpolated() {
        let tau = [9.0, 1.0, 50.0, 50.0, 4.0, 5.0, 80.0];
        let marked = [true, false, true, true, false, false, true];
        assert_eq!(interpolated_torque(&tau, &marked), [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0]);
        assert_eq!(interpolated_torque(&tau, &[]), tau);
    }

    #[test]
    fn noise_is_distinguished_from_smooth_torque_and_steps() {
        // White and uniform between -1 and 1: the generator SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
        let noise = |row: usize| {
            let mut bits = (row as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let smooth = |row: usize| 20.0 * (0.05 * row as f64).sin() + if row % 100 < 50 { 5.0 } else { -5.0 };
        let deviation = (0..2000).map(|row| noise(row).powi(2)).sum::<f64>() / 2000.0;
        let of = |tau: Vec<f64>| {
            let rows = MotionRows { tau: vec![tau], ..MotionRows::empty(1) };
            let samples = MotionSamples {
                rows,
                pieces: vec![0],
                spacing_s: 0.1,
                rows_of_fit: 1.0,
                interpolated: Vec::new(),
                max_interpolated: 0.3,
                resting: Vec::new(),
            };
            samples.torque_noise(0)
        };
        let found = of((0..2000).map(|row| smooth(row) + noise(row)).collect());
        // The median of 2000 third differences varies by about 2 %. In addition, the ratio of median and standard
        // deviation is different for uniform noise, and successive third differences share samples.
        assert!((found / deviation.sqrt() - 1.0).abs() < 0.15, "{found}");
        assert!(of((0..2000).map(smooth).collect()) < 0.05);
        assert_eq!(of(vec![1.0, 2.0]), 0.0);
    }

    #[test]
    fn a_shifted_torque_is_taken_from_the_same_piece() {
        let line = |from: f64| (0..40).map(|row| from + f64::from(row)).collect::<Vec<f64>>();
        let rows = MotionRows {
            q: vec![line(0.0)],
            dq: vec![line(100.0)],
            ddq: vec![line(200.0)],
            tau: vec![line(300.0)],
            rate_hz: 10.0,
            independent: 40.0,
        };
        let (pieces, interpolated) = (vec![0, 20], Vec::new());
        let samples = MotionSamples {
            rows,
            pieces,
            spacing_s: 0.1,
            rows_of_fit: 4.0,
            interpolated,
            max_interpolated: 0.3,
            resting: Vec::new(),
        };
        assert!((samples.longest_s() - 2.0).abs() < 1e-12);
        let late = samples.shifted(Channels::Torque, &[0.25], 0.3, 100);
        // Both pieces lose four rows at each end.
        assert_eq!((late.len(), late.independent), (2 * 12, 6.0));
        for row in 0..late.len() {
            assert!((late.tau[0][row] - late.q[0][row] - 302.5).abs() < 1e-9);
            assert!((late.dq[0][row] - late.q[0][row] - 100.0).abs() < 1e-9);
        }
        let late = samples.shifted(Channels::Position, &[-0.1], 0.3, 100);
        assert!((0..late.len()).all(|row| (late.tau[0][row] - late.q[0][row] - 301.0).abs() < 1e-9));
    }

    #[test]
    fn rests_are_left_out_if_enough_motion_remains() {
        // Two joints that move at the same time during half of the log, and a dead joint.
        let dq = |row: usize| if (row / 50).is_multiple_of(2) { (0.2 * row as f64).sin() + 1.5 } else { 1e-3 };
        let rows = |count: usize| MotionRows {
            dq: vec![(0..count).map(dq).collect(), (0..count).map(|row| 0.1 * dq(row)).collect(), vec![0.0; count]],
            q: vec![vec![0.0; count]; 3],
            ..MotionRows::empty(3)
        };
        let limits = MotionLimits::default();
        let of_400 = resting(&rows(400), &limits);
        assert!((0..400).all(|row| of_400[row] == ((row / 50) % 2 == 1)));
        // 100 moving instants are enough, 90 are not.
        assert_eq!(resting(&rows(150), &limits).iter().filter(|rests| !**rests).count(), 100);
        assert!(resting(&rows(140), &limits).is_empty());
    }
}
