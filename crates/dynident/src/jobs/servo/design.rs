//! `design` for drives with a position controller: position commands that determine the parameters of drives and
//! bodies.

use super::result::{DETERMINED, is_of_body};
use super::{first_drives, training_runs};
use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::design::limits_of_commands;
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::motion_provenance;
use crate::result::{LimitReport, SERVO_DESIGN_SCHEMA, ServoDesignFile, ServoForecast, ServoForecastValue};
use crate::study::{Folders, ServoSection, Study, StudyError, StudyFile, StudyRobot};
use core::fmt::Write;
use dynident_estimation::HALF_WIDTH_95;
use dynident_excitation::Motion;
use dynident_excitation::check::check_limits;
use dynident_excitation::limits::{LimitError, Limits, LimitsInForce};
use dynident_model::{JointKind, Model};
use dynident_servo::{
    CommandRange, DesignedCommands, Drive, ServoError, ServoRobot, ServoValue, design_commands, unknowns,
};
use std::path::Path;
use std::time::Instant;

/// A design of commands.
#[derive(Debug)]
pub struct ServoDesignOutcome {
    /// Content of `design.json`.
    pub file: ServoDesignFile,
    /// Times of the commands, s.
    pub times_s: Vec<f64>,
    /// Commands of each joint, rad (m).
    pub commands: Vec<Vec<f64>>,
    /// Simulated positions of each joint, rad (m).
    pub positions: Vec<Vec<f64>>,
    /// The robot.
    pub robot: StudyRobot,
}

impl ServoDesignOutcome {
    /// Text of `commands.csv`: time and the command of each joint, `t_s, c1, ..`, in s and rad (m). Each command is
    /// held until the next. `[format] command = { columns = "c{1..n}", unit = "rad" }` reads this file.
    pub fn csv(&self) -> String {
        let mut text = String::from("t_s");
        for joint in 1..=self.commands.len() {
            let _ = write!(text, ",c{joint}");
        }
        text.push('\n');
        for (sample, time) in self.times_s.iter().enumerate() {
            let _ = write!(text, "{time}");
            for joint in &self.commands {
                let _ = write!(text, ",{}", joint[sample]);
            }
            text.push('\n');
        }
        text
    }
}

/// Designs commands for the drives of a study. Drive values are those of `[drive.servo]`, otherwise those that follow
/// from the responses in the training logs. The simulated motion keeps the limits of the robot description and of
/// `[design]` (position, velocity, places, self-collision), and does not touch the floor.
///
/// # Errors
/// Study, robot and logs that cannot be read; drives without values; joints without range; no permitted motion.
pub fn design_servos(study: &Study, study_path: &Path, options: &RunOptions<'_>) -> Result<ServoDesignOutcome, Error> {
    let study = StudyFile::new(study, study_path);
    let files = InputFiles::of(study, options.data.as_deref());
    files.while_unchanged(|| from_files(study, options))
}

fn from_files(study: StudyFile<'_>, options: &RunOptions<'_>) -> Result<ServoDesignOutcome, Error> {
    let begin = Instant::now();
    let folders = study.folders(options.data.as_deref());
    let robot = study.robot_in(&folders)?;
    let model = robot.model();
    let section = study.drive.servo.clone().unwrap_or_default();
    let in_study = |error: StudyError| Error::section(study.path, "drive.servo")(error);
    let drives = drives(study, &folders, &robot, &section)?;
    let floor = section.floor(model).map_err(in_study)?;
    let servos = ServoRobot { model: model.clone(), drives, floor };
    let LimitsInForce { limits, assumed, not_checked } = limits_of_commands(study, &folders, &robot)?;
    let ranges = ranges(model, &limits, &section).map_err(Error::section(study.path, "design"))?;
    let start = start(study, model, &ranges).map_err(Error::section(study.path, "design"))?;
    let provenance = motion_provenance(study, options.data.as_deref(), &[])?;
    let settings = &section.design;
    let check = |positions: &[Vec<f64>]| reports(&limits, model, positions, settings.rate_hz);
    // Errors in the limits are the same for all motions, so they are reported before the search.
    check(&start.iter().map(|q| vec![*q; 2]).collect::<Vec<_>>())
        .map_err(Error::section(study.path, "design.limits"))?;
    let is_permitted = |positions: &[Vec<f64>]| {
        servos.floor.as_ref().is_none_or(|floor| floor.is_clear(model, positions))
            && check(positions).is_ok_and(|reports| reports.iter().all(|report| !report.violated))
    };
    let parameters = unknowns(&servos, &section.fit);
    options.progress.begin("design of commands", Some(settings.evaluations() as u64));
    let advance = |count| options.progress.advance(count);
    // The checks of limits run on this thread, simulations on the pool of threads.
    let found = crate::jobs::servo::on_threads(options.threads, || {
        let bounds = (&ranges[..], &start[..]);
        design_commands(&servos, &parameters, bounds, (&section.fit, settings), &is_permitted, &advance)
    });
    options.progress.end();
    let found = found.map_err(|error: ServoError| Error::section(study.path, "drive.servo")(error))?;
    let mut file = file(&robot, &section, &found);
    file.study = study.title();
    file.limits = check(&found.positions).map_err(Error::section(study.path, "design.limits"))?;
    (file.assumed, file.not_checked) = (assumed, not_checked);
    file.provenance = Some(provenance);
    file.seconds = begin.elapsed().as_secs_f64();
    let DesignedCommands { times_s, commands, positions, .. } = found;
    Ok(ServoDesignOutcome { file, times_s, commands, positions, robot })
}

/// The assumed drives.
fn drives(
    study: StudyFile<'_>,
    folders: &Folders,
    robot: &StudyRobot,
    section: &ServoSection,
) -> Result<Vec<Drive>, Error> {
    let in_study = |error: StudyError| Error::section(study.path, "drive.servo")(error);
    let runs = if study.fits_commands() { training_runs(study, folders, robot, section)? } else { Vec::new() };
    if runs.is_empty() {
        return section.stated_drives(robot.model().dof()).map_err(in_study);
    }
    for run in &runs {
        run.validate(robot.model().dof()).map_err(|error| Error::section(study.path, "drive.servo")(error))?;
    }
    first_drives(robot.model(), &runs, section).map_err(in_study)
}

/// Range and speed of each joint's commands.
fn ranges(model: &Model, limits: &Limits, section: &ServoSection) -> Result<Vec<CommandRange>, StudyError> {
    let of_joint = |(joint, own): (usize, &dynident_model::Joint)| {
        let limit = limits.of(&own.name);
        let [mut least, mut greatest] = limit.and_then(|limit| limit.position).ok_or_else(|| {
            StudyError::conflict(
                format!("the joint `{}` has no position limits", own.name),
                "state position in limits.joints of [design]",
            )
        })?;
        if let Some([low, high]) = section.command_range.as_ref().and_then(|ranges| ranges.get(joint)) {
            (least, greatest) = (least.max(*low), greatest.min(*high));
        }
        if least >= greatest {
            return Err(StudyError::conflict(
                format!("no position of the joint `{}` is within its limits and drive.servo.command_range", own.name),
                "correct one of them",
            ));
        }
        // Without a velocity limit, commands take one second for the range.
        let speed = limit.and_then(|limit| limit.speed).unwrap_or(greatest - least);
        Ok(CommandRange { least, greatest, speed })
    };
    model.joints().iter().enumerate().map(of_joint).collect()
}

/// The posture at the beginning and at the end: that of the study, otherwise the middle of the ranges.
fn start(study: StudyFile<'_>, model: &Model, ranges: &[CommandRange]) -> Result<Vec<f64>, StudyError> {
    let stated = study.design.as_ref().and_then(|design| design.start_posture.as_ref());
    let stated = stated.map(|posture| posture.named("start_posture", model)).transpose()?.unwrap_or_default();
    let of_joint = |(joint, range): (usize, &CommandRange)| {
        let middle = f64::midpoint(range.least, range.greatest);
        stated.get(joint).copied().flatten().unwrap_or(middle).clamp(range.least, range.greatest)
    };
    Ok(ranges.iter().enumerate().map(of_joint).collect())
}

/// Ratio of value to limit for each limit, from the positions of each joint at `rate_hz`, with velocities by
/// differences.
fn reports(
    limits: &Limits,
    model: &Model,
    positions: &[Vec<f64>],
    rate_hz: f64,
) -> Result<Vec<LimitReport>, LimitError> {
    let samples = positions[0].len();
    let duration_s = (samples - 1) as f64 / rate_hz;
    check_limits(limits, model, duration_s, rate_hz, |times: &[f64], out: &mut Motion| {
        out.reset(positions.len(), times.len());
        for (joint, positions) in positions.iter().enumerate() {
            for (place, time) in times.iter().enumerate() {
                let sample = ((time * rate_hz).round() as usize).min(samples - 1);
                let before = sample.saturating_sub(1);
                out.q[joint * times.len() + place] = positions[sample];
                out.dq[joint * times.len() + place] = (positions[sample] - positions[before]) * rate_hz;
            }
        }
    })
}

fn file(robot: &StudyRobot, section: &ServoSection, found: &DesignedCommands) -> ServoDesignFile {
    let model = robot.model();
    let rotary: Vec<bool> = model.joints().iter().map(|joint| joint.kind != JointKind::Prismatic).collect();
    let pairs = || found.forecast.values.iter().zip(&found.chirp.values);
    let of = |is_own: &dyn Fn(&ServoValue) -> bool, name: &str, is_rotary: bool| ServoForecast {
        name: name.to_owned(),
        values: pairs().filter(|(own, _)| is_own(own)).map(|(own, chirp)| expected(own, chirp, is_rotary)).collect(),
    };
    let drives =
        model.joints().iter().enumerate().map(|(joint, own)| {
            of(&|value| !is_of_body(value.quantity) && value.index == joint, &own.name, rotary[joint])
        });
    let bodies = model
        .bodies()
        .iter()
        .enumerate()
        .map(|(body, own)| of(&|value| is_of_body(value.quantity) && value.index == body, own.name(), true));
    let bodies: Vec<ServoForecast> = bodies.filter(|body| !body.values.is_empty()).collect();
    let drives: Vec<ServoForecast> = drives.collect();
    let open = drives.iter().chain(&bodies).flat_map(|owner| {
        let open = owner.values.iter().filter(|value| !value.determined);
        open.map(move |value| format!("{} of {}", value.name, owner.name))
    });
    let settings = &section.design;
    ServoDesignFile {
        schema: SERVO_DESIGN_SCHEMA.to_owned(),
        robot: model.name().to_owned(),
        joints: model.joints().iter().map(|joint| joint.name.clone()).collect(),
        duration_s: found.times_s.len() as f64 / settings.rate_hz,
        rate_hz: settings.rate_hz,
        seed: settings.seed,
        evaluations: found.evaluations,
        expected_error: settings.error,
        correlation_s: settings.correlation_s,
        feasible: found.is_permitted,
        log_det: found.forecast.log_det,
        chirp_log_det: found.chirp.log_det,
        error_bars_to_chirp: ratio(pairs()),
        not_determined: open.collect(),
        notes: vec![
            "the scale of torques, inertias and masses is not in positions: play the commands a second time with a \
             known payload"
                .to_owned(),
        ],
        drives,
        bodies,
        ..ServoDesignFile::default()
    }
}

fn expected(own: &ServoValue, chirp: &ServoValue, is_rotary: bool) -> ServoForecastValue {
    ServoForecastValue {
        name: own.quantity.name().to_owned(),
        unit: own.quantity.unit(is_rotary).to_owned(),
        value: own.value,
        half_width_95: HALF_WIDTH_95 * own.std,
        half_width_95_at_scale: HALF_WIDTH_95 * own.std_at_scale,
        half_width_95_before: HALF_WIDTH_95 * own.prior_std,
        half_width_95_chirp: HALF_WIDTH_95 * chirp.std_at_scale,
        determined: own.std_at_scale <= DETERMINED * own.prior_std,
    }
}

/// Geometric mean of the ratios of these error bars to those of a chirp motion.
fn ratio<'a>(pairs: impl Iterator<Item = (&'a ServoValue, &'a ServoValue)>) -> f64 {
    let logs: Vec<f64> = pairs
        .map(|(own, chirp)| own.std_at_scale / chirp.std_at_scale)
        .filter(|ratio| ratio.is_finite() && *ratio > 0.0)
        .map(f64::ln)
        .collect();
    (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp()
}
