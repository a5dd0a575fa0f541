//! Denoised motion and torque of recordings for simulated copies.

use super::thinned::Thinned;
use crate::error::IdentificationError;
use dynident_recording::derivative::ButterworthZeroPhase;
use dynident_recording::{
    DecimationSettings, Decimator, Derivatives, Differentiator, FilterError, MotionBlock, MotionSettings, MotionStream,
    Place, SampleRanges,
};
use dynident_rows::{LogError, LogSpectrum, Logs, RegressorModel, Samples};

/// Sample rate of a simulated copy, relative to the highest candidate cut-off.
const RATE_RATIO: f64 = 4.0;

/// A separate low-pass for each joint. Its cut-off is the frequency at which the motion of the joint disappears in the
/// noise.
#[derive(Debug)]
pub(super) struct JointByJoint(pub(super) Vec<ButterworthZeroPhase>);

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

/// Denoised and decimated motion and torque of the recordings read so far.
pub(super) struct ReadLogs {
    highest_hz: f64,
    /// Rate of the first log, hertz; logs with another rate are skipped.
    pub(super) log_rate_hz: f64,
    pub(super) thinning: usize,
    pub(super) blocks: Vec<MotionBlock>,
    pub(super) noise_squares: Vec<f64>,
    /// For each joint, the frequency at which its motion disappears in the noise, hertz; the highest one of all logs.
    pub(super) reference_hz: Vec<f64>,
    pub(super) used: u64,
    pub(super) total: u64,
}

impl ReadLogs {
    pub(super) fn new(dof: usize, highest_hz: f64) -> Self {
        Self {
            highest_hz,
            log_rate_hz: 0.0,
            thinning: 1,
            blocks: Vec::new(),
            noise_squares: vec![0.0; dof],
            reference_hz: vec![0.0; dof],
            used: 0,
            total: 0,
        }
    }

    /// Reads about `most` decimated samples of a log.
    pub(super) fn take(
        &mut self,
        logs: &Logs<'_>,
        motion: &MotionSettings,
        model: &RegressorModel,
        log: &LogSpectrum,
        most: usize,
    ) -> Result<(), IdentificationError> {
        let LogSpectrum { index, rate_hz, choice: spectrum, position_noise } = log;
        let (recording, rate_hz, highest_hz) = (&logs.recordings[*index], *rate_hz, self.highest_hz);
        let Samples::Log(log) = &recording.samples else { return Ok(()) };
        let places = recording.joint_indices(model.model())?;
        if self.log_rate_hz == 0.0 {
            self.log_rate_hz = rate_hz;
            self.thinning = (rate_hz / (RATE_RATIO * highest_hz)).floor().clamp(1.0, 1000.0) as usize;
        } else if (rate_hz / self.log_rate_hz - 1.0).abs() > 0.01 {
            return Ok(());
        }
        let thinning = self.thinning;
        let motion = recording.in_log_order(model.model(), motion)?.into_owned();
        let motion = MotionSettings { smooth_torque: false, ..motion };
        let faded = &spectrum.faded_hz;
        let suggested = spectrum.joints_hz.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let build = || -> Result<Box<dyn Differentiator>, FilterError> {
            let of = |hz: &Option<f64>| {
                let cutoff_hz = hz.unwrap_or(suggested).min(highest_hz).min(0.4 * rate_hz);
                ButterworthZeroPhase::new(4, cutoff_hz)
            };
            Ok(Box::new(JointByJoint(faded.iter().map(of).collect::<Result<_, _>>()?)))
        };
        let named = |source| LogError::recording(&recording.name, source);
        let mut stream = MotionStream::with_differentiator(log, &motion, |_| build()).map_err(named)?;
        if logs.execution.parallel() {
            stream = stream.read_beside();
        }
        // Only the torque needs a filter; decimation without a filter does not distort the denoised motion.
        let filter = DecimationSettings { factor: thinning, ..DecimationSettings::default() };
        let in_filter = |source| LogError::Filter { log: recording.name.clone(), source };
        let decimator = || Decimator::new(&filter, rate_hz, 1).map_err(in_filter);
        let mut pieces = Thinned::new(thinning, model.dof());
        let mut block = MotionBlock::default();
        let mut samples = 0;
        while samples < most * thinning && stream.next_block(&mut block).map_err(named)? {
            let rows = block.rows.min(most * thinning - samples);
            pieces.take(&block, &places, rows, &decimator)?;
            samples += rows;
        }
        self.used += samples as u64;
        self.total += recording.rows_of_whole().unwrap_or(samples as u64).max(samples as u64);
        for (joint, &place) in places.iter().enumerate() {
            let reference_hz = faded[place].unwrap_or(suggested).min(highest_hz);
            self.reference_hz[joint] = self.reference_hz[joint].max(reference_hz);
            let noise = position_noise.get(place).copied().unwrap_or(0.0);
            self.noise_squares[joint] = self.noise_squares[joint].max(noise * noise);
        }
        self.blocks.extend(pieces.finished());
        Ok(())
    }
}
