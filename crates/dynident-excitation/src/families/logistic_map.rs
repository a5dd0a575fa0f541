//! The paper's map from position to speed and acceleration.

/// Speed and acceleration read from a position on a known path, rad/s and rad/s² (m/s, m/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRates {
    /// Speed.
    pub dq: f64,
    /// Acceleration.
    pub ddq: f64,
}

/// On which half of its period a [`SplicedLogistic`](super::SplicedLogistic) joint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// From h towards h + A.
    There,
    /// Back to h.
    Back,
}

impl Branch {
    /// The branch by phase, as in Eq. 15: there in the first half of each period, back in the second, rem(t, T) being the time since the last whole period.
    ///
    /// A robot that lags behind is still on the branch of an earlier time: subtract the lag from `time_s`.
    pub fn at(time_s: f64, period_s: f64) -> Self {
        if time_s.rem_euclid(period_s) < 0.5 * period_s { Self::There } else { Self::Back }
    }
}

/// One joint's logistic stroke between h and h + A with steepness ω, as a path: where it is tells how fast it goes.
///
/// # Source
/// The paper's Eqs. 15 and 16.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogisticMap {
    /// Amplitude A, rad (m), not zero.
    pub amplitude: f64,
    /// Steepness ω, 1/s.
    pub omega: f64,
    /// Offset h, rad (m).
    pub offset: f64,
}

impl LogisticMap {
    /// q̇ = ±(ω/A)(q - h)(A - q + h), plus on the way there; q̈ = (ω²/A²)(q - h)(A - q + h)(A - 2q + 2h).
    ///
    /// `None` outside the stroke, where q is not strictly between h and h + A: there the formulas give a speed of the wrong sign. Noise of q comes out at most ω times larger
    /// in q̇ and ω² times in q̈; a tracking error e that is no delay biases q̇ by ė - g'(q) e, |g'| <= ω.
    ///
    /// ```
    /// use dynident_excitation::families::{Branch, LogisticMap};
    /// let map = LogisticMap { amplitude: 2.0, omega: 1.0, offset: 0.0 };
    /// let rates = map.rates(1.0, Branch::There).unwrap();
    /// assert_eq!((rates.dq, rates.ddq), (0.5, 0.0)); // Aω/4 half-way
    /// assert_eq!(map.rates(2.1, Branch::There), None);
    /// ```
    pub fn rates(&self, q: f64, branch: Branch) -> Option<PathRates> {
        let Self { amplitude, omega, offset } = *self;
        let (gone, left) = (q - offset, amplitude - (q - offset));
        if !(gone / amplitude > 0.0 && left / amplitude > 0.0) {
            return None;
        }
        let dq = omega / amplitude * gone * left;
        let ddq = omega * omega / (amplitude * amplitude) * gone * left * (left - gone);
        Some(PathRates { dq: if branch == Branch::There { dq } else { -dq }, ddq })
    }
}
