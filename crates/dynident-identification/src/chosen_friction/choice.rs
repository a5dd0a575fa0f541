//! Selection of friction from the recordings: first the terms, then their nonlinear constants.

use super::constants::{
    best_constants, better_of_joints, error_of_constants, friction_evidence, one_step, take, with_constants,
};
use super::passes::{with_friction_of, with_terms, without_bars};
use crate::error::IdentificationError;
use crate::estimators::Estimator;
use crate::friction::{
    CandidateColumn, ConstantsError, FrictionSearch, JointFriction, JointScale, SearchLimits, candidate_columns,
    choose_friction as choose_terms, is_coulomb, smooth_width, step_columns,
};
use crate::payload::{Payload, free_gains};
use crate::settings::IdentificationSettings;
use crate::training::{Training, TrainingPasses, plain_estimate};
use dynident_dynamics::ParametricModel;
use dynident_estimation::Estimate;
use dynident_model::terms::TorqueTerm;
use dynident_rows::{Logs, RegressorModel};
use nalgebra::DMatrix;

/// A model with selected friction.
#[derive(Clone, Debug)]
pub struct ChosenFriction {
    /// Robot model with the selected friction, including the bodies whose torque is the load if friction depends on it.
    pub model: RegressorModel,
    /// Selected friction of each joint; empty if nothing was selected.
    pub joints: Vec<JointFriction>,
    /// Rows and fit with the friction terms that the study states, from which the selection starts; `None` if nothing
    /// was selected.
    pub stated: Option<(Training, Estimate)>,
    /// Effect of the error of the friction constants on all parameters; `None` if nothing was selected.
    pub(crate) constants_error: Option<ConstantsError>,
}

impl ChosenFriction {
    pub(crate) fn as_stated(model: RegressorModel) -> Self {
        Self { model, joints: Vec::new(), stated: None, constants_error: None }
    }

    /// Covariance that the uncertainty of the friction constants adds to an estimate of the parameters `symbols`.
    pub fn error_of_constants(&self, symbols: &[String], estimate: &Estimate) -> Option<DMatrix<f64>> {
        self.constants_error.as_ref().map(|error| error.covariance_of(symbols, estimate))
    }
}

/// Selects the friction of the joints in `settings.friction` by cross-validation within the recordings `training`.
/// First, it selects terms with one set of triangular factors that contains all candidate terms, with their nonlinear
/// constants on a grid. Then further passes over the recordings refine the constants together with all parameters. The
/// filters of `logs` are used.
///
/// # Errors
/// Recordings cannot be read, or rows do not determine an estimate.
pub fn choose_friction(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    training: &[usize],
    payloads: &[Payload],
) -> Result<ChosenFriction, IdentificationError> {
    let passes = TrainingPasses::of_logs(logs, settings, training, payloads);
    if !is_friction_open(settings, robot) {
        return stated_friction(&passes, robot);
    }
    friction_by_terms(&passes, logs, robot, None)
}

/// Friction as the study states it, with the uncertainty of constants that were selected from other recordings.
pub(crate) fn stated_friction(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
) -> Result<ChosenFriction, IdentificationError> {
    let (stated, before) = (RegressorModel::from(robot.clone()), passes.settings.friction.before());
    if before.is_empty() {
        return Ok(ChosenFriction::as_stated(stated));
    }
    // If the load were missing, load-dependent friction would appear as noise.
    let stated = if stated.needs_load() { passes.fit(stated)?.model } else { stated };
    let constants_error = error_of_constants(passes, before, &stated)?;
    Ok(ChosenFriction { constants_error, ..ChosenFriction::as_stated(stated) })
}

/// Selects friction terms from the rows of `passes`, and their constants from the rows of `of_constants`. The terms may
/// already be known from [`friction_by_grid`]. If `passes` has too few rows, terms are also selected from
/// `of_constants`.
pub(crate) fn friction_of_logs(
    passes: &TrainingPasses<'_>,
    of_constants: &Logs<'_>,
    robot: &ParametricModel,
    of_grid: Option<GridFriction>,
) -> Result<ChosenFriction, IdentificationError> {
    let found = friction_by_terms(passes, of_constants, robot, of_grid)?;
    let has_no_terms = |one: &JointFriction| one.terms.is_none();
    if found.joints.is_empty() || !found.joints.iter().all(has_no_terms) {
        return Ok(found);
    }
    friction_by_terms(&TrainingPasses { logs: of_constants, ..*passes }, of_constants, robot, None)
}

fn friction_by_terms(
    passes: &TrainingPasses<'_>,
    of_constants: &Logs<'_>,
    robot: &ParametricModel,
    of_grid: Option<GridFriction>,
) -> Result<ChosenFriction, IdentificationError> {
    let searches = searches_of(passes.settings, robot);
    let of_grid = match of_grid {
        Some(found) => found,
        None => friction_of_grid(passes, robot, &searches, GridTerms::All)?,
    };
    let GridFriction { model, mut joints, stated, gains } = of_grid;
    let near_rest: Vec<&str> =
        searches.iter().filter(|(_, one)| one.rows_near_rest).map(|(_, one)| &one.joint[..]).collect();
    let of_constants = TrainingPasses { logs: of_constants, ..*passes };
    let (mut model, constants_error) = best_constants(&of_constants, robot, &mut joints, &near_rest, model, &gains)?;
    // The next fit estimates the torque gains with the selected friction.
    model.torque_gains.clear();
    Ok(ChosenFriction { model, joints, stated: Some(stated), constants_error })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GridTerms {
    All,
    /// Only terms without hysteresis. Maxwell-slip friction responds with a delay and would absorb a lag.
    WithoutMemory,
}

impl GridTerms {
    fn may_be(self, term: &TorqueTerm) -> bool {
        self == Self::All || !term.has_memory()
    }
}

/// Selects friction terms with constants on a grid, at the cut-off of `logs`. This is sufficient to estimate a lag and
/// takes a third of the time. `None` if the friction of all joints is stated.
pub(crate) fn friction_by_grid(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    terms: GridTerms,
) -> Result<Option<GridFriction>, IdentificationError> {
    let searches = searches_of(passes.settings, robot);
    if searches.is_empty() {
        return Ok(None);
    }
    friction_of_grid(passes, robot, &searches, terms).map(Some)
}

pub(crate) fn is_friction_open(settings: &IdentificationSettings, robot: &ParametricModel) -> bool {
    !searches_of(settings, robot).is_empty()
}

fn searches_of<'a>(settings: &'a IdentificationSettings, robot: &ParametricModel) -> Vec<(usize, &'a FrictionSearch)> {
    let of = |search: &'a FrictionSearch| Some((robot.model().joint_index(&search.joint)?, search));
    settings.friction.searches().iter().filter_map(of).collect()
}

#[derive(Clone)]
pub(crate) struct GridFriction {
    model: RegressorModel,
    joints: Vec<JointFriction>,
    stated: (Training, Estimate),
    gains: Vec<usize>,
}

impl GridFriction {
    /// The grid selection as final friction, with the constants of the grid, for the estimation of a lag.
    pub(crate) fn as_chosen(&self) -> ChosenFriction {
        let Self { mut model, joints, stated, .. } = self.clone();
        model.torque_gains.clear();
        ChosenFriction { model, joints, stated: Some(stated), constants_error: None }
    }
}

fn friction_of_grid(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    searches: &[(usize, &FrictionSearch)],
    terms: GridTerms,
) -> Result<GridFriction, IdentificationError> {
    let TrainingPasses { logs, settings, .. } = passes;
    let equal_weights = matches!(settings.estimation.estimator, Estimator::Ordinary);

    // Fit with the stated terms. It gives the load, the noise of every joint and the excited columns, and the torque in
    // newton metres if gains are unknown.
    let first = passes.with_gains(passes.rows_once(RegressorModel::from(robot.clone()))?)?;
    let plain = match &first.gains {
        Some((with_gains, _)) => with_gains.clone(),
        None => plain_estimate(&without_bars(settings), &first.problem)?,
    };
    let gains = first.gains.as_ref().map_or_else(Vec::new, |(_, gains)| free_gains(gains));

    // All candidate terms are columns of one set of factors; each candidate model is a selection of these columns.
    let limits_of = |(_, search): &(usize, &FrictionSearch)| SearchLimits {
        max_inflation: search.most_inflation.unwrap_or(f64::INFINITY),
        thresholds: &settings.thresholds.friction,
    };
    let limits: Vec<SearchLimits<'_>> = searches.iter().map(limits_of).collect();
    let chosen_among = |candidates: &[(usize, Vec<CandidateColumn>)]| -> Result<_, IdentificationError> {
        let further = candidates.iter().flat_map(|(_, columns)| columns).map(|column| column.term.clone());
        let wide = with_terms(&first.model, further).with_load_of_estimate(&first.model, &plain.values);
        let wide_problem = passes.free_problem(&wide, &passes.read(&wide)?, &first.model, &plain.values, &gains)?;
        Ok(choose_terms(&first.model, &wide, &wide_problem, candidates, &limits, &plain, equal_weights)?)
    };
    // First the velocity scale of the smoothed sign is selected, then all terms. If a log has a payload, load-dependent
    // friction is not a candidate, because its load would be that of the bare arm.
    let scale = |joint: usize| JointScale::of(robot.model(), joint);
    let steps: Vec<_> = searches.iter().map(|(joint, search)| (*joint, step_columns(search, scale(*joint)))).collect();
    let widths: Vec<Option<f64>> = chosen_among(&steps)?.iter().map(smooth_step_width).collect();
    let is_loaded = logs.recordings.iter().any(|recording| recording.payload.is_some());
    let all = |((joint, search), width): (&(usize, &FrictionSearch), &Option<f64>)| {
        let mut columns = candidate_columns(search, scale(*joint), *width);
        columns.retain(|column| terms.may_be(&column.term) && !(is_loaded && column.term.needs_load()));
        (*joint, columns)
    };
    let candidates: Vec<_> = searches.iter().zip(&widths).map(all).collect();
    let joints = chosen_among(&candidates)?;
    let model = with_friction_of(robot, &joints, &first.model, &plain.values)?;
    Ok(GridFriction { model, joints, stated: (first, plain), gains })
}

/// Compares two selections of friction on the same rows: `chosen`, which was selected at another cut-off and whose
/// constants are refitted to these rows, and `other`, which was selected from these rows. For each joint, the selection
/// with the lower information criterion is used.
///
/// Rows at a higher cut-off can show more details of friction than those of the first selection. At a lower cut-off
/// (`shows_less`), residuals are correlated, so the rows contain far less information than as many independent rows. On
/// the other hand, if the residual is unmodelled friction, the effective number of rows that follows from the error
/// bars is too small. At a lower cut-off, `other` must therefore be better with both numbers: all rows, and the
/// effective number of rows. A term that `other` adds needs stronger evidence than in a first selection.
pub(crate) fn better_friction(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    chosen: &ChosenFriction,
    other: ChosenFriction,
    shows_less: bool,
) -> Result<ChosenFriction, IdentificationError> {
    let mut joints = chosen.joints.clone();
    let (model, constants_error) = with_constants(passes, robot, &mut joints, chosen.model.clone(), &[])?;
    let (mut may_be, mut effects) = (vec![true; joints.len()], vec![1.0; joints.len()]);
    if shows_less {
        let evidence = friction_evidence(passes, &other.joints, &other.model, &joints)?;
        may_be = evidence.iter().map(|one| !one.is_doubtful).collect();
        effects = evidence.iter().map(|one| one.design_effect).collect();
    }
    let taken = better_of_joints(passes, &joints, &model, &other.joints, &other.model, &may_be, &effects)?;
    if !taken.contains(&false) {
        return Ok(other);
    }
    let stated = other.stated;
    if !taken.contains(&true) {
        return Ok(ChosenFriction { model, joints, stated, constants_error });
    }

    // Some joints have one selection, some the other; each joint keeps the constants of its own selection.
    take(&mut joints, other.joints, &taken);
    let model = passes.with_friction(robot, &joints, &model)?;
    let constants_error = error_of_constants(passes, &joints, &model)?;
    Ok(ChosenFriction { model, joints, stated, constants_error })
}

/// Adjusts the constants of friction that was selected from an excerpt to all rows. One Gauss-Newton step is
/// sufficient, because the constants from the excerpt are close.
pub(crate) fn constants_of_all_rows(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    mut chosen: ChosenFriction,
) -> Result<ChosenFriction, IdentificationError> {
    if let Some((model, error)) = one_step(passes, robot, &mut chosen.joints, &chosen.model)? {
        (chosen.model, chosen.constants_error) = (model, Some(error));
    }
    Ok(chosen)
}

fn smooth_step_width(joint: &JointFriction) -> Option<f64> {
    joint.terms.iter().flatten().filter(|term| is_coulomb(term)).find_map(smooth_width)
}
