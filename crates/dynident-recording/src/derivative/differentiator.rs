//! Interface of differentiators, which compute velocity dq and acceleration ddq from positions q. Callers can implement
//! their own.

use crate::error::FilterError;
use core::ops::Range;

/// Output slices of a differentiator; each has the length of the input.
#[derive(Debug)]
pub struct Derivatives<'a> {
    /// Filtered position.
    pub q: &'a mut [f64],
    /// First derivative, per second.
    pub dq: &'a mut [f64],
    /// Second derivative, per second squared.
    pub ddq: &'a mut [f64],
}

/// Time and joint of the samples, for differentiators that use the commanded motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Joint index, in the order of the reference.
    pub joint: usize,
    /// Time of the first sample, seconds after the log's first row.
    pub first_time_s: f64,
}

impl Place {
    /// The first joint, starting at time zero.
    pub fn start(rate_hz: f64) -> Self {
        Self { rate_hz, joint: 0, first_time_s: 0.0 }
    }

    /// Time of sample `i`, s.
    pub fn time_s(&self, i: usize) -> f64 {
        self.first_time_s + i as f64 / self.rate_hz
    }
}

/// Sample indices as ascending ranges.
pub type SampleRanges = Vec<Range<usize>>;

pub(crate) fn add_sample(ranges: &mut SampleRanges, i: usize) {
    match ranges.last_mut() {
        Some(last) if last.end >= i => last.end = last.end.max(i + 1),
        _ => ranges.push(i..i + 1),
    }
}

/// Estimates filtered position, velocity and acceleration from uniformly sampled positions of one joint.
///
/// A differentiator with finite [`context_samples`](Self::context_samples) processes a long log in windows: with this
/// number of additional samples on either side, a window gives the same result as the whole log. Methods that fit the
/// whole log, or estimate a lag over it, keep the default.
///
/// To implement a differentiator, define its name, the minimum number of samples and
/// [`differentiate_at`](Self::differentiate_at).
/// [`MotionStream::with_differentiator`](crate::MotionStream::with_differentiator) accepts any implementation.
///
/// ```
/// use dynident_recording::{Derivatives, Differentiator, FilterError, Place, SampleRanges};
/// use dynident_recording::{JointSamples, MotionBlock, MotionSettings, MotionStream};
///
/// /// Backward differences: inaccurate, and delayed by half a sample and by one sample.
/// #[derive(Debug)]
/// struct Backward;
///
/// impl Differentiator for Backward {
///     fn name(&self) -> &'static str {
///         "backward"
///     }
///     fn minimum_samples(&self) -> usize {
///         3
///     }
///     fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
///         Some(2)
///     }
///     fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives) -> Result<SampleRanges, FilterError> {
///         self.check_length(q.len())?;
///         for i in 0..q.len() {
///             let [q0, q1, q2] = [i, i.saturating_sub(1), i.saturating_sub(2)].map(|k| q[k]);
///             out.q[i] = q0;
///             out.dq[i] = place.rate_hz * (q0 - q1);
///             out.ddq[i] = place.rate_hz * place.rate_hz * (q0 - 2.0 * q1 + q2);
///         }
///         // The first two samples have no previous samples: leave them out.
///         Ok(if place.first_time_s == 0.0 { vec![0..2; 1] } else { Vec::new() })
///     }
/// }
///
/// let q: Vec<f64> = (0..200).map(|i| 0.25 * f64::from(i * i)).collect();
/// let log = JointSamples::at_rate(1.0, vec![q.clone()], vec![q]).into_log("parabola", &["x".to_owned()])?;
/// let settings = MotionSettings::default();
/// let mut stream = MotionStream::with_differentiator(&log, &settings, |_| Ok(Box::new(Backward)))?;
/// let mut block = MotionBlock::default();
/// assert!(stream.next_block(&mut block)?);
/// assert!(block.rows == 198 && block.ddq.iter().all(|ddq| *ddq == 0.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Differentiator: core::fmt::Debug + Send + Sync {
    /// Name as in the study file.
    fn name(&self) -> &'static str;

    /// Minimum length of the signal, samples.
    fn minimum_samples(&self) -> usize;

    /// Number of samples at either end of a window that depend on samples outside the window (by more than 1e-12 of the
    /// signal); `None` (default) if every sample depends on the whole piece.
    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        let _ = rate_hz;
        None
    }

    /// Computes `out` from the positions `q`. Joint and time in `place` are used only by differentiators that need the
    /// commanded motion, a [`Reference`](crate::Reference).
    ///
    /// Returns the samples where velocity and acceleration are not valid.
    ///
    /// # Errors
    /// [`FilterError`] if `q` is shorter than [`minimum_samples`](Self::minimum_samples) or the filter is invalid at
    /// this rate.
    ///
    /// # Panics
    /// If a slice of `out` is shorter than `q`.
    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError>;

    /// Applies the smoothing of the positions to another signal with the same clock (a torque). By default the signal
    /// is unchanged.
    ///
    /// # Errors
    /// As [`differentiate_at`](Self::differentiate_at).
    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let _ = rate_hz;
        out[..signal.len()].copy_from_slice(signal);
        Ok(())
    }

    /// Calls [`differentiate_at`](Self::differentiate_at) for the first joint, starting at time zero.
    ///
    /// # Errors
    /// As [`differentiate_at`](Self::differentiate_at).
    fn differentiate(&self, rate_hz: f64, q: &[f64], out: Derivatives<'_>) -> Result<(), FilterError> {
        self.differentiate_at(Place::start(rate_hz), q, out).map(drop)
    }

    /// Checks that a signal has at least [`minimum_samples`](Self::minimum_samples) samples.
    ///
    /// # Errors
    /// [`FilterError::TooShort`].
    fn check_length(&self, found: usize) -> Result<(), FilterError> {
        let needed = self.minimum_samples();
        if found < needed {
            return Err(FilterError::TooShort { method: self.name(), found, needed });
        }
        Ok(())
    }
}
