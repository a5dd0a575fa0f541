//! Do study, robot and log fit together, and if not, which mistake explains it?
//!
//! A fit of base parameters explains many a wrong study: signs, orders and units hide in its parameters. Here the same
//! samples are read as they would be if one mistake or another had been made, and every reading is asked how well a
//! robot explains it that can exist: positive masses, friction that takes energy out, stops and velocities that hold,
//! bodies not too far from the description's. The study is doubted only if another reading is better by a clear margin.
//!
//! | file | holds |
//! | --- | --- |
//! | `motion_rows` | a recording as a few hundred instants |
//! | `mistake`, `candidates`, `units` | mistakes of studies, and which to try |
//! | `joint_fits`, `explanation`, `nominal`, `plausibility` | the witnesses: best robots, the description, limits |
//! | `step_width` | the step of dry friction that the rows have |
//! | `beside_friction`, `usual_errors` | torque beside friction, drive inertia and offsets; descriptions as they err |
//! | `reading`, `search` | their sum, and the reading with the best |
//! | `numbers`, `refinement` | the number of a mistake between those tried |
//! | `confirmation` | that it is not what honest logs look like |
//! | `torque_clock` | torque of another moment |
//! | `description_fit`, `wrong_mass`, `unseen_load` | what no reading of single columns covers: units of torque, another robot, one wrong mass, payloads |
//! | `held_out_logs`, `held_out_reading` | loads and mistakes that a held-out log alone has |
//! | `same_columns` | columns that stand for two joints, torques that lost their signs |
//! | `stray_torque` | torques that do not belong to one robot with the others |
//! | `noise_torque`, `further_friction` | what noise and laws of friction beyond the study's make of these |
//! | `span` | what of a torque lies outside some columns |

mod beside_friction;
mod candidates;
mod confirmation;
mod description_fit;
mod error;
mod explanation;
mod further_friction;
mod held_out_logs;
mod held_out_reading;
mod joint_fits;
mod mistake;
mod motion_rows;
mod noise_torque;
mod nominal;
mod numbers;
mod plausibility;
mod reading;
mod refinement;
mod same_columns;
mod search;
mod span;
mod step_width;
mod stray_torque;
mod torque_clock;
mod units;
mod unseen_load;
mod usual_errors;
mod wrong_mass;

pub use description_fit::DescriptionFit;
pub use error::DiagnosisError;
pub use held_out_reading::HeldOutReading;
pub use mistake::{Channels, Mistake};
pub use motion_rows::MotionRows;
pub use plausibility::BeyondLimit;
pub use reading::Reading;
pub use same_columns::SameColumn;
pub use search::Search;
pub use stray_torque::StrayTorque;
pub use unseen_load::UnseenLoad;
pub use wrong_mass::WrongMass;

use crate::left_to_the_logs::with_drives_left_to_the_logs;
use crate::logs::Logs;
use crate::regressor_model::RegressorModel;
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;
use dynident_model::Model;
use dynident_recording::ImportReport;
use explanation::Explanation;
use held_out_logs::HeldOutLogs;
use motion_rows::{INSTANTS, MotionSamples, share_of_log};
use reading::{CLEARLY_BETTER, Corrected};
use search::rough_consistency;
use torque_clock::TorqueClock;

/// Where even the believed reading leaves this share of the torque, positions may be noise more than motion.
const MOSTLY_NOISE: f64 = 0.5;
/// Parts of the cut-off that are tried then, where it was left to the data.
const SLOWER: [f64; 2] = [0.5, 0.25];

/// Times what the best reading in time leaves of all torque that a channel of another moment has to leave.
const LEAVES_LESS: f64 = 0.8;

/// What was found about study, robot and logs.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The readings that were compared.
    pub search: Search,
    /// What the description's bodies say of the torque, in the best reading; none while they are unknown.
    pub description_fit: Option<DescriptionFit>,
    /// Loads that held-out logs carry and training logs do not, or the other way round.
    pub unseen_loads: Vec<UnseenLoad>,
    /// Mistakes that held-out logs alone have.
    pub held_out: Vec<HeldOutReading>,
    /// Columns that stand for two joints; while there are any, no reading means much.
    pub same_columns: Vec<SameColumn>,
    /// Whether the torques are magnitudes, whose signs are lost.
    pub lost_signs: bool,
    /// Torques that do not belong to one robot with the others, in the reading that is believed.
    pub stray_torques: Vec<StrayTorque>,
}

impl Diagnosis {
    /// Whether even the best reading leaves far more than each joint's own parameters do: the description is not this
    /// robot's, or several mistakes were made at once.
    pub fn is_unexplained(&self) -> bool {
        self.search.believed().is_unexplained()
    }
}

/// Whether an import report has a joint beyond its limits, or a rate that no recorder has.
pub(crate) fn is_beyond_limits(model: &Model, report: &ImportReport) -> bool {
    plausibility::is_beyond(model, report)
}

/// Whether a log has jumps that no motion makes: wrapped angles, absurd samples. Until these are mended, readings of it
/// would mean nothing.
pub(crate) fn has_jumps(report: &ImportReport) -> bool {
    plausibility::has_jumps(report)
}

/// Compares readings of the recordings `training`, and looks for loads in the held-out ones beside the base parameters
/// `theta`, where these are given. Where no reading explains half of the torque, or none is a robot of the description,
/// and the cut-off was left to the data, slower parts of the motion are tried: noise of the positions, which grows with
/// frequency as no mistake does, may cover what tells readings apart, or be all that is left.
///
/// # Errors
/// Recordings that cannot be read, too few rows.
pub fn diagnose(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    training: &[usize],
    theta: Option<&[f64]>,
) -> Result<Diagnosis, DiagnosisError> {
    let found = diagnosed((logs, settings), robot, training, theta)?;
    let is_explained =
        found.search.best.is_some() || (found.search.believed().left_of_all <= MOSTLY_NOISE && !found.is_unexplained());
    let Some(cutoff_hz) = logs.motion.differentiator.cutoff_hz().filter(|_| !is_explained) else { return Ok(found) };
    if !settings.motion.differentiator.wants_cutoff() {
        return Ok(found);
    }
    // Noise of the positions may cover what tells the readings apart.
    for share in SLOWER {
        let (model, cutoff_hz) = (robot.model(), Some(share * cutoff_hz));
        let slower = Logs::new(model, logs.recordings, settings.filters(), training, cutoff_hz, logs.execution)?;
        let slower = slower.with_excerpts(logs.excerpts());
        let again = diagnosed((&slower, settings), robot, training, None)?;
        let is_noise_alone = found.is_unexplained() && !again.is_unexplained();
        if again.search.best.is_some() || is_noise_alone {
            return Ok(again);
        }
    }
    Ok(found)
}

/// [`diagnose`] on the motion as it is.
fn diagnosed(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    training: &[usize],
    theta: Option<&[f64]>,
) -> Result<Diagnosis, DiagnosisError> {
    let model = RegressorModel::from(robot.clone());
    let of_recording = |&index: &usize| MotionSamples::of_recording(logs, &model, index);
    let samples: Vec<MotionSamples> = training.iter().map(of_recording).collect::<Result<_, _>>()?;
    let mut rows = MotionRows::empty(robot.dof());
    for (place, one) in samples.iter().enumerate() {
        rows.append(&one.instants(share_of_log(INSTANTS, (place, samples.len()))));
    }
    // Identification asks the logs for what the study leaves to them; no mistake has to explain it.
    let stated = robot;
    let mut robot = with_drives_left_to_the_logs(stated, settings)?;
    let consistency = rough_consistency(settings.consistency.as_ref());
    let as_written = Corrected::new(robot.clone(), rows.clone(), Vec::new());
    let mut written = rows.clone();
    let as_read = as_written.reading(Some(&consistency))?;
    let taken_off_s = |joint| logs.motion.torque_lag_s.as_ref().and_then(|lag_s| lag_s.at(joint)).unwrap_or(0.0);
    let taken_off_s: Vec<f64> = (0..robot.dof()).map(taken_off_s).collect();
    let searches =
        |as_written: &Reading, start: (Corrected, Reading)| search::searches(as_written, &start, &consistency);
    // A torque of another moment hides every other mistake, and another mistake may look like one.
    let clock = TorqueClock::new(&robot, &samples, taken_off_s.clone());
    let shifted = clock.and_then(|clock| clock.reading(&robot, &as_read, &consistency, INSTANTS));
    let [mut search, further] = match shifted {
        // A fit takes it off by itself.
        Some(late) if late.corrected.mistakes.is_empty() => {
            rows.clone_from(&late.corrected.rows);
            written.clone_from(&rows);
            searches(&late.reading.clone(), (late.corrected, late.reading))
        }
        Some(late) => {
            let in_time = searches(&as_read, (as_written, as_read.clone()));
            // Half a turn of a motion that repeats looks like another sign: the lag has to explain clearly more.
            let believed = in_time[1].believed();
            let gain = as_read.score() - believed.score();
            let leaves_less = late.reading.left_of_all < LEAVES_LESS * believed.left_of_all;
            if leaves_less && late.gain > gain + CLEARLY_BETTER {
                rows.clone_from(&late.corrected.rows);
                searches(&as_read, (late.corrected, late.reading))
            } else {
                in_time
            }
        }
        None => searches(&as_read, (as_written, as_read.clone())),
    };
    // Rarer mistakes count where the usual ones explain clearly less of the torque: a joint that is held smaller breaks
    // fewer limits, whatever the description's are worth, unless it travels far beyond all it can. Where most joints'
    // torques are in another unit still, the unit of one joint or another rate only makes the best of that.
    let has_free_factor = further.best.as_ref().is_some_and(|best| best.mistakes.iter().any(Mistake::is_free_factor));
    let is_in_another_unit = || {
        let (robot, rows) = further.corrected(&robot, &rows);
        let fit = description_fit::description_fit(&robot, &rows, &further.believed().left);
        fit.is_some_and(|fit| !fit.joints_in_another_unit().is_empty())
    };
    let makes_the_best = has_free_factor && is_in_another_unit();
    search.tried = further.tried;
    let gains = |of: fn(&Reading) -> f64| of(further.believed()) < of(search.believed()) - CLEARLY_BETTER;
    let is_shown_by_torque = gains(Reading::torque_score) || further.believed().is_shown_by_travel();
    if gains(Reading::score) && is_shown_by_torque && !makes_the_best {
        search = further;
    }
    // What identification finds by itself, and what descriptions err by, is no mistake of the study.
    let (of_best, rows_of_best) = search.corrected(&robot, &rows);
    let again = confirmation::without_mistake((&robot, &written), (&of_best, &rows_of_best), &search, &consistency)?;
    if let Some((own_steps, as_written)) = again {
        search = Search { as_written, best: None, alike: Vec::new(), tried: search.tried };
        (robot, rows) = (own_steps, written);
    }
    let model = RegressorModel::from(robot.clone());
    // Units of torque are judged in the best reading, payloads only where the study is believed.
    let (believed, as_read) = (search.corrected(&robot, &rows), rows);
    let description_fit = description_fit::description_fit(&believed.0, &believed.1, &search.believed().left);
    let is_explained = search.best.is_none() && search.as_written.left_of_all < MOSTLY_NOISE;
    let held_out = match theta.filter(|_| is_explained) {
        Some(theta) => {
            let known = (robot.terms() == stated.terms()).then_some(theta);
            let (reading, rows, consistency) = (&search.as_written, &as_read, &consistency);
            held_out_logs::held_out_logs(
                (logs, &taken_off_s),
                &model,
                &held_out_logs::Trained { rows, reading, known, consistency },
            )?
        }
        None => HeldOutLogs::default(),
    };
    let as_written = &search.as_written;
    let same_columns = same_columns::same_columns(&as_read, &as_written.left);
    let lost_signs = same_columns::has_lost_signs(&as_read, as_written.left_of_all);
    // Of a reading that is corrected the noise is not known: its columns are other ones.
    let noise = |explained: &Explanation| {
        if search.best.is_some() {
            return Ok(vec![0.0; robot.dof()]);
        }
        let noise = noise_torque::torque_of_noise(logs, &model, training, &explained.free_parameters)?;
        let share = |(noise, torque): (&f64, &f64)| if *torque > 0.0 { noise / torque } else { 0.0 };
        Ok::<_, DiagnosisError>(noise.iter().zip(&explained.torque).map(share).collect())
    };
    let stray_torques = stray_torque::stray_torques(search.believed(), (&believed.0, &believed.1), noise)?;
    let HeldOutLogs { unseen_loads, readings: held_out } = held_out;
    Ok(Diagnosis { search, description_fit, unseen_loads, held_out, same_columns, lost_signs, stray_torques })
}
