//! Unexplained torque that repeats with the position of a joint, as of a spring, a counterbalance or a cable.
//!
//! The range of a joint is divided into bins. Consecutive samples in one bin with one direction of motion are a visit,
//! and its datum is the mean residual. With means m₊ and m₋ of the visits in both directions, the torque at a bin is
//!
//! ```text
//! f = (m₊ + m₋)/2
//! ```
//!
//! so that errors of the friction cancel. A torque that depends on anything else than this position differs between the
//! visits of a cell (bin and direction). With the mean square s² of these differences, the variance of f is
//! `v = s² (1/n₊ + 1/n₋)/4`, and the share of the position is `σ_f²/(σ_f² + s²)`, where σ_f² is the variance of f over
//! the bins minus the mean of v: the random-effects analysis of variance (Searle, Casella and McCulloch, *Variance
//! Components*, 1992, chapter 3).

use super::motion_trace::MotionTrace;
use crate::examination_settings::ExaminationSettings;
use dynident_model::Model;
use dynident_recording::{Finding, Level};

/// Number of bins over the range of a joint.
const BINS: usize = 12;

/// Smallest number of visits of a cell, for its mean and their differences.
const MIN_VISITS: usize = 2;

/// Unexplained torque of one joint as a function of its position.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionTorque {
    /// Index of the joint.
    pub joint: usize,
    /// Name of the joint.
    pub name: String,
    /// Share of the unexplained torque (variance of the means of visits) that is a function of the position.
    pub share: f64,
    /// Root mean square of the function, Nm (N).
    pub rms_nm: f64,
    /// Root mean square of the measured torque, Nm (N).
    pub torque_nm: f64,
    /// Lowest and highest position in the logs, rad (m).
    pub range: [f64; 2],
}

impl PositionTorque {
    /// What was found, with its size.
    pub fn words(&self) -> String {
        format!(
            "{:.0} % of its unexplained torque repeats with its position ({:.3} Nm (N) RMS of {:.3}), as of a spring, counterbalance or cable",
            100.0 * self.share,
            self.rms_nm,
            self.torque_nm
        )
    }
}

/// Joints whose unexplained torque in the training logs is mostly a function of their own position.
pub fn position_torques(model: &Model, traces: &[&MotionTrace], settings: &ExaminationSettings) -> Vec<PositionTorque> {
    let of_joint = |joint: usize| {
        let cells = Cells::of(joint, traces)?;
        let function = cells.function()?;
        let is_named = function.share >= settings.min_position_share
            && function.fisher >= settings.min_position_fisher
            && function.rms >= settings.min_position_ratio * cells.torque_rms;
        is_named.then(|| PositionTorque {
            joint,
            name: model.joints()[joint].name.clone(),
            share: function.share,
            rms_nm: function.rms,
            torque_nm: cells.torque_rms,
            range: [cells.from, cells.from + cells.width * BINS as f64],
        })
    };
    (0..model.dof()).filter_map(of_joint).collect()
}

/// A warning for each joint.
pub fn position_torque_findings(found: &[PositionTorque]) -> impl Iterator<Item = Finding> {
    found.iter().map(|torque| Finding {
        code: "fit-position-torque".to_owned(),
        level: Level::Warning,
        channel: format!("torque {}", torque.name),
        message: format!("{}; `dynident check` prints the [[torque]] table for it", torque.words()),
    })
}

/// Means of the visits of one joint, by bin and direction.
struct Cells {
    from: f64,
    width: f64,
    torque_rms: f64,
    visits: [[Vec<f64>; 2]; BINS],
}

/// A function of the position.
struct Function {
    share: f64,
    /// Mean square of f over the bins relative to its expectation without a function.
    fisher: f64,
    rms: f64,
}

impl Cells {
    /// `None` without motion.
    fn of(joint: usize, traces: &[&MotionTrace]) -> Option<Self> {
        let positions = || traces.iter().filter_map(|trace| trace.q.get(joint)).flatten().copied();
        let (from, to) = (positions().fold(f64::INFINITY, f64::min), positions().fold(f64::NEG_INFINITY, f64::max));
        let width = (to - from) / BINS as f64;
        if !(width.is_finite() && width > 0.0) {
            return None;
        }
        let (mut squares, mut samples) = (0.0, 0_usize);
        let mut visits: [[Vec<f64>; 2]; BINS] = Default::default();
        for trace in traces {
            let (q, measured, predicted) = (&trace.q[joint], &trace.measured_nm[joint], &trace.predicted_nm[joint]);
            // Bin and direction of the current visit, sum and number of its residuals.
            let mut visit: Option<((usize, usize), f64, usize)> = None;
            for k in 1..q.len() {
                let residual = measured[k] - predicted[k];
                if !residual.is_finite() {
                    continue;
                }
                squares += measured[k] * measured[k];
                samples += 1;
                let bin = (((q[k] - from) / width) as usize).min(BINS - 1);
                let cell = (bin, usize::from(q[k] < q[k - 1]));
                match &mut visit {
                    Some((own, sum, count)) if *own == cell => {
                        *sum += residual;
                        *count += 1;
                    }
                    _ => {
                        if let Some(((bin, direction), sum, count)) = visit.replace((cell, residual, 1)) {
                            visits[bin][direction].push(sum / count as f64);
                        }
                    }
                }
            }
            if let Some(((bin, direction), sum, count)) = visit {
                visits[bin][direction].push(sum / count as f64);
            }
        }
        (samples > 0).then(|| Self { from, width, torque_rms: (squares / samples as f64).sqrt(), visits })
    }

    /// The function, if at least half of the bins have enough visits in both directions.
    fn function(&self) -> Option<Function> {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let known: Vec<(usize, &[Vec<f64>; 2])> = (self.visits.iter().enumerate())
            .filter(|(_, both)| both.iter().all(|visits| visits.len() >= MIN_VISITS))
            .collect();
        if known.len() < BINS / 2 {
            return None;
        }
        let cells = || known.iter().flat_map(|(_, both)| both.iter());
        let freedom: usize = cells().map(|visits| visits.len() - 1).sum();
        let squares: f64 =
            cells().map(|visits| visits.iter().map(|one| (one - mean(visits)).powi(2)).sum::<f64>()).sum();
        let within = squares / freedom as f64;
        let bins = known.len() as f64;
        let values: Vec<f64> = known.iter().map(|(_, [up, down])| 0.5 * (mean(up) + mean(down))).collect();
        let inverse = |visits: &Vec<f64>| 1.0 / visits.len() as f64;
        let expected: f64 =
            known.iter().map(|(_, [up, down])| 0.25 * within * (inverse(up) + inverse(down))).sum::<f64>() / bins;
        let centre = mean(&values);
        let between = values.iter().map(|value| (value - centre).powi(2)).sum::<f64>() / (bins - 1.0);
        let own = (between - expected).max(0.0);
        Some(Function { share: own / (own + within), fisher: between / expected, rms: own.sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 60 s of a sine of two frequencies; the residual is `unexplained(q, dq, t)` with a noise of 0.2 Nm.
    fn trace(unexplained: impl Fn(f64, f64, f64) -> f64) -> MotionTrace {
        let times_s: Vec<f64> = (0..1500).map(|k| 0.04 * f64::from(k)).collect();
        let q = |t: f64| (0.9 * t).sin() + 0.4 * (2.3 * t).sin();
        let dq = |t: f64| 0.9 * (0.9 * t).cos() + 0.92 * (2.3 * t).cos();
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            0.7 * ((state >> 40) as f64 / f64::from(1 << 24) - 0.5)
        };
        let predicted: Vec<f64> = times_s.iter().map(|t| 10.0 * q(*t).sin()).collect();
        let measured = (times_s.iter().zip(&predicted))
            .map(|(&t, torque)| torque + unexplained(q(t), dq(t), t) + noise())
            .collect();
        let q = times_s.iter().map(|&t| q(t)).collect();
        MotionTrace { times_s, q: vec![q], measured_nm: vec![measured], predicted_nm: vec![predicted] }
    }

    fn found(trace: &MotionTrace) -> Option<Function> {
        let function = Cells::of(0, &[trace])?.function()?;
        let settings = ExaminationSettings::default();
        (function.share >= settings.min_position_share && function.fisher >= settings.min_position_fisher)
            .then_some(function)
    }

    #[test]
    fn a_spring_is_found_next_to_unexplained_friction() {
        let spring = |q: f64| 2.0 * q.powi(2);
        let function = found(&trace(|q, dq, _| spring(q) + 1.5 * dq.signum())).expect("the spring is found");
        // Over the range of ±1.4 rad the spring differs from its mean by 1.17 Nm (RMS). Noise of 0.2 Nm and twelve bins
        // change this by less than a tenth.
        assert!((function.rms - 1.17).abs() < 0.12 && function.share > 0.9, "{} {}", function.rms, function.share);
    }

    #[test]
    fn noise_friction_and_time_are_no_function_of_the_position() {
        assert!(found(&trace(|_, _, _| 0.0)).is_none());
        assert!(found(&trace(|_, dq, _| 1.5 * dq.signum() + 0.5 * dq)).is_none());
        assert!(found(&trace(|_, _, t| 1.5 * (0.1 * t).sin())).is_none());
        // The posture of another joint: only a part is a function of the own position.
        assert!(found(&trace(|q, _, t| 1.5 * (q + 1.3 * (1.37 * t).sin()).cos())).is_none());
    }
}
