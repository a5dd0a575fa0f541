//! Simulation of the closed loop of an experiment for estimators. Controller, reference, instants and filters are those
//! of the logs; the parameters vary.

use super::row_pass::PassError;
use super::{EstimatorError, TrainingRows};
use dynident_estimation::{SimulatedCriterion, SimulatedMotion, SimulatedRows};
use dynident_excitation::Motion;
use dynident_model::terms::TorqueTerm;
use dynident_recording::{DecimationSettings, FilterError, MotionBlock};
use dynident_rows::{JointFilters, JointRows, LogError, RegressorModel, RowBuilder, RowConsumer, motion_band_hz};
use dynident_simulation::{
    ControllerModel, ControllerSettings, LoopSettings, Plant, Reference, Run, SimulationError, closed_loop,
};
use nalgebra::{DMatrix, DVector};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ComparedSignal {
    /// Torque, compared by linear regression with the regressor of the simulated motion (DIDIM).
    TorqueRows,
    Torque,
    Position,
}

impl ComparedSignal {
    pub(super) fn method(self) -> &'static str {
        match self {
            Self::TorqueRows => "didim",
            Self::Torque => "clie",
            Self::Position => "cloe",
        }
    }

    pub(super) fn criterion(self) -> SimulatedCriterion {
        match self {
            Self::TorqueRows => SimulatedCriterion::Didim,
            Self::Torque | Self::Position => SimulatedCriterion::Output,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Piece {
    segment: usize,
    first_time_s: f64,
    rows: usize,
}

/// Reference, filter and sampling instants of a log.
pub(super) struct LoopLog {
    pub(super) name: String,
    rate_hz: f64,
    pieces: Vec<Piece>,
    filter: Option<DecimationSettings>,
    reference: Reference,
    /// Start of the simulation, s after the first row of the log: the start of the commanded motion, or the start of
    /// the log if it is later.
    begins_s: f64,
    pub(super) rows: Vec<usize>,
    /// Measured and filtered outputs (torques or positions) of each joint.
    measured: Vec<Vec<f64>>,
}

pub(super) struct SimulatedLoop<'a> {
    pub(super) model: &'a RegressorModel,
    pub(super) controller: &'a ControllerSettings,
    pub(super) controller_model: Option<ControllerModel>,
    pub(super) settings: LoopSettings,
    pub(super) compared: ComparedSignal,
    pub(super) logs: Vec<LoopLog>,
    /// Converts a message to an error of this estimator.
    pub(super) wrong: &'a dyn Fn(String) -> EstimatorError,
    /// Reason for the last failed simulation.
    pub(super) failure: Option<String>,
}

impl LoopLog {
    /// Reads log `index`: its instants, its filtered outputs, and the commanded motion at the controller's rate.
    pub(super) fn read(
        training: &TrainingRows<'_>,
        index: usize,
        compared: ComparedSignal,
        rate_hz: f64,
        wrong: &dyn Fn(String) -> EstimatorError,
    ) -> Result<Self, EstimatorError> {
        let TrainingRows { logs, model, .. } = *training;
        let (recording, motion) = (&logs.recordings[index], &logs.motion);
        let name = recording.name.clone();
        let Some(commanded) = recording.commanded.as_deref() else {
            return Err(wrong(format!(
                "log `{name}` has no commanded motion: give reference = \"trajectory.csv\" under [[log]]"
            )));
        };
        let Some(mut stream) = recording.open(model.model(), motion)? else {
            return Err(wrong(format!("log `{name}`: a prepared motion has no sampling instants; give raw samples")));
        };
        let places = recording.joint_indices(model.model())?;
        let filter = logs.filter.decimation(stream.rate_hz(), motion_band_hz(motion));
        let in_filter = |source| LogError::Filter { log: name.clone(), source };
        let dof = model.dof();
        let mut outputs = Outputs::new(dof, filter.as_ref(), stream.rate_hz()).map_err(in_filter)?;
        let (mut block, mut pieces, mut samples) = (MotionBlock::default(), Vec::new(), 0);
        while stream.next_block(&mut block).map_err(|source| LogError::recording(&name, source))? {
            let values = if compared == ComparedSignal::Position { &block.q } else { &block.tau };
            for (joint, &place) in places.iter().enumerate() {
                outputs.take(joint, block.segment, block.joint(values, place));
            }
            pieces.push(Piece { segment: block.segment, first_time_s: block.first_time_s, rows: block.rows });
            samples += block.rows;
            logs.execution.progress.advance(block.rows as u64);
        }
        let log_rate_hz = stream.rate_hz();
        if outputs.rows.iter().any(Vec::is_empty) {
            let (rows, needed) = (samples as u64, outputs.filters.needed());
            return Err(LogError::NothingLeft { log: name, rows, needed, cause: String::new() }.into());
        }
        let begins_s = commanded.start_s().min(0.0);
        let ends_s =
            pieces.iter().map(|piece| piece.first_time_s + piece.rows as f64 / log_rate_hz).fold(0.0, f64::max);
        let over = |piece: &Piece| {
            let last_s = piece.first_time_s + (piece.rows - 1) as f64 / log_rate_hz;
            let ends = [piece.first_time_s, last_s];
            ends.into_iter().find(|&time_s| (0..dof).any(|joint| !commanded.covers(joint, time_s)))
        };
        if let Some(time_s) = pieces.iter().filter(|piece| piece.rows > 0).find_map(over) {
            return Err(wrong(format!(
                "log `{name}`: at {time_s:.3} s of the log the reference has not begun or is over while the robot still moves; cut the log with time_range_s, or fix the reference's start_s"
            )));
        }
        let count = ((ends_s - begins_s) * rate_hz).ceil() as usize + 2;
        let mut command = Motion::default();
        command.reset(dof, count);
        for joint in 0..dof {
            for sample in 0..count {
                let at = joint * count + sample;
                [command.q[at], command.dq[at], command.ddq[at]] =
                    commanded.at(joint, begins_s + sample as f64 / rate_hz);
            }
        }
        let reference = Reference::new(rate_hz, command).map_err(|error| wrong(format!("log `{name}`: {error}")))?;
        let rows = outputs.rows.iter().map(Vec::len).collect();
        Ok(Self { name, rate_hz: log_rate_hz, pieces, filter, reference, begins_s, rows, measured: outputs.rows })
    }
}

impl SimulatedLoop<'_> {
    /// Measured outputs, ordered by log, then by joint, as all rows.
    pub(super) fn measured(&self) -> DVector<f64> {
        let all = self.logs.iter().flat_map(|log| log.measured.iter().flatten().copied());
        DVector::from_iterator(self.rows(), all)
    }

    pub(super) fn rows(&self) -> usize {
        self.logs.iter().flat_map(|log| &log.rows).sum()
    }

    /// The robot with base parameters θ. Every set of inertial parameters with these base parameters has the same
    /// torques and mass matrix.
    fn plant(&self, theta: &[f64]) -> Result<Plant, SimulationError> {
        let model = ControllerModel::from_columns(self.model.model(), self.model.layout().columns(), theta)?;
        let (terms, values): (Vec<TorqueTerm>, Vec<f64>) = model.terms().iter().cloned().unzip();
        Plant::new(model.model(), &terms, &values)
    }

    fn rows_of(&self, log: &LoopLog, run: &Run, out: &mut CollectedRows) -> Result<(), EstimatorError> {
        let dof = self.model.model().dof();
        let motion = (self.compared != ComparedSignal::Torque)
            .then(|| sampled(run, log.begins_s))
            .transpose()
            .map_err(|source| LogError::Filter { log: log.name.clone(), source })?;
        let in_filter = |source| LogError::Filter { log: log.name.clone(), source };
        let mut outputs = Outputs::new(dof, log.filter.as_ref(), log.rate_hz).map_err(in_filter)?;
        let layout = self.model.layout();
        let places: Vec<usize> = (0..dof).collect();
        let builder = || RowBuilder::new(self.model, &places, log.rate_hz, log.filter.as_ref());
        let mut builder = (self.compared == ComparedSignal::TorqueRows).then(builder).transpose().map_err(in_filter)?;
        let mut panels = PanelRows { joints: vec![Vec::new(); dof] };
        let mut values = Vec::new();
        for piece in &log.pieces {
            let time = |row: usize| piece.first_time_s + row as f64 / log.rate_hz;
            let mut block = MotionBlock {
                rate_hz: log.rate_hz,
                segment: piece.segment,
                first_time_s: piece.first_time_s,
                rows: piece.rows,
                joints: dof,
                ..MotionBlock::default()
            };
            if builder.is_some() {
                for field in [&mut block.q, &mut block.dq, &mut block.ddq, &mut block.tau] {
                    field.resize(dof * piece.rows, 0.0);
                }
            }
            for joint in 0..dof {
                values.clear();
                for row in 0..piece.rows {
                    values.push(match &motion {
                        Some(motion) if self.compared == ComparedSignal::Position => motion.at(joint, time(row))[0],
                        _ => held_torque(run, joint, time(row) - log.begins_s),
                    });
                    if let (Some(motion), true) = (&motion, builder.is_some()) {
                        let at = joint * piece.rows + row;
                        [block.q[at], block.dq[at], block.ddq[at]] = motion.at(joint, time(row));
                    }
                }
                outputs.take(joint, piece.segment, &values);
            }
            if let Some(builder) = &mut builder {
                builder.take(&block, &mut panels)?;
            }
        }
        for joint in 0..dof {
            out.output.append(&mut outputs.rows[joint]);
            if builder.is_some() {
                let (rows, columns) = (log.rows[joint], layout.joint_columns(joint));
                for (place, &column) in columns.iter().enumerate() {
                    let mut row = out.filled;
                    for (count, panel) in &panels.joints[joint] {
                        let from = &panel[place * count..(place + 1) * count];
                        out.regressor.view_mut((row, column), (*count, 1)).copy_from_slice(from);
                        row += count;
                    }
                }
                out.filled += rows;
            }
        }
        Ok(())
    }
}

impl SimulatedMotion for SimulatedLoop<'_> {
    type Error = PassError;

    fn simulate(&mut self, parameters: &[f64]) -> Result<Option<SimulatedRows>, PassError> {
        let mut plant = match self.plant(parameters) {
            Ok(plant) => plant,
            Err(reason) => {
                self.failure = Some(reason.to_string());
                return Ok(None);
            }
        };
        let rows = self.rows();
        let with_regressor = self.compared == ComparedSignal::TorqueRows;
        let mut out = CollectedRows {
            output: Vec::with_capacity(rows),
            regressor: DMatrix::zeros(if with_regressor { rows } else { 0 }, parameters.len()),
            filled: 0,
        };
        for log in &self.logs {
            let in_loop = |error: SimulationError| {
                PassError::Log((self.wrong)(format!(
                    "log `{}`: the closed loop cannot be simulated: {error}",
                    log.name
                )))
            };
            let mut controller = self.controller.build(plant.dof(), self.controller_model.as_ref()).map_err(in_loop)?;
            let run = closed_loop(&mut plant, controller.as_mut(), &log.reference, &self.settings).map_err(in_loop)?;
            if !run.status.is_done() {
                self.failure = Some(format!("log `{}`: {}", log.name, run.status));
                return Ok(None);
            }
            self.rows_of(log, &run, &mut out).map_err(PassError::Log)?;
        }
        Ok(Some(SimulatedRows { output: DVector::from_vec(out.output), regressor: out.regressor }))
    }
}

struct CollectedRows {
    output: Vec<f64>,
    regressor: DMatrix<f64>,
    filled: usize,
}

/// Filters one value per joint and sample with the parallel filter.
struct Outputs {
    filters: JointFilters,
    segment: usize,
    rows: Vec<Vec<f64>>,
}

impl Outputs {
    fn new(dof: usize, filter: Option<&DecimationSettings>, rate_hz: f64) -> Result<Self, FilterError> {
        let filters = JointFilters::new(&vec![1; dof], rate_hz, filter)?;
        Ok(Self { filters, segment: 0, rows: vec![Vec::new(); dof] })
    }

    fn take(&mut self, joint: usize, segment: usize, values: &[f64]) {
        if core::mem::replace(&mut self.segment, segment) != segment {
            self.filters.restart();
        }
        let rows = self.filters.push(joint, values, values.len(), &[]);
        self.rows[joint].extend_from_slice(&rows.panel[..rows.rows]);
    }
}

struct PanelRows {
    joints: Vec<Vec<(usize, Vec<f64>)>>,
}

impl RowConsumer for PanelRows {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.joints[rows.joint].push((rows.rows, rows.panel.to_vec()));
        Ok(())
    }
}

/// Motion of a simulated run at any time on the log's clock, by quintic interpolation of position, velocity and
/// acceleration between the samples of the controller.
fn sampled(run: &Run, begins_s: f64) -> Result<dynident_recording::Reference, FilterError> {
    let times: Vec<f64> = (0..run.samples).map(|sample| begins_s + run.time_s(sample)).collect();
    let joints: Vec<[Vec<f64>; 3]> = (0..run.joints.len())
        .map(|joint| [&run.q, &run.dq, &run.ddq].map(|values| values[run.of(joint)].to_vec()))
        .collect();
    dynident_recording::Reference::sampled(&times, &joints)
}

/// Torque of the last controller sample before `time_s`, which is held until the next one. A small offset of the time
/// avoids rounding errors.
fn held_torque(run: &Run, joint: usize, time_s: f64) -> f64 {
    let sample = ((time_s * run.rate_hz).max(0.0) + 1e-6).floor() as usize;
    run.tau[run.of(joint)][sample.min(run.samples - 1)]
}
