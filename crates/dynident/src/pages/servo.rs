//! Page of drives and bodies found from commands and positions.

use super::robot::{RobotAppearance, ellipsoid};
use crate::error::Error;
use crate::result::{ServoDrive, ServoFile, ServoLog, ServoMotion, ServoNumber};
use dynident_model::Model;
use dynident_report::{Cell, Heading, LinePlot, Report, SceneMotion, Table, Text, Tone, short};

/// Number of motions in the picture of the robot.
const MOST_PLAYED: usize = 3;

/// Writes the page: verdict, errors on each log, the robot with its motion, drives, bodies.
///
/// # Errors
/// [`Error::Report`], which indicates a bug.
pub(crate) fn servo_page(
    file: &ServoFile,
    motions: &[ServoMotion],
    robot: &RobotAppearance,
    model: &Model,
) -> Result<String, Error> {
    let subtitle =
        format!("{}: {} unknowns from commands and positions, step {} s", file.robot, file.unknowns, file.step_s);
    let mut page = Report::new(&file.study).subtitle(subtitle);
    let mut paragraphs = vec![verdict_words(file), file.scale.anchor.clone()];
    paragraphs.extend(file.problems.iter().map(|problem| format!("PROBLEM: {problem}.")));
    page.add(Text { paragraphs, points: plain(&file.notes) });
    page.add(Heading::new("Errors of the simulated motion"));
    page.add(errors(file));
    let mut scene = robot.scene("Robot");
    for (body, inertial) in scene.bodies.iter_mut().skip(1).zip(model.inertials()) {
        body.ellipsoids.extend(ellipsoid(&inertial.0, true));
    }
    scene.words = "the simulated motion; the pale arm is the measured one".into();
    scene.motions = motions.iter().take(MOST_PLAYED).map(played).collect();
    page.add(scene);
    page.add(Heading::new("Drives"));
    let drives: Vec<Vec<ServoNumber>> = file.drives.iter().map(ServoDrive::shown_values).collect();
    page.add(numbers("joint", file.joints.iter().zip(&drives)));
    page.add(Heading::new("Bodies"));
    page.add(numbers("body", file.bodies.iter().map(|body| (&body.body, &body.values))));
    if let Some(log) = motions.first() {
        page.add(Heading::new(format!("Motion of {}", log.name)));
        for (joint, name) in file.joints.iter().enumerate() {
            page.add(motion(log, joint, name, file.rotary[joint]));
        }
    }
    if !file.not_determined.is_empty() {
        page.add(Heading::new("Not determined by the motion"));
        page.add(Text { paragraphs: Vec::new(), points: plain(&file.not_determined) });
    }
    Ok(page.html()?)
}

/// The result in one sentence.
pub fn verdict_words(file: &ServoFile) -> String {
    let mean = |logs: &[ServoLog], of: fn(&ServoLog) -> &[f64]| {
        let all: Vec<f64> = logs.iter().flat_map(|log| of(log).iter().copied()).collect();
        1e3 * all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let (kind, logs) =
        if file.validation.is_empty() { ("training", &file.training) } else { ("unseen", &file.validation) };
    format!(
        "Simulated from commands alone, this model follows {kind} motion to {:.1} mrad (mean over joints and logs of the \
         root mean square error). Without a model, with the command as motion, the error is {:.1} mrad.",
        mean(logs, |log| &log.errors),
        mean(logs, |log| &log.command_errors)
    )
}

fn plain(words: &[String]) -> Vec<(Tone, String)> {
    words.iter().map(|words| (Tone::Plain, words.clone())).collect()
}

fn errors(file: &ServoFile) -> Table {
    let columns = ["log".to_owned(), "role".to_owned()].into_iter().chain(file.joints.iter().cloned());
    let mut table = Table::new("", columns).note(
        "Root mean square error in mrad (mm), simulated from the first position without resets; in brackets with the \
         command as motion.",
    );
    for (role, logs) in [("held out", &file.validation), ("training", &file.training)] {
        for log in logs {
            let own = log.errors.iter().zip(&log.command_errors).map(|(error, command)| {
                let tone = if error <= command { Tone::Plain } else { Tone::Warning };
                Cell::judged(format!("{} ({})", short(1e3 * error, 3), short(1e3 * command, 3)), tone)
            });
            let names = [Cell::from(log.name.clone()), Cell::from(role)];
            table.rows.push(names.into_iter().chain(own).collect());
        }
    }
    table
}

fn numbers<'a>(owner: &str, all: impl Iterator<Item = (&'a String, &'a Vec<ServoNumber>)>) -> Table {
    let columns = [owner, "value", "estimate", "± (95 %)", "± at this scale", "± before", "unit", "determined"];
    let mut table = Table::new("", columns);
    for (name, values) in all {
        for value in values {
            table.rows.push(vec![
                name.clone().into(),
                value.name.clone().into(),
                short(value.value, 4).into(),
                short(value.half_width_95, 2).into(),
                short(value.half_width_95_at_scale, 2).into(),
                short(value.half_width_95_before, 2).into(),
                value.unit.clone().into(),
                if value.determined { Cell::from("yes") } else { Cell::judged("no", Tone::Warning) },
            ]);
        }
    }
    table
}

fn played(log: &ServoMotion) -> SceneMotion {
    SceneMotion {
        name: log.name.clone(),
        times_s: log.times_s.clone(),
        q: log.simulated.clone(),
        ghost: log.measured.clone(),
        ..SceneMotion::default()
    }
}

fn motion(log: &ServoMotion, joint: usize, name: &str, is_rotary: bool) -> LinePlot {
    let unit = if is_rotary { "rad" } else { "m" };
    let mut plot = LinePlot::new(name, "time, s", format!("position, {unit}"), log.times_s.clone())
        .of_joint(name)
        .dashed("command", log.commands[joint].clone())
        .line("measured", log.measured[joint].clone())
        .line("simulated", log.simulated[joint].clone());
    plot.difference = Some(("measured minus simulated".into(), [1, 2]));
    plot
}
