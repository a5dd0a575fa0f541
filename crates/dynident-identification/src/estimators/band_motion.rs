//! Instruments from the motion of a log after an additional low-pass, without reading the file again.

use super::instruments::InstrumentSource;
use super::{EstimatorError, TrainingRows};
use dynident_recording::derivative::ButterworthZeroPhase;
use dynident_recording::{Derivatives, Differentiator, FilterError, MotionBlock, Place, cutoff, unsettled_samples};
use dynident_rows::{LogError, LogPass};

/// Order of the low-pass, equal to the default of the differentiator.
const ORDER: usize = 4;

/// Positions, velocities and accelerations of every joint of the log in one uninterrupted segment.
type Piece = Vec<[Vec<f64>; 3]>;

/// Motion from the positions of a log after the differentiator and an additional zero-phase Butterworth filter.
pub(super) struct BandMotion<'r, 'a> {
    rows: &'r TrainingRows<'a>,
    cutoff_hz: f64,
    most_samples: Option<u64>,
    log: usize,
    pieces: Vec<(usize, Piece)>,
    next: (usize, usize),
}

impl<'r, 'a> BandMotion<'r, 'a> {
    pub(super) fn new(rows: &'r TrainingRows<'a>, cutoff_hz: f64, most_samples: Option<u64>) -> Self {
        Self { rows, cutoff_hz, most_samples, log: 0, pieces: Vec::new(), next: (0, 0) }
    }

    fn refused(&self, message: String) -> EstimatorError {
        EstimatorError::Instruments { log: self.rows.logs.recordings[self.log].name.clone(), message }
    }

    fn smoothed(&self, rate_hz: f64, q: &[f64]) -> Result<[Vec<f64>; 3], FilterError> {
        let filter = ButterworthZeroPhase::new(ORDER, self.cutoff_hz)?;
        let [mut smooth, mut dq, mut ddq] = [(); 3].map(|()| vec![0.0; q.len()]);
        let out = Derivatives { q: &mut smooth, dq: &mut dq, ddq: &mut ddq };
        filter.differentiate_at(Place::start(rate_hz), q, out)?;
        Ok([smooth, dq, ddq])
    }
}

impl InstrumentSource for BandMotion<'_, '_> {
    fn begin(&mut self, log: usize) -> Result<(), EstimatorError> {
        (self.log, self.next) = (log, (0, 0));
        let (rate_hz, pieces) = positions(self.rows, log, self.most_samples)?;
        self.pieces.clear();
        for (segment, q) in pieces {
            let one = |q: &Vec<f64>| self.smoothed(rate_hz, q);
            let piece = self.rows.logs.execution.try_map(&q, one);
            let piece = piece.map_err(|problem| self.refused(format!("the instruments' filter: {problem}")))?;
            self.pieces.push((segment, piece));
        }
        Ok(())
    }

    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), EstimatorError> {
        let (mut piece, mut from) = self.next;
        if self.pieces.get(piece).is_some_and(|(segment, _)| *segment != measured.segment) {
            (piece, from) = (piece + 1, 0);
        }
        let to = from + measured.rows;
        let found = self
            .pieces
            .get(piece)
            .filter(|(segment, joints)| *segment == measured.segment && joints.iter().all(|[q, ..]| q.len() >= to));
        let Some((_, joints)) = found else {
            return Err(self.refused("the smoothed motion does not cover the samples of the regressor".to_owned()));
        };
        for (order, values) in [&mut instruments.q, &mut instruments.dq, &mut instruments.ddq].into_iter().enumerate() {
            values.clear();
            for joint in joints {
                values.extend_from_slice(&joint[order][from..to]);
            }
        }
        let whole = joints.first().map_or(0, |[q, ..]| q.len());
        let ends = unsettled_samples(measured.rate_hz, self.cutoff_hz).min(whole / 4);
        instruments.unsettled =
            [ends.saturating_sub(from), (to + ends).saturating_sub(whole)].map(|end| end.min(to - from));
        self.next = (piece, to);
        Ok(())
    }
}

/// Sample rate, and the positions of a log by segment and joint.
type Positions = (f64, Vec<(usize, Vec<Vec<f64>>)>);

fn positions(rows: &TrainingRows<'_>, log: usize, most_samples: Option<u64>) -> Result<Positions, LogError> {
    let (mut rate_hz, mut pieces) = (0.0, Vec::<(usize, Vec<Vec<f64>>)>::new());
    let pass = LogPass { most_samples, ..rows.logs.pass(rows.model, log) };
    pass.each_block(&mut |block| {
        rate_hz = block.rate_hz;
        if pieces.last().is_none_or(|(segment, _)| *segment != block.segment) {
            pieces.push((block.segment, vec![Vec::new(); block.joints]));
        }
        if let Some((_, joints)) = pieces.last_mut() {
            for (joint, values) in joints.iter_mut().enumerate() {
                values.extend_from_slice(block.joint(&block.q, joint));
            }
        }
        Ok(())
    })?;
    Ok((rate_hz, pieces))
}

/// Cut-off of the positions that the regressor is computed from: the cut-off in use, or the highest one that the
/// longest piece of each training log suggests.
pub(super) fn regressor_cutoff_hz(rows: &TrainingRows<'_>) -> Result<f64, LogError> {
    if let Some(cutoff_hz) = rows.logs.motion.differentiator.cutoff_hz() {
        return Ok(cutoff_hz);
    }
    let mut highest = 0.0_f64;
    for &log in rows.training {
        let (rate_hz, pieces) = positions(rows, log, None)?;
        let longest = pieces.iter().max_by_key(|(_, joints)| joints.first().map_or(0, Vec::len));
        highest = longest.map_or(highest, |(_, joints)| highest.max(cutoff(joints, rate_hz).cutoff_hz));
    }
    Ok(highest)
}
