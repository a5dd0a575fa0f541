//! Error of the predicted torque that two effects cause: the low-pass of the positions, and friction at rest.
//!
//! The low-pass of the differentiator is selected for the training motion. Acceleration above its cut-off is lost, and
//! reversals and pauses are blurred over a period of the cut-off frequency. The torque that is predicted from the same
//! positions with a several times higher cut-off shows the size of this error d; F is the effect of friction at rest:
//!
//! ```text
//! d = h * (τ̂(q_f) − τ̂(q_kf)),   F = |h| * [|q̇_kf| < v_rest] F(load)
//! ```
//!
//! Here h are the coefficients of the parallel filter (`*` is convolution), q_f and q_kf the positions after low-passes
//! with the cut-offs f and k f, and F(load) is the largest friction of a joint at rest ([`Stiction`]). F is the largest
//! torque that any friction within ±F(load) can add to a filtered row, so absolute values of the coefficients are used.

use super::stiction::Stiction;
use dynident_estimation::SpeedRanges;
use dynident_recording::{DifferentiatorSettings, FilterError};
use dynident_rows::{
    JointFilters, JointRows, LogError, LogPass, Logs, ParallelFilterSettings, RawSamples, RegressorModel, RowConsumer,
    motion_band_hz, predicted_torque,
};

/// Maximum cut-off relative to the sample rate.
const MAX_CUTOFF_OVER_RATE: f64 = 0.4;

/// Rows of one joint, computed from positions with a higher cut-off.
#[derive(Clone, Debug, Default)]
pub(crate) struct FinerRows {
    /// Predicted torque, Nm (N).
    pub(crate) predicted: Vec<f64>,
    /// Largest torque that friction at rest can add to the row, Nm (N).
    pub(crate) held: Vec<f64>,
}

/// Computes the largest torque that friction at rest of one joint can add to the filtered rows of a segment.
#[derive(Debug, Default)]
struct HeldBound {
    /// Largest friction at rest for each sample, from sample `first` on.
    samples: Vec<f64>,
    first: usize,
    rows: usize,
}

impl HeldBound {
    /// Adds samples, and appends the rows that they complete to `out`.
    fn push(&mut self, samples: impl Iterator<Item = f64>, taps: &[f64], factor: usize, out: &mut Vec<f64>) {
        self.samples.extend(samples);
        while let Some(own) = self.samples.get(self.rows * factor - self.first..).and_then(|own| own.get(..taps.len()))
        {
            out.push(own.iter().zip(taps).map(|(sample, tap)| sample * tap.abs()).sum());
            self.rows += 1;
        }
        let done = (self.rows * factor - self.first).min(self.samples.len());
        self.samples.drain(..done);
        self.first += done;
    }
}

struct FinerFilters {
    rate_bits: u64,
    segment: usize,
    predicted: JointFilters,
    held: Vec<HeldBound>,
    taps: Vec<f64>,
    factor: usize,
}

struct FinerMotion<'a> {
    model: &'a RegressorModel,
    theta: &'a [f64],
    stictions: Vec<Stiction>,
    rest_below: Vec<f64>,
    log: &'a str,
    settings: &'a ParallelFilterSettings,
    torque_hz: Option<f64>,
    filters: Option<FinerFilters>,
    predicted: Vec<f64>,
    rows: Vec<FinerRows>,
}

/// Rows of every joint of recording `index` with `ratio` times the cut-off of `logs`, at the same instants as the rows
/// of an ordinary pass. `None` if the differentiator is not a zero-phase low-pass, or if the sample rate does not allow
/// the higher cut-off.
pub(crate) fn finer_rows(
    logs: &Logs<'_>,
    model: &RegressorModel,
    theta: &[f64],
    index: usize,
    ratio: f64,
) -> Result<Option<Vec<FinerRows>>, LogError> {
    let Some(motion_hz) = motion_band_hz(&logs.motion) else { return Ok(None) };
    let Some(stream) = logs.recordings[index].open(model.model(), &logs.motion)? else { return Ok(None) };
    let finer_hz = (ratio * motion_hz).min(MAX_CUTOFF_OVER_RATE * stream.rate_hz());
    drop(stream);
    if finer_hz <= motion_hz {
        return Ok(None);
    }
    let mut motion = logs.motion.clone();
    // A causal filter would also change the delay, and other differentiators have no cut-off.
    let (DifferentiatorSettings::Butterworth { cutoff_hz, .. }
    | DifferentiatorSettings::FrequencyDomain { cutoff_hz, .. }) = &mut motion.differentiator
    else {
        return Ok(None);
    };
    *cutoff_hz = Some(finer_hz);
    let pass = logs.pass(model, index);
    let torque_hz = pass.torque_hz.or(Some(motion_hz));
    let scale = model.model().characteristic_scale();
    let rest_below = |joint: &dynident_model::Joint| scale.velocity(joint.is_rotary(), SpeedRanges::REST_BELOW);
    let mut finer = FinerMotion {
        model,
        theta,
        stictions: (0..model.dof()).map(|joint| Stiction::of(model, joint, theta)).collect(),
        rest_below: model.model().joints().iter().map(rest_below).collect(),
        log: &logs.recordings[index].name,
        settings: &logs.filter,
        torque_hz,
        filters: None,
        predicted: Vec::new(),
        rows: vec![FinerRows::default(); model.dof()],
    };
    LogPass { motion: &motion, torque_hz, kept: None, ..pass }.run(&mut finer)?;
    Ok(Some(finer.rows))
}

impl FinerMotion<'_> {
    fn filters(&self, samples: &RawSamples<'_>) -> Result<FinerFilters, FilterError> {
        let (dof, rate_hz) = (self.model.dof(), samples.rate_hz);
        let filter = self.settings.decimation(rate_hz, self.torque_hz);
        Ok(FinerFilters {
            rate_bits: rate_hz.to_bits(),
            segment: samples.segment,
            predicted: JointFilters::new(&vec![1; dof], rate_hz, filter.as_ref())?,
            held: (0..dof).map(|_| HeldBound::default()).collect(),
            taps: filter.as_ref().map_or_else(|| Ok(vec![1.0]), |settings| settings.taps(rate_hz))?,
            factor: filter.as_ref().map_or(1, |settings| settings.factor),
        })
    }
}

impl RowConsumer for FinerMotion<'_> {
    fn filtered(&mut self, _: &JointRows<'_>) -> Result<(), LogError> {
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        if self.filters.as_ref().is_none_or(|filters| filters.rate_bits != samples.rate_hz.to_bits()) {
            let failed = |source| LogError::Filter { log: self.log.to_owned(), source };
            self.filters = Some(self.filters(samples).map_err(failed)?);
        }
        let Some(filters) = &mut self.filters else { return Ok(()) };
        if filters.segment != samples.segment {
            filters.segment = samples.segment;
            filters.predicted.restart();
            filters.held.iter_mut().for_each(|held| *held = HeldBound::default());
        }
        let rows = samples.panels.samples();
        for joint in 0..self.model.dof() {
            let (columns, panel) = (self.model.layout().joint_columns(joint), samples.panels.joint(joint));
            predicted_torque(panel, rows, columns, self.theta, &mut self.predicted);
            let left_out = samples.set_aside.get(joint).map_or(&[][..], Vec::as_slice);
            let found = filters.predicted.push(joint, &self.predicted, rows, left_out);
            let own = &mut self.rows[joint];
            own.predicted.extend_from_slice(&found.panel[..found.rows]);
            let (stiction, below) = (&self.stictions[joint], self.rest_below[joint]);
            let velocities = &samples.motion[1][joint * rows..(joint + 1) * rows];
            let held = velocities.iter().enumerate().map(|(row, velocity)| {
                if velocity.abs() < below { stiction.level(panel, rows, row, self.predicted[row]) } else { 0.0 }
            });
            filters.held[joint].push(held, &filters.taps, filters.factor, &mut own.held);
        }
        filters.predicted.advance(rows);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_the_largest_filtered_torque_of_either_sign() {
        let (taps, factor) = ([0.5, -0.25, 0.75], 2);
        let held = [0.0, 1.0, 2.0, 0.0, 3.0, 1.0, 0.0, 4.0, 1.0];
        let (mut bound, mut rows) = (HeldBound::default(), Vec::new());
        for piece in held.chunks(2) {
            bound.push(piece.iter().copied(), &taps, factor, &mut rows);
        }
        // Row r has the samples 2 r to 2 r + 2; sums of |tap| times sample by hand.
        assert_eq!(rows, [1.75, 3.25, 1.75, 1.75]);
    }
}
