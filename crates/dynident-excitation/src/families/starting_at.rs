//! A family with a given start posture.

use super::error::{FamilyError, require};
use crate::family::Family;
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;

/// Minimum share of a joint's range that a random start uses, for any start posture.
const MIN_RANGE_SHARE: f64 = 0.3;

/// Every motion of another family, shifted joint by joint to start at given positions: `q_j(t) + s_j - q_j(0)`.
///
/// The start is exact by construction, and so is the end of a family that returns. Velocities and accelerations do
/// not change. Parameters are those of the family. A parameter that only shifts a joint has no effect if the start of
/// that joint is given. A family with a fixed posture, such as a sequence with its own start posture, is shifted as a
/// whole.
#[derive(Debug)]
pub struct WithStartPosture {
    inner: Box<dyn Family>,
    start: Vec<Option<f64>>,
}

impl WithStartPosture {
    /// Creates the family. `start` is the position of each joint at the beginning, rad (m); for `None` the family
    /// determines it.
    ///
    /// # Errors
    /// A wrong number of entries, or a position that is not finite.
    pub fn new(inner: Box<dyn Family>, start: Vec<Option<f64>>) -> Result<Self, FamilyError> {
        let (family, expected, found) = (inner.name(), inner.joints(), start.len());
        if expected != found {
            return Err(FamilyError::Length { family, what: "start posture", expected, found });
        }
        for &q in start.iter().flatten() {
            require(q.is_finite(), family, "start posture", q, "give finite positions")?;
        }
        Ok(Self { inner, start })
    }

    fn given(&self) -> impl Iterator<Item = (usize, f64)> {
        self.start.iter().enumerate().filter_map(|(joint, start)| start.map(|start| (joint, start)))
    }
}

impl Family for WithStartPosture {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn joints(&self) -> usize {
        self.inner.joints()
    }

    fn duration_s(&self) -> f64 {
        self.inner.duration_s()
    }

    fn parameters(&self) -> usize {
        self.inner.parameters()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.inner.bounds()
    }

    /// Random start of the family in ranges around the start posture; the search corrects violations of the joint's
    /// position range.
    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let mut ranges = ranges.to_vec();
        for (joint, start) in self.given() {
            let [lower, upper] = ranges[joint];
            if (upper - lower).is_finite() && upper > lower {
                let room = (start - lower).min(upper - start).max(0.0);
                let half = 0.5 * room.max(MIN_RANGE_SHARE * (upper - lower));
                ranges[joint] = [start - half, start + half];
            }
        }
        self.inner.random(&ranges, speeds, random)
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        self.inner.motion(parameters, times_s, out);
        let first = (times_s.first() != Some(&0.0)).then(|| {
            let mut first = Motion::default();
            self.inner.motion(parameters, &[0.0], &mut first);
            first
        });
        for (joint, start) in self.given() {
            let own = out.of(joint);
            let q0 = first.as_ref().map_or_else(|| out.q[own.start], |first| first.q[joint]);
            for q in &mut out.q[own.clone()] {
                *q += start - q0;
            }
            // Set to the exact value, without rounding of the sum.
            if first.is_none() {
                out.q[own.start] = start;
            }
        }
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        self.inner.apply_adjoint(parameters, times_s, adjoint, gradient);
        if times_s.is_empty() {
            return;
        }
        // Adjoint of s - q(0): the sum of the adjoints of all positions of a joint, added at the start with opposite
        // sign.
        let mut at_start = Motion::default();
        at_start.reset(adjoint.joints, 1);
        for (joint, _) in self.given() {
            at_start.q[joint] = -adjoint.q[adjoint.of(joint)].iter().sum::<f64>();
        }
        self.inner.apply_adjoint(parameters, &[0.0], &at_start, gradient);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Fourier, FourierSettings, LogisticStrokes, LogisticStrokesSettings, check};

    fn families() -> [Box<dyn Family>; 2] {
        [
            Box::new(Fourier::new(3, 7.0, &FourierSettings { rest: false, ..Default::default() }).unwrap()),
            Box::new(LogisticStrokes::new(3, 7.0, &LogisticStrokesSettings::default()).unwrap()),
        ]
    }

    #[test]
    fn starts_there_with_the_same_rates() {
        for inner in families() {
            let parameters = check::start(&*inner, 5);
            let mut plain = Motion::default();
            let times = [0.0, 1.3, 3.5, 7.0];
            inner.motion(&parameters, &times, &mut plain);
            let moved = WithStartPosture::new(inner, vec![Some(0.7), None, Some(-1.1)]).unwrap();
            let (mut whole, mut later) = (Motion::default(), Motion::default());
            moved.motion(&parameters, &times, &mut whole);
            moved.motion(&parameters, &times[1..], &mut later);
            assert_eq!((whole.q[0], whole.q[8]), (0.7, -1.1));
            assert!((whole.q[3] - 0.7).abs() < 1e-12 && (whole.q[11] + 1.1).abs() < 1e-12);
            assert_eq!(whole.q[4..8], plain.q[4..8]);
            assert_eq!((&whole.dq, &whole.ddq, &whole.dddq), (&plain.dq, &plain.ddq, &plain.dddq));
            for joint in 0..3 {
                assert_eq!(whole.q[whole.of(joint)][1..], later.q[later.of(joint)]);
            }
        }
    }

    #[test]
    fn gradient_is_exact() {
        for (seed, inner) in families().into_iter().enumerate() {
            let parameters = check::start(&*inner, seed as u64);
            let moved = WithStartPosture::new(inner, vec![Some(0.2), Some(-0.4), None]).unwrap();
            check::gradient_at(&moved, &parameters, 3);
            check::gradient_on(&moved, &parameters, &[0.0, 0.9, 6.0], 4);
        }
    }

    #[test]
    fn rejects_invalid_postures() {
        for start in [vec![None; 2], vec![Some(f64::NAN), None, None]] {
            let [inner, _] = families();
            assert!(WithStartPosture::new(inner, start).is_err());
        }
    }
}
