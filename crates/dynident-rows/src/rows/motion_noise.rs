//! Effect of position noise on regressor rows.

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

/// Number of simulated samples: it gives the noise power within about 10 %, in some milliseconds.
const NOISE_SAMPLES: usize = 4096;
/// Maximum number of noise realisations for a short log.
const MAX_REPEATS: usize = 8;
/// Maximum length of a simulated noise sequence, samples.
const MAX_SERIES_SAMPLES: usize = 1 << 16;
const SEED: u64 = 0x6e6f_6973_6521;

/// Computes the rows N that position noise adds to the regressor W of every joint: `N = W(m + n) − W(m)`. Here m is the
/// measured motion and n is simulated position noise, differentiated like the positions; both regressors are filtered
/// by the parallel filter. `NᵀN` is the contribution of noise to `WᵀW`. The last column of N, the torque, is zero.
///
/// n is white noise with a fixed seed and the standard deviation that the importer found for each joint. m already
/// contains noise, so the noise of products of two velocities is overestimated by a factor of up to two. Pieces of a
/// long log are used; a short log is used several times. The rows are weighted to represent `filtered_rows` rows.
///
/// `None` if the noise is unknown: for a prepared motion, and for differentiators that follow a commanded motion.
///
/// # Errors
/// The log cannot be read again.
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
    let places = pass.recording.joint_indices(model.model())?;
    let builder = || RowBuilder::new(model, &places, rate_hz, filter.as_ref()).map_err(in_filter);
    let (pieces, read) = pass.some_pieces(NOISE_SAMPLES, (NOISE_SAMPLES / 4).max(4 * builder()?.needed()))?;
    let samples: usize = pieces.iter().map(|piece| piece.rows).sum();
    let differentiator = settings.build_following(report.cutoff.cutoff_hz, None).map_err(in_filter)?;
    let repeats = (NOISE_SAMPLES / samples.max(1)).clamp(1, MAX_REPEATS);
    let mut random = Random::new(SEED);
    let noise = |_| Noise::new(differentiator.as_ref(), &mut random, &report.position_noise, rate_hz, read, samples);
    let noise: Vec<Noise> = (0..repeats).map(noise).collect::<Result<_, _>>().map_err(in_filter)?;
    // The panels with and without noise have the same samples in the same order.
    let rows = |block: &(dyn Fn(usize, &MotionBlock, usize) -> MotionBlock + Sync)| -> Result<JointPanels, LogError> {
        let (mut builder, mut panels) = (builder()?, JointPanels(vec![Vec::new(); model.dof()]));
        for repeat in 0..repeats {
            let mut from = 0;
            for piece in &pieces {
                // Each piece gets its own segment number, so that the filters restart.
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

/// Noise of position, velocity and acceleration of all joints, joint-major.
struct Noise {
    length: usize,
    derivatives: [Vec<f64>; 3],
}

impl Noise {
    fn new(
        differentiator: &dyn Differentiator,
        random: &mut Random,
        position_noise: &[f64],
        rate_hz: f64,
        read: usize,
        length: usize,
    ) -> Result<Self, dynident_recording::FilterError> {
        // A differentiator that uses all samples needs a noise sequence as long as the log.
        let (whole, margin) = match differentiator.context_samples(rate_hz) {
            Some(context) => (length + 2 * context, context),
            None => (read.clamp(length, MAX_SERIES_SAMPLES.max(length)), 0),
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

    /// The piece with noise added: its first sample gets sample `from` of the noise.
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

struct JointPanels(Vec<Vec<Vec<f64>>>);

impl RowConsumer for JointPanels {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0[rows.joint].push(rows.panel.to_vec());
        Ok(())
    }
}
