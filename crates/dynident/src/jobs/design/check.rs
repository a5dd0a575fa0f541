//! Check of an existing motion, without a search: a trajectory of the user, or a log after the run.

use super::limit_check::{LimitCheck, SingleChanges};
use super::outcome::{MotionOrigin, MotionReview};
use super::setup::{DesignSetup, MotionInformation};
use super::{DesignOutcome, table};
use crate::error::{Error, StudyError};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::motion_provenance;
use crate::study::{DesignSection, Folders, Study, StudyFile, StudyInput, StudyLogSource, StudyRobot};
use dynident_excitation::check::CHECK_RATE_HZ;
use dynident_excitation::families::SampledMotion;
use dynident_excitation::{Family, Motion, grid};
use dynident_identification::{Execution, IdentificationSettings, Logs};
use dynident_recording::MotionBlock;
use nalgebra::DMatrix;
use std::path::Path;

const SPLINE: &str = "the quintic spline through the samples of the table";
const SAMPLES: &str = "the log's own samples, its positions through the study's differentiator";

/// Neither a search for limit changes nor a stop request.
const NO_SEARCH: SingleChanges<'static> = (&|| Ok(Vec::new()), &|| false);

const MAX_SAMPLES: usize = 2_000_000;

/// Largest velocity of a joint at which it is treated as at rest, relative to its peak velocity.
const MAX_REST_SPEED_RATIO: f64 = 1e-3;

/// Checks the trajectory in the table `trajectory` like a design. The table has `t_s`, `q1..` or the joint names, and
/// optionally both `dq1..` and `ddq1..`. Every limit is checked at 10 kHz on the quintic spline through the samples;
/// criteria and forecast are computed at `search.rate_hz`.
///
/// # Errors
/// If the study is invalid, or the table is missing, has other joints, or is not a valid motion.
pub fn check_trajectory(
    study: &Study,
    study_path: &Path,
    trajectory: &Path,
    options: &RunOptions<'_>,
) -> Result<DesignOutcome, Error> {
    let study = StudyFile::new(study, study_path);
    let folders = study.folders(options.data.as_deref());
    let joints = study.robot_in(&folders)?.parametric.joint_names();
    let table = table::trajectory(trajectory, &joints, &study.motion)?;
    let given = table.given;
    let samples = given.samples();
    let start: Vec<f64> = (0..joints.len()).map(|joint| samples.q[samples.of(joint).start]).collect();
    let mut setup = DesignSetup::for_check(study, options, &start)?;
    let duration_s = given.duration_s();
    let longest_s = DesignSection::longest_s(setup.robot.model());
    if duration_s > longest_s {
        let message = format!("{duration_s} s: at most {longest_s:.0} s can be checked; use a part of it");
        return Err(Error::States { path: trajectory.to_owned(), line: 1, message });
    }
    setup.notes.extend(table.note);
    setup.notes.extend(not_at_rest(&given, &joints));
    let motion_at = |times: &[f64], out: &mut Motion| given.motion(&[], times, out);
    let check_rate_hz = setup.robot.model().characteristic_scale().round_hertz(CHECK_RATE_HZ);
    let check = LimitCheck::of(&setup, study.path, duration_s, check_rate_hz, SPLINE, &motion_at, NO_SEARCH)?;
    let rate_hz = setup.section.search.rate_hz;
    let times = grid(duration_s, (duration_s * rate_hz).round() as usize + 1);
    let information = setup.information(&times, &motion_at);
    // An absolute path is stored relative to the study.
    let name = if trajectory.is_absolute() { study.relative(trajectory) } else { trajectory.display().to_string() };
    let origin = MotionOrigin::given(&setup, name, given, &information);
    let read = [("trajectory", StudyInput::File(trajectory.to_owned()))];
    let data = options.data.as_deref();
    let provenance = setup.inputs.while_unchanged(|| motion_provenance(study, data, &read))?;
    let review = MotionReview { duration_s, rate_hz, information, check };
    Ok(DesignOutcome::new(setup, origin, review).with_provenance(provenance))
}

/// Checks a log of the study, given by name or file: how much information the run contains about each parameter.
/// Velocities and accelerations are computed as for a fit. Limits are checked on the log's samples; the forecast uses
/// all samples.
///
/// # Errors
/// If the study is invalid, no log or several logs have the name, or the log cannot be read.
pub fn check_log(
    study: &Study,
    study_path: &Path,
    name: &str,
    options: &RunOptions<'_>,
) -> Result<DesignOutcome, Error> {
    let study = StudyFile::new(study, study_path);
    study.require_log(study.path)?;
    let index = log_called(&study, name).map_err(Error::study(study.path))?;
    let mut setup = DesignSetup::for_log(study, options)?;
    let folders = study.folders(options.data.as_deref());
    let source = study.log_source(&folders, index)?;
    let (mut pieces, rate_hz) = log_pieces(study, &setup.robot, &folders, index, &source)?;
    let gaps = pieces.len().saturating_sub(1);
    if gaps > 0 {
        setup.notes.push(format!(
            "the log has {gaps} gap(s): its pieces are checked separately and combined; plots show the longest"
        ));
    }
    let count = setup.robot.layout().columns().len();
    let [mut plain, mut weighted] = [(); 2].map(|()| DMatrix::zeros(count, count));
    let mut check = LimitCheck { reports: Vec::new(), rate_hz, of: SAMPLES, diagnosis: Vec::new() };
    let mut duration_s = 0.0;
    for piece in &pieces {
        let motion_at = |times: &[f64], out: &mut Motion| piece.motion(&[], times, out);
        check.append(
            LimitCheck::of(&setup, study.path, piece.duration_s(), rate_hz, SAMPLES, &motion_at, NO_SEARCH)?,
            duration_s,
        );
        let part = setup.information(piece.times_s(), &motion_at);
        plain += part.plain;
        weighted += part.weighted;
        duration_s += piece.duration_s();
    }
    let longest = (0..pieces.len())
        .fold(0, |best, piece| if pieces[piece].duration_s() > pieces[best].duration_s() { piece } else { best });
    let information = MotionInformation { plain, weighted };
    let origin = MotionOrigin::given(&setup, study.log_name(index), pieces.swap_remove(longest), &information);
    let read = [("log", source.into())];
    let data = options.data.as_deref();
    let provenance = setup.inputs.while_unchanged(|| motion_provenance(study, data, &read))?;
    let review = MotionReview { duration_s, rate_hz, information, check };
    Ok(DesignOutcome::new(setup, origin, review).with_provenance(provenance))
}

fn log_called(study: &Study, name: &str) -> Result<usize, StudyError> {
    let all: Vec<usize> = (0..study.log.len()).collect();
    let mut called: Vec<usize> = all.iter().copied().filter(|&index| study.log_name(index) == name).collect();
    if called.is_empty() {
        called = all.iter().copied().filter(|&index| study.log[index].file == Path::new(name)).collect();
    }
    if let [index] = called[..] {
        return Ok(index);
    }
    let known = all.iter().map(|&index| study.log_name(index)).collect();
    Err(StudyError::LogName { name: name.to_owned(), found: called.len(), known })
}

/// Continuous pieces of a log as motions, with joints in the order of the model; and the sampling rate, Hz.
pub(in crate::jobs) fn log_pieces(
    study: StudyFile<'_>,
    robot: &StudyRobot,
    folders: &Folders,
    index: usize,
    source: &StudyLogSource,
) -> Result<(Vec<SampledMotion>, f64), Error> {
    let log = study.log_name(index);
    let failed = |source| Error::recording(&log, source);
    let recording = study.recording(robot, folders, index, source)?;
    let mut settings = IdentificationSettings::default();
    settings.motion = study.motion.clone();
    let execution = Execution::default();
    let (model, alone) = (robot.model(), core::slice::from_ref(&recording));
    let motion = Logs::new(model, alone, settings.row_settings(), &[0], None, execution)
        .map_err(Error::identification(study.path))?
        .motion;
    let places = recording.joint_indices(model).map_err(Error::identification(study.path))?;
    let Some(mut stream) = recording.open(model, &motion).map_err(Error::identification(study.path))? else {
        return Err(Error::study(study.path)(StudyError::missing(format!("log `{log}`"), "it has no samples")));
    };
    let rate_hz = stream.rate_hz();
    // Per piece: samples of q, dq, ddq for each joint of the model.
    let mut found: Vec<Vec<Vec<f64>>> = Vec::new();
    let (mut segment, mut samples, mut block) = (None, 0, MotionBlock::default());
    let dof = robot.model().dof();
    while stream.next_block(&mut block).map_err(failed)? {
        if segment != Some(block.segment) {
            segment = Some(block.segment);
            found.push(vec![Vec::new(); 3 * dof]);
        }
        samples += block.rows;
        if samples > MAX_SAMPLES {
            let message = format!("log `{log}`: more than {MAX_SAMPLES} samples: select a part with time_range_s");
            return Err(Error::States { path: source.path(), line: 1, message });
        }
        if let Some(piece) = found.last_mut() {
            for (order, source) in [&block.q, &block.dq, &block.ddq].into_iter().enumerate() {
                for (joint, &place) in places.iter().enumerate() {
                    piece[order * dof + joint].extend_from_slice(block.joint(source, place));
                }
            }
        }
    }
    let given = |piece: Vec<Vec<f64>>| {
        let samples = piece[0].len();
        let [q, dq, ddq] = core::array::from_fn(|order| piece[order * dof..(order + 1) * dof].concat());
        let times = (0..samples).map(|sample| sample as f64 / rate_hz).collect();
        SampledMotion::new(times, Motion { samples, joints: dof, q, dq, ddq, dddq: Vec::new() })
    };
    let whole = found.into_iter().filter(|piece| piece[0].len() >= 2).map(given).collect::<Result<Vec<_>, _>>();
    let wrong = |message: String| Error::States { path: source.path(), line: 1, message };
    let pieces = whole.map_err(|error| wrong(format!("log `{log}`: {error}")))?;
    if pieces.is_empty() {
        return Err(wrong(format!("log `{log}`: no uninterrupted piece of two samples or more")));
    }
    Ok((pieces, rate_hz))
}

/// Note about joints that are not at rest at the start and the end; a robot cannot execute such a motion.
fn not_at_rest(given: &SampledMotion, joints: &[String]) -> Option<String> {
    let motion = given.samples();
    let moving: Vec<&str> = joints
        .iter()
        .enumerate()
        .filter(|(joint, _)| {
            let speeds = &motion.dq[motion.of(*joint)];
            let peak = speeds.iter().fold(0.0_f64, |peak, speed| peak.max(speed.abs()));
            [speeds[0], speeds[speeds.len() - 1]].iter().any(|speed| speed.abs() > MAX_REST_SPEED_RATIO * peak)
        })
        .map(|(_, name)| name.as_str())
        .collect();
    (!moving.is_empty()).then(|| format!("the motion does not start and end at rest: {}", moving.join(", ")))
}
