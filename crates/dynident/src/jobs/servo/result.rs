//! Content of `result.json` for a study with commands.

use super::{Found, RoleRun};
use crate::error::Error;
use crate::result::{SERVO_SCHEMA, ServoBody, ServoDrive, ServoFile, ServoLog, ServoMotion, ServoNumber, ServoScale};
use crate::study::{ServoSection, StudyFile};
use dynident_dynamics::{Workspace, mass_matrix_and_bias};
use dynident_estimation::HALF_WIDTH_95;
use dynident_identification::Role;
use dynident_model::{JointKind, Model};
use dynident_servo::{Drive, Quantity, Run, Scale, ServoRobot, ServoValue, errors, values};

/// Maximum number of samples of a motion.
const MOST_SAMPLES: usize = 1500;
/// A value is determined if the width of its interval is at most this share of the width before the fit.
pub(super) const DETERMINED: f64 = 0.5;
/// Least time by which a motion must begin before its command to be reported, s: steps of the simulation are 2.5 ms.
const LEAST_LATE_S: f64 = 0.0025;
/// Largest root mean square error of a simulated joint in a usable model, rad (m), and relative to the range of its
/// measured motion; both must be exceeded. A real SO-101 has at most 13 mrad in held-out motions, simulated arms with a
/// reversed or exchanged joint have 200 mrad and 15 % or more.
const LARGEST_ERROR: f64 = 0.03;
const LARGEST_ERROR_SHARE: f64 = 0.1;
/// The scale is determined if its interval is at most this part of that before the fit: without an anchor, the fit
/// narrows it by less than a quarter.
const SCALE_DETERMINED: f64 = 0.5;

pub(super) fn servo_file(
    study: StudyFile<'_>,
    model: &Model,
    runs: &[RoleRun],
    found: &Found,
    section: &ServoSection,
) -> Result<ServoFile, Error> {
    let (list, scale) = values(&found.nominal, &found.parameters, &found.search)
        .map_err(|error| Error::section(study.path, "drive.servo")(dynident_servo::ServoError::from(error)))?;
    let rotary: Vec<bool> = model.joints().iter().map(|joint| joint.kind != JointKind::Prismatic).collect();
    let joints: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let means = means(&found.robot, runs);
    let number = |value: &ServoValue, is_rotary: bool| number(value, is_rotary);
    let drives = found.robot.drives.iter().enumerate().map(|(joint, drive)| {
        let own = list.iter().filter(|value| value.index == joint && !is_of_body(value.quantity));
        let velocity_limit = model.joints()[joint].limits.velocity.filter(|limit| *limit > 0.0);
        let values = own.map(|value| number(value, rotary[joint])).collect();
        ServoDrive { velocity_limit, ..drive_of(drive, means[joint], values) }
    });
    let bodies = found.robot.model.inertials().iter().enumerate().map(|(body, inertial)| ServoBody {
        body: found.robot.model.bodies()[body].name().to_owned(),
        parameters: inertial.0,
        nominal_mass_kg: model.inertials()[body].mass_kg(),
        values: list
            .iter()
            .filter(|value| value.index == body && is_of_body(value.quantity))
            .map(|value| number(value, true))
            .collect(),
    });
    let mut file = ServoFile {
        schema: SERVO_SCHEMA.to_owned(),
        study: study.title(),
        robot: model.name().to_owned(),
        step_s: section.fit.step_s,
        unknowns: found.parameters.len(),
        iterations: found.search.iterations,
        settled: found.search.settled,
        drives: drives.collect(),
        bodies: bodies.collect(),
        scale: scale_of(&scale, runs),
        joints,
        rotary,
        ..ServoFile::default()
    };
    for (run, simulated) in runs.iter().zip(&found.simulated) {
        let Some(simulated) = simulated else {
            file.problems.push(format!("the simulation of {} fails: its motion is outside of the model", run.run.name));
            continue;
        };
        let log = log_of(run, simulated);
        if run.role == Role::Validate { file.validation.push(log) } else { file.training.push(log) }
    }
    file.notes.extend(unexplained(&file, runs, found));
    file.problems.extend(late_commands(&file, study));
    remarks(&mut file);
    Ok(file)
}

/// Problems of joints whose simulated motion in held-out logs differs from the measured one by a large part of the
/// motion. Friction and soft drives cause at most a few percent of it.
fn wrong_motions(file: &ServoFile) -> Vec<String> {
    let of_log = |log: &ServoLog| {
        let all = file.joints.iter().zip(log.errors.iter().zip(&log.ranges));
        let wrong = all.filter(|(_, (error, range))| **error > LARGEST_ERROR.max(LARGEST_ERROR_SHARE * **range));
        let wrong: Vec<String> = wrong
            .map(|(joint, (error, range))| format!("{joint} ({:.0} % of its range)", 100.0 * error / range))
            .collect();
        (!wrong.is_empty()).then(|| {
            format!(
                "{}: the simulation is far from the measured motion of {}: run `dynident check`; look for reversed or \
                 exchanged columns, another unit, or a load that the study does not state",
                log.name,
                wrong.join(", ")
            )
        })
    };
    let logs = if file.validation.is_empty() { &file.training } else { &file.validation };
    logs.iter().filter_map(of_log).collect()
}

/// The problem of motion that begins before its command, which no servo does.
fn late_commands(file: &ServoFile, study: StudyFile<'_>) -> Option<String> {
    let own = file.drives.iter().map(|drive| {
        let bar = drive.values.iter().filter(|value| value.name.ends_with("delay")).map(|value| value.half_width_95);
        (drive.read_delay_s - drive.delay_s, bar.fold(LEAST_LATE_S, f64::max))
    });
    let early = own.enumerate().filter(|(_, (early_s, bar))| early_s > bar).collect::<Vec<_>>();
    let longest = early.iter().map(|(_, (early_s, _))| *early_s).fold(0.0, f64::max);
    let names: Vec<&str> = early.iter().map(|(joint, _)| file.joints[*joint].as_str()).collect();
    let stated = study.format_of(0).command_late_s.unwrap_or(0.0);
    (!names.is_empty()).then(|| {
        format!(
            "the motion of {} begins up to {:.0} ms before its command: the recorder stamps commands late. Write \
             command_late_s = {:.3} or more in [format] of the study; a servo itself needs 5 to 30 ms",
            names.join(", "),
            1e3 * longest,
            stated + longest
        )
    })
}

/// A sentence for each log with intervals that the model does not explain.
fn unexplained(file: &ServoFile, runs: &[RoleRun], found: &Found) -> Vec<String> {
    let training: Vec<&RoleRun> = runs.iter().filter(|run| run.role != Role::Validate).collect();
    let of_log = |(index, run): (usize, &&RoleRun)| {
        let own = found.search.unexplained.iter().filter(|own| own.run == index);
        let intervals: Vec<String> = own
            .map(|own| format!("{} {:.0} to {:.0} s", file.joints[own.joint], own.interval_s[0], own.interval_s[1]))
            .collect();
        (!intervals.is_empty()).then(|| {
            format!(
                "{}: the model does not explain {}. These rows have little weight in the fit; look for a contact, a \
                 push, or a limit of the drive that the study does not state",
                run.run.name,
                intervals.join(", ")
            )
        })
    };
    training.iter().enumerate().filter_map(of_log).collect()
}

pub(super) fn is_of_body(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Mass | Quantity::Centre(_))
}

fn number(value: &ServoValue, is_rotary: bool) -> ServoNumber {
    ServoNumber {
        name: value.quantity.name().to_owned(),
        unit: value.quantity.unit(is_rotary).to_owned(),
        value: value.value,
        half_width_95: HALF_WIDTH_95 * value.std,
        half_width_95_at_scale: HALF_WIDTH_95 * value.std_at_scale,
        half_width_95_before: HALF_WIDTH_95 * value.prior_std,
        determined: value.std_at_scale <= DETERMINED * value.prior_std,
    }
}

/// A limit, or `None` without one.
fn finite(limit: f64) -> Option<f64> {
    limit.is_finite().then_some(limit)
}

fn drive_of(drive: &Drive, means: DriveMeans, values: Vec<ServoNumber>) -> ServoDrive {
    ServoDrive {
        stiffness: drive.stiffness,
        damping: drive.damping,
        armature: drive.armature,
        coulomb: drive.coulomb,
        load_friction: drive.load_friction,
        stribeck: drive.stribeck,
        stribeck_speed: drive.stribeck_speed,
        torque_limit: finite(drive.torque_limit),
        profile_acceleration: finite(drive.profile_acceleration),
        profile_speed: finite(drive.profile_speed),
        velocity_limit: None,
        delay_s: drive.delay_s,
        read_delay_s: drive.read_delay_s,
        zero: drive.zero,
        mean_load: means.load,
        mean_friction: means.friction,
        values,
    }
}

fn scale_of(scale: &Scale, runs: &[RoleRun]) -> ServoScale {
    let has_payload = runs.iter().any(|run| run.role != Role::Validate && !run.run.payloads.is_empty());
    let determined = has_payload && scale.std <= SCALE_DETERMINED * scale.prior_std;
    let percent = 100.0 * HALF_WIDTH_95 * scale.std;
    let anchor = if determined {
        format!("The known payloads of the logs give the scale to ±{percent:.1} %.")
    } else {
        format!(
            "Positions do not contain the scale of torques, inertias and masses. It is that of the masses in the robot \
             description, ±{percent:.0} %; the total mass of the fit is {:.3} kg. Record one log with a known payload \
             and name it in [[payload]] to measure the scale.",
            scale.mass_kg
        )
    };
    ServoScale { determined, mass_kg: scale.mass_kg, half_width_95_percent: percent, anchor }
}

fn range(values: &[f64]) -> f64 {
    let ends = values.iter().fold([f64::MAX, f64::MIN], |[low, high], value| [low.min(*value), high.max(*value)]);
    ends[1] - ends[0]
}

/// Means of a joint over the measured motion of the training logs.
#[derive(Clone, Copy, Debug, Default)]
struct DriveMeans {
    /// Mean torque of gravity and velocity effects without its sign, Nm (N).
    load: f64,
    /// Largest friction at this transmitted torque and velocity, Nm (N).
    friction: f64,
}

/// Means of each joint over the inner samples of the training logs.
fn means(robot: &ServoRobot, runs: &[RoleRun]) -> Vec<DriveMeans> {
    let dof = robot.model.dof();
    let (mut sums, mut count) = (vec![DriveMeans::default(); dof], 0.0);
    let mut workspace = Workspace::new(&robot.model);
    for RoleRun { run, .. } in runs.iter().filter(|run| run.role != Role::Validate) {
        for sample in (1..run.times_s.len() - 1).step_by(10) {
            let q: Vec<f64> = run.positions.iter().map(|joint| joint[sample]).collect();
            let span = run.times_s[sample + 1] - run.times_s[sample - 1];
            let v: Vec<f64> =
                run.positions.iter().map(|joint| (joint[sample + 1] - joint[sample - 1]) / span).collect();
            let (_, loads) = mass_matrix_and_bias(&robot.model, &mut workspace, &q, &v);
            for (((sum, load), drive), v) in sums.iter_mut().zip(loads).zip(&robot.drives).zip(&v) {
                sum.load += load.abs();
                sum.friction += drive.coulomb
                    + drive.load_friction * load.abs()
                    + drive.stribeck * (-(v / drive.stribeck_speed).powi(2)).exp();
            }
            count += 1.0;
        }
    }
    sums.iter().map(|sum| DriveMeans { load: sum.load / count, friction: sum.friction / count }).collect()
}

fn log_of(run: &RoleRun, simulated: &[Vec<f64>]) -> ServoLog {
    let run = &run.run;
    let samples = run.times_s.len();
    ServoLog {
        name: run.name.clone(),
        samples,
        duration_s: run.times_s[samples - 1] - run.times_s[0],
        errors: errors(run, simulated),
        command_errors: errors(run, &run.commands),
        ranges: run.positions.iter().map(|joint| range(joint)).collect(),
    }
}

/// The motions of all logs; held-out logs come first.
pub(super) fn motions(runs: &[RoleRun], found: &Found) -> Vec<ServoMotion> {
    let all = || runs.iter().zip(&found.simulated);
    let held_out = |(run, _): &(&RoleRun, _)| run.role == Role::Validate;
    let ordered = all().filter(held_out).chain(all().filter(|own| !held_out(own)));
    ordered.filter_map(|(run, simulated)| Some(motion_of(&run.run, simulated.as_ref()?))).collect()
}

fn motion_of(run: &Run, simulated: &[Vec<f64>]) -> ServoMotion {
    let step = run.times_s.len().div_ceil(MOST_SAMPLES).max(1);
    let thin = |values: &Vec<f64>| values.iter().step_by(step).copied().collect::<Vec<f64>>();
    ServoMotion {
        name: run.name.clone(),
        times_s: thin(&run.times_s),
        measured: run.positions.iter().map(thin).collect(),
        simulated: simulated.iter().map(thin).collect(),
        commands: run.commands.iter().map(thin).collect(),
    }
}

/// Adds notes on values that are not determined, and on reasons not to use the result.
fn remarks(file: &mut ServoFile) {
    let name = |owner: &str, value: &ServoNumber| format!("{} of {owner}", value.name);
    for (joint, drive) in file.joints.iter().zip(&file.drives) {
        let open = drive.values.iter().filter(|value| !value.determined);
        file.not_determined.extend(open.map(|value| name(joint, value)));
    }
    for body in &file.bodies {
        let open = body.values.iter().filter(|value| !value.determined);
        file.not_determined.extend(open.map(|value| name(&body.body, value)));
    }
    if !file.settled {
        file.problems.push("the search did not settle: raise drive.servo.fit.iterations".to_owned());
    }
    file.problems.extend(wrong_motions(file));
    for log in &file.validation {
        let worse = file.joints.iter().zip(log.errors.iter().zip(&log.command_errors));
        let worse: Vec<&str> =
            worse.filter(|(_, (error, command))| error > command).map(|(joint, _)| joint.as_str()).collect();
        if !worse.is_empty() {
            file.notes.push(format!(
                "{}: the simulation of {} is further from the measured motion than the command is; look for contact or \
                 a clamped command",
                log.name,
                worse.join(", ")
            ));
        }
    }
    if file.validation.is_empty() {
        file.notes.push("no held-out log: give a log the role \"validate\" to test the model".to_owned());
    }
}
