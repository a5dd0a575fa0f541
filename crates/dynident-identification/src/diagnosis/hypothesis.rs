//! A hypothesis about the logs: possible mistakes of the study, with the evidence for and against them.

use super::explanation::Explanation;
use super::joint_fits::{JointFits, SharedMotion, score};
use super::mistakes::{Mistake, Proof};
use super::motion_rows::MotionRows;
use super::plausibility::{BeyondLimit, beyond_limits, is_rate_of_a_recorder};
use super::span::norm;
use super::step_width::with_fitted_steps;
use crate::consistent::ConsistencySettings;
use crate::diagnosis_settings::{DiagnosisSettings, ScoreSettings};
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;

/// A hypothesis: a list of mistakes of the study, and the residuals after their correction.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Mistakes in the order of their correction; empty for the study as written.
    pub mistakes: Vec<Mistake>,
    /// Unexplained share of each joint's torque for the best physically consistent robot, 0 to 1 (root mean squares).
    pub left: Vec<f64>,
    /// Unexplained share of each joint's torque for one set of base parameters, physically consistent or not.
    pub free: Vec<f64>,
    /// Unexplained share of each joint's torque for separate parameters of each joint, corrected for overfitting.
    pub alone: Vec<f64>,
    /// Unexplained share of each joint's torque for the nominal bodies with friction fitted joint by joint; empty if a
    /// body is unknown.
    pub nominal: Vec<f64>,
    /// For each joint, whether there are enough instants for separate parameters of this joint.
    pub own_parameters_tell: Vec<bool>,
    /// Factor on the improvement that another hypothesis needs; above 1 for few instants.
    pub margin: f64,
    /// Unexplained share of the torque of all joints together for the best physically consistent robot, without
    /// weights.
    pub left_of_all: f64,
    /// Joints that exceed their limits.
    pub beyond: Vec<BeyondLimit>,
    /// Whether the sample rate is plausible for a recorder.
    pub plausible_rate: bool,
    /// Sum `Σ_j ln(unexplained share of joint j)` for separate parameters of each joint, not corrected for overfitting.
    pub alone_score: f64,
    /// Base parameters of the best physically consistent robot; if no such robot was found, those that belong to
    /// `free`.
    pub parameters: Vec<f64>,
    /// Range of the position factor of the last mistake within which the samples do not distinguish factors; `None` if
    /// the mistake has no such factor or the range was not computed.
    pub factors_alike: Option<[f64; 2]>,
    /// Logarithm of the growth of torques to which the correction adds other columns. This growth alone reduces
    /// unexplained shares.
    pub torque_growth: f64,
    pub(super) settings: DiagnosisSettings,
}

impl Hypothesis {
    /// All evidence as one number, smaller is better: logarithms of unexplained shares, a cost for exceeded joint
    /// limits, and a cost for rare mistakes.
    pub fn score(&self) -> f64 {
        self.consistent_score() + self.other_evidence()
    }

    /// `Σ_j ln(unexplained share of joint j)` for the best consistent robot.
    pub(super) fn consistent_score(&self) -> f64 {
        sum_of_logarithms(&self.left)
    }

    /// `Σ_j ln(unexplained share of joint j)` for one set of base parameters, physically consistent or not.
    pub(super) fn free_score(&self) -> f64 {
        sum_of_logarithms(&self.free)
    }

    /// `Σ_j ln(unexplained share of joint j)` for the nominal bodies; zero if a body is unknown.
    pub(super) fn nominal_score(&self) -> f64 {
        sum_of_logarithms(&self.nominal)
    }

    /// The score without the costs of joint limits and sample rates.
    pub(super) fn torque_score(&self) -> f64 {
        self.score() - self.limit_cost()
    }

    /// The score of the physically consistent fit alone.
    pub(super) fn bodies_score(&self) -> f64 {
        self.consistent_score() + self.torque_growth
    }

    /// Whether the last mistake is only tried for joints that travel far beyond their range.
    pub(super) fn is_shown_by_travel(&self) -> bool {
        self.mistakes.iter().any(|mistake| matches!(mistake.facts().proof, Proof::Travel(_)))
    }

    /// Whether the physically consistent fit has a far larger residual than separate parameters of each joint. False if
    /// there are not enough instants for separate parameters.
    pub fn is_unexplained(&self) -> bool {
        let ScoreSettings { few_instants_margin, max_log_ratio, .. } = self.settings.score;
        self.margin < few_instants_margin
            && self.consistent_score() - self.alone_score > max_log_ratio * self.left.len() as f64
    }

    /// Lower bound of [`score`](Self::score) for any physically consistent robot.
    pub(super) fn lower_bound(&self) -> f64 {
        self.free_score() + self.other_evidence()
    }

    fn other_evidence(&self) -> f64 {
        let limit_cost = self.limit_cost();
        self.settings.score.other_evidence(&self.mistakes, self.nominal_score(), self.torque_growth, limit_cost)
    }

    fn limit_cost(&self) -> f64 {
        self.settings.score.limit_cost(&self.beyond, self.plausible_rate)
    }
}

impl ScoreSettings {
    /// The part of the score that does not depend on the fit of a physically consistent robot.
    fn other_evidence(&self, mistakes: &[Mistake], nominal_score: f64, torque_growth: f64, limit_cost: f64) -> f64 {
        let rarity: f64 = mistakes.iter().map(|mistake| mistake.facts().rarity).sum();
        self.nominal_weight * nominal_score + (1.0 + self.nominal_weight) * torque_growth + limit_cost + rarity
    }

    fn limit_cost(&self, beyond: &[BeyondLimit], plausible_rate: bool) -> f64 {
        self.limit_cost * (beyond.len() + usize::from(!plausible_rate)) as f64
    }
}

#[derive(Clone, Debug)]
pub(super) struct CorrectedStudy {
    pub(super) robot: ParametricModel,
    pub(super) rows: MotionRows,
    pub(super) mistakes: Vec<Mistake>,
    pub(super) torque_growth: f64,
    pub(super) settings: DiagnosisSettings,
}

#[derive(Clone, Debug)]
pub(super) struct Explained {
    pub(super) study: CorrectedStudy,
    pub(super) hypothesis: Hypothesis,
}

impl CorrectedStudy {
    /// A robot and rows in which `mistakes` are already corrected.
    pub(super) fn new(
        robot: ParametricModel,
        rows: MotionRows,
        mistakes: Vec<Mistake>,
        settings: &DiagnosisSettings,
    ) -> Self {
        Self { robot, rows, mistakes, torque_growth: 0.0, settings: *settings }
    }

    /// The study with one more mistake corrected.
    pub(super) fn without(&self, mistake: &Mistake) -> Self {
        let robot = mistake.corrected_robot(&self.robot).unwrap_or_else(|| self.robot.clone());
        let mistakes = self.mistakes.iter().chain([mistake]).cloned().collect();
        let rows = mistake.corrected(&self.robot, &self.rows);
        let growth_of = |joint: usize| {
            let [before, after] = [&self.rows, &rows].map(|rows| norm(&rows.tau[joint]));
            if before > 0.0 && after > before { (after / before).ln() } else { 0.0 }
        };
        let grown = if mistake.facts().adds_torques { 0..rows.tau.len() } else { 0..0 };
        let growth: f64 = grown.map(growth_of).sum();
        Self { robot, rows, mistakes, torque_growth: self.torque_growth + growth, settings: self.settings }
    }

    /// The study with the widths of smoothed friction signs that fit its rows best.
    pub(super) fn with_fitted_steps(&self) -> Result<Self, EstimationError> {
        let robot = with_fitted_steps(&self.robot, &self.rows, self.settings.acceptance.max_ratio_of_step)?;
        Ok(Self { robot, ..self.clone() })
    }

    pub(super) fn without_all(&self, mistakes: &[Mistake]) -> Self {
        mistakes.iter().fold(self.clone(), |study, mistake| study.without(mistake))
    }

    /// The [lower bound of the score](Hypothesis::lower_bound) if it is at most `limit`. Separate parameters of each
    /// joint are cheap to compute and exclude most hypotheses first. `motion` is the motion before the last mistake is
    /// corrected; for each joint, it contains the torques of all joints.
    pub(super) fn lower_bound_within(&self, limit: f64, motion: &SharedMotion) -> Option<f64> {
        let (fits, settings) = (self.joint_fits(motion).ok()?, &self.settings.score);
        let limits = settings.limit_cost(&self.beyond(), self.has_plausible_rate());
        let nominal_score = score(&fits.left_by_nominal(), &fits.torque);
        let other = settings.other_evidence(&self.mistakes, nominal_score, self.torque_growth, limits);
        if score(&fits.alone, &fits.torque) + other > limit {
            return None;
        }
        Some(fits.free_score().ok()? + other).filter(|bound| *bound <= limit)
    }

    /// The [score of one set of base parameters](Hypothesis::free_score), with `motion` as in
    /// [`lower_bound_within`](Self::lower_bound_within); infinite if the fit fails.
    pub(super) fn free_score(&self, motion: &SharedMotion) -> f64 {
        self.joint_fits(motion).and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
    }

    /// The motion of the study; for each joint, it contains the torques of all joints.
    pub(super) fn motion(&self) -> Result<SharedMotion, EstimationError> {
        let torques = |_| self.rows.tau.iter().map(Vec::as_slice).collect();
        SharedMotion::new(&self.robot, &self.rows, torques)
    }

    fn joint_fits(&self, motion: &SharedMotion) -> Result<JointFits<'_>, EstimationError> {
        let Some(sources) = self.mistakes.last().and_then(Mistake::torques_alone) else {
            return JointFits::new(&self.robot, &self.rows);
        };
        let mut torques: Vec<(usize, f64)> = (0..self.robot.dof()).map(|joint| (joint, 1.0)).collect();
        for source in sources {
            torques[source.joint] = (source.from, source.factor);
        }
        JointFits::of_shared(&self.robot, &self.rows, motion, &torques)
    }

    fn beyond(&self) -> Vec<BeyondLimit> {
        beyond_limits(self.robot.model(), &self.rows, &self.settings.motion)
    }

    fn has_plausible_rate(&self) -> bool {
        is_rate_of_a_recorder(self.robot.model(), self.rows.rate_hz, &self.settings.motion)
    }

    /// The hypothesis with a physically consistent fit.
    pub(super) fn explained(self, consistency: &ConsistencySettings) -> Result<Explained, EstimationError> {
        let hypothesis = self.hypothesis(Some(consistency))?;
        Ok(Explained { study: self, hypothesis })
    }

    /// The hypothesis; a physically consistent fit is only computed if `consistency` is given.
    pub(super) fn hypothesis(&self, consistency: Option<&ConsistencySettings>) -> Result<Hypothesis, EstimationError> {
        let explained = Explanation::new(&self.robot, &self.rows, consistency)?;
        let best = if explained.consistent.is_empty() { &explained.torque } else { &explained.consistent };
        let share = |(left, torque): (&f64, &f64)| if *torque > 0.0 { left / torque } else { 0.0 };
        let shares = |left: &[f64]| -> Vec<f64> { left.iter().zip(&explained.torque).map(share).collect() };
        Ok(Hypothesis {
            mistakes: self.mistakes.clone(),
            left: shares(best),
            free: shares(&explained.free),
            alone: shares(&explained.alone_of_noise_free()),
            nominal: shares(&explained.nominal),
            own_parameters_tell: explained.own_parameters_tell(&self.settings.score),
            margin: explained.margin(&self.settings.score),
            left_of_all: share((&norm(best), &norm(&explained.torque))),
            beyond: self.beyond(),
            plausible_rate: self.has_plausible_rate(),
            alone_score: score(&explained.alone, &explained.torque),
            parameters: explained.parameters().to_vec(),
            factors_alike: None,
            torque_growth: self.torque_growth,
            settings: self.settings,
        })
    }
}

/// Sum of the logarithms. Joints without torque, whose share is zero, are omitted.
fn sum_of_logarithms(shares: &[f64]) -> f64 {
    shares.iter().filter(|share| **share > 0.0).map(|share| share.ln()).sum()
}
