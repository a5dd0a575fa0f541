//! The friction of the joints as their recordings choose it: which terms, then their constants.

use super::constants::{best_constants, error_of_constants, friction_scores, one_step, with_constants};
use super::passes::{with_friction_of, with_terms, without_bars};
use crate::error::IdentificationError;
use crate::estimators::Estimator;
use crate::friction::{
    CandidateColumn, ConstantsError, FrictionSearch, JointFriction, JointScale, candidate_columns,
    choose_friction as choose_terms, smooth_width, step_columns,
};
use crate::logs::Logs;
use crate::payload::{Payload, free_gains};
use crate::regressor_model::RegressorModel;
use crate::settings::IdentificationSettings;
use crate::training::{Training, TrainingPasses, plain_estimate};
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use dynident_model::terms::TorqueTerm;

/// A model with the friction that its recordings chose.
#[derive(Clone, Debug)]
pub struct ChosenFriction {
    /// The model, with the load where friction depends on it.
    pub model: RegressorModel,
    /// How each joint's was chosen; empty where none was to be.
    pub joints: Vec<JointFriction>,
    /// The rows and the fit with the terms as stated, of which the choice began; none where none was to be.
    pub stated: Option<(Training, Estimate)>,
    /// What the error of the chosen constants adds to the bars of all parameters; none where none was chosen.
    pub(crate) constants_error: Option<ConstantsError>,
}

impl ChosenFriction {
    /// A model whose friction is all stated.
    pub(crate) fn as_stated(model: RegressorModel) -> Self {
        Self { model, joints: Vec::new(), stated: None, constants_error: None }
    }

    /// An estimate over the columns `symbols` with what is unknown of the constants of friction in its bars.
    pub fn with_error_of_constants(&self, symbols: &[String], estimate: Estimate) -> Estimate {
        match &self.constants_error {
            Some(error) => error.added_to(symbols, &estimate),
            None => estimate,
        }
    }
}

/// Chooses the friction of the joints that `settings.friction` names, by cross-validation inside the recordings
/// `training`: first among terms whose columns stand in one set of factors, for a grid of constants; then in further
/// passes the constants between the grid's points, together with all parameters. Filters are those of `logs`.
///
/// # Errors
/// Recordings that cannot be read, rows that do not carry an estimate.
pub fn choose_friction(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    friction_of_logs((logs, logs), settings, robot, (training, payloads))
}

/// The same with other filters for the constants: terms from the rows of `logs`, constants from those of
/// `of_constants`. Where the first are too few to choose from, terms come from the second as well.
pub(crate) fn friction_of_logs(
    (logs, of_constants): (&Logs<'_>, &Logs<'_>),
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let found = friction_by_terms((logs, of_constants), settings, robot, (training, payloads))?;
    let is_nothing = |one: &JointFriction| one.terms.is_none();
    if core::ptr::eq(logs, of_constants) || found.joints.is_empty() || !found.joints.iter().all(is_nothing) {
        return Ok(found);
    }
    friction_by_terms((of_constants, of_constants), settings, robot, (training, payloads))
}

fn friction_by_terms(
    (logs, of_constants): (&Logs<'_>, &Logs<'_>),
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let stated = RegressorModel::from(robot.clone());
    let searches: Vec<(usize, &FrictionSearch)> = settings
        .friction
        .iter()
        .filter_map(|search| Some((stated.model().joint_index(&search.joint)?, search)))
        .collect();
    if searches.is_empty() {
        let passes = TrainingPasses { logs: of_constants, settings, training, payloads, known_arm: None };
        let constants_error = error_of_constants(&passes, &settings.friction_before, &stated)?;
        return Ok(ChosenFriction { constants_error, ..ChosenFriction::as_stated(stated) });
    }
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    let equal_weights = matches!(settings.estimation.estimator, Estimator::Ordinary);

    // The stated terms first: the load, the noise of every joint, what is excited; with gains that nobody knows the
    // torque in newton metres.
    let first = passes.with_gains(passes.rows_once(stated)?)?;
    let plain = match &first.gains {
        Some((with_gains, _)) => with_gains.clone(),
        None => plain_estimate(&without_bars(settings), &first.problem)?,
    };
    let gains = first.gains.as_ref().map_or_else(Vec::new, |(_, gains)| free_gains(gains));

    // All candidates as columns of one set of factors, from which each candidate model is a selection.
    let chosen_among = |candidates: &[(usize, Vec<CandidateColumn>)]| -> Result<_, IdentificationError> {
        let further = candidates.iter().flat_map(|(_, columns)| columns).map(|column| column.term.clone());
        let wide = with_terms(&first.model, further).with_load_of_estimate(&first.model, &plain.values);
        let wide_problem = passes.free_problem(&wide, &passes.read(&wide)?, (&first.model, &plain, &gains))?;
        Ok(choose_terms(&first.model, &wide, &wide_problem, candidates, (&plain, equal_weights))?)
    };
    // How wide the step is; then all that friction may be. With payloads the load would be the bare arm's.
    let scale = |joint: usize| JointScale::of(robot.model(), joint);
    let steps: Vec<_> = searches.iter().map(|(joint, search)| (*joint, step_columns(search, scale(*joint)))).collect();
    let widths: Vec<Option<f64>> = chosen_among(&steps)?.iter().map(smooth_step_width).collect();
    let is_loaded = logs.recordings.iter().any(|recording| recording.payload.is_some());
    let all = |((joint, search), width): (&(usize, &FrictionSearch), &Option<f64>)| {
        let mut columns = candidate_columns(search, scale(*joint), *width);
        columns.retain(|column| !(is_loaded && column.term.needs_load()));
        (*joint, columns)
    };
    let candidates: Vec<_> = searches.iter().zip(&widths).map(all).collect();
    let mut joints = chosen_among(&candidates)?;
    let model = with_friction_of(robot, &joints, (&first.model, &plain))?;
    let passes = TrainingPasses { logs: of_constants, ..passes };
    let near_rest: Vec<&str> =
        searches.iter().filter(|(_, one)| one.rows_near_rest).map(|(_, one)| &one.joint[..]).collect();
    let (mut model, constants_error) = best_constants(&passes, robot, (&mut joints, &near_rest), (model, &gains))?;
    // What follows finds the gains with the friction that was chosen.
    model.torque_gains.clear();
    Ok(ChosenFriction { model, joints, stated: Some((first, plain)), constants_error })
}

/// What friction that other rows have chosen says of these, with constants that suit them: the sum of Schwarz's
/// criterion over joints.
///
/// # Errors
/// As [`choose_friction`].
pub(crate) fn friction_score(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    chosen: &ChosenFriction,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<f64, IdentificationError> {
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    let mut joints = chosen.joints.clone();
    let (model, _) = with_constants(&passes, robot, &mut joints, (chosen.model.clone(), &[]))?;
    Ok(friction_scores(&passes, &model, &joints)?.into_iter().sum())
}

/// Friction that an excerpt of the recordings `training` chose, with constants by all of their rows: one step from
/// where the excerpt's have settled, for what is left is short, and a step of Gauss and Newton then ends where a second
/// one would.
pub(crate) fn constants_of_all_rows(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    chosen: &ChosenFriction,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let mut found = chosen.clone();
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    if let Some((model, error)) = one_step(&passes, robot, &mut found.joints, &chosen.model)? {
        (found.model, found.constants_error) = (model, Some(error));
    }
    Ok(found)
}

/// The width of the smooth step that a joint's friction has.
fn smooth_step_width(joint: &JointFriction) -> Option<f64> {
    joint.terms.iter().flatten().filter(|term| matches!(term, TorqueTerm::Coulomb(_))).find_map(smooth_width)
}
