//! Fitting again without the lag that the rows show.

use super::choice::{LagChoice, LagKind, choose_lag, covariance_of_lag};
use super::fit::LagFit;
use crate::settings::LagCandidates;
use dynident_estimation::Estimate;
use dynident_recording::log::OneOrMany;
use nalgebra::DMatrix;

/// Rounds of measuring the lag and making the rows again without it, at most; one or two are usual.
const MOST_ROUNDS: usize = 3;

/// Rounds of fitting and measuring the lag that the fit's rows show, until they show none that moves parameters. Begin
/// with the default, fit without [`torque_lag_s`](Self::torque_lag_s), and go on as long as [`again`](Self::again) says
/// so.
#[derive(Clone, Debug, Default)]
pub struct LagRounds {
    candidates: LagCandidates,
    done: usize,
    choice: LagChoice,
}

impl LagRounds {
    /// Rounds that look for these lags.
    pub fn of(candidates: LagCandidates) -> Self {
        Self { candidates, ..Self::default() }
    }

    /// The same with a lag that was taken off before.
    #[must_use]
    pub fn after(self, choice: LagChoice) -> Self {
        Self { choice, ..self }
    }

    /// What the next fit's rows are made without: for
    /// [`MotionSettings::torque_lag_s`](dynident_recording::MotionSettings::torque_lag_s).
    pub fn torque_lag_s(&self) -> Option<OneOrMany<f64>> {
        self.choice.taken_off()
    }

    /// Whether to fit once more, now without the lag that `fit` found in the rows of `estimate`. `fit` is `None` where
    /// the rows do not determine a lag.
    pub fn again(&mut self, fit: Option<&LagFit>, estimate: &Estimate) -> bool {
        let Some(fit) = fit else { return false };
        let next = choose_lag(fit, &self.choice.lag_s, estimate, self.candidates);
        if next.kind != LagKind::None && self.done < MOST_ROUNDS {
            self.choice = next;
            self.done += 1;
            return true;
        }
        let before = core::mem::take(&mut self.choice);
        self.choice = LagChoice { kind: before.kind, lag_s: before.lag_s, ..next };
        false
    }

    /// The covariance that the remaining uncertainty of the lag adds to `estimate`, after the last round. `None` where
    /// the rows do not determine a lag, and for a lag that the study states.
    pub fn error(&self, fit: Option<&LagFit>, estimate: &Estimate) -> Option<DMatrix<f64>> {
        covariance_of_lag(fit?, &self.choice, self.candidates, estimate)
    }

    /// What was taken off in the end.
    pub fn choice(self) -> LagChoice {
        self.choice
    }
}
