//! One reading of the samples and what speaks for and against it.

use super::candidates::FAR;
use super::explanation::Explanation;
use super::joint_fits::{JointFits, SharedMotion, score};
use super::mistake::Mistake;
use super::motion_rows::MotionRows;
use super::plausibility::{BeyondLimit, beyond_limits, is_rate_of_a_recorder};
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;

/// By how much a reading must score better before the study is doubted: as if one joint had less than 0.55 of what was
/// left of its torque. On seven sets of real logs the best wrong reading gains 0.41.
pub(super) const CLEARLY_BETTER: f64 = 0.6;
/// Readings this close to the best cannot be told from it.
pub(super) const ALIKE: f64 = 0.2;
/// Weight of what the description's own bodies leave beside what the best consistent ones leave: descriptions err.
pub(super) const NOMINAL_WEIGHT: f64 = 0.5;
/// Per joint: what a consistent robot leaves more than parameters of each joint's own do, as a logarithm, from which a
/// reading explains nothing; real logs of arms with friction of their own reach 0.55.
const UNEXPLAINED: f64 = 0.9;
/// What a joint beyond its limits costs, as if e times as much of one joint's torque were left.
const LIMIT_COST: f64 = 1.0;

/// Margin from which instants are so few that parameters of each joint's own say nothing.
const FEW_INSTANTS: f64 = 1.5;

/// The samples with some mistakes corrected, and how well a robot explains them.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Mistakes that are corrected in it, in the order of their correction; none for the study as it is.
    pub mistakes: Vec<Mistake>,
    /// Share of each joint's torque that no physically consistent robot explains, 0 to 1 (root mean squares).
    pub left: Vec<f64>,
    /// The same by one set of base parameters, consistent or not.
    pub free: Vec<f64>,
    /// The same by parameters of each joint's own, freed of what these follow of the noise.
    pub alone: Vec<f64>,
    /// The same by the description's own bodies with friction fitted joint by joint; empty where it has none.
    pub nominal: Vec<f64>,
    /// Whether what parameters of a joint's own leave says anything: there are instants enough.
    pub own_parameters_tell: Vec<bool>,
    /// Times as much as usual that another reading has to gain, for there are few instants to tell them apart.
    pub margin: f64,
    /// The share of all joints' torque together that no consistent robot explains, unweighted.
    pub left_of_all: f64,
    /// Joints beyond their limits.
    pub beyond: Vec<BeyondLimit>,
    /// Whether the rate is one that recorders have.
    pub plausible_rate: bool,
    /// `Σ_j ln(left of joint j)` by the best consistent robot.
    pub consistent_score: f64,
    /// The same by one set of base parameters, consistent or not.
    pub free_score: f64,
    /// The same by parameters of each joint's own.
    pub alone_score: f64,
    /// The same by the description's own bodies; zero where it has none.
    pub nominal_score: f64,
    /// The base parameters of the best consistent robot; those of `free` where there is none.
    pub parameters: Vec<f64>,
    /// The least and the greatest factor of positions that explain the samples as well as that of the last mistake;
    /// none where it has no such factor, or nothing between units was looked for.
    pub factors_alike: Option<[f64; 2]>,
    /// Logarithm of how much larger the torques became that columns were added to: shares of these fall by themselves.
    pub torque_growth: f64,
}

impl Reading {
    /// All evidence as one number, the less the better: logarithms of what is left, plus one for each limit that is
    /// broken, plus a little for mistakes that are rare.
    pub fn score(&self) -> f64 {
        self.consistent_score + self.beside_fit()
    }

    /// The evidence of torque alone, without limits and rates.
    pub(super) fn torque_score(&self) -> f64 {
        self.score() - self.broken()
    }

    /// Whether a mistake is among those corrected that is only looked for where a joint travels far more than it can.
    pub(super) fn is_shown_by_travel(&self) -> bool {
        let is_far = |mistake: &Mistake| matches!(mistake, Mistake::PositionUnit { joints, factor } if joints.len() == 1 && *factor < FAR.recip());
        self.mistakes.iter().any(is_far)
    }

    /// Whether it leaves far more than parameters of each joint's own do, and these say something: then it is no
    /// explanation either.
    pub fn is_unexplained(&self) -> bool {
        self.margin < FEW_INSTANTS && self.consistent_score - self.alone_score > UNEXPLAINED * self.left.len() as f64
    }

    /// The least that [`score`](Self::score) could be, whatever a consistent robot leaves.
    pub(super) fn lower_bound(&self) -> f64 {
        self.free_score + self.beside_fit()
    }

    fn beside_fit(&self) -> f64 {
        beside_fit(&self.mistakes, self.nominal_score, self.torque_growth, self.broken())
    }

    /// What its broken limits cost.
    fn broken(&self) -> f64 {
        broken(&self.beyond, self.plausible_rate)
    }
}

/// What speaks for a reading and against it beside the fit of a robot.
fn beside_fit(mistakes: &[Mistake], nominal_score: f64, torque_growth: f64, broken: f64) -> f64 {
    let rarity: f64 = mistakes.iter().map(Mistake::rarity).sum();
    NOMINAL_WEIGHT * nominal_score + (1.0 + NOMINAL_WEIGHT) * torque_growth + broken + rarity
}

fn broken(beyond: &[BeyondLimit], plausible_rate: bool) -> f64 {
    LIMIT_COST * (beyond.len() + usize::from(!plausible_rate)) as f64
}

/// The robot and the rows of a reading, for going on from it.
#[derive(Clone, Debug)]
pub(super) struct Corrected {
    pub(super) robot: ParametricModel,
    pub(super) rows: MotionRows,
    pub(super) mistakes: Vec<Mistake>,
    pub(super) torque_growth: f64,
}

impl Corrected {
    /// A robot and rows with these mistakes corrected.
    pub(super) fn new(robot: ParametricModel, rows: MotionRows, mistakes: Vec<Mistake>) -> Self {
        Self { robot, rows, mistakes, torque_growth: 0.0 }
    }

    /// With one more mistake corrected.
    pub(super) fn without(&self, mistake: &Mistake) -> Self {
        let robot = mistake.corrected_robot(&self.robot).unwrap_or_else(|| self.robot.clone());
        let mistakes = self.mistakes.iter().chain([mistake]).cloned().collect();
        let rows = mistake.corrected(&self.robot, &self.rows);
        let growth_of = |joint: usize| {
            let [before, after] = [&self.rows, &rows].map(|rows| norm(&rows.tau[joint]));
            if before > 0.0 && after > before { (after / before).ln() } else { 0.0 }
        };
        let growth = match mistake {
            Mistake::Coupled { with, .. } => growth_of(*with),
            Mistake::Compensated => (0..rows.tau.len()).map(growth_of).sum(),
            _ => 0.0,
        };
        Self { robot, rows, mistakes, torque_growth: self.torque_growth + growth }
    }

    /// The [least that the score could be](Reading::lower_bound), where that is at most `limit`. Most readings that
    /// cannot win are told by parameters of each joint's own, before any are found for all joints together. `motion` is
    /// that of the reading before the last mistake with the torques of all joints for each.
    pub(super) fn lower_bound_within(&self, limit: f64, motion: &SharedMotion) -> Option<f64> {
        let fits = self.joint_fits(motion).ok()?;
        let broken = broken(&self.beyond(), self.plausible_rate());
        let nominal_score = score(&fits.left_by_nominal(), &fits.torque);
        let beside_fit = beside_fit(&self.mistakes, nominal_score, self.torque_growth, broken);
        if score(&fits.alone, &fits.torque) + beside_fit > limit {
            return None;
        }
        let (_, free) = fits.one_set().ok()?;
        let bound = score(&free, &fits.torque) + beside_fit;
        (bound <= limit).then_some(bound)
    }

    /// What one set of base parameters leaves, [as a score](Reading::free_score), without all else; `motion` as
    /// [there](Self::lower_bound_within).
    pub(super) fn free_score(&self, motion: &SharedMotion) -> Result<f64, EstimationError> {
        self.joint_fits(motion)?.free_score()
    }

    /// The motion with the torques of all joints for each.
    pub(super) fn motion(&self) -> Result<SharedMotion, EstimationError> {
        let torques = |_| self.rows.tau.iter().map(Vec::as_slice).collect();
        SharedMotion::new(&self.robot, &self.rows, torques)
    }

    fn joint_fits(&self, motion: &SharedMotion) -> Result<JointFits<'_>, EstimationError> {
        match self.mistakes.last().and_then(|last| last.torques(self.robot.dof())) {
            Some(torques) => JointFits::of_shared((&self.robot, &self.rows), motion, &torques),
            None => JointFits::new(&self.robot, &self.rows),
        }
    }

    fn beyond(&self) -> Vec<BeyondLimit> {
        beyond_limits(self.robot.model(), &self.rows)
    }

    fn plausible_rate(&self) -> bool {
        is_rate_of_a_recorder(self.robot.model(), self.rows.rate_hz)
    }

    /// What speaks for it and against it; without a consistent robot where `consistency` is not given.
    pub(super) fn reading(&self, consistency: Option<&ConsistencySettings>) -> Result<Reading, EstimationError> {
        let explained = Explanation::new(&self.robot, &self.rows, consistency)?;
        let best = if explained.consistent.is_empty() { &explained.torque } else { &explained.consistent };
        let shares = |left: &[f64]| -> Vec<f64> {
            let share = |(left, torque): (&f64, &f64)| if *torque > 0.0 { left / torque } else { 0.0 };
            left.iter().zip(&explained.torque).map(share).collect()
        };
        let (left_of_all, all) = (norm(best), norm(&explained.torque));
        Ok(Reading {
            mistakes: self.mistakes.clone(),
            left: shares(best),
            free: shares(&explained.free),
            alone: shares(&explained.alone_of_noise_free()),
            nominal: shares(&explained.nominal),
            own_parameters_tell: explained.own_parameters_tell(),
            margin: explained.margin(),
            left_of_all: if all > 0.0 { left_of_all / all } else { 0.0 },
            beyond: self.beyond(),
            plausible_rate: self.plausible_rate(),
            consistent_score: explained.consistent_score(),
            free_score: explained.free_score(),
            alone_score: explained.alone_score(),
            nominal_score: explained.nominal_score(),
            parameters: explained.parameters().to_vec(),
            factors_alike: None,
            torque_growth: self.torque_growth,
        })
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}
