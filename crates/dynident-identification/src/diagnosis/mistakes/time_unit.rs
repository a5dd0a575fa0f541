//! Mistake: another unit of time, or another sample rate.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Setup, scale};
use super::numbers::{MAX_RATIO_OF_ONE_FACTOR, Number};
use super::study_keys::{KeyChange, StudyKeys, significant};
use crate::diagnosis::motion_rows::MotionRows;
use crate::diagnosis::plausibility::{beyond_limits, is_rate_of_a_recorder};
use dynident_dynamics::ParametricModel;
use dynident_recording::log::TimeUnit as LogUnit;

/// Units of time to try.
const UNITS: [f64; 8] = [1e-3, 1e-6, 1e-9, 1e-2, 1e3, 1e6, 1e9, 1e2];
/// Factors on the sample rate to try: every second sample, a decimal place, minutes. The search ranges of neighbours
/// overlap.
const OTHER_RATES: [f64; 7] = [0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 60.0];
/// Half-width of the search range, as the logarithm of the factor.
const REACH: f64 = 0.5;

/// The time stamps have another unit, or the recorder has another rate.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeUnit {
    /// Factor on the times.
    pub factor: f64,
}

impl MistakeKind for TimeUnit {
    /// Candidates. Units are tried only if the rate is implausible or the robot would be too fast.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let limits = &setup.settings.motion;
        let is_plausible = |rate_hz: f64| is_rate_of_a_recorder(setup.model(), rate_hz, limits);
        let is_too_fast =
            || beyond_limits(setup.model(), setup.rows, limits).iter().any(|beyond| beyond.quantity == "velocity");
        let rate_hz = setup.rows.rate_hz;
        let factors: &[f64] = match breadth {
            Breadth::Usual if !is_plausible(rate_hz) || is_too_fast() => &UNITS,
            Breadth::Rare => &OTHER_RATES,
            Breadth::Usual | Breadth::KnownRobot(_) => &[],
        };
        let is_possible = |factor: &&f64| is_plausible(rate_hz / **factor);
        factors.iter().filter(is_possible).map(|&factor| Self { factor }).collect()
    }

    fn correct(&self, _: &ParametricModel, rows: &mut MotionRows) {
        let factor = self.factor;
        rows.dq.iter_mut().for_each(|values| scale(values, factor.recip()));
        rows.ddq.iter_mut().for_each(|values| scale(values, (factor * factor).recip()));
        rows.rate_hz /= factor;
    }

    fn facts(&self) -> Facts {
        let is_other_rate = !UNITS.contains(&self.factor);
        let factor = Number { is_round: true, ..Number::factor(self.factor, REACH) };
        Facts { is_other_rate, number: is_other_rate.then_some(factor), ..Facts::of("unit") }
    }

    fn sentence(&self, _: &[String]) -> String {
        let factor = self.factor;
        let power = factor.log10() / 3.0;
        if (power - power.round()).abs() < 1e-9 {
            return format!("time is in another unit: multiply it by {factor:e} to get seconds");
        }
        format!("the recorder had another rate: multiply the time stamps by {factor:.3} to get seconds")
    }

    fn other_factors(&self, [least, greatest]: [f64; 2]) -> String {
        if !self.facts().is_other_rate || greatest <= MAX_RATIO_OF_ONE_FACTOR * least {
            return String::new();
        }
        let [least, greatest] = [least, greatest].map(significant);
        format!(
            "; these logs do not distinguish factors between {least} and {greatest}: use the rate of the recorder in this range"
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        if let Some(rate_hz) = keys.format.rate_hz {
            let line = format!("rate_hz = {}", significant(rate_hz / self.factor));
            return vec![KeyChange { table: keys.table.clone(), line }];
        }
        let units = [
            (LogUnit::Seconds, "s"),
            (LogUnit::Milliseconds, "ms"),
            (LogUnit::Microseconds, "us"),
            (LogUnit::Nanoseconds, "ns"),
        ];
        let (now, own) = keys.format.time.as_ref().map_or((1.0, 1.0), |time| (time.unit.seconds(), time.scale));
        let is_wanted = |unit: &LogUnit| (unit.seconds() / (now * self.factor) - 1.0).abs() < 1e-6;
        let unit = units.iter().find(|(unit, _)| is_wanted(unit));
        let scale = || format!("scale = {}", significant(self.factor * own));
        let line = unit.map_or_else(scale, |(_, name)| format!("unit = {name:?}"));
        vec![KeyChange { table: format!("{}.time", keys.table), line }]
    }

    fn with_number(&self, factor: f64) -> Option<Mistake> {
        Some(Self { factor }.into())
    }
}
