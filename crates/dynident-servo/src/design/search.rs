//! Search for the sequence of segments with the most information, and the chirp that it is compared with.

use super::information::{Simulated, forecast, log_det, simulated};
use super::segment::{CommandRange, SegmentClock, random_segment, sweep};
use super::settings::ServoDesignSettings;
use crate::error::ServoError;
use crate::fit::Search;
use crate::parameters::{FreeParameter, ServoRobot, VariedRobot};
use crate::settings::ServoSettings;
use crate::values::{Scale, ServoValue, values};
use dynident_model::sample::Random;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Ratio of the time step in the search to that of the fit.
const COARSE: f64 = 4.0;
/// Factor on the amplitudes after a batch without a permitted candidate.
const SMALLER: f64 = 0.6;
/// Number of batches for one segment, and of attempts for the chirp, after which the search ends.
const ATTEMPTS: usize = 8;
/// Lowest frequency of the chirp, Hz.
const CHIRP_FROM_HZ: f64 = 0.1;
/// Amplitude of the chirp, relative to half of the joint's range.
const CHIRP_AMPLITUDE: f64 = 0.5;
/// Minimum improvement of the criterion by an exchange of a segment.
const LEAST_GAIN: f64 = 1e-6;

/// Function that returns whether a simulated motion is permitted. Argument: positions of each joint at the rate of the
/// commands.
pub type MotionCheck<'a> = &'a dyn Fn(&[Vec<f64>]) -> bool;

/// Expected result of a fit to planned commands.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// Values of drives and bodies with their expected standard deviations.
    pub values: Vec<ServoValue>,
    /// The common factor of all torques, inertias and masses.
    pub scale: Scale,
    /// Logarithm of the determinant of the information matrix, including priors.
    pub log_det: f64,
}

/// Result of a design of commands.
#[derive(Clone, Debug)]
pub struct DesignedCommands {
    /// Times, s.
    pub times_s: Vec<f64>,
    /// Commands of each joint, rad (m); each command is held until the next.
    pub commands: Vec<Vec<f64>>,
    /// Simulated positions of each joint, rad (m).
    pub positions: Vec<Vec<f64>>,
    /// Whether the whole motion is permitted.
    pub is_permitted: bool,
    /// Expected result of a fit to the designed commands.
    pub forecast: Forecast,
    /// Expected result of a fit to a chirp of all joints with the same length, range, speed and highest frequency, for
    /// comparison.
    pub chirp: Forecast,
    /// Number of simulated candidates.
    pub evaluations: usize,
}

struct Designer<'a> {
    robot: &'a ServoRobot,
    parameters: &'a [FreeParameter],
    varied: VariedRobot,
    ranges: &'a [CommandRange],
    settings: &'a ServoDesignSettings,
    clock: SegmentClock,
    step_s: f64,
    prior: DMatrix<f64>,
    is_permitted: MotionCheck<'a>,
    advance: &'a (dyn Fn(u64) + Sync),
}

/// A selected segment.
struct Chosen {
    commands: Vec<Vec<f64>>,
    simulated: Simulated,
}

/// Designs commands for a motion that starts at rest in `start` and returns to it. `advance` receives the number of
/// finished candidates.
///
/// # Errors
/// Invalid settings; a robot whose simulation fails; no permitted motion.
pub fn design_commands(
    robot: &ServoRobot,
    parameters: &[FreeParameter],
    (ranges, start): (&[CommandRange], &[f64]),
    (fit, settings): (&ServoSettings, &ServoDesignSettings),
    is_permitted: MotionCheck<'_>,
    advance: &(dyn Fn(u64) + Sync),
) -> Result<DesignedCommands, ServoError> {
    settings.validate()?;
    fit.validate()?;
    let zeros = vec![0.0; parameters.len()];
    let sds = parameters.iter().map(|parameter| parameter.prior_sd.powi(-2));
    let designer = Designer {
        robot,
        parameters,
        varied: VariedRobot::new(robot, parameters, &zeros)?,
        ranges,
        settings,
        clock: SegmentClock { samples: settings.samples(), rate_hz: settings.rate_hz, highest_hz: settings.highest_hz },
        step_s: fit.step_s,
        prior: DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(parameters.len(), sds)),
        is_permitted,
        advance,
    };
    let chirp = designer.chirp(start)?;
    let mut random = Random::new(settings.seed);
    let mut chosen = designer.greedy(start, &mut random)?;
    for _ in 0..settings.exchanges {
        designer.exchange(&mut chosen, start, &mut random);
    }
    designer.finish(&chosen, start, chirp)
}

impl Designer<'_> {
    fn no_motion(&self) -> ServoError {
        ServoError::NoMotion { attempts: ATTEMPTS * self.settings.candidates }
    }

    /// Simulates random candidates between the postures `ends` and sorts them by the criterion for the information of
    /// `others` and of the candidate, the best first.
    fn batch(
        &self,
        others: &DMatrix<f64>,
        ends: (&[f64], Option<&[f64]>),
        (from, size): (&[f64], f64),
        random: &mut Random,
    ) -> Vec<(f64, Chosen)> {
        let segments: Vec<Vec<Vec<f64>>> = (0..self.settings.candidates)
            .map(|_| random_segment(self.ranges, ends, self.clock, size, random))
            .collect();
        let clock = (self.settings.rate_hz, COARSE * self.step_s, self.settings.weight());
        let (varied, advance) = (&self.varied, self.advance);
        let mut found: Vec<(f64, Chosen)> = segments
            .into_par_iter()
            .filter_map(|commands| {
                let simulated = simulated(varied, from, &commands, clock);
                advance(1);
                let simulated = simulated?;
                Some((log_det(&(others + &simulated.information))?, Chosen { commands, simulated }))
            })
            .collect();
        // A stable sort, so that equal candidates keep their order.
        found.sort_by(|(one, _), (other, _)| other.total_cmp(one));
        found
    }

    /// The best permitted candidate whose criterion exceeds `above`, simulated with the time step of the fit.
    fn best(&self, batch: Vec<(f64, Chosen)>, above: f64, from: &[f64]) -> Option<Chosen> {
        let better = batch.into_iter().take_while(|(criterion, _)| *criterion > above);
        let mut permitted = better.filter(|(_, chosen)| (self.is_permitted)(&chosen.simulated.positions));
        permitted.find_map(|(_, Chosen { commands, .. })| {
            let simulated = self.whole(from, &commands).ok()?;
            (self.is_permitted)(&simulated.positions).then_some(Chosen { commands, simulated })
        })
    }

    fn greedy(&self, start: &[f64], random: &mut Random) -> Result<Vec<Chosen>, ServoError> {
        let segments = self.settings.segments();
        let mut total = self.prior.clone();
        let (mut command, mut position) = (start.to_vec(), start.to_vec());
        let mut chosen: Vec<Chosen> = Vec::with_capacity(segments);
        for segment in 0..segments {
            let end = (segment + 1 == segments).then_some(start);
            let best = (0..ATTEMPTS).find_map(|attempt| {
                let size = SMALLER.powi(attempt as i32);
                let batch = self.batch(&total, (&command, end), (&position, size), random);
                self.best(batch, f64::NEG_INFINITY, &position)
            });
            let best = best.ok_or_else(|| self.no_motion())?;
            total += &best.simulated.information;
            command = best.commands.iter().map(|joint| joint[joint.len() - 1]).collect();
            position = best.simulated.positions.iter().map(|joint| joint[joint.len() - 1]).collect();
            chosen.push(best);
        }
        Ok(chosen)
    }

    /// Compares each segment with new candidates between the same end postures, and replaces it by a better one.
    fn exchange(&self, chosen: &mut [Chosen], start: &[f64], random: &mut Random) {
        let mut total = chosen.iter().fold(self.prior.clone(), |sum, own| sum + &own.simulated.information);
        for at in 0..chosen.len() {
            let last = |values: &[Vec<f64>]| values.iter().map(|joint| joint[joint.len() - 1]).collect::<Vec<f64>>();
            let before = at.checked_sub(1).map(|before| &chosen[before]);
            let command = before.map_or_else(|| start.to_vec(), |own| last(&own.commands));
            let position = before.map_or_else(|| start.to_vec(), |own| last(&own.simulated.positions));
            let end = last(&chosen[at].commands);
            let others = &total - &chosen[at].simulated.information;
            let now = log_det(&total).unwrap_or(f64::NEG_INFINITY);
            let batch = self.batch(&others, (&command, Some(&end)), (&position, 1.0), random);
            if let Some(better) = self.best(batch, now + LEAST_GAIN, &position) {
                total = others + &better.simulated.information;
                chosen[at] = better;
            }
        }
    }

    /// Simulates the complete sequence with the time step of the fit.
    fn finish(&self, chosen: &[Chosen], start: &[f64], chirp: Forecast) -> Result<DesignedCommands, ServoError> {
        let joined = |joint: usize| chosen.iter().flat_map(|own| own.commands[joint].iter().copied()).collect();
        let commands: Vec<Vec<f64>> = (0..start.len()).map(joined).collect();
        let whole = self.whole(start, &commands)?;
        Ok(DesignedCommands {
            times_s: (0..commands[0].len()).map(|sample| sample as f64 / self.settings.rate_hz).collect(),
            is_permitted: (self.is_permitted)(&whole.positions),
            forecast: self.forecast(&whole)?,
            positions: whole.positions,
            commands,
            chirp,
            evaluations: self.settings.evaluations(),
        })
    }

    fn whole(&self, start: &[f64], commands: &[Vec<f64>]) -> Result<Simulated, ServoError> {
        let clock = (self.settings.rate_hz, self.step_s, self.settings.weight());
        simulated(&self.varied, start, commands, clock).ok_or_else(no_numbers)
    }

    fn forecast(&self, simulated: &Simulated) -> Result<Forecast, ServoError> {
        let search: Search = forecast(&simulated.information, &self.prior).ok_or_else(no_numbers)?;
        let (values, scale) = values(self.robot, self.parameters, &search)?;
        let log_det = log_det(&(&simulated.information + &self.prior)).unwrap_or(f64::NEG_INFINITY);
        Ok(Forecast { values, scale, log_det })
    }

    /// Expected result for a chirp of all joints around `start`, with the largest permitted amplitude.
    fn chirp(&self, start: &[f64]) -> Result<Forecast, ServoError> {
        let samples = self.clock.samples * self.settings.segments();
        let duration_s = samples as f64 / self.settings.rate_hz;
        for attempt in 0..ATTEMPTS {
            let size = SMALLER.powi(attempt as i32);
            let of_joint = |joint: usize| {
                let range = &self.ranges[joint];
                let amplitude = size * CHIRP_AMPLITUDE * 0.5 * (range.greatest - range.least);
                // Joints with the same frequency would move in proportion, which separates their parameters badly.
                let from_hz = CHIRP_FROM_HZ * (1.0 + 0.15 * joint as f64);
                let at = |sample: usize| {
                    let t = sample as f64 / self.settings.rate_hz;
                    let ends = [from_hz, self.settings.highest_hz];
                    let swing = sweep(t, duration_s, ends, [amplitude, size * range.speed]);
                    (start[joint] + swing).clamp(range.least, range.greatest)
                };
                (0..samples).map(at).collect()
            };
            let commands: Vec<Vec<f64>> = (0..start.len()).map(of_joint).collect();
            let whole = self.whole(start, &commands)?;
            if (self.is_permitted)(&whole.positions) {
                return self.forecast(&whole);
            }
        }
        Err(self.no_motion())
    }
}

fn no_numbers() -> ServoError {
    ServoError::Start { run: "the designed commands".to_owned() }
}
