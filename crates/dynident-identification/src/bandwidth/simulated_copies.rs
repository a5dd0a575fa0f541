//! Simulated copies of recordings: denoised motion, torque that a first fit predicts, and noise as in the recordings.

use super::read_logs::{JointByJoint, ReadLogs};
use crate::error::IdentificationError;
use crate::settings::IdentificationSettings;
use crate::training::plain_fit;
use dynident_model::sample::Random;
use dynident_recording::derivative::ButterworthZeroPhase;
use dynident_recording::{Derivatives, Differentiator, FilterError, MotionBlock, MotionSettings, Place};
use dynident_rows::{
    Execution, JointRows, LogError, LogSpectrum, Logs, ParallelFilterSettings, RegressorModel, RowBuilder, RowConsumer,
    predicted_torque,
};
use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;

/// Maximum number of samples of all pieces. It is enough to compare errors and takes milliseconds.
const MAX_SAMPLES: usize = 4096;
const COPIES: usize = 4;
/// Minimum length of a piece, samples.
const MIN_PIECE_SAMPLES: usize = 32;
/// For each copy, the time shift of the torque noise, relative to the length of a piece.
const NOISE_SHIFTS: [f64; COPIES] = [0.29, 0.53, 0.83, 0.11];
/// Minimum share of the torque noise's power that remains after the effect of position noise is subtracted.
const MIN_NOISE_SHARE: f64 = 1.0e-4;
/// Length of the end effects of filters that are removed, in periods of the lowest cut-off.
const END_EFFECT_PERIODS: f64 = 1.5;
const GOLDEN_RATIO: f64 = 1.618_033_988_749_895;
const SEED: u64 = 0x005E_ED0F_7157;

struct Piece {
    /// Denoised motion, with the torque that the first fit predicts.
    motion: MotionBlock,
    noise: Vec<f64>,
}

/// Simulated measurements of a piece in one copy, joint after joint.
struct Measured {
    q: Vec<f64>,
    tau: Vec<f64>,
}

/// Denoised motion and noise of the recordings, with the parameters that generate the torque of the copies.
pub(super) struct SimulatedCopies {
    pieces: Vec<Piece>,
    copies: Vec<Vec<Measured>>,
    /// For each joint, `WᵀW` of motion that was not used for the fit, divided by the variance of the joint's torque.
    /// The motion consists of the same motions with each joint shifted by another time, which gives other combinations
    /// of postures and velocities. `None` for a joint without torque.
    unseen: Vec<Option<DMatrix<f64>>>,
    theta: Vec<f64>,
    position_noise: Vec<f64>,
    /// Factor on the torque noise. With it, the fit to the selected pieces is as uncertain as a fit to the complete
    /// recordings.
    scale: f64,
    log_rate_hz: f64,
    thinning: usize,
}

impl SimulatedCopies {
    /// Reads the recordings and computes the first fit. `highest_hz` is the highest candidate cut-off.
    pub(super) fn of(
        logs: &Logs<'_>,
        settings: &IdentificationSettings,
        model: &RegressorModel,
        training: &[usize],
        highest_hz: f64,
    ) -> Result<Option<Self>, IdentificationError> {
        let is_bare =
            |log: &&LogSpectrum| training.contains(&log.index) && logs.recordings[log.index].payload.is_none();
        let bare: Vec<&LogSpectrum> = logs.spectra().iter().filter(is_bare).collect();
        let most = MAX_SAMPLES / bare.len().max(1);
        let mut read = ReadLogs::new(model.dof(), highest_hz);
        for log in bare {
            read.take(logs, &settings.motion, model, log, most)?;
        }
        let ReadLogs { log_rate_hz, thinning, blocks, reference_hz, noise_squares, used, total, .. } = read;
        // Beyond the ends of a log, these low-pass filters extrapolate, so a margin is removed.
        let slowest_hz = reference_hz.iter().copied().fold(f64::INFINITY, f64::min);
        let ends = (END_EFFECT_PERIODS * log_rate_hz / thinning as f64 / slowest_hz).ceil() as usize;
        let measured: Vec<MotionBlock> =
            blocks.iter().map(|block| inside(block, ends)).filter(|block| block.rows >= MIN_PIECE_SAMPLES).collect();
        if measured.is_empty() || used == 0 {
            return Ok(None);
        }
        let fitted = Self::fitted(logs, settings, model, measured, log_rate_hz, thinning)?;
        let Some(mut simulated) = fitted else { return Ok(None) };
        // White noise of the log after the low-pass of the decimation.
        simulated.position_noise = noise_squares.iter().map(|square| (square / thinning as f64).sqrt()).collect();
        simulated.scale = (used as f64 / total as f64).sqrt();
        let rate_hz = log_rate_hz / thinning as f64;
        let reference = |hz: &f64| ButterworthZeroPhase::new(4, hz.min(0.4 * rate_hz));
        let reference = reference_hz.iter().map(reference).collect::<Result<Vec<_>, _>>();
        if let Ok(reference) = reference {
            simulated.take_motion_noise(model, &JointByJoint(reference))?;
        }
        simulated.copies = (0..COPIES).into_par_iter().map(|copy| simulated.measured(copy)).collect();
        Ok(Some(simulated))
    }

    /// Subtracts the effect of position noise from the torque noise. The residual of the first fit contains this
    /// effect, and every copy adds new position noise.
    fn take_motion_noise(&mut self, model: &RegressorModel, reference: &JointByJoint) -> Result<(), LogError> {
        let (mut all, mut of_motion) = (vec![0.0_f64; model.dof()], vec![0.0_f64; model.dof()]);
        for (number, piece) in self.pieces.iter().enumerate() {
            // The same filter is used for both motions, so that its end effects cancel.
            let seed = SEED ^ !(number as u64);
            let of = |q: &[f64]| differentiated(&piece.motion, q, reference);
            let noisy = of(&self.noisy_positions(piece, seed));
            let (Some(noisy), Some(clean)) = (noisy, of(&piece.motion.q)) else { return Ok(()) };
            let (with_noise, without) = (torque(model, &noisy, &self.theta)?, torque(model, &clean, &self.theta)?);
            for (joint, (all, of_motion)) in all.iter_mut().zip(&mut of_motion).enumerate() {
                let squares = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>();
                *all += squares(&mut piece.motion.joint(&piece.noise, joint).iter().copied());
                let pairs = noisy.joint(&with_noise, joint).iter().zip(noisy.joint(&without, joint));
                *of_motion += squares(&mut pairs.map(|(x, y)| x - y));
            }
        }
        let left = |(all, of_motion): (&f64, &f64)| {
            if *all > 0.0 { (1.0 - of_motion / all).max(MIN_NOISE_SHARE).sqrt() } else { 1.0 }
        };
        let left: Vec<f64> = all.iter().zip(&of_motion).map(left).collect();
        for piece in &mut self.pieces {
            let rows = piece.motion.rows;
            for (values, left) in piece.noise.chunks_exact_mut(rows).zip(&left) {
                for value in values {
                    *value *= left;
                }
            }
        }
        Ok(())
    }

    /// Positions of a piece with newly simulated noise.
    fn noisy_positions(&self, piece: &Piece, seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed);
        let joints = piece.motion.q.chunks_exact(piece.motion.rows).zip(&self.position_noise);
        joints.flat_map(|(q, noise)| q.iter().map(|q| q + noise * random.normal()).collect::<Vec<_>>()).collect()
    }

    /// Measurements of all pieces in copy number `copy`: new position noise, and the torque noise shifted in time.
    fn measured(&self, copy: usize) -> Vec<Measured> {
        let sign = if copy.is_multiple_of(2) { 1.0 } else { -1.0 };
        let one = |(number, piece): (usize, &Piece)| {
            let (rows, mut tau) = (piece.motion.rows, piece.motion.tau.clone());
            let shift = (NOISE_SHIFTS[copy] * rows as f64) as usize;
            for (tau, noise) in tau.chunks_exact_mut(rows).zip(piece.noise.chunks_exact(rows)) {
                for (row, tau) in tau.iter_mut().enumerate() {
                    *tau += sign * self.scale * noise[(row + shift) % rows];
                }
            }
            Measured { q: self.noisy_positions(piece, SEED ^ ((copy as u64) << 32) ^ number as u64), tau }
        };
        self.pieces.iter().enumerate().map(one).collect()
    }

    fn fitted(
        logs: &Logs<'_>,
        settings: &IdentificationSettings,
        model: &RegressorModel,
        measured: Vec<MotionBlock>,
        log_rate_hz: f64,
        thinning: usize,
    ) -> Result<Option<Self>, IdentificationError> {
        let motion_hz: f64 = logs.spectra().iter().map(|log| log.choice.cutoff_hz).fold(0.0, f64::max);
        let rate_hz = log_rate_hz / thinning as f64;
        let gain_half_hz = (0.7 * motion_hz).min(0.4 * rate_hz);
        let filter = ParallelFilterSettings {
            factor: Some(1),
            cutoff_hz: Some(gain_half_hz),
            transition_hz: Some(gain_half_hz.min(0.5 * rate_hz - gain_half_hz)),
            ..ParallelFilterSettings::default()
        };
        let execution = Execution { threads: logs.execution.threads, ..Execution::default() };
        let plain = super::plain_settings(settings);
        let Ok(values) = plain_fit(model.clone(), measured.clone(), &filter, &plain, execution) else {
            return Ok(None);
        };
        let theta = values[..model.layout().columns().len()].to_vec();
        let mut pieces = Vec::with_capacity(measured.len());
        for mut block in measured {
            let torque = torque(model, &block, &theta)?;
            let mut noise: Vec<f64> =
                block.tau.iter().zip(&torque).map(|(measured, torque)| measured - torque).collect();
            // The noise of invalid torque samples is unknown. The copies exclude these samples, as the fit does.
            noise
                .iter_mut()
                .zip(&block.set_aside)
                .filter(|(_, left_out)| **left_out)
                .for_each(|(noise, _)| *noise = 0.0);
            block.tau = torque;
            pieces.push(Piece { motion: block, noise });
        }
        let unseen = unseen_rows(model, &pieces)?;
        let (copies, position_noise) = (Vec::new(), Vec::new());
        Ok(Some(Self { pieces, copies, unseen, theta, position_noise, scale: 1.0, log_rate_hz, thinning }))
    }

    pub(super) fn log_rate_hz(&self) -> f64 {
        self.log_rate_hz
    }

    pub(super) fn thinning(&self) -> usize {
        self.thinning
    }

    /// The copies, differentiated with this cut-off; `None` for a copy to which the filter cannot be applied.
    pub(super) fn copies(
        &self,
        settings: &MotionSettings,
        cutoff_hz: f64,
    ) -> Result<impl Iterator<Item = Option<Vec<MotionBlock>>>, FilterError> {
        let differentiator = settings.differentiator.clone().with_cutoff(cutoff_hz).build(cutoff_hz)?;
        Ok(self.copies.iter().map(move |copy| {
            let one = |(piece, Measured { q, tau }): (&Piece, &Measured)| {
                let motion = differentiated(&piece.motion, q, differentiator.as_ref())?;
                Some(MotionBlock { tau: tau.clone(), ..motion })
            };
            self.pieces.iter().zip(copy).map(one).collect()
        }))
    }

    /// Mean square over the joints of the difference between two torques: with the parameters `values` and with the
    /// parameters of the first fit, both on denoised motion that was not used for the fit. Each joint is divided by the
    /// standard deviation of its torque.
    pub(super) fn square_error(&self, model: &RegressorModel, values: &[f64]) -> f64 {
        let of_joint = |(joint, squares): (usize, &Option<DMatrix<f64>>)| {
            let columns = model.layout().joint_columns(joint).iter();
            let difference =
                DVector::from_iterator(columns.len(), columns.map(|&column| values[column] - self.theta[column]));
            squares.as_ref().map(|squares| (squares * &difference).dot(&difference).max(0.0))
        };
        let joints: Vec<f64> = self.unseen.iter().enumerate().filter_map(of_joint).collect();
        joints.iter().sum::<f64>() / joints.len().max(1) as f64
    }
}

/// A motion with the positions `q` (joint after joint) and their derivatives; `None` if the differentiator cannot be
/// applied.
fn differentiated(motion: &MotionBlock, q: &[f64], differentiator: &dyn Differentiator) -> Option<MotionBlock> {
    let (rows, mut block) = (motion.rows, motion.clone());
    for (joint, q) in q.chunks_exact(rows).enumerate() {
        let own = joint * rows..(joint + 1) * rows;
        let out =
            Derivatives { q: &mut block.q[own.clone()], dq: &mut block.dq[own.clone()], ddq: &mut block.ddq[own] };
        let place = Place { joint, ..Place::start(block.rate_hz) };
        differentiator.differentiate_at(place, q, out).ok()?;
    }
    Some(block)
}

/// Removes this number of samples at both ends, but keeps at least the middle half.
fn inside(motion: &MotionBlock, ends: usize) -> MotionBlock {
    let ends = ends.min(motion.rows / 4);
    motion.part(ends..motion.rows - ends)
}

/// The same motion with each joint shifted cyclically by another time.
fn shifted(motion: &MotionBlock) -> MotionBlock {
    let mut other = motion.clone();
    for joint in 0..motion.joints {
        let own = joint * motion.rows..(joint + 1) * motion.rows;
        // Multiples of the golden ratio's fractional part, so that no two joints have the same shift.
        let shift = ((GOLDEN_RATIO * (joint + 1) as f64).fract() * motion.rows as f64) as usize;
        for values in [&mut other.q, &mut other.dq, &mut other.ddq] {
            values[own.clone()].rotate_left(shift);
        }
    }
    other
}

fn spread(pieces: &[Piece], joint: usize) -> f64 {
    let values = || pieces.iter().flat_map(|piece| piece.motion.joint(&piece.motion.tau, joint));
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    (values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count).sqrt()
}

fn unseen_rows(model: &RegressorModel, pieces: &[Piece]) -> Result<Vec<Option<DMatrix<f64>>>, LogError> {
    struct Squares<'a>(&'a RegressorModel, Vec<DMatrix<f64>>);
    impl RowConsumer for Squares<'_> {
        fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
            let columns = self.0.layout().joint_columns(rows.joint).len();
            let panel = DMatrixView::from_slice(&rows.panel[..columns * rows.rows], rows.rows, columns);
            self.1[rows.joint].gemm_tr(1.0, &panel, &panel, 1.0);
            Ok(())
        }
    }
    let empty = |joint| {
        let columns = model.layout().joint_columns(joint).len();
        DMatrix::zeros(columns, columns)
    };
    let mut squares = Squares(model, (0..model.dof()).map(empty).collect());
    for piece in pieces {
        every_sample(model, &shifted(&piece.motion), &mut squares)?;
    }
    let rows: usize = pieces.iter().map(|piece| piece.motion.rows).sum();
    let in_spreads = |(joint, squares): (usize, DMatrix<f64>)| {
        let spread = spread(pieces, joint);
        (spread > 0.0).then(|| squares / (rows as f64 * spread * spread))
    };
    Ok(squares.1.into_iter().enumerate().map(in_spreads).collect())
}

/// Sends the unfiltered rows of a motion to a consumer, including rows with invalid torque.
fn every_sample(model: &RegressorModel, block: &MotionBlock, consumer: &mut dyn RowConsumer) -> Result<(), LogError> {
    if !block.set_aside.is_empty() {
        let block = MotionBlock { set_aside: Vec::new(), ..block.clone() };
        return every_sample(model, &block, consumer);
    }
    let places: Vec<usize> = (0..model.dof()).collect();
    let in_filter = |source| LogError::Filter { log: "a simulated copy".to_owned(), source };
    RowBuilder::new(model, &places, block.rate_hz, None).map_err(in_filter)?.take(block, consumer)
}

/// Torque that the base parameters `theta` predict for a motion, joint after joint.
fn torque(model: &RegressorModel, block: &MotionBlock, theta: &[f64]) -> Result<Vec<f64>, LogError> {
    struct Predicted<'a> {
        model: &'a RegressorModel,
        theta: &'a [f64],
        joints: Vec<Vec<f64>>,
        buffer: Vec<f64>,
    }
    impl RowConsumer for Predicted<'_> {
        fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
            let columns = self.model.layout().joint_columns(rows.joint);
            predicted_torque(rows.panel, rows.rows, columns, self.theta, &mut self.buffer);
            self.joints[rows.joint].extend_from_slice(&self.buffer);
            Ok(())
        }
    }
    let mut predicted = Predicted { model, theta, joints: vec![Vec::new(); model.dof()], buffer: Vec::new() };
    every_sample(model, block, &mut predicted)?;
    Ok(predicted.joints.concat())
}
