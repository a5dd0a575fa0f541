//! What the noise of the positions makes of the rows.

use super::builder::RowBuilder;
use super::filter::motion_band_hz;
use super::pass::LogPass;
use super::{JointRows, RowConsumer};
use crate::recording::{LogError, Samples};
use crate::regressor_model::RegressorModel;
use dynident_estimation::{SegmentSettings, SegmentedFactor};
use dynident_model::sample::Random;
use dynident_recording::{Derivatives, Differentiator, ImportReport, MotionBlock, Place};
use rayon::prelude::*;

/// Samples that are looked at: a power from so many is right within a tenth or so, which costs some milliseconds.
const SAMPLES: usize = 4096;
/// Most times that a short log is looked at with other noise.
const MOST_REPEATS: usize = 8;
/// Longest series of noise.
const LONGEST: usize = 1 << 16;
const SEED: u64 = 0x6e6f_6973_6521;

/// For every joint of the model the rows that noise adds to those of a log: `W(m + n) − W(m)` with m the motion as it
/// was measured and n noise of the positions that has passed the same differentiator, and both the parallel filter. Of
/// these rows N it is `NᵀN` that matters: what noise makes of `WᵀW`. Their last column, the torque, is zero.
///
/// n is white noise of the standard deviation that the importer found for each joint, with a fixed seed. m has its own
/// noise already: products of two noisy velocities come out up to twice too large, which errs to the side of noise.
/// Long logs are looked at in pieces, short ones several times; the rows are weighted to be `filtered_rows`.
///
/// `None` where no noise is known: for a motion that was made already, and for differentiators that follow a commanded
/// motion.
///
/// # Errors
/// A log that cannot be read again.
pub fn noise_factors(
    pass: &LogPass<'_>,
    model: &RegressorModel,
    report: Option<&ImportReport>,
    filtered_rows: u64,
) -> Result<Option<Vec<SegmentedFactor>>, LogError> {
    let Some(report) = report else { return Ok(None) };
    let settings = &pass.motion.differentiator;
    let quiet = report.position_noise.iter().all(|noise| *noise == 0.0);
    if settings.reference().is_some() || matches!(pass.recording.samples, Samples::Motion(_)) {
        return Ok(None);
    }
    let columns: Vec<usize> = (0..model.dof()).map(|joint| model.layout().joint_columns(joint).len()).collect();
    let name = &pass.recording.name;
    let in_rows = |source| LogError::Rows { log: name.clone(), source };
    let empty = |&columns: &usize| SegmentedFactor::new(columns, SegmentSettings::default());
    let mut factors: Vec<SegmentedFactor> = columns.iter().map(empty).collect::<Result<_, _>>().map_err(in_rows)?;
    if quiet {
        return Ok(Some(factors));
    }
    let (rate_hz, in_filter) = (report.rate_hz, |source| LogError::Filter { log: name.clone(), source });
    let filter = pass.filter.decimation(rate_hz, pass.torque_hz.or_else(|| motion_band_hz(pass.motion)));
    let places = pass.recording.places(model.model())?;
    let builder = || RowBuilder::new(model, &places, rate_hz, filter.as_ref()).map_err(in_filter);
    let (pieces, read) = pass.some_pieces(SAMPLES, (SAMPLES / 4).max(4 * builder()?.needed()))?;
    let samples: usize = pieces.iter().map(|piece| piece.rows).sum();
    let differentiator = settings.build_following(report.cutoff.cutoff_hz, None).map_err(in_filter)?;
    let repeats = (SAMPLES / samples.max(1)).clamp(1, MOST_REPEATS);
    let mut random = Random::new(SEED);
    let noise = |_| Noise::new(differentiator.as_ref(), &mut random, &report.position_noise, (rate_hz, read, samples));
    let noise: Vec<Noise> = (0..repeats).map(noise).collect::<Result<_, _>>().map_err(in_filter)?;
    // The rows with noise and those without, side by side: the same samples give the same panels in the same order.
    let rows = |block: &(dyn Fn(usize, &MotionBlock, usize) -> MotionBlock + Sync)| -> Result<JointPanels, LogError> {
        let (mut builder, mut panels) = (builder()?, JointPanels(vec![Vec::new(); model.dof()]));
        for repeat in 0..repeats {
            let mut from = 0;
            for piece in &pieces {
                // A segment of its own each time, so that no filter goes on from one to the next.
                let segment = piece.segment + repeat * pieces.len() + 1;
                builder.take(&MotionBlock { segment, ..block(repeat, piece, from) }, &mut panels)?;
                from += piece.rows;
            }
        }
        Ok(panels)
    };
    let noisy = || rows(&|repeat, piece, from| noise[repeat].on(piece, from));
    let (noisy, plain) = rayon::join(noisy, || rows(&|_, piece, _| piece.clone()));
    let (noisy, plain) = (noisy?.0, plain?.0);
    let all = factors.par_iter_mut().zip(noisy).zip(plain).zip(&columns);
    all.try_for_each(|(((factor, noisy), plain), &columns)| {
        let count: usize = plain.iter().map(|panel| panel.len() / (columns + 1)).sum();
        let weight = (filtered_rows as f64 / count.max(1) as f64).sqrt();
        for (noisy, plain) in noisy.iter().zip(&plain) {
            let scaled: Vec<f64> = noisy.iter().zip(plain).map(|(noisy, plain)| weight * (noisy - plain)).collect();
            factor.absorb(&scaled, scaled.len() / (columns + 1))?;
        }
        *factor = factor.as_one_segment();
        Ok(())
    })
    .map_err(in_rows)?;
    Ok(Some(factors))
}

/// Noise of all joints: of position, velocity and acceleration, joint-major.
struct Noise {
    length: usize,
    derivatives: [Vec<f64>; 3],
}

impl Noise {
    fn new(
        differentiator: &dyn Differentiator,
        random: &mut Random,
        position_noise: &[f64],
        (rate_hz, read, length): (f64, usize, usize),
    ) -> Result<Self, dynident_recording::FilterError> {
        // Where a sample depends on the whole piece, the piece is as long as the log.
        let (whole, margin) = match differentiator.context_samples(rate_hz) {
            Some(context) => (length + 2 * context, context),
            None => (read.clamp(length, LONGEST.max(length)), 0),
        };
        let whole = whole.max(differentiator.minimum_samples());
        let mut derivatives: [Vec<f64>; 3] = Default::default();
        let mut out = [vec![0.0; whole], vec![0.0; whole], vec![0.0; whole]];
        for &sigma in position_noise {
            let white: Vec<f64> = (0..whole).map(|_| random.normal()).collect();
            let [q, dq, ddq] = &mut out;
            differentiator.differentiate_at(Place::start(rate_hz), &white, Derivatives { q, dq, ddq })?;
            for (all, own) in derivatives.iter_mut().zip(&out) {
                all.extend(own[margin..margin + length].iter().map(|x| sigma * x));
            }
        }
        Ok(Self { length, derivatives })
    }

    /// A piece with noise on it, the piece's first sample with sample `from` of the noise.
    fn on(&self, piece: &MotionBlock, from: usize) -> MotionBlock {
        let mut noisy = piece.clone();
        let [q, dq, ddq] = &self.derivatives;
        for (values, noise) in [(&mut noisy.q, q), (&mut noisy.dq, dq), (&mut noisy.ddq, ddq)] {
            for (joint, own) in values.chunks_exact_mut(piece.rows.max(1)).enumerate() {
                let noise = noise[joint * self.length + from..].iter();
                own.iter_mut().zip(noise).for_each(|(value, noise)| *value += noise);
            }
        }
        noisy
    }
}

/// The rows of every joint, panel by panel.
struct JointPanels(Vec<Vec<Vec<f64>>>);

impl RowConsumer for JointPanels {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0[rows.joint].push(rows.panel.to_vec());
        Ok(())
    }
}
