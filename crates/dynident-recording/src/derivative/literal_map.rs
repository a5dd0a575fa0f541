//! The paper's map as it is written, to show what it does; [`PositionMap`](crate::PositionMap) is the one to use.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use super::reference_lag::check_joint;
use crate::error::FilterError;
use crate::reference::Reference;
use std::sync::Arc;

/// Eqs. 15 and 16 to the letter: the branch changes at half a period whatever the joint's lag, and positions outside the stroke are mapped as well, to speeds of the wrong sign.
///
/// Needs the strokes in closed form ([`Reference::logistic`]). Source: the paper's Eqs. 15 and 16.
#[derive(Clone, Debug)]
pub struct LiteralMap {
    reference: Arc<Reference>,
}

impl LiteralMap {
    /// For the strokes of `reference`.
    pub fn new(reference: Arc<Reference>) -> Self {
        Self { reference }
    }
}

impl Differentiator for LiteralMap {
    fn name(&self) -> &'static str {
        "literal-map"
    }

    fn minimum_samples(&self) -> usize {
        1
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        check_joint(&self.reference, place)?;
        let Some(path) = self.reference.logistic_path(place.joint) else {
            let problem =
                "the map as it is written needs the strokes in closed form: give `joints`, or take position-map"
                    .to_owned();
            return Err(FilterError::Reference { problem });
        };
        for (i, &q) in q.iter().enumerate() {
            let there = self.reference.goes_there(place.joint, place.time_s(i));
            out.q[i] = q;
            [out.dq[i], out.ddq[i]] = path.rates_as_written(q, there);
        }
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::LogisticPath;

    #[test]
    fn on_the_stroke_it_is_the_map_and_outside_the_sign_is_wrong() {
        let path = LogisticPath { amplitude: 2.0, omega: 1.0, offset: 0.0, period_s: 40.0, repetitions: 1 };
        let map = LiteralMap::new(Arc::new(Reference::logistic(&[path]).unwrap()));
        let times = [5.0, 9.0, 12.0, 31.0];
        let mut all = [[0.0; 1], [0.0; 1], [0.0; 1]];
        for time in times {
            let [q, dq, ddq] = path.at(time);
            let [y, dy, ddy] = &mut all;
            let place = Place { rate_hz: 100.0, joint: 0, first_time_s: time };
            map.differentiate_at(place, &[q], Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
            // Rounding of a product of four factors of order one.
            assert!((all[1][0] - dq).abs() < 1e-14 && (all[2][0] - ddq).abs() < 1e-14, "{time}: {all:?}");
        }
        let [y, dy, ddy] = &mut all;
        let place = Place { rate_hz: 100.0, joint: 0, first_time_s: 9.0 };
        map.differentiate_at(place, &[2.1], Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
        assert!(all[1][0] < 0.0);
    }
}
