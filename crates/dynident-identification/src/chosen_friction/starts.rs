//! Starts of the estimation of friction constants. Passes over the recordings start from the selection on the grid, from
//! a second start if the first is known to end in a local minimum, and from the runners-up of the grid. A grid cannot
//! rank laws that differ less than the constants of two grid points.

use super::choice::GridFriction;
use super::constants::with_constants;
use crate::error::IdentificationError;
use crate::friction::{ConstantsError, FrictionConstants, JointFriction, JointScale, is_one_friction, second_start};
use crate::likelihood::JointScore;
use crate::training::TrainingPasses;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::TorqueTerm;
use dynident_rows::RegressorModel;

/// Friction with estimated constants.
pub(super) struct Refined {
    pub(super) joints: Vec<JointFriction>,
    pub(super) model: RegressorModel,
    /// Uncertainty of the constants; `None` without constants.
    pub(super) error: Option<ConstantsError>,
}

impl Refined {
    fn new(
        passes: &TrainingPasses<'_>,
        robot: &ParametricModel,
        mut joints: Vec<JointFriction>,
        start: RegressorModel,
        gains: &[usize],
    ) -> Result<Self, IdentificationError> {
        let (model, error) = with_constants(passes, robot, &mut joints, start, gains)?;
        Ok(Self { joints, model, error })
    }

    /// Estimates the constants again with the terms `starts` of the joints that have an entry there. Each of these
    /// joints takes the friction with the lower Bayesian information criterion.
    fn or_from(
        self,
        passes: &TrainingPasses<'_>,
        robot: &ParametricModel,
        starts: &[Option<Vec<TorqueTerm>>],
        gains: &[usize],
    ) -> Result<Self, IdentificationError> {
        let is_moved: Vec<bool> = starts.iter().map(Option::is_some).collect();
        if !is_moved.contains(&true) {
            return Ok(self);
        }
        let mut others = self.joints.clone();
        for (one, start) in others.iter_mut().zip(starts) {
            start.iter().for_each(|terms| one.choose(terms));
        }
        let start = passes.with_friction(robot, &others, &self.model)?;
        let other = Self::new(passes, robot, others, start, gains)?;
        let as_counted = vec![1.0; starts.len()];
        let (first, second) = (&self.joints, &other.joints);
        let taken = better_of_joints(passes, first, &self.model, second, &other.model, &is_moved, &as_counted)?;
        if !taken.contains(&true) {
            return Ok(self);
        }
        if taken == is_moved {
            return Ok(other);
        }
        let mut joints = self.joints;
        take(&mut joints, other.joints, &taken);
        let start = passes.with_friction(robot, &joints, &self.model)?;
        Self::new(passes, robot, joints, start, gains)
    }
}

/// Finds the best constants from the selection on the grid and from the other starts. `near_rest` names the joints with
/// rows near rest, for which a [second start](second_start) may be needed.
pub(super) fn best_constants(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    of_grid: &GridFriction,
    near_rest: &[&str],
) -> Result<Refined, IdentificationError> {
    let GridFriction { model, joints, runners_up, gains, .. } = of_grid;
    let second = |one: &JointFriction| {
        let joint = model.model().joint_index(&one.joint).filter(|_| near_rest.contains(&&one.joint[..]))?;
        second_start(one.terms.as_ref()?, JointScale::of(robot.model(), joint))
    };
    let second: Vec<Option<Vec<TorqueTerm>>> = joints.iter().map(second).collect();
    let first = Refined::new(passes, robot, joints.clone(), model.clone(), gains)?;
    let mut best = first.or_from(passes, robot, &second, gains)?;
    for number in 0..runners_up.iter().map(Vec::len).max().unwrap_or(0) {
        let starts: Vec<_> = runners_up.iter().map(|own| own.get(number).cloned()).collect();
        best = best.or_from(passes, robot, &starts, gains)?;
    }
    Ok(best)
}

/// For each joint, whether the friction `others` has a lower Bayesian information criterion (Schwarz, Annals of
/// Statistics 6 (1978) 461) than the friction `joints`. It must be lower with all rows and with the number of rows
/// divided by `design_effects`. Only joints in `is_other` can differ.
pub(crate) fn better_of_joints(
    passes: &TrainingPasses<'_>,
    joints: &[JointFriction],
    model: &RegressorModel,
    others: &[JointFriction],
    of_others: &RegressorModel,
    is_other: &[bool],
    design_effects: &[f64],
) -> Result<Vec<bool>, IdentificationError> {
    let of_joints =
        |model: &RegressorModel, joints: &[JointFriction]| -> Result<Vec<JointScore>, IdentificationError> {
            let scores = friction_scores(passes, model, joints)?;
            let place = |one: &JointFriction| model.model().joint_index(&one.joint);
            Ok(joints.iter().map(|one| place(one).map_or(JointScore::default(), |joint| scores[joint])).collect())
        };
    let (first, second) = (of_joints(model, joints)?, of_joints(of_others, others)?);
    let is_possible = |one: &JointFriction| one.terms.as_deref().is_none_or(is_one_friction);
    let is_better = |place: usize| {
        let counted = |effect: f64| second[place].bic(effect) < first[place].bic(effect);
        is_other[place] && is_possible(&others[place]) && counted(1.0) && counted(design_effects[place])
    };
    Ok((0..joints.len()).map(is_better).collect())
}

/// Copies the friction in `others` to the joints that are marked in `taken`.
pub(crate) fn take(joints: &mut [JointFriction], others: Vec<JointFriction>, taken: &[bool]) {
    for ((one, other), _) in joints.iter_mut().zip(others).zip(taken).filter(|(_, taken)| **taken) {
        *one = other;
    }
}

/// Quality of the fit to each joint's rows. The number of parameters of a joint is the number of terms and constants of
/// its friction.
fn friction_scores(
    passes: &TrainingPasses<'_>,
    model: &RegressorModel,
    joints: &[JointFriction],
) -> Result<Vec<JointScore>, IdentificationError> {
    let (rows, fit) = passes.rows_and_fit(model)?;
    let constants = FrictionConstants::new(model, joints);
    let mut scores = vec![JointScore::default(); model.dof()];
    for ((&joint, count), &sigma) in rows.joints.iter().zip(rows.problem.joint_rows()).zip(&fit.joint_sigma) {
        let is_own = |term: &&TorqueTerm| term.is_joint_friction() && term.own_joint() == Some(joint);
        let terms = model.parametric.terms().iter().filter(is_own).count();
        scores[joint] = JointScore { rows: count, sigma, own: terms + constants.count(joint) };
    }
    Ok(scores)
}
