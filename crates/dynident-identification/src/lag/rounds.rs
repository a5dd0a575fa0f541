//! Repetition of fit and lag estimation until the lag is compensated.

use super::choice::{LagChoice, LagKind, choose_lag, covariance_of_lag};
use super::fit::LagFit;
use crate::settings::LagCandidates;
use dynident_estimation::Estimate;
use dynident_recording::log::OneOrMany;
use nalgebra::DMatrix;

const MAX_ROUNDS: usize = 3;

/// Repeats fit and lag estimation until no significant lag remains in the rows. Begin with the default value, fit with
/// the lag in [`torque_lag_s`](Self::torque_lag_s) compensated, and continue while [`again`](Self::again) returns true.
#[derive(Clone, Debug, Default)]
pub struct LagRounds {
    candidates: LagCandidates,
    done: usize,
    choice: LagChoice,
}

impl LagRounds {
    /// Starts with these candidate lags.
    pub fn of(candidates: LagCandidates) -> Self {
        Self { candidates, ..Self::default() }
    }

    /// Sets a lag that was compensated before.
    #[must_use]
    pub fn after(self, choice: LagChoice) -> Self {
        Self { choice, ..self }
    }

    /// Lag to compensate in the next fit, for
    /// [`MotionSettings::torque_lag_s`](dynident_recording::MotionSettings::torque_lag_s).
    pub fn torque_lag_s(&self) -> Option<OneOrMany<f64>> {
        self.choice.taken_off()
    }

    /// Whether to fit again with the newly found lag compensated. `fit` is the lag in the rows of `estimate`, or `None`
    /// if the rows do not determine a lag.
    pub fn again(&mut self, fit: Option<&LagFit>, estimate: &Estimate) -> bool {
        let Some(fit) = fit else { return false };
        let next = choose_lag(fit, &self.choice.lag_s, estimate, self.candidates);
        if next.kind != LagKind::None && self.done < MAX_ROUNDS {
            self.choice = next;
            self.done += 1;
            return true;
        }
        let before = core::mem::take(&mut self.choice);
        self.choice = LagChoice { kind: before.kind, lag_s: before.lag_s, ..next };
        false
    }

    /// Covariance that the remaining uncertainty of the lag adds to `estimate`, after the last fit. `None` if the rows
    /// do not determine a lag, and for a stated lag.
    pub fn error(&self, fit: Option<&LagFit>, estimate: &Estimate) -> Option<DMatrix<f64>> {
        covariance_of_lag(fit?, &self.choice, self.candidates, estimate)
    }

    /// The selected lag after the last fit.
    pub fn choice(self) -> LagChoice {
        self.choice
    }
}
