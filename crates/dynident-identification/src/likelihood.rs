//! Likelihood and information criterion of a fit.

use dynident_estimation::{Estimate, LinearProblem};

/// Deviance of a fit (minus two times the logarithm of the likelihood) with the estimated noise of every joint, up to a
/// constant that depends on the rows: `Σ_j n_j ln σ_j²` for n_j rows and residual standard deviation σ_j of joint j.
pub(crate) fn deviance(problem: &LinearProblem, joint_sigma: &[f64]) -> f64 {
    let of_joint = |(rows, sigma): (usize, &f64)| deviance_of_joint(rows, *sigma);
    problem.joint_rows().into_iter().zip(joint_sigma).map(of_joint).sum()
}

fn deviance_of_joint(rows: usize, sigma: f64) -> f64 {
    rows as f64 * 2.0 * sigma.max(f64::MIN_POSITIVE).ln()
}

/// Quality of the fit to one joint's rows, and the number of parameters of the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct JointScore {
    pub(crate) rows: usize,
    /// Standard deviation of the residual, in the unit of the torque.
    pub(crate) sigma: f64,
    pub(crate) own: usize,
}

impl JointScore {
    /// Bayesian information criterion of a joint with correlated rows: `design_effect` rows contain as much information
    /// as one independent row (Kish, *Survey Sampling*, 1965, 8.2). Smaller is better; 0 for a joint without rows.
    ///
    /// Source of the correction: Rao and Scott, Annals of Statistics 12 (1984) 46.
    pub(crate) fn bic(&self, design_effect: f64) -> f64 {
        let independent = (self.rows as f64 / design_effect).max(1.0);
        deviance_of_joint(self.rows, self.sigma) / design_effect + self.own as f64 * independent.ln()
    }
}

/// Bayesian information criterion (BIC) of a fit with k free parameters and n rows, `deviance + k ln n`; smaller is
/// better. Source: Schwarz, Annals of Statistics 6 (1978) 461.
pub fn bic(problem: &LinearProblem, fit: &Estimate) -> f64 {
    let rows = problem.joint_rows().into_iter().sum::<usize>().max(1) as f64;
    let free = (fit.values.len() - fit.rank.fixed.len()) as f64;
    deviance(problem, &fit.joint_sigma) + free * rows.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four copies of every row contain as much information as the row alone.
    #[test]
    fn repeated_rows_do_not_add_evidence() {
        let score = |rows: usize| JointScore { rows, sigma: 0.3, own: 5 };
        let (once, repeated) = (score(250).bic(1.0), score(1000).bic(4.0));
        assert!((once - repeated).abs() < 1e-9 * once.abs(), "{once} {repeated}");
        // Without the correction, the evidence is four times as strong.
        assert!(score(1000).bic(1.0) < 3.0 * once);
        assert_eq!(JointScore::default().bic(1.0), 0.0);
    }
}
