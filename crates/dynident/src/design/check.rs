//! The look at a motion that is there already: a trajectory that the user brings, or a log after the run. Nothing is searched.

use super::prepared::{Judged, Prepared};
use super::{DesignOutcome, sentences, table};
use crate::cpu_time::cpu_seconds;
use crate::error::Error;
use crate::job::{RunOptions, joint_names};
use crate::machine::Machine;
use crate::measured::motion_log::motion_stream;
use crate::measured::rows::motion_in_force;
use crate::study::{Folders, Study};
use dynident_excitation::check::{CHECK_RATE_HZ, LimitReport, check_limits};
use dynident_excitation::families::Given;
use dynident_excitation::{Family, Motion, grid};
use dynident_recording::MotionBlock;
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The family of such motions in `design.json`.
const GIVEN: &str = "given";

/// Longest trajectory, s: the check at 10 kHz looks at every sample.
const MAX_DURATION_S: f64 = 3600.0;

/// Most samples of a log.
const MAX_SAMPLES: usize = 2_000_000;

/// A speed at an end below this share of its peak is rest.
const REST: f64 = 1e-3;

/// Judges the trajectory in the table `trajectory` (`t_s`, `q1..` or the joints' names, and `dq1..`, `ddq1..` or neither) as a design would be: every limit at 10 kHz on the quintic spline through the table's
/// samples, the criteria's figures and the forecast at `search.rate_hz`.
///
/// # Errors
/// If the study makes no sense, or the table is missing, holds other joints or something that is no motion.
pub fn check_trajectory(
    study: &Study,
    study_path: &Path,
    trajectory: &Path,
    options: &RunOptions<'_>,
) -> Result<DesignOutcome, Error> {
    let (started, cpu_at_start) = (Instant::now(), cpu_seconds());
    let mut prepared = Prepared::for_check(study, study_path, options)?;
    let joints = joint_names(&prepared.machine);
    let table = table::trajectory(trajectory, &joints, &study.motion)?;
    let given = table.given;
    let duration_s = given.duration_s();
    if duration_s > MAX_DURATION_S {
        let message = format!("{duration_s} s: at most {MAX_DURATION_S} s can be checked; give a part of it");
        return Err(Error::States { path: trajectory.to_owned(), line: 1, message });
    }
    prepared.notes.extend(table.note);
    prepared.notes.extend(not_at_rest(&given, &joints));
    let motion_at = |times: &[f64], out: &mut Motion| given.motion(&[], times, out);
    let reports = checked(&prepared, study_path, duration_s, CHECK_RATE_HZ, &motion_at)?;
    let broken = reports.iter().any(|report| report.violated);
    let diagnosis = if broken { sentences(&prepared.set, duration_s, &reports, &motion_at) } else { Vec::new() };
    let rate_hz = prepared.section.search.rate_hz;
    let times = grid(duration_s, (duration_s * rate_hz).round() as usize + 1);
    let [plain, weighted] = prepared.informations(&times, &motion_at);
    let judged = Judged {
        duration_s,
        rate_hz,
        reports,
        check_rate_hz: CHECK_RATE_HZ,
        check_of: "the quintic spline through the samples of the table",
        diagnosis,
        ..looked_at(&prepared, trajectory.display().to_string(), [plain, weighted], (started, cpu_at_start))
    };
    Ok(prepared.outcome(judged, Box::new(given)))
}

/// Judges a log of the study, by its name or its file: what the run that is over tells about each parameter. Positions go the same way to speeds and accelerations as they would to a fit; limits are looked at
/// on the log's own samples, every one of which counts for the forecast.
///
/// # Errors
/// If the study makes no sense, no log or more than one is called `name`, or the log cannot be read.
pub fn check_log(
    study: &Study,
    study_path: &Path,
    name: &str,
    options: &RunOptions<'_>,
) -> Result<DesignOutcome, Error> {
    let (started, cpu_at_start) = (Instant::now(), cpu_seconds());
    study.require_log(study_path)?;
    let index = log_called(study, name).map_err(|message| Error::study(study_path, message))?;
    let mut prepared = Prepared::for_check(study, study_path, options)?;
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let file = folders.find(&study.log[index].file, study.source.as_deref())?;
    let (mut pieces, rate_hz) = pieces(study, &prepared.machine, index, &file)?;
    let gaps = pieces.len().saturating_sub(1);
    if gaps > 0 {
        prepared.notes.push(format!(
            "the log has {gaps} gap(s): its pieces are judged one by one and count together; pictures show the longest"
        ));
    }
    let count = prepared.machine.layout().columns().len();
    let [mut plain, mut weighted] = [(); 2].map(|()| DMatrix::zeros(count, count));
    let (mut reports, mut diagnosis, mut duration_s): (Vec<LimitReport>, Vec<String>, f64) =
        (Vec::new(), Vec::new(), 0.0);
    for piece in &pieces {
        let motion_at = |times: &[f64], out: &mut Motion| piece.motion(&[], times, out);
        let found = checked(&prepared, study_path, piece.duration_s(), rate_hz, &motion_at)?;
        if found.iter().any(|report| report.violated) {
            diagnosis.extend(sentences(&prepared.set, piece.duration_s(), &found, &motion_at));
        }
        reports = worse_of(reports, found, duration_s);
        for (sum, part) in
            [&mut plain, &mut weighted].into_iter().zip(prepared.informations(piece.times_s(), &motion_at))
        {
            *sum += part;
        }
        duration_s += piece.duration_s();
    }
    let longest = (0..pieces.len())
        .fold(0, |best, piece| if pieces[piece].duration_s() > pieces[best].duration_s() { piece } else { best });
    let judged = Judged {
        duration_s,
        rate_hz,
        reports,
        check_rate_hz: rate_hz,
        check_of: "the log's own samples, its positions through the study's differentiator",
        diagnosis,
        ..looked_at(&prepared, study.log_name(index), [plain, weighted], (started, cpu_at_start))
    };
    Ok(prepared.outcome(judged, Box::new(pieces.swap_remove(longest))))
}

/// What is the same of every motion that was given: no search, no family. Limits, times and rates are filled in by who knows them.
fn looked_at(
    prepared: &Prepared,
    given: String,
    [plain, weighted]: [DMatrix<f64>; 2],
    (started, cpu_at_start): (Instant, Option<f64>),
) -> Judged {
    Judged {
        family: GIVEN,
        family_settings: None,
        given: Some(given),
        parameters: Vec::new(),
        start_posture: Vec::new(),
        optimiser: "none",
        criterion: prepared.criterion(),
        figure: prepared.figure(&plain, &weighted),
        windowed: None,
        history: Vec::new(),
        plain,
        weighted,
        duration_s: 0.0,
        rate_hz: 0.0,
        reports: Vec::new(),
        check_rate_hz: 0.0,
        check_of: "",
        diagnosis: Vec::new(),
        evaluations: 0,
        seconds: started.elapsed().as_secs_f64(),
        cpu_at_start,
    }
}

fn checked(
    prepared: &Prepared,
    study_path: &Path,
    duration_s: f64,
    rate_hz: f64,
    motion_at: &dyn Fn(&[f64], &mut Motion),
) -> Result<Vec<LimitReport>, Error> {
    check_limits(&prepared.limits, &prepared.machine.model(), duration_s, rate_hz, motion_at)
        .map_err(|why| Error::study(study_path, format!("[design.limits]: {why}")))
}

/// Which log is meant: by its name in reports, or by its file.
fn log_called(study: &Study, name: &str) -> Result<usize, String> {
    let all: Vec<usize> = (0..study.log.len()).collect();
    let mut called: Vec<usize> = all.iter().copied().filter(|&index| study.log_name(index) == name).collect();
    if called.is_empty() {
        called = all.iter().copied().filter(|&index| study.log[index].file == Path::new(name)).collect();
    }
    let names = || all.iter().map(|&index| format!("`{}`", study.log_name(index))).collect::<Vec<_>>().join(", ");
    match called[..] {
        [index] => Ok(index),
        [] => Err(format!("no log is called `{name}`: the study's logs are {}", names())),
        _ => {
            Err(format!("{} logs are called `{name}`: give each a name of its own; they are {}", called.len(), names()))
        }
    }
}

/// The uninterrupted pieces of a log as motions in the model's order of joints, and the log's rate.
fn pieces(study: &Study, machine: &Machine, index: usize, file: &Path) -> Result<(Vec<Given>, f64), Error> {
    let log = study.log_name(index);
    let failed = |source| Error::recording(&log, source);
    let mut files = vec![PathBuf::new(); study.log.len()];
    file.clone_into(&mut files[index]);
    let motion = motion_in_force(study, machine, &files, &[index], None)?;
    let mut stream = motion_stream(study, machine, &motion, index, file)?;
    let rate_hz = stream.rate_hz();
    // By piece: for q, dq, ddq and each joint of the model its samples.
    let mut found: Vec<Vec<Vec<f64>>> = Vec::new();
    let (mut segment, mut samples, mut block) = (None, 0, MotionBlock::default());
    let dof = machine.model().dof();
    while stream.next_block(&mut block).map_err(failed)? {
        if segment != Some(block.segment) {
            segment = Some(block.segment);
            found.push(vec![Vec::new(); 3 * dof]);
        }
        samples += block.rows;
        if samples > MAX_SAMPLES {
            let message = format!("log `{log}`: more than {MAX_SAMPLES} samples: give a part of it with time_range_s");
            return Err(Error::States { path: file.to_owned(), line: 1, message });
        }
        if let Some(piece) = found.last_mut() {
            for (order, source) in [&block.q, &block.dq, &block.ddq].into_iter().enumerate() {
                for (joint, &place) in machine.log_place.iter().enumerate() {
                    piece[order * dof + joint].extend_from_slice(block.joint(source, place));
                }
            }
        }
    }
    let given = |piece: Vec<Vec<f64>>| {
        let samples = piece[0].len();
        let [q, dq, ddq] = core::array::from_fn(|order| piece[order * dof..(order + 1) * dof].concat());
        let times = (0..samples).map(|sample| sample as f64 / rate_hz).collect();
        Given::new(times, Motion { samples, joints: dof, q, dq, ddq, dddq: Vec::new() })
    };
    let whole = found.into_iter().filter(|piece| piece[0].len() >= 2).map(given).collect::<Result<Vec<_>, _>>();
    let none = |message: String| Error::States { path: file.to_owned(), line: 1, message };
    let pieces = whole.map_err(|error| none(format!("log `{log}`: {error}")))?;
    if pieces.is_empty() {
        return Err(none(format!("log `{log}`: no uninterrupted piece of two samples or more")));
    }
    Ok((pieces, rate_hz))
}

/// The worse report of each limit; those of `later` happened `after_s` into the log's pieces.
fn worse_of(earlier: Vec<LimitReport>, later: Vec<LimitReport>, after_s: f64) -> Vec<LimitReport> {
    let later = later.into_iter().map(|mut report| {
        report.at_s += after_s;
        report
    });
    if earlier.is_empty() {
        return later.collect();
    }
    earlier.into_iter().zip(later).map(|(a, b)| if b.worst_ratio > a.worst_ratio { b } else { a }).collect()
}

/// A word on ends in motion: a robot cannot begin there.
fn not_at_rest(given: &Given, joints: &[String]) -> Option<String> {
    let motion = given.samples();
    let moving: Vec<&str> = joints
        .iter()
        .enumerate()
        .filter(|(joint, _)| {
            let speeds = &motion.dq[motion.of(*joint)];
            let peak = speeds.iter().fold(0.0_f64, |peak, speed| peak.max(speed.abs()));
            [speeds[0], speeds[speeds.len() - 1]].iter().any(|speed| speed.abs() > REST * peak)
        })
        .map(|(_, name)| name.as_str())
        .collect();
    (!moving.is_empty()).then(|| format!("the motion does not start and end at rest: {}", moving.join(", ")))
}
