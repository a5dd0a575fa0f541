//! A hypothesis about the logs: the mistakes that the study may have, and the evidence for and against them.

use super::explanation::Explanation;
use super::joint_fits::{JointFits, SharedMotion, score};
use super::mistakes::{Mistake, Proof};
use super::motion_rows::MotionRows;
use super::plausibility::{BeyondLimit, beyond_limits, is_rate_of_a_recorder};
use super::step_width::with_steps_of;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;

/// Improvement of the score from which the study is doubted: as if one joint had less than 0.55 of its unexplained
/// torque. On seven sets of real logs the best wrong hypothesis gains 0.41.
pub(super) const CLEARLY_BETTER: f64 = 0.6;
/// Difference of the score up to which hypotheses are not distinguishable.
pub(super) const INDISTINGUISHABLE: f64 = 0.2;
/// Weight of the residual of the described bodies beside that of the best consistent ones: descriptions err.
pub(super) const NOMINAL_WEIGHT: f64 = 0.5;
/// Logarithm of the ratio, for each joint, of the residual of a consistent robot to that of the joint's own parameters,
/// from which a hypothesis explains nothing; real logs of arms with unusual friction reach 0.55.
const MIN_UNEXPLAINED: f64 = 0.9;
/// Cost of a joint beyond its limits, as if e times as much of one joint's torque were unexplained.
pub(super) const LIMIT_COST: f64 = 1.0;
/// Margin from which instants are too few for the own parameters of a joint.
const FEW_INSTANTS: f64 = 1.5;

/// The samples with some mistakes corrected, and how well a robot explains them.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Mistakes that are corrected, in the order of their correction; empty for the study as it is.
    pub mistakes: Vec<Mistake>,
    /// Share of each joint's torque that no physically consistent robot explains, 0 to 1 (root mean squares).
    pub left: Vec<f64>,
    /// The same for one set of base parameters, consistent or not.
    pub free: Vec<f64>,
    /// The same for separate parameters of each joint, without the share of the noise that these follow.
    pub alone: Vec<f64>,
    /// The same for the described bodies with friction fitted joint by joint; empty if a body is unknown.
    pub nominal: Vec<f64>,
    /// Whether there are enough instants for separate parameters of a joint.
    pub own_parameters_tell: Vec<bool>,
    /// Factor on the improvement that another hypothesis needs: larger where there are few instants.
    pub margin: f64,
    /// Share of the torque of all joints together that no consistent robot explains, unweighted.
    pub left_of_all: f64,
    /// Joints beyond their limits.
    pub beyond: Vec<BeyondLimit>,
    /// Whether recorders have such a rate.
    pub plausible_rate: bool,
    /// `Σ_j ln(share of joint j)` for separate parameters of each joint, with the share of the noise that these follow.
    pub alone_score: f64,
    /// Base parameters of the best consistent robot; those of `free` if no consistent robot was found.
    pub parameters: Vec<f64>,
    /// Least and greatest factor of positions that explain the samples as well as that of the last mistake; none if it
    /// has no such factor, or no numbers between units were tried.
    pub factors_alike: Option<[f64; 2]>,
    /// Logarithm of the growth of torques to which columns were added: their unexplained shares fall by this alone.
    pub torque_growth: f64,
}

impl Hypothesis {
    /// All evidence as one number, smaller is better: logarithms of unexplained shares, one for each broken limit, and
    /// the rarity of the mistakes.
    pub fn score(&self) -> f64 {
        self.consistent_score() + self.other_evidence()
    }

    /// `Σ_j ln(unexplained share of joint j)` for the best consistent robot.
    pub(super) fn consistent_score(&self) -> f64 {
        sum_of_logarithms(&self.left)
    }

    /// The same for one set of base parameters, consistent or not.
    pub(super) fn free_score(&self) -> f64 {
        sum_of_logarithms(&self.free)
    }

    /// The same for the described bodies; zero if a body is unknown.
    pub(super) fn nominal_score(&self) -> f64 {
        sum_of_logarithms(&self.nominal)
    }

    /// The evidence of torque alone, without limits and rates.
    pub(super) fn torque_score(&self) -> f64 {
        self.score() - self.limit_cost()
    }

    /// The evidence of the consistent fit alone.
    pub(super) fn bodies_score(&self) -> f64 {
        self.consistent_score() + self.torque_growth
    }

    /// Whether a mistake is tried only where a joint travels far beyond its range.
    pub(super) fn is_shown_by_travel(&self) -> bool {
        self.mistakes.iter().any(|mistake| matches!(mistake.facts().proof, Proof::Travel(_)))
    }

    /// Whether far more is unexplained than by separate parameters of each joint, and these are significant: then it is
    /// no explanation.
    pub fn is_unexplained(&self) -> bool {
        self.margin < FEW_INSTANTS
            && self.consistent_score() - self.alone_score > MIN_UNEXPLAINED * self.left.len() as f64
    }

    /// Lower bound of [`score`](Self::score) for any consistent robot.
    pub(super) fn lower_bound(&self) -> f64 {
        self.free_score() + self.other_evidence()
    }

    fn other_evidence(&self) -> f64 {
        other_evidence(&self.mistakes, self.nominal_score(), self.torque_growth, self.limit_cost())
    }

    fn limit_cost(&self) -> f64 {
        limit_cost(&self.beyond, self.plausible_rate)
    }
}

/// The evidence in addition to the fit of a robot.
fn other_evidence(mistakes: &[Mistake], nominal_score: f64, torque_growth: f64, limit_cost: f64) -> f64 {
    let rarity: f64 = mistakes.iter().map(|mistake| mistake.facts().rarity).sum();
    NOMINAL_WEIGHT * nominal_score + (1.0 + NOMINAL_WEIGHT) * torque_growth + limit_cost + rarity
}

fn limit_cost(beyond: &[BeyondLimit], plausible_rate: bool) -> f64 {
    LIMIT_COST * (beyond.len() + usize::from(!plausible_rate)) as f64
}

/// Robot and rows with some mistakes corrected.
#[derive(Clone, Debug)]
pub(super) struct CorrectedStudy {
    pub(super) robot: ParametricModel,
    pub(super) rows: MotionRows,
    pub(super) mistakes: Vec<Mistake>,
    pub(super) torque_growth: f64,
}

/// A hypothesis with its robot and rows.
#[derive(Clone, Debug)]
pub(super) struct Explained {
    pub(super) study: CorrectedStudy,
    pub(super) hypothesis: Hypothesis,
}

impl CorrectedStudy {
    /// A robot and rows in which these mistakes are corrected already.
    pub(super) fn new(robot: ParametricModel, rows: MotionRows, mistakes: Vec<Mistake>) -> Self {
        Self { robot, rows, mistakes, torque_growth: 0.0 }
    }

    /// The same with one more mistake corrected.
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
        Self { robot, rows, mistakes, torque_growth: self.torque_growth + growth }
    }

    /// The same with the friction steps that its rows need.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn with_own_steps(&self) -> Result<Self, EstimationError> {
        Ok(Self { robot: with_steps_of(&self.robot, &self.rows)?, ..self.clone() })
    }

    /// The same with these mistakes corrected as well, one after the other.
    pub(super) fn without_all(&self, mistakes: &[Mistake]) -> Self {
        mistakes.iter().fold(self.clone(), |study, mistake| study.without(mistake))
    }

    /// The [lower bound of the score](Hypothesis::lower_bound) if it is at most `limit`. The separate parameters of
    /// each joint exclude most hypotheses before any parameters of all joints are estimated. `motion` is that of the
    /// study before the last mistake with the torques of all joints for each.
    pub(super) fn lower_bound_within(&self, limit: f64, motion: &SharedMotion) -> Option<f64> {
        let fits = self.joint_fits(motion).ok()?;
        let limits = limit_cost(&self.beyond(), self.has_plausible_rate());
        let nominal_score = score(&fits.left_by_nominal(), &fits.torque);
        let other = other_evidence(&self.mistakes, nominal_score, self.torque_growth, limits);
        if score(&fits.alone, &fits.torque) + other > limit {
            return None;
        }
        Some(fits.free_score().ok()? + other).filter(|bound| *bound <= limit)
    }

    /// The [score of one set of base parameters](Hypothesis::free_score), with `motion` as for
    /// [`lower_bound_within`](Self::lower_bound_within); infinite without a fit.
    pub(super) fn free_score(&self, motion: &SharedMotion) -> f64 {
        self.joint_fits(motion).and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
    }

    /// The motion with the torques of all joints for each.
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
        beyond_limits(self.robot.model(), &self.rows)
    }

    fn has_plausible_rate(&self) -> bool {
        is_rate_of_a_recorder(self.robot.model(), self.rows.rate_hz)
    }

    /// The evidence, with that of a consistent robot.
    pub(super) fn explained(self, consistency: &ConsistencySettings) -> Result<Explained, EstimationError> {
        let hypothesis = self.hypothesis(Some(consistency))?;
        Ok(Explained { study: self, hypothesis })
    }

    /// The evidence; without a consistent robot where `consistency` is not given.
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
            own_parameters_tell: explained.own_parameters_tell(),
            margin: explained.margin(),
            left_of_all: share((&norm(best), &norm(&explained.torque))),
            beyond: self.beyond(),
            plausible_rate: self.has_plausible_rate(),
            alone_score: score(&explained.alone, &explained.torque),
            parameters: explained.parameters().to_vec(),
            factors_alike: None,
            torque_growth: self.torque_growth,
        })
    }
}

/// The share of a joint without torque is zero and left out.
fn sum_of_logarithms(shares: &[f64]) -> f64 {
    shares.iter().filter(|share| **share > 0.0).map(|share| share.ln()).sum()
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}
