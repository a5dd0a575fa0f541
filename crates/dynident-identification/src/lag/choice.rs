//! Which lag is taken off the rows: none, one for all joints, or joints with one of their own.
//!
//! A lag of a recorder or a bus is the same for all joints, so their common lag is what is looked for first: the
//! generalised mean of the joints' lags, its bar widened by what the joints differ by beyond their own bars (Birge,
//! Phys. Rev. 40 (1932) 207). What friction or elasticity leaves looks like a lag too, another in every joint: it
//! widens the bar and is not taken off. A lag that is not known leaves its mark on the parameters in any case,
//! `∂θ/∂δ = Cov(θ, δ) Cov(δ, δ)⁻¹`, and the error bars hold it.

use super::fit::LagFit;
use super::measured::TorqueLag;
use dynident_estimation::Estimate;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A lag is taken off where it moves some parameter by this share of its error bar.
const MATTERS: f64 = 0.3;
/// Joints have lags of their own where one common lag is as unlikely as this many standard deviations, ...
const UNLIKE: f64 = 4.0;
/// ... and those where their own takes off this share of the torque's square that the model leaves: what friction
/// leaves looks like a lag and takes off less.
const OWN_SHARE: f64 = 0.2;
/// Standard deviation of a lag of which nothing is known but that it is one of a drive or a bus, seconds.
const USUAL_LAG_S: f64 = 5.0e-3;

/// Whose lag was taken off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LagKind {
    /// None: the rows show none, or none that matters.
    #[default]
    None,
    /// One for all joints.
    Common,
    /// One for each of some joints.
    Joints,
    /// The study states it.
    Stated,
}

/// What was taken off the rows, and how well the rest is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LagChoice {
    /// Whose lag was taken off.
    pub kind: LagKind,
    /// Seconds that were taken off, joint by joint; empty for none.
    pub lag_s: Vec<f64>,
    /// One lag for all joints by all training logs, with what was taken off where that is the same for all (of joints
    /// of their own what is left after it); none where the logs determine none.
    pub common: Option<TorqueLag>,
    /// χ² of the joints' lags about the common one, per degree of freedom: far above 1 where they differ.
    pub scatter: Option<f64>,
}

impl LagChoice {
    /// What was done, in a sentence without a full stop; none where there is nothing to tell.
    pub fn sentence(&self) -> Option<String> {
        let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
        let taken_off = || self.lag_s.first().copied().unwrap_or(0.0);
        let side = |lag_s: f64| if lag_s < 0.0 { "before" } else { "after" };
        Some(match self.kind {
            LagKind::None => {
                let common = self.common?;
                let bar = ms(common.half_width_95_s);
                format!("none that matters ({} +- {bar} ms, 95 %, one for all joints)", ms(common.lag_s))
            }
            LagKind::Common => {
                let bar = self.common.map_or_else(String::new, |common| format!(" +- {}", ms(common.half_width_95_s)));
                let lag_s = taken_off();
                format!("{}{bar} ms {} the motion at all joints, taken off", ms(lag_s.abs()), side(lag_s))
            }
            LagKind::Joints => "another at each joint, taken off".to_owned(),
            LagKind::Stated => {
                let is_one = self.lag_s.iter().all(|lag_s| *lag_s == taken_off());
                let what = if is_one { format!("{} ms", ms(taken_off())) } else { "joint by joint".to_owned() };
                format!("{what} as stated, taken off")
            }
        })
    }
}

/// The choice that a fit's lags ask for, beyond what was `taken_off` before (seconds, joint by joint, or empty);
/// `estimate` is the one whose parameters are to be kept from harm.
pub(crate) fn choose_lag(fit: &LagFit, taken_off: &[f64], estimate: &Estimate) -> LagChoice {
    let dof = fit.joints.len();
    let before = |joint: usize| taken_off.get(joint).copied().unwrap_or(0.0);
    let taken_off_s = match taken_off {
        [first, others @ ..] if others.iter().all(|other| other == first) => *first,
        _ => 0.0,
    };
    let total = |rest: &dyn Fn(usize) -> f64| (0..dof).map(|joint| before(joint) + rest(joint)).collect::<Vec<f64>>();
    let as_before = LagChoice { lag_s: taken_off.to_vec(), ..LagChoice::default() };
    let all: Vec<usize> = (0..dof).filter(|&joint| fit.joints[joint].is_some()).collect();
    let Some(Mean { lag, scatter }) = common(fit, &all) else { return as_before };
    let matters = |rest: &[f64]| {
        let moved = fit.answers() * DVector::from_column_slice(rest);
        moved.iter().zip(&estimate.std).any(|(moved, std)| moved.abs() > MATTERS * std)
    };
    let choice = LagChoice { common: Some(lag.after(taken_off_s)), scatter, ..as_before };

    // Joints whose own lag explains much of what the model leaves, where one lag for all does not do.
    let freedoms = all.len().saturating_sub(1) as f64;
    let unlike = scatter.is_some_and(|scatter| (scatter - 1.0) * freedoms > UNLIKE * (2.0 * freedoms).sqrt());
    let own: Vec<usize> = all.iter().copied().filter(|&joint| unlike && fit.share(joint) > OWN_SHARE).collect();
    if !own.is_empty() {
        let others: Vec<usize> = all.iter().copied().filter(|joint| !own.contains(joint)).collect();
        let of_others =
            common(fit, &others).map(|mean| mean.lag).filter(is_beyond_its_bar).map_or(0.0, |lag| lag.lag_s);
        let rest = |joint: usize| match fit.joints[joint] {
            Some(lag) if own.contains(&joint) => lag.lag_s,
            _ => of_others,
        };
        return LagChoice { kind: LagKind::Joints, lag_s: total(&rest), ..choice };
    }
    let rest = vec![lag.lag_s; dof];
    if is_beyond_its_bar(&lag) && matters(&rest) {
        return LagChoice { kind: LagKind::Common, lag_s: total(&|_| lag.lag_s), ..choice };
    }
    choice
}

/// The estimate with the error of the lags in its covariance, `Σ + S Σ_δ Sᵀ` with `S = ∂θ/∂δ`: of a lag for all joints,
/// or of joints of their own. Where no lag was taken off, what is known of lags beforehand bounds it.
pub(crate) fn with_lag_error(fit: &LagFit, choice: &LagChoice, estimate: &Estimate) -> Estimate {
    let answers = fit.answers();
    let usual = |std_s: f64| (std_s.powi(-2) + USUAL_LAG_S.powi(-2)).powf(-0.5);
    let half = match choice.kind {
        LagKind::Stated => return estimate.clone(),
        LagKind::Joints => {
            // Joints of their own do not err together.
            let std = |joint: &Option<TorqueLag>| joint.map_or(0.0, |lag| lag.std_s);
            let stds = DVector::from_iterator(fit.joints.len(), fit.joints.iter().map(std));
            answers * DMatrix::from_diagonal(&stds)
        }
        LagKind::None | LagKind::Common => {
            let Some(common) = choice.common else { return estimate.clone() };
            let std_s = if choice.kind == LagKind::None { usual(common.std_s) } else { common.std_s };
            let of_all = answers.column_sum() * std_s;
            DMatrix::from_column_slice(of_all.len(), 1, of_all.as_slice())
        }
    };
    let mut further = &half * half.transpose();
    for fixed in estimate.rank.fixed.iter().filter(|fixed| fixed.column < fit.base) {
        further.row_mut(fixed.column).fill(0.0);
        further.column_mut(fixed.column).fill(0.0);
    }
    estimate.with_further_error(&further)
}

fn is_beyond_its_bar(lag: &TorqueLag) -> bool {
    lag.lag_s.abs() > lag.half_width_95_s
}

/// One lag for some joints.
struct Mean {
    lag: TorqueLag,
    scatter: Option<f64>,
}

/// The generalised mean of some joints' lags.
fn common(fit: &LagFit, joints: &[usize]) -> Option<Mean> {
    let lags: Vec<TorqueLag> = joints.iter().filter_map(|&joint| fit.joints[joint]).collect();
    let covariance = fit.covariance(joints);
    let values = DVector::from_iterator(lags.len(), lags.iter().map(|lag| lag.lag_s));
    let ones = DVector::from_element(lags.len(), 1.0);
    let weighted = |matrix: DMatrix<f64>| matrix.cholesky().map(|factor| factor.solve(&ones));
    // Few segments: lags of all joints together may be less than independent.
    let weights = weighted(covariance.clone()).filter(|weights| weights.sum() > 0.0);
    let weights = weights.or_else(|| weighted(DMatrix::from_diagonal(&covariance.diagonal())))?;
    let total = weights.sum();
    let mean = weights.dot(&values) / total;
    let rest = values.add_scalar(-mean);
    let chi_square = covariance.cholesky().map(|factor| rest.dot(&factor.solve(&rest)));
    let scatter = chi_square.filter(|_| lags.len() > 1).map(|sum| sum / (lags.len() - 1) as f64);
    let std_s = total.powf(-0.5) * scatter.unwrap_or(1.0).max(1.0).sqrt();
    let quantile = lags.iter().map(|lag| lag.half_width_95_s / lag.std_s).fold(0.0, f64::max);
    let half_width_95_s = quantile * std_s;
    let matters = mean.abs() > half_width_95_s && lags.iter().any(|lag| lag.matters);
    (std_s.is_finite() && mean.is_finite())
        .then_some(Mean { lag: TorqueLag { lag_s: mean, std_s, half_width_95_s, matters, taken_off_s: 0.0 }, scatter })
}
