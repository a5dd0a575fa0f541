//! Selection of the torque lag to compensate: no lag, one lag for all joints, or separate lags of some joints.
//!
//! A lag of a recorder or a bus is the same for all joints, so a common lag is estimated first. It is the generalised
//! mean of the joints' lags. If the lags differ by more than their error bars, the error bar of the mean is increased
//! by this spread (Paule and Mandel, J. Res. NBS 87 (1982) 377). Unmodelled friction or elasticity also looks like a
//! lag, but a different one in every joint; it increases the error bar and is not compensated. Joints get separate lags
//! only after a common lag was compensated, because friction that was selected from rows with a lag absorbs a different
//! part of the lag at each joint. The parameters θ depend on the lag δ with the sensitivity
//! `∂θ/∂δ = Cov(θ, δ) Cov(δ, δ)⁻¹`, so the error bars include the uncertainty of the lag.

use super::fit::LagFit;
use super::measured::TorqueLag;
use crate::settings::LagCandidates;
use dynident_estimation::Estimate;
use dynident_recording::log::OneOrMany;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Number of bisections for the spread between joints.
const BISECTIONS: usize = 20;

/// Kind of lag that is compensated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LagKind {
    /// No lag, because there is no significant one.
    #[default]
    None,
    /// One lag for all joints.
    Common,
    /// Separate lags of some joints.
    Joints,
    /// The lag that the study states.
    Stated,
}

/// The compensated lag and the uncertainty that remains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LagChoice {
    /// Kind of lag that is compensated.
    pub kind: LagKind,
    /// Compensated lag of each joint, s; empty if no lag is compensated.
    pub lag_s: Vec<f64>,
    /// Lag that is common to all joints and training logs, including a compensated common lag (for separate lags of
    /// joints, only the remaining lag); `None` if the logs do not determine it.
    pub common: Option<TorqueLag>,
    /// χ² of the differences between the joints' lags and the common lag, per degree of freedom; far above 1 if the
    /// joints have different lags.
    pub scatter: Option<f64>,
    /// Time by which the friction of each joint changes its sign later than the filtered velocity, s (negative:
    /// earlier), besides the lag; `null` for a joint without such friction. Empty if these times are not significant.
    #[serde(default)]
    pub reversal_s: Vec<Option<f64>>,
}

impl LagChoice {
    /// Compensated lag in the form of
    /// [`MotionSettings::torque_lag_s`](dynident_recording::MotionSettings::torque_lag_s), for other rows with the same
    /// settings. `None` if nothing was compensated.
    pub fn taken_off(&self) -> Option<OneOrMany<f64>> {
        (!self.lag_s.is_empty()).then(|| OneOrMany::Many(self.lag_s.clone()))
    }

    /// Largest magnitude of the compensated lags of all joints, s.
    pub fn longest_s(&self) -> f64 {
        self.lag_s.iter().fold(0.0, |longest, lag_s| longest.max(lag_s.abs()))
    }

    /// Part of the compensated lag that is certain: the largest magnitude over the joints minus the half-width of the
    /// 95 % interval of the common lag, s. Zero if no lag was compensated or the interval includes zero.
    pub fn certain_s(&self) -> f64 {
        let half_width_s = self.common.as_ref().map_or(0.0, |common| common.half_width_95_s);
        (self.longest_s() - half_width_s).max(0.0)
    }

    /// The selection as a sentence without a full stop; `None` if there is nothing to report.
    pub fn sentence(&self) -> Option<String> {
        let sentences: Vec<String> = self.lag_sentence().into_iter().chain(self.reversal_sentence()).collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }

    fn reversal_sentence(&self) -> Option<String> {
        let times_s = || self.reversal_s.iter().flatten().copied();
        let [low, high] = [times_s().fold(f64::INFINITY, f64::min), times_s().fold(f64::NEG_INFINITY, f64::max)];
        (low <= high).then(|| {
            format!(
                "friction changes its sign {:.1} to {:.1} ms after the velocity (negative: before), as if joints stick at \
                 reversals; the error bars include this",
                1e3 * low,
                1e3 * high
            )
        })
    }

    fn lag_sentence(&self) -> Option<String> {
        let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
        let taken_off = || self.lag_s.first().copied().unwrap_or(0.0);
        let side = |lag_s: f64| if lag_s < 0.0 { "before" } else { "after" };
        Some(match self.kind {
            LagKind::None => {
                let common = self.common?;
                let bar = ms(common.half_width_95_s);
                format!("not significant ({} +- {bar} ms, 95 %, one for all joints)", ms(common.lag_s))
            }
            LagKind::Common => {
                let bar = self.common.map_or_else(String::new, |common| format!(" +- {}", ms(common.half_width_95_s)));
                let lag_s = taken_off();
                format!("{}{bar} ms {} the motion at all joints, compensated", ms(lag_s.abs()), side(lag_s))
            }
            LagKind::Joints => {
                let low = self.lag_s.iter().copied().fold(f64::INFINITY, f64::min);
                let high = self.lag_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                format!("{} to {} ms, different at each joint, compensated", ms(low), ms(high))
            }
            LagKind::Stated => {
                let is_one = self.lag_s.iter().all(|lag_s| *lag_s == taken_off());
                let what = if is_one { format!("{} ms", ms(taken_off())) } else { "joint by joint".to_owned() };
                format!("{what} as stated, compensated")
            }
        })
    }
}

/// Selects the lag from a fit. `taken_off` are the lags that were already compensated before this fit (s, by joint, or
/// empty). `estimate` contains the parameters that an uncompensated lag must not change significantly.
pub(super) fn choose_lag(fit: &LagFit, taken_off: &[f64], estimate: &Estimate, candidates: LagCandidates) -> LagChoice {
    let dof = fit.joints.len();
    let before = |joint: usize| taken_off.get(joint).copied().unwrap_or(0.0);
    let taken_off_s = match taken_off {
        [first, others @ ..] if others.iter().all(|other| other == first) => *first,
        _ => 0.0,
    };
    let total = |rest: &dyn Fn(usize) -> f64| (0..dof).map(|joint| before(joint) + rest(joint)).collect::<Vec<f64>>();
    let mut reversal_s = vec![None; if fit.reversals.is_empty() { 0 } else { dof }];
    for reversal in &fit.reversals {
        reversal_s[reversal.joint] = Some(reversal.late_s);
    }
    let as_before = LagChoice { lag_s: taken_off.to_vec(), reversal_s, ..LagChoice::default() };
    let all = informative_joints(fit);
    let Some(CommonLag { lag, scatter, .. }) = common(fit, &all) else { return as_before };
    let thresholds = &fit.thresholds;
    let matters = |rest: &[f64]| {
        let moved = fit.lag_answers() * DVector::from_column_slice(rest);
        moved
            .iter()
            .take(fit.parameters)
            .zip(&estimate.std)
            .any(|(moved, std)| moved.abs() > thresholds.min_parameter_shift * std)
    };
    let choice = LagChoice { common: Some(lag.after(taken_off_s)), scatter, ..as_before };

    let rest = vec![lag.lag_s; dof];
    let is_common = is_beyond_its_bar(&lag) && matters(&rest);
    if is_common && taken_off.is_empty() {
        return LagChoice { kind: LagKind::Common, lag_s: rest, ..choice };
    }

    // Separate lags of joints are selected if they explain much of the residual and a common lag does not.
    let freedoms = all.len().saturating_sub(1) as f64;
    let is_scattered = scatter
        .is_some_and(|scatter| (scatter - 1.0) * freedoms > thresholds.max_scatter_std * (2.0 * freedoms).sqrt());
    let may_be_separate = is_scattered && candidates == LagCandidates::CommonOrJoints;
    let is_own = |joint: usize| may_be_separate && fit.share(joint) > thresholds.min_own_share;
    let own: Vec<usize> = all.iter().copied().filter(|&joint| is_own(joint)).collect();
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
    if is_common {
        return LagChoice { kind: LagKind::Common, lag_s: total(&|_| lag.lag_s), ..choice };
    }
    choice
}

/// Effect of the lag's uncertainty on parameters and unknown gains: `S Σ_δ^½` with the sensitivity `S = ∂θ/∂δ` and the
/// covariance Σ_δ of the lags, for a common lag or for separate lags. If no lag was compensated, the uncertainty is
/// limited by the prior knowledge of lags. `None` for a stated lag. If joints cannot have separate lags (`candidates`),
/// the spread of their lags remains in the rows and is part of the uncertainty. The times of reversal are not
/// compensated, so they are part of it with their values.
fn lag_error(fit: &LagFit, choice: &LagChoice, candidates: LagCandidates) -> Option<DMatrix<f64>> {
    let answers = fit.lag_answers();
    let usual = |std_s: f64| (std_s.powi(-2) + fit.usual_lag_s.powi(-2)).powf(-0.5);
    let of_lags = match choice.kind {
        LagKind::Stated => return None,
        LagKind::Joints => {
            // The errors of separate lags are independent.
            let std = |joint: &Option<TorqueLag>| joint.map_or(0.0, |lag| lag.std_s);
            let stds = DVector::from_iterator(fit.joints.len(), fit.joints.iter().map(std));
            answers * DMatrix::from_diagonal(&stds)
        }
        LagKind::None | LagKind::Common => {
            let shared = choice.common?;
            let std_s = if choice.kind == LagKind::None { usual(shared.std_s) } else { shared.std_s };
            let of_all = answers.column_sum() * std_s;
            let of_all = DMatrix::from_column_slice(of_all.len(), 1, of_all.as_slice());
            let telling = informative_joints(fit);
            let spread_s = match candidates {
                LagCandidates::CommonOrJoints => 0.0,
                LagCandidates::Common => common(fit, &telling).map_or(0.0, |mean| mean.spread_s),
            };
            let own = answers.select_columns(&telling) * spread_s;
            DMatrix::from_fn(own.nrows(), own.ncols() + 1, |row, column| match column.checked_sub(1) {
                None => of_all[(row, 0)],
                Some(joint) => own[(row, joint)],
            })
        }
    };
    let of_reversals = fit.reversal_error();
    let columns = of_lags.column_iter().chain(of_reversals.column_iter()).collect::<Vec<_>>();
    Some(DMatrix::from_columns(&columns))
}

/// Covariance `S Σ_δ Sᵀ` that the error of the lags adds to an estimate (S: sensitivity, Σ_δ: covariance of the lags).
pub(super) fn covariance_of_lag(
    fit: &LagFit,
    choice: &LagChoice,
    candidates: LagCandidates,
    estimate: &Estimate,
) -> Option<DMatrix<f64>> {
    let half = lag_error(fit, choice, candidates)?;
    let half = half.rows(0, fit.parameters);
    let mut further = half * half.transpose();
    for fixed in estimate.rank.fixed.iter().filter(|fixed| fixed.column < fit.parameters) {
        further.row_mut(fixed.column).fill(0.0);
        further.column_mut(fixed.column).fill(0.0);
    }
    Some(further)
}

/// Relative standard deviations of the unknown gains that the error of the lags causes.
pub(crate) fn gain_errors(fit: &LagFit, choice: &LagChoice) -> Vec<f64> {
    let Some(half) = lag_error(fit, choice, LagCandidates::CommonOrJoints) else {
        return vec![0.0; fit.first - fit.parameters];
    };
    (fit.parameters..fit.first).map(|row| half.row(row).norm()).collect()
}

/// Joints whose lags are more accurate than the prior; if there are none, all joints with a lag. The lag of a joint at
/// rest is determined by noise only.
fn informative_joints(fit: &LagFit) -> Vec<usize> {
    let lags = fit.joints.iter().enumerate().filter_map(|(joint, lag)| Some((joint, lag.as_ref()?)));
    let telling: Vec<usize> =
        lags.clone().filter(|(_, lag)| lag.std_s < fit.usual_lag_s).map(|(joint, _)| joint).collect();
    if telling.is_empty() { lags.map(|(joint, _)| joint).collect() } else { telling }
}

fn is_beyond_its_bar(lag: &TorqueLag) -> bool {
    lag.lag_s.abs() > lag.half_width_95_s
}

struct CommonLag {
    lag: TorqueLag,
    scatter: Option<f64>,
    /// Standard deviation of the joints' lags around the common lag, beyond their own errors, s.
    spread_s: f64,
}

/// Common lag of some joints: the generalised mean of their lags, with a spread τ between the joints in addition to
/// their own errors, from `χ²(τ) = n − 1` for n joints (Paule and Mandel, J. Res. NBS 87 (1982) 377). Unmodelled
/// friction changes the lags of all joints with the same sign and does not average out. Therefore the interval that
/// decides whether there is a lag includes the complete spread. The standard deviation, which increases the error bars
/// of the parameters, is that of the mean.
fn common(fit: &LagFit, joints: &[usize]) -> Option<CommonLag> {
    let lags: Vec<TorqueLag> = joints.iter().filter_map(|&joint| fit.joints[joint]).collect();
    let covariance = fit.covariance(joints);
    let values = DVector::from_iterator(lags.len(), lags.iter().map(|lag| lag.lag_s));
    // With few time segments, the covariance of all joints can be singular.
    let covariance = match covariance.clone().cholesky() {
        Some(_) => covariance,
        None => DMatrix::from_diagonal(&covariance.diagonal()),
    };
    let alone = SharedLag::with_spread(&covariance, &values, 0.0)?;
    let freedoms = lags.len().saturating_sub(1) as f64;
    let (mut spread, mut shared) = (0.0, alone);
    if alone.chi_square > freedoms && freedoms > 0.0 {
        // χ² decreases with the spread τ. It is below n − 1 if τ is the spread of the values themselves.
        let mut bounds = [0.0, values.iter().fold(0.0_f64, |most, value| most.max((value - alone.mean).abs()))];
        bounds[1] *= (lags.len() as f64).sqrt();
        for _ in 0..BISECTIONS {
            spread = 0.5 * (bounds[0] + bounds[1]);
            shared = SharedLag::with_spread(&covariance, &values, spread)?;
            bounds[usize::from(shared.chi_square <= freedoms)] = spread;
        }
    }
    let std_s = shared.variance.sqrt();
    let quantile = lags.iter().map(|lag| lag.half_width_95_s / lag.std_s).fold(0.0, f64::max);
    let (lag_s, half_width_95_s) = (shared.mean, quantile * std_s.hypot(spread));
    let matters = lag_s.abs() > half_width_95_s && lags.iter().any(|lag| lag.matters);
    let scatter = (freedoms > 0.0).then(|| alone.chi_square / freedoms);
    (std_s.is_finite() && lag_s.is_finite()).then_some(CommonLag {
        lag: TorqueLag { lag_s, std_s, half_width_95_s, matters, taken_off_s: 0.0 },
        scatter,
        spread_s: spread,
    })
}

#[derive(Clone, Copy)]
struct SharedLag {
    mean: f64,
    variance: f64,
    chi_square: f64,
}

impl SharedLag {
    fn with_spread(covariance: &DMatrix<f64>, values: &DVector<f64>, spread: f64) -> Option<Self> {
        let count = values.len();
        let factor = (covariance + DMatrix::from_diagonal_element(count, count, spread * spread)).cholesky()?;
        let ones = DVector::from_element(count, 1.0);
        let weights = factor.solve(&ones);
        let total = weights.sum();
        let mean = weights.dot(values) / total;
        let rest = values.add_scalar(-mean);
        (total > 0.0).then(|| Self { mean, variance: 1.0 / total, chi_square: rest.dot(&factor.solve(&rest)) })
    }
}
