//! Tests for mistakes in study, robot description and logs.
//!
//! A fit of base parameters can explain the logs even if the study is wrong, because the parameters compensate for
//! wrong signs, orders and units. Therefore the diagnosis corrects possible mistakes in the samples, one at a time. It
//! scores each of these hypotheses by the best physically consistent fit (positive masses, dissipative friction), by
//! joint limits, and by the distance of the bodies from the robot description. It reports a mistake only if another
//! hypothesis is clearly better than the study as written.
//!
//! | file | content |
//! | --- | --- |
//! | `mistakes` | the kinds of mistakes, one file each |
//! | `motion_rows` | a few hundred instants of a recording |
//! | `joint_fits`, `explanation`, `nominal`, `plausibility` | the evidence: residuals of several fits, limits |
//! | `step_width`, `friction_spans`, `further_friction`, `noise_torque`, `usual_errors`, `span` | other causes than mistakes: friction, noise, errors of descriptions |
//! | `hypothesis`, `search`, `round`, `refinement` | the score, the best hypothesis, and its number |
//! | `confirmation` | test whether correct logs would support the hypothesis too |
//! | `lag_search` | channels that were logged too late or too early |
//! | `training` | the search in the training logs |
//! | `description_fit`, `wrong_mass` | units of torque, another robot, one wrong mass |
//! | `held_out_logs`, `held_out_hypothesis`, `unmodelled_payload`, `repeated_motion` | payloads, mistakes and motion of one held-out log |
//! | `duplicate_channels`, `inconsistent_torque` | columns that no correction repairs |

mod channels;
mod confirmation;
mod description_fit;
mod duplicate_channels;
mod error;
mod explanation;
mod friction_spans;
mod further_friction;
mod held_out_hypothesis;
mod held_out_logs;
mod hypothesis;
mod inconsistent_torque;
mod joint_fits;
mod lag_search;
pub mod mistakes;
mod motion_rows;
mod noise_torque;
mod nominal;
mod plausibility;
mod refinement;
mod repeated_motion;
mod round;
mod search;
mod span;
mod step_width;
mod training;
mod unmodelled_payload;
mod usual_errors;
mod wrong_mass;

pub use crate::diagnosis_settings::{
    AcceptanceSettings, ChannelSettings, DescriptionSettings, DiagnosisSettings, HeldOutSettings, LateChannelSettings,
    MotionLimits, ScoreSettings,
};
pub use crate::limits::InvalidLimit;
pub use channels::Channels;
pub use description_fit::DescriptionFit;
pub use duplicate_channels::DuplicateChannel;
pub use error::DiagnosisError;
pub use held_out_hypothesis::HeldOutHypothesis;
pub use hypothesis::Hypothesis;
pub use inconsistent_torque::InconsistentTorque;
pub use mistakes::{KeyChange, Mistake, StudyKeys};
pub use motion_rows::MotionRows;
pub use plausibility::BeyondLimit;
pub use search::Search;
pub use training::DiagnosisTask;
pub use unmodelled_payload::UnmodelledPayload;
pub use wrong_mass::WrongMass;

pub(crate) use plausibility::{has_jumps, is_beyond_limits};

use description_fit::description_fit;
use duplicate_channels::{duplicate_channels, has_lost_signs};
use dynident_rows::{Logs, RegressorModel};
use explanation::Explanation;
use held_out_logs::{HeldOutLogs, TrainingResult, held_out_logs};
use inconsistent_torque::inconsistent_torques;
use noise_torque::torque_of_noise;
use nominal::is_torque_of_description;
use span::dot;
use training::{SearchedLogs, searched_logs};

/// Findings about study, robot and logs.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The compared hypotheses.
    pub search: Search,
    /// The nominal bodies, compared with the torque of the best hypothesis; `None` if a body is unknown.
    pub description_fit: Option<DescriptionFit>,
    /// Payloads that are in held-out logs but not in training logs, or in training logs but not in held-out logs.
    pub unmodelled_payloads: Vec<UnmodelledPayload>,
    /// Mistakes of single held-out logs.
    pub held_out: Vec<HeldOutHypothesis>,
    /// Numbers of the held-out logs that repeat the motion of the training logs.
    pub repeated_motions: Vec<usize>,
    /// Columns that are used for two joints; then no hypothesis is reliable.
    pub duplicate_channels: Vec<DuplicateChannel>,
    /// Whether the torques are magnitudes without signs.
    pub lost_signs: bool,
    /// Whether the nominal bodies explain the torque of every joint without friction: a model computed it.
    pub is_torque_of_description: bool,
    /// Torques that are inconsistent with the others under the best hypothesis.
    pub inconsistent_torques: Vec<InconsistentTorque>,
    /// Share of each joint's torque that noise explains, 0 to 1 (root mean squares). Included are white noise of the
    /// torque and, if the best hypothesis leaves most of the torque unexplained, noise of the positions.
    pub noise: Vec<f64>,
    /// Share of the torque of all joints together that noise explains, 0 to 1 (root mean squares).
    pub noise_of_all: f64,
}

impl Diagnosis {
    /// Whether even the best hypothesis has a far larger residual than separate parameters of each joint. Then the
    /// description is of another robot, or the study has several mistakes.
    pub fn is_unexplained(&self) -> bool {
        self.search.believed().is_unexplained()
    }

    /// Share of the torque of all joints that neither the best hypothesis nor noise explains, 0 to 1.
    pub fn unexplained_beyond_noise(&self) -> f64 {
        let left = self.search.believed().left_of_all.min(1.0);
        (left.powi(2) - self.noise_of_all.powi(2)).max(0.0).sqrt()
    }
}

/// Searches for the mistake that explains the training recordings best, and for payloads and mistakes of single
/// held-out recordings. If no hypothesis explains the torque, and the cut-off was chosen from the data, lower cut-offs
/// are tried: noise of the positions, which grows with frequency, may hide the mistake.
///
/// # Errors
/// Unreadable recordings, too few rows, invalid limits in the settings.
pub fn diagnose(task: DiagnosisTask<'_>) -> Result<Diagnosis, DiagnosisError> {
    let DiagnosisTask { logs, settings, robot, training, .. } = task;
    settings.diagnosis_limits.validate()?;
    let limits = &settings.diagnosis_limits.score;
    let found = diagnose_at_cutoff(task)?;
    let is_explained = found.search.best.is_some()
        || (found.search.believed().left_of_all <= limits.max_unexplained && !found.is_unexplained());
    let Some(cutoff_hz) = logs.motion.differentiator.cutoff_hz().filter(|_| !is_explained) else { return Ok(found) };
    if !settings.motion.differentiator.wants_cutoff() {
        return Ok(found);
    }
    for share in limits.lower_cutoffs {
        let (model, cutoff_hz) = (robot.model(), Some(share * cutoff_hz));
        let slower = Logs::new(model, logs.recordings, settings.row_settings(), training, cutoff_hz, logs.execution)?;
        let slower = slower.with_excerpts(logs.excerpts());
        let again = diagnose_at_cutoff(DiagnosisTask { logs: &slower, theta: None, ..task })?;
        let is_noise_alone = found.is_unexplained() && !again.is_unexplained();
        if again.search.best.is_some() || is_noise_alone {
            return Ok(again);
        }
    }
    Ok(found)
}

/// Diagnosis with one cut-off; see [`diagnose`].
fn diagnose_at_cutoff(task: DiagnosisTask<'_>) -> Result<Diagnosis, DiagnosisError> {
    let SearchedLogs { search, study, consistency, compensated_s, torque_noise } = searched_logs(task)?;
    let DiagnosisTask { logs, training, theta, settings, .. } = task;
    let settings = &settings.diagnosis_limits;
    let (robot, model) = (&study.robot, RegressorModel::from(study.robot.clone()));
    // Units of torque are compared with the best hypothesis. Payloads are searched only if there is no mistake.
    let best = search.corrected(&study);
    let description_fit = description_fit(&best.robot, &best.rows, &search.believed().left, settings.description);
    let as_written = &search.as_written;
    let is_explained = search.best.is_none() && as_written.left_of_all < settings.score.max_unexplained;
    let HeldOutLogs { payloads, hypotheses, repeated_motions } = match theta.filter(|_| is_explained) {
        Some(theta) => {
            let theta = (robot.terms() == task.robot.terms()).then_some(theta);
            let (consistency, compensated_s) = (&consistency, &compensated_s[..]);
            let (model, rows) = (&model, &study.rows);
            held_out_logs(
                logs,
                &TrainingResult { model, rows, as_written, theta, consistency, compensated_s, settings },
            )?
        }
        None => HeldOutLogs::default(),
    };
    let duplicate_channels = duplicate_channels(&study.rows, &as_written.left, &settings.channels);
    let lost_signs = has_lost_signs(&study.rows, as_written.left_of_all, &settings.channels);
    // The noise of columns that were corrected is unknown.
    let noise = |explained: &Explanation| {
        if search.best.is_some() {
            return Ok(vec![0.0; robot.dof()]);
        }
        let noise = torque_of_noise(logs, &model, training, &explained.free_parameters)?;
        let share = |(noise, torque): (&f64, &f64)| if *torque > 0.0 { noise / torque } else { 0.0 };
        Ok::<_, DiagnosisError>(noise.iter().zip(&explained.torque).map(share).collect())
    };
    let mut squares: Vec<f64> = torque_noise.iter().map(|noise| noise.powi(2)).collect();
    let torques: Vec<f64> = best.rows.tau.iter().map(|tau| dot(tau, tau) / tau.len().max(1) as f64).collect();
    if search.believed().left_of_all > settings.score.max_unexplained {
        let of_positions = noise(&Explanation::new(&best.robot, &best.rows, None)?)?;
        for ((square, share), torque) in squares.iter_mut().zip(of_positions).zip(&torques) {
            *square += share.powi(2) * torque;
        }
    }
    let share = |noise: f64, torque: f64| if torque > 0.0 { (noise / torque).sqrt().min(1.0) } else { 0.0 };
    let noise_of_all = share(squares.iter().sum(), torques.iter().sum());
    let noise_shares = squares.iter().zip(&torques).map(|(noise, torque)| share(*noise, *torque)).collect();
    let inconsistent_torques = inconsistent_torques(search.believed(), &best.robot, &best.rows, noise)?;
    Ok(Diagnosis {
        search,
        description_fit,
        unmodelled_payloads: payloads,
        held_out: hypotheses,
        repeated_motions,
        duplicate_channels,
        lost_signs,
        is_torque_of_description: is_torque_of_description(&study.robot, &study.rows, settings.channels),
        inconsistent_torques,
        noise: noise_shares,
        noise_of_all,
    })
}
