//! Search for mistakes in the training recordings.

use super::confirmation::unless_confirmed;
use super::description_fit::description_fit;
use super::error::DiagnosisError;
use super::hypothesis::{CorrectedStudy, Explained, Hypothesis};
use super::lag_search::LagSearch;
use super::motion_rows::{INSTANTS, MotionRows, MotionSamples, instants_of_log};
use super::search::{Search, searches};
use crate::consistent::ConsistencySettings;
use crate::left_to_the_logs::with_drives_left_to_the_logs;
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;
use dynident_rows::{Logs, RegressorModel};

/// Input of the diagnosis.
#[derive(Clone, Copy)]
pub struct DiagnosisTask<'a> {
    /// The recordings.
    pub logs: &'a Logs<'a>,
    /// Settings of the identification.
    pub settings: &'a IdentificationSettings,
    /// The robot with the torque terms of the study.
    pub robot: &'a ParametricModel,
    /// Indices of the training recordings.
    pub training: &'a [usize],
    /// Base parameters from the training recordings; `None` skips held-out recordings.
    pub theta: Option<&'a [f64]>,
}

pub(super) struct SearchedLogs {
    pub(super) search: Search,
    /// The study as written, or with its lag corrected. The robot has friction widths and drive inertia that fit the
    /// logs.
    pub(super) study: CorrectedStudy,
    pub(super) consistency: ConsistencySettings,
    /// The compensated lag of each joint's torque, s.
    pub(super) compensated_s: Vec<f64>,
    /// Standard deviation of the white noise of each joint's torque at the instants, Nm (N).
    pub(super) torque_noise: Vec<f64>,
}

/// Searches for the mistake that explains the training recordings best.
pub(super) fn searched_logs(task: DiagnosisTask<'_>) -> Result<SearchedLogs, DiagnosisError> {
    let DiagnosisTask { logs, settings, robot, training, .. } = task;
    let model = RegressorModel::from(robot.clone());
    let limits = &settings.diagnosis_limits;
    let of_recording = |&index: &usize| MotionSamples::of_recording(logs, &model, index, &limits.motion);
    let samples: Vec<MotionSamples> = training.iter().map(of_recording).collect::<Result<_, _>>()?;
    let mut rows = MotionRows::empty(robot.dof());
    for (place, one) in samples.iter().enumerate() {
        rows.append(&one.instants(instants_of_log(INSTANTS, place, samples.len())));
    }
    let torque_noise = torque_noise(&samples, robot.dof());
    // An identification estimates drive inertia that the study does not state. Without it, a mistake would have to
    // explain its torque.
    let robot = with_drives_left_to_the_logs(robot, settings)?;
    // Scores need an accuracy of only 0.01.
    let known = settings.consistency.clone().unwrap_or_default();
    let consistency = ConsistencySettings { tolerance: 1e-2, max_iterations: 100, ..known };
    let compensated_s = |joint| logs.motion.torque_lag_s.as_ref().and_then(|lag_s| lag_s.at(joint)).unwrap_or(0.0);
    let compensated_s: Vec<f64> = (0..robot.dof()).map(compensated_s).collect();
    let lag_search = LagSearch::new(&robot, &samples, compensated_s.clone(), limits);
    let as_written = CorrectedStudy::new(robot, rows, Vec::new(), limits).explained(&consistency)?;
    let SearchResults { searches, study, written } = search_with_lag(&as_written, lag_search.as_ref(), &consistency);
    let search = select_search(searches, &study);
    let again = unless_confirmed(&written, &search.corrected(&study), &search, &consistency)?;
    let (study, search) = again.unwrap_or((study, search));
    Ok(SearchedLogs { search, study, consistency, compensated_s, torque_noise })
}

/// Root mean square, over the recordings, of the white noise of each joint's torque.
fn torque_noise(samples: &[MotionSamples], dof: usize) -> Vec<f64> {
    let of_joint = |joint: usize| {
        let squares: f64 = samples.iter().map(|samples| samples.torque_noise(joint).powi(2)).sum();
        (squares / samples.len().max(1) as f64).sqrt()
    };
    (0..dof).map(of_joint).collect()
}

struct SearchResults {
    /// Search for common mistakes, and search for common and rarer mistakes.
    searches: [Search; 2],
    /// The study whose instants the searches use.
    study: CorrectedStudy,
    /// The study as written; if a fit compensates a lag, with this lag corrected.
    written: CorrectedStudy,
}

/// Searches for mistakes, with the best lag of the torque if a lag is evident. A lag hides every other mistake, and
/// another mistake may look like a lag.
fn search_with_lag(
    as_written: &Explained,
    lag_search: Option<&LagSearch<'_>>,
    consistency: &ConsistencySettings,
) -> SearchResults {
    let written = as_written.study.clone();
    let late = lag_search
        .and_then(|lag_search| lag_search.late_channel(&written.robot, &as_written.hypothesis, consistency, INSTANTS));
    // A lag that a fit compensates is not a mistake.
    if let Some(late) = late.as_ref().filter(|late| late.explained.study.mistakes.is_empty()) {
        let study = late.explained.study.clone();
        let searches = searches(&late.explained.hypothesis, &late.explained, consistency);
        return SearchResults { searches, study: study.clone(), written: study };
    }
    let in_time = searches(&as_written.hypothesis, as_written, consistency);
    let believed = in_time[1].believed();
    // In a periodic motion, a lag of half a period looks like a reversed sign. Therefore a lag must explain clearly
    // more than other mistakes.
    let gain = as_written.hypothesis.score() - believed.score();
    let (max_ratio, min_gain) = (written.settings.late_channel.max_ratio_of_all, written.settings.score.min_gain);
    let explains_more = |late: &Explained| late.hypothesis.left_of_all < max_ratio * believed.left_of_all;
    match late.filter(|late| explains_more(&late.explained) && late.gain > gain + min_gain) {
        Some(late) => {
            let searches = searches(&as_written.hypothesis, &late.explained, consistency);
            let study = CorrectedStudy { mistakes: Vec::new(), ..late.explained.study };
            SearchResults { searches, study, written }
        }
        None => SearchResults { searches: in_time, study: written.clone(), written },
    }
}

/// Selects the result of the search for common mistakes, or of the search for all mistakes. The latter needs a clearly
/// smaller residual. (With a smaller position unit of one joint, fewer joint limits are exceeded, but these limits may
/// be wrong.) A joint that travels far beyond its range is an exception. Another unit of one joint, or another sample
/// rate, is not accepted if most torques are then still in another unit, because it would only compensate for that.
fn select_search(searches: [Search; 2], study: &CorrectedStudy) -> Search {
    let [usual, all] = searches;
    let (best, tried) = (all.believed(), all.tried);
    let gains = |of: fn(&Hypothesis) -> f64| of(best) < of(usual.believed()) - study.settings.score.min_gain;
    let is_shown_by_torque = gains(Hypothesis::torque_score) || best.is_shown_by_travel();
    // A torque gain or another sample rate changes the ratio of torque to motion, as the bodies of another robot do.
    let has_free_factor = best.mistakes.iter().any(|mistake| {
        let facts = mistake.facts();
        facts.torque_gain.is_some() || facts.is_other_rate
    });
    let is_in_another_unit = || {
        let study = all.corrected(study);
        let fit = description_fit(&study.robot, &study.rows, &best.left, study.settings.description);
        fit.is_some_and(|fit| !fit.joints_in_another_unit().is_empty())
    };
    let is_likelier = gains(Hypothesis::score) && is_shown_by_torque && !(has_free_factor && is_in_another_unit());
    if is_likelier { all } else { Search { tried, ..usual } }
}
