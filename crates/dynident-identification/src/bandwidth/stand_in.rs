//! Recordings that stand in for themselves: their motion without its noise, a first fit's torque, and their noise.

use crate::error::IdentificationError;
use crate::logs::{LogSpectrum, Logs};
use crate::recording::{LogError, Samples};
use crate::regressor_model::RegressorModel;
use crate::rows::{JointRows, ParallelFilterSettings, RowBuilder, RowConsumer, predicted_torque};
use crate::settings::IdentificationSettings;
use crate::training::plain_fit;
use dynident_model::sample::Random;
use dynident_recording::derivative::ButterworthZeroPhase;
use dynident_recording::{
    DecimationSettings, Decimator, Derivatives, Differentiator, FilterError, MotionBlock, MotionSettings, MotionStream,
    Place, SampleRanges,
};
use std::sync::Arc;

/// Samples a second of the copy, in units of the highest candidate.
const RATE: f64 = 4.0;
/// Samples of all pieces together, at most: enough to tell errors apart, and milliseconds.
const MOST_SAMPLES: usize = 4096;
/// Shortest piece that counts.
const SHORTEST: usize = 32;
/// Of each copy, how far along its piece the torque's noise is moved.
const SHIFTS: [f64; 4] = [0.29, 0.53, 0.83, 0.11];
/// Part of the torque's noise that is kept where the noise of the positions seems to make all of it.
const LEAST_LEFT: f64 = 1.0e-4;
/// Periods of the slowest cut-off within which an end is felt.
const INVENTED: f64 = 1.5;
/// The golden ratio.
const GOLDEN: f64 = 1.618_033_988_749_895;
const SEED: u64 = 0x005E_ED0F_7157;

/// One uninterrupted piece.
struct Piece {
    /// The motion without its noise and the torque that the first fit makes of it.
    motion: Arc<MotionBlock>,
    /// What the first fit leaves of the measured torque.
    noise: Vec<f64>,
}

/// The recordings' motion and noise, and parameters that are known for once.
pub(super) struct StandIn {
    pieces: Vec<Piece>,
    /// The same motions with each joint at another time: postures and velocities that no fit has seen together.
    unseen: Vec<MotionBlock>,
    theta: Vec<f64>,
    position_noise: Vec<f64>,
    /// What the noise of the torque is multiplied by, so that a part of the recordings is as uncertain as the whole.
    scale: f64,
    spread: Vec<f64>,
    log_rate_hz: f64,
    thinning: usize,
}

/// A low-pass of its own for each joint: where its motion has faded into the noise.
#[derive(Debug)]
struct JointByJoint(Vec<ButterworthZeroPhase>);

impl Differentiator for JointByJoint {
    fn name(&self) -> &'static str {
        "joint-by-joint"
    }

    fn minimum_samples(&self) -> usize {
        self.0.iter().map(Differentiator::minimum_samples).max().unwrap_or(1)
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        self.0.iter().filter_map(|joint| joint.context_samples(rate_hz)).max()
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        self.0[place.joint].differentiate_at(place, q, out)
    }
}

impl StandIn {
    /// Reads the recordings and fits to them; `highest_hz` is the highest candidate.
    pub(super) fn of(
        (logs, settings): (&Logs<'_>, &IdentificationSettings),
        model: &RegressorModel,
        training: &[usize],
        highest_hz: f64,
    ) -> Result<Option<Self>, IdentificationError> {
        let dof = model.dof();
        let is_bare =
            |log: &&LogSpectrum| training.contains(&log.index) && logs.recordings[log.index].payload.is_none();
        let bare: Vec<&LogSpectrum> = logs.spectra().iter().filter(is_bare).collect();
        let each = MOST_SAMPLES / bare.len().max(1);
        let (mut log_rate_hz, mut thinning) = (0.0, 1);
        let mut measured: Vec<MotionBlock> = Vec::new();
        let (mut noise_squares, mut reference_hz) = (vec![0.0_f64; dof], vec![0.0_f64; dof]);
        let (mut used, mut seen) = (0_u64, 0_u64);
        for LogSpectrum { index, rate_hz, choice: spectrum, position_noise } in bare {
            let (recording, rate_hz) = (&logs.recordings[*index], *rate_hz);
            let Samples::Log(log) = &recording.samples else { continue };
            let places = recording.places(model.model())?;
            if log_rate_hz == 0.0 {
                log_rate_hz = rate_hz;
                thinning = (rate_hz / (RATE * highest_hz)).floor().clamp(1.0, 1000.0) as usize;
            } else if (rate_hz / log_rate_hz - 1.0).abs() > 0.01 {
                continue;
            }
            let motion = MotionSettings { smooth_torque: false, ..settings.motion.clone() };
            let faded = &spectrum.faded_hz;
            let asked = spectrum.joints_hz.iter().flatten().copied().fold(f64::INFINITY, f64::min);
            let build = || -> Result<Box<dyn Differentiator>, FilterError> {
                let of = |hz: &Option<f64>| {
                    let cutoff_hz = hz.unwrap_or(asked).min(highest_hz).min(0.4 * rate_hz);
                    ButterworthZeroPhase::new(4, cutoff_hz)
                };
                Ok(Box::new(JointByJoint(faded.iter().map(of).collect::<Result<_, _>>()?)))
            };
            let named = |source| LogError::recording(&recording.name, source);
            let mut stream = MotionStream::with_differentiator(log, &motion, |_| build()).map_err(named)?;
            // One filter for the torque; the motion without its noise has nothing to lose by being thinned out.
            let filter = DecimationSettings { factor: thinning, ..DecimationSettings::default() };
            let in_filter = |source| LogError::Filter { log: recording.name.clone(), source };
            let decimator = || Decimator::new(&filter, rate_hz, 1).map_err(in_filter);
            let mut pieces = Thinned { thinning, dof, ..Thinned::default() };
            let mut block = MotionBlock::default();
            let mut samples = 0;
            while samples < each * thinning && stream.next_block(&mut block).map_err(named)? {
                let rows = block.rows.min(each * thinning - samples);
                pieces.take(&block, &places, rows, &decimator)?;
                samples += rows;
            }
            used += samples as u64;
            seen += recording.estimated_rows().unwrap_or(samples as u64).max(samples as u64);
            for (joint, &place) in places.iter().enumerate() {
                reference_hz[joint] = reference_hz[joint].max(faded[place].unwrap_or(asked).min(highest_hz));
                let noise = position_noise.get(place).copied().unwrap_or(0.0);
                noise_squares[joint] = noise_squares[joint].max(noise * noise);
            }
            measured.extend(pieces.finished());
        }
        // The filters of the reference invent what lies beyond the ends.
        let slowest_hz = reference_hz.iter().copied().fold(f64::INFINITY, f64::min);
        let ends = (INVENTED * log_rate_hz / thinning as f64 / slowest_hz).ceil() as usize;
        let measured: Vec<MotionBlock> =
            measured.iter().map(|block| inside(block, ends)).filter(|block| block.rows >= SHORTEST).collect();
        if measured.is_empty() || used == 0 {
            return Ok(None);
        }
        let fitted = Self::fitted((logs, settings), model, measured, (log_rate_hz, thinning))?;
        let Some(mut stand_in) = fitted else { return Ok(None) };
        // White noise of the log, thinned out below a low-pass.
        stand_in.position_noise = noise_squares.iter().map(|square| (square / thinning as f64).sqrt()).collect();
        stand_in.scale = (used as f64 / seen as f64).sqrt();
        let rate_hz = log_rate_hz / thinning as f64;
        let reference = |hz: &f64| ButterworthZeroPhase::new(4, hz.min(0.4 * rate_hz));
        let reference = reference_hz.iter().map(reference).collect::<Result<Vec<_>, _>>();
        if let Ok(reference) = reference {
            stand_in.take_motion_noise(model, &JointByJoint(reference))?;
        }
        Ok(Some(stand_in))
    }

    /// Takes from the torque's noise what the noise of the positions alone makes: the first fit saw it in the motion,
    /// and every copy gets it anew.
    fn take_motion_noise(&mut self, model: &RegressorModel, reference: &JointByJoint) -> Result<(), LogError> {
        let (mut all, mut of_motion) = (vec![0.0_f64; model.dof()], vec![0.0_f64; model.dof()]);
        for (number, piece) in self.pieces.iter().enumerate() {
            // Both through the same filter: what it does to the ends is no noise.
            let seed = SEED ^ !(number as u64);
            let of = |scale: f64| self.noisy_motion(piece, reference, (seed, scale));
            let (Some(noisy), Some(clean)) = (of(1.0), of(0.0)) else { return Ok(()) };
            let (with_noise, without) = (torque(model, &noisy, &self.theta)?, torque(model, &clean, &self.theta)?);
            for (joint, (all, of_motion)) in all.iter_mut().zip(&mut of_motion).enumerate() {
                let squares = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>();
                *all += squares(&mut piece.motion.joint(&piece.noise, joint).iter().copied());
                let pairs = noisy.joint(&with_noise, joint).iter().zip(noisy.joint(&without, joint));
                *of_motion += squares(&mut pairs.map(|(x, y)| x - y));
            }
        }
        let left = |(all, of_motion): (&f64, &f64)| {
            if *all > 0.0 { (1.0 - of_motion / all).max(LEAST_LEFT).sqrt() } else { 1.0 }
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

    /// A piece's motion with fresh noise, `scale` times the recordings', through a differentiator; `None` where that
    /// does not apply.
    fn noisy_motion(
        &self,
        piece: &Piece,
        differentiator: &dyn Differentiator,
        (seed, scale): (u64, f64),
    ) -> Option<MotionBlock> {
        let (rows, mut block) = (piece.motion.rows, MotionBlock::clone(&piece.motion));
        let (mut random, mut noisy) = (Random::new(seed), vec![0.0; rows]);
        for joint in 0..block.joints {
            let own = joint * rows..(joint + 1) * rows;
            for (noisy, q) in noisy.iter_mut().zip(&piece.motion.q[own.clone()]) {
                *noisy = q + scale * self.position_noise[joint] * random.normal();
            }
            let out =
                Derivatives { q: &mut block.q[own.clone()], dq: &mut block.dq[own.clone()], ddq: &mut block.ddq[own] };
            let place = Place { joint, ..Place::start(block.rate_hz) };
            differentiator.differentiate_at(place, &noisy, out).ok()?;
        }
        Some(block)
    }

    /// The first fit, its torque and what it leaves.
    fn fitted(
        (logs, settings): (&Logs<'_>, &IdentificationSettings),
        model: &RegressorModel,
        measured: Vec<MotionBlock>,
        (log_rate_hz, thinning): (f64, usize),
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
        let Ok(estimate) = plain_fit(model.clone(), measured.clone(), &filter, &super::plain_settings(settings)) else {
            return Ok(None);
        };
        let theta = estimate.values[..model.layout().columns().len()].to_vec();
        let mut pieces = Vec::with_capacity(measured.len());
        for mut block in measured {
            let torque = torque(model, &block, &theta)?;
            let noise = block.tau.iter().zip(&torque).map(|(measured, torque)| measured - torque).collect();
            block.tau = torque;
            pieces.push(Piece { motion: Arc::new(block), noise });
        }
        let unseen = pieces.iter().map(|piece| shifted(&piece.motion)).collect();
        let spread = (0..model.dof()).map(|joint| spread(&pieces, joint)).collect();
        Ok(Some(Self { pieces, unseen, theta, position_noise: Vec::new(), scale: 1.0, spread, log_rate_hz, thinning }))
    }

    /// Samples a second of the recordings.
    pub(super) fn log_rate_hz(&self) -> f64 {
        self.log_rate_hz
    }

    /// Samples of the recordings for each of the copy.
    pub(super) fn thinning(&self) -> usize {
        self.thinning
    }

    /// Copy number `copy` of the recordings as a fit with this cut-off sees them; `None` where the filter does not
    /// apply.
    pub(super) fn copy(&self, settings: &MotionSettings, cutoff_hz: f64, copy: usize) -> Option<Vec<MotionBlock>> {
        let differentiator = settings.differentiator.clone().with_cutoff(cutoff_hz).build(cutoff_hz).ok()?;
        let one = |(number, piece): (usize, &Piece)| {
            let seed = SEED ^ ((copy as u64) << 32) ^ number as u64;
            let mut block = self.noisy_motion(piece, differentiator.as_ref(), (seed, 1.0))?;
            let rows = block.rows;
            let shift = (SHIFTS[copy % SHIFTS.len()] * rows as f64) as usize;
            let sign = if copy.is_multiple_of(2) { 1.0 } else { -1.0 };
            for (tau, noise) in block.tau.chunks_exact_mut(rows).zip(piece.noise.chunks_exact(rows)) {
                for (row, tau) in tau.iter_mut().enumerate() {
                    *tau += sign * self.scale * noise[(row + shift) % rows];
                }
            }
            Some(block)
        };
        self.pieces.iter().enumerate().map(one).collect()
    }

    /// Root mean square over joints of the torque that parameters `values` predict beside that of the first fit's, on
    /// motion without noise that the fit has not seen, each in units of its spread.
    pub(super) fn error(&self, model: &RegressorModel, values: &[f64]) -> f64 {
        let difference: Vec<f64> = self.theta.iter().zip(values).map(|(known, found)| found - known).collect();
        let dof = model.dof();
        let (mut squares, mut rows) = (vec![0.0; dof], 0);
        for motion in &self.unseen {
            let Ok(torque) = torque(model, motion, &difference) else { return f64::INFINITY };
            rows += motion.rows;
            for (joint, square) in squares.iter_mut().enumerate() {
                *square += motion.joint(&torque, joint).iter().map(|x| x * x).sum::<f64>();
            }
        }
        let moving: Vec<f64> = squares
            .iter()
            .zip(&self.spread)
            .filter(|(_, spread)| **spread > 0.0)
            .map(|(square, spread)| square / (rows as f64 * spread * spread))
            .collect();
        (moving.iter().sum::<f64>() / moving.len().max(1) as f64).sqrt()
    }
}

/// A motion without so many samples at both ends, but at least its middle half.
fn inside(motion: &MotionBlock, ends: usize) -> MotionBlock {
    let ends = ends.min(motion.rows / 4);
    let rows = motion.rows - 2 * ends;
    let part = |values: &[f64]| -> Vec<f64> {
        values.chunks_exact(motion.rows.max(1)).flat_map(|joint| &joint[ends..ends + rows]).copied().collect()
    };
    let MotionBlock { q, dq, ddq, tau, .. } = motion;
    MotionBlock { rows, q: part(q), dq: part(dq), ddq: part(ddq), tau: part(tau), ..motion.clone() }
}

/// The same motion with each joint at another time; each goes on at its start behind its end.
fn shifted(motion: &MotionBlock) -> MotionBlock {
    let mut other = motion.clone();
    for joint in 0..motion.joints {
        let own = joint * motion.rows..(joint + 1) * motion.rows;
        // Multiples of the golden ratio's fraction: no two joints keep their distance in time.
        let shift = ((GOLDEN * (joint + 1) as f64).fract() * motion.rows as f64) as usize;
        for values in [&mut other.q, &mut other.dq, &mut other.ddq] {
            values[own.clone()].rotate_left(shift);
        }
    }
    other
}

/// Standard deviation of a joint's torque over all pieces.
fn spread(pieces: &[Piece], joint: usize) -> f64 {
    let values = || pieces.iter().flat_map(|piece| piece.motion.joint(&piece.motion.tau, joint));
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    (values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count).sqrt()
}

/// A log's blocks at a lower rate, piece by piece, joints in the model's order.
#[derive(Default)]
struct Thinned {
    thinning: usize,
    dof: usize,
    pieces: Vec<MotionBlock>,
    segment: Option<usize>,
    decimators: Vec<Decimator>,
    columns: [Vec<Vec<f64>>; 4],
    out: Vec<f64>,
    rate_hz: f64,
}

impl Thinned {
    fn take(
        &mut self,
        block: &MotionBlock,
        places: &[usize],
        rows: usize,
        decimator: &dyn Fn() -> Result<Decimator, LogError>,
    ) -> Result<(), LogError> {
        if self.segment != Some(block.segment) {
            self.close();
            self.segment = Some(block.segment);
            self.rate_hz = block.rate_hz;
            self.decimators = (0..self.dof).map(|_| decimator()).collect::<Result<_, _>>()?;
            self.columns = core::array::from_fn(|_| vec![Vec::new(); self.dof]);
        }
        for (joint, &place) in places.iter().enumerate() {
            for (column, source) in self.columns.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
                column[joint].extend_from_slice(&block.joint(source, place)[..rows]);
            }
            self.decimators[joint].push(&block.joint(&block.tau, place)[..rows], rows, &mut self.out);
            self.columns[3][joint].extend_from_slice(&self.out);
        }
        Ok(())
    }

    /// Ends a piece.
    fn close(&mut self) {
        let Some(decimator) = self.decimators.first() else { return };
        let (rows, first) = (self.columns[3].first().map_or(0, Vec::len), decimator.half_length());
        let thinned = |columns: &[Vec<f64>]| -> Vec<f64> {
            columns.iter().flat_map(|x| (0..rows).map(|row| x[first + row * self.thinning])).collect()
        };
        let [q, dq, ddq, tau] = &self.columns;
        self.pieces.push(MotionBlock {
            rate_hz: self.rate_hz / self.thinning as f64,
            rows,
            joints: self.dof,
            q: thinned(q),
            dq: thinned(dq),
            ddq: thinned(ddq),
            tau: tau.concat(),
            ..MotionBlock::default()
        });
        self.decimators.clear();
    }

    fn finished(mut self) -> Vec<MotionBlock> {
        self.close();
        self.pieces
    }
}

/// Torque of the base parameters `theta` on a motion, joint-major.
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
    let places: Vec<usize> = (0..model.dof()).collect();
    let in_filter = |source| LogError::Filter { log: String::new(), source };
    let mut builder = RowBuilder::new(model, &places, block.rate_hz, None).map_err(in_filter)?;
    let mut predicted = Predicted { model, theta, joints: vec![Vec::new(); model.dof()], buffer: Vec::new() };
    builder.take(block, &mut predicted)?;
    Ok(predicted.joints.concat())
}
