//! Motion, torque and regressor of one log, averaged over short bins.

use crate::settings::EventSettings;
use dynident_dynamics::{BatchWorkspace, Column, PanelLayout, Panels, ParametricModel, regressor_panels};
use dynident_model::terms::{JointMotion, TorqueTerm};
use dynident_recording::MotionBlock;
use dynident_rows::{LogError, LogPass, PANEL_SAMPLES};

/// Number of samples at which the regressor is evaluated in a bin.
const SAMPLES_PER_BIN: usize = 4;
/// Maximum number of bins; longer logs have longer bins.
const MAX_BINS: f64 = 20_000.0;
/// Number of columns that are added for each joint: offset, two smoothed signs of the velocity (narrow and wide),
/// presliding friction, two powers of velocity, drive inertia, friction that grows with the torque.
pub(crate) const DRIVE_COLUMNS: usize = 8;
/// Columns of dry friction among them.
pub(crate) const DRY_FRICTION: core::ops::Range<usize> = 1..4;
/// Column of presliding friction among them.
const PRESLIDING: usize = 3;

/// One log, averaged over bins. Vectors of joints are in the order of the model.
#[derive(Clone, Debug, Default)]
pub(crate) struct LogRows {
    /// Settings of the search.
    pub(crate) settings: EventSettings,
    /// Length of a bin, s.
    pub(crate) bin_s: f64,
    /// Centre of each bin, s after the first data row.
    pub(crate) time_s: Vec<f64>,
    /// Index of the uninterrupted piece of the log that contains each bin.
    pub(crate) piece: Vec<usize>,
    /// Whether the motion of the bin is reliable.
    pub(crate) usable: Vec<bool>,
    /// Positions.
    pub(crate) q: Vec<Vec<f64>>,
    /// Velocities.
    pub(crate) dq: Vec<Vec<f64>>,
    /// Torques.
    pub(crate) tau: Vec<Vec<f64>>,
    /// Columns of each joint's regression, row-major: base parameters, then [`DRIVE_COLUMNS`] further columns. Each
    /// column is scaled to a root mean square of 1.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Number of columns of each joint.
    pub(crate) width: Vec<usize>,
    /// Weight of each bin in the fits, by joint.
    pub(crate) weight: Vec<Vec<f64>>,
    /// Velocity of the narrow friction step of each joint.
    pub(crate) step: Vec<f64>,
    /// Velocity of each joint below which the joint is at rest.
    pub(crate) rest: Vec<f64>,
    /// Root mean square of each joint's [`DRIVE_COLUMNS`] columns before scaling.
    pub(crate) drive_scale: Vec<[f64; DRIVE_COLUMNS]>,
    /// Torque samples by piece and joint, for the searches for straight lines and jumps.
    pub(crate) samples: Vec<TorquePiece>,
}

/// Torque samples of one uninterrupted piece of the log.
#[derive(Clone, Debug, Default)]
pub(crate) struct TorquePiece {
    pub(crate) first_s: f64,
    pub(crate) rate_hz: f64,
    pub(crate) tau: Vec<Vec<f64>>,
}

/// Columns of the bodies, of torques declared by `[[torque]]` and of couplings. Friction and drives of the joints are
/// represented by [`DRIVE_COLUMNS`] further columns instead.
pub(crate) fn without_history(robot: &ParametricModel) -> Option<PanelLayout> {
    let is_kept = |column: &Column| match column {
        Column::Body { .. } => true,
        Column::Term(term) => matches!(term, TorqueTerm::Declared(_) | TorqueTerm::Coupling(_)),
    };
    let columns: Vec<Column> = robot.layout().columns().iter().filter(|column| is_kept(column)).cloned().collect();
    (!columns.is_empty()).then(|| PanelLayout::new(robot.model(), columns))
}

#[derive(Default)]
struct Collected {
    /// Positions at the samples within a bin at which the regressor is evaluated, one vector for each joint.
    q: Vec<Vec<f64>>,
    dq: Vec<Vec<f64>>,
    ddq: Vec<Vec<f64>>,
    bin: Vec<usize>,
}

impl LogRows {
    /// Reads a log and averages it over bins. `None` for a log without rows.
    pub(crate) fn read(
        pass: &LogPass<'_>,
        robot: &ParametricModel,
        settings: &EventSettings,
    ) -> Result<Option<Self>, LogError> {
        let model = robot.model();
        let places = pass.recording.joint_indices(model)?;
        let joints = places.len();
        let mut rows = Self { settings: *settings, q: vec![Vec::new(); joints], ..Self::default() };
        (rows.dq, rows.tau) = (rows.q.clone(), rows.q.clone());
        let mut of = Collected { q: rows.q.clone(), dq: rows.q.clone(), ddq: rows.q.clone(), bin: Vec::new() };
        let mut per_bin = 0;
        let mut in_bin = 0;
        let mut segment = None;
        let mut take = |block: &MotionBlock| {
            if per_bin == 0 {
                let duration_s = pass.recording.estimated_rows().unwrap_or(0) as f64 / block.rate_hz;
                let wanted = settings.bins.bin_s.max(duration_s / MAX_BINS) * block.rate_hz;
                per_bin = (wanted.round() as usize).max(1);
                rows.bin_s = per_bin as f64 / block.rate_hz;
            }
            if segment != Some(block.segment) {
                rows.close(in_bin, per_bin, &mut of);
                (segment, in_bin) = (Some(block.segment), 0);
                let tau = vec![Vec::new(); joints];
                rows.samples.push(TorquePiece { first_s: block.first_time_s, rate_hz: block.rate_hz, tau });
            }
            rows.add(block, &places, per_bin, &mut in_bin, &mut of);
            Ok(())
        };
        pass.each_block(&mut take)?;
        rows.close(in_bin, per_bin.max(1), &mut of);
        if rows.time_s.is_empty() {
            return Ok(None);
        }
        rows.fill_columns(robot, &of);
        Ok(Some(rows))
    }

    fn add(&mut self, block: &MotionBlock, places: &[usize], per_bin: usize, in_bin: &mut usize, of: &mut Collected) {
        let stride = per_bin.div_ceil(SAMPLES_PER_BIN).max(1);
        let [begin, behind] = block.unsettled;
        let number = block.segment;
        for row in 0..block.rows {
            if *in_bin == 0 {
                self.time_s.push(block.first_time_s + (row as f64 + 0.5 * (per_bin - 1) as f64) / block.rate_hz);
                self.piece.push(number);
                self.usable.push(true);
                for joint in 0..places.len() {
                    for values in [&mut self.q, &mut self.dq, &mut self.tau] {
                        values[joint].push(0.0);
                    }
                }
            }
            let bin = self.time_s.len() - 1;
            if row < begin || row + behind >= block.rows {
                self.usable[bin] = false;
            }
            let share = 1.0 / per_bin as f64;
            let is_sample = *in_bin % stride == stride / 2;
            for (joint, &place) in places.iter().enumerate() {
                let at = place * block.rows + row;
                self.q[joint][bin] += share * block.q[at];
                self.dq[joint][bin] += share * block.dq[at];
                self.tau[joint][bin] += share * block.tau[at];
                if block.set_aside.get(at).copied().unwrap_or(false) {
                    self.usable[bin] = false;
                }
                if is_sample {
                    of.q[joint].push(block.q[at]);
                    of.dq[joint].push(block.dq[at]);
                    of.ddq[joint].push(block.ddq[at]);
                }
                let piece = self.samples.last_mut().map(|piece| &mut piece.tau[joint]);
                if let Some(tau) = piece {
                    tau.push(block.tau[at]);
                }
            }
            if is_sample {
                of.bin.push(bin);
            }
            *in_bin = (*in_bin + 1) % per_bin;
        }
    }

    /// Removes the last bin of a piece if it is incomplete.
    fn close(&mut self, in_bin: usize, per_bin: usize, of: &mut Collected) {
        if in_bin == 0 || in_bin == per_bin {
            return;
        }
        let bin = self.time_s.len() - 1;
        self.time_s.pop();
        self.piece.pop();
        self.usable.pop();
        for values in [&mut self.q, &mut self.dq, &mut self.tau] {
            for joint in values.iter_mut() {
                joint.pop();
            }
        }
        let kept = of.bin.iter().position(|at| *at == bin).unwrap_or(of.bin.len());
        of.bin.truncate(kept);
        for values in [&mut of.q, &mut of.dq, &mut of.ddq] {
            for joint in values.iter_mut() {
                joint.truncate(kept);
            }
        }
    }

    fn fill_columns(&mut self, robot: &ParametricModel, of: &Collected) {
        let (joints, bins) = (self.q.len(), self.time_s.len());
        let (layout, own) = (without_history(robot), self.settings.bins);
        let body_columns = |joint: usize| layout.as_ref().map_or(0, |layout| layout.joint_columns(joint).len());
        self.width = (0..joints).map(|joint| body_columns(joint) + DRIVE_COLUMNS).collect();
        self.columns = self.width.iter().map(|width| vec![0.0; width * bins]).collect();
        self.step = (0..joints).map(|joint| (own.narrow_step_ratio * rms(&of.dq[joint])).max(1e-9)).collect();
        self.rest = (0..joints).map(|joint| own.rest_ratio * rms(&of.dq[joint])).collect();
        let presliding: Vec<Vec<f64>> = (0..joints).map(|joint| self.presliding(joint, of)).collect();
        let mut counts = vec![0.0; bins];
        for &bin in &of.bin {
            counts[bin] += 1.0;
        }
        let mut workspace = BatchWorkspace::new(robot.model());
        let mut panels = Panels::default();
        let mut motion: [Vec<f64>; 3] = Default::default();
        let mut from = 0;
        while from < of.bin.len() {
            let to = (from + PANEL_SAMPLES).min(of.bin.len());
            let samples = to - from;
            for (out, values) in motion.iter_mut().zip([&of.q, &of.dq, &of.ddq]) {
                out.clear();
                for joint in values {
                    out.extend_from_slice(&joint[from..to]);
                }
            }
            if let Some(layout) = &layout {
                let [q, dq, ddq] = &motion;
                let motion = JointMotion { samples, q, dq, ddq };
                regressor_panels(robot.model(), &mut workspace, layout, &motion, &mut panels);
            }
            for joint in 0..joints {
                let (width, body) = (self.width[joint], body_columns(joint));
                for sample in 0..samples {
                    let bin = of.bin[from + sample];
                    let share = 1.0 / counts[bin];
                    let row = &mut self.columns[joint][bin * width..(bin + 1) * width];
                    for (column, value) in row[..body].iter_mut().enumerate() {
                        *value += share * panels.joint(joint)[column * samples + sample];
                    }
                    let (dq, ddq) = (of.dq[joint][from + sample], of.ddq[joint][from + sample]);
                    let steps = [self.step[joint], own.wide_step_ratio * self.step[joint]];
                    let held = presliding[joint][from + sample];
                    let drives = drive_columns([dq, ddq, held], self.tau[joint][bin], steps);
                    for (value, drive) in row[body..].iter_mut().zip(drives) {
                        *value += share * drive;
                    }
                }
            }
            from = to;
        }
        self.scale_columns();
        self.weight = vec![vec![1.0; bins]; joints];
    }

    /// Presliding friction at each sample, from -1 to 1: `z += Δq / reach`, limited to ±1. A joint that rests keeps the
    /// value of its last motion. Zero at the start of a piece, because the motion before it is unknown.
    fn presliding(&self, joint: usize, of: &Collected) -> Vec<f64> {
        let reach = (self.settings.bins.presliding_ratio * rms(&of.dq[joint]) * self.bin_s).max(f64::MIN_POSITIVE);
        let q = &of.q[joint];
        let mut held = 0.0_f64;
        let next = |at: usize| {
            let is_first = at == 0 || self.piece[of.bin[at]] != self.piece[of.bin[at - 1]];
            held = if is_first { 0.0 } else { (held + (q[at] - q[at - 1]) / reach).clamp(-1.0, 1.0) };
            held
        };
        (0..q.len()).map(next).collect()
    }

    /// Scales every column to a root mean square of 1. Marks bins with values that are not finite as unusable.
    fn scale_columns(&mut self) {
        let bins = self.time_s.len();
        for joint in 0..self.q.len() {
            let width = self.width[joint];
            for bin in 0..bins {
                let row = &mut self.columns[joint][bin * width..(bin + 1) * width];
                if !row.iter().all(|value| value.is_finite()) || !self.tau[joint][bin].is_finite() {
                    row.fill(0.0);
                    self.tau[joint][bin] = 0.0;
                    self.usable[bin] = false;
                }
            }
            let mut scales = vec![0.0; width];
            for row in self.columns[joint].chunks_exact(width) {
                for (scale, value) in scales.iter_mut().zip(row) {
                    *scale += value * value;
                }
            }
            for scale in &mut scales {
                *scale = (*scale / bins as f64).sqrt();
            }
            for row in self.columns[joint].chunks_exact_mut(width) {
                for (value, scale) in row.iter_mut().zip(&scales) {
                    *value = if *scale > 1e-12 { *value / scale } else { 0.0 };
                }
            }
            let mut drive = [0.0; DRIVE_COLUMNS];
            drive.copy_from_slice(&scales[width - DRIVE_COLUMNS..]);
            self.drive_scale.push(drive);
        }
    }

    /// Marks the bins in these intervals (s) as unusable, and the bins up to `margin_s` before and after them.
    pub(crate) fn leave_out(&mut self, intervals: &[[f64; 2]], margin_s: f64) {
        for (usable, time_s) in self.usable.iter_mut().zip(&self.time_s) {
            let is_near = |[from, to]: &[f64; 2]| *time_s > from - margin_s && *time_s < to + margin_s;
            *usable &= !intervals.iter().any(is_near);
        }
    }

    /// The same rows with the weight `1 / variance` of each bin, relative to the median of the joint.
    pub(crate) fn weighted(&self, variance: &[Vec<f64>]) -> Self {
        let of_joint = |variance: &Vec<f64>| -> Vec<f64> {
            let usual = median(variance.clone());
            variance.iter().map(|variance| usual / variance.max(f64::MIN_POSITIVE)).collect()
        };
        Self { weight: variance.iter().map(of_joint).collect(), samples: Vec::new(), ..self.clone() }
    }

    /// The same rows without presliding friction.
    pub(crate) fn without_presliding(&self) -> Self {
        let mut plain = Self { samples: Vec::new(), ..self.clone() };
        for (columns, width) in plain.columns.iter_mut().zip(&self.width) {
            columns.chunks_exact_mut(*width).for_each(|row| row[width - DRIVE_COLUMNS + PRESLIDING] = 0.0);
        }
        plain
    }

    /// Whether any joint moves in a bin.
    pub(crate) fn is_moving(&self, bin: usize) -> bool {
        (0..self.joints()).any(|joint| self.dq[joint][bin].abs() > self.rest[joint])
    }

    /// Number of bins.
    pub(crate) fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        self.q.len()
    }

    /// The columns of one joint in one bin.
    pub(crate) fn row(&self, joint: usize, bin: usize) -> &[f64] {
        &self.columns[joint][bin * self.width[joint]..(bin + 1) * self.width[joint]]
    }
}

/// Values of the columns for offset, narrow and wide smoothed sign of the velocity, presliding friction, velocity,
/// signed square of the velocity, acceleration, and friction that grows with the torque.
fn drive_columns([dq, ddq, held]: [f64; 3], tau: f64, [narrow, wide]: [f64; 2]) -> [f64; DRIVE_COLUMNS] {
    let wide = (dq / wide).tanh();
    [1.0, (dq / narrow).tanh(), wide, held, dq, dq * dq.abs(), ddq, tau.abs() * wide]
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Median; zero without values.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
