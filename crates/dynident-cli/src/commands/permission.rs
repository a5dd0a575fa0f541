//! What a person is asked before a robot moves.

use super::answer;
use crate::terminal;
use dynident::iteration::{NextMotion, RunPurpose};
use dynident::study::{RobotChoice, Study};
use std::io::IsTerminal;

/// A study names a program, and whoever wrote the study may be somebody else: it is shown, and started only by who was
/// told `--allow-command`, or says yes.
pub(crate) fn for_command(study: &Study, allowed: bool) -> Result<(), String> {
    let robot = study.iteration.as_ref().map(|section| &section.robot);
    let Some(RobotChoice::Process(process)) = robot else { return Ok(()) };
    let command = shown(&process.command);
    if allowed {
        terminal::remark(&format!("the robot's program: {command}"));
        return Ok(());
    }
    let question = format!("the study starts this program as the robot:\n  {command}\nStart it?");
    match agreed(&question) {
        Some(true) => Ok(()),
        Some(false) => Err("the robot's program was not allowed: nothing was run".to_owned()),
        None => Err(format!(
            "the study starts a program as the robot: {command}\nRead it; if you trust it, call again with \
             --allow-command. Nothing was run"
        )),
    }
}

/// Asks before a motion.
pub(crate) fn for_motion(motion: &NextMotion) -> bool {
    let (leg, legs) = motion.leg;
    let of = if legs > 1 { format!(", trajectory {} of {legs}", leg + 1) } else { String::new() };
    let model = if motion.model_based { "with the model so far" } else { "without a model" };
    let share = if motion.speed < 1.0 { format!(" at {} of its speed", motion.speed) } else { String::new() };
    let what = match motion.purpose {
        RunPurpose::WarmUp { pass, of } => format!("pass {pass} of {of} that warm up for run {}", motion.run),
        RunPurpose::HeldOut => format!("the held-out motion after run {}", motion.run),
        RunPurpose::Run => format!("run {}", motion.run),
    };
    let speeds = |of: &[(String, f64)]| -> String {
        of.iter().map(|(joint, speed)| format!("{joint} {speed:.2}")).collect::<Vec<_>>().join(", ")
    };
    let ways = motion.ways.as_ref().map_or_else(String::new, |ways| {
        let over = |way: usize| match ways.over_postures[way] {
            0 => String::new(),
            1 => " over a posture in between".to_owned(),
            several => format!(" over {several} postures in between"),
        };
        format!(
            "\n  from home {:.1} s{}, back {:.1} s{}; largest velocities on these ways: {}",
            ways.approach_s,
            over(0),
            ways.return_s,
            over(1),
            speeds(&ways.largest_speed)
        )
    });
    let question = format!(
        "{what}{of}: {:.1} s{share} under {} {model}; largest velocities, rad/s (m/s): {}{ways}\nIs the robot clear?",
        motion.duration_s,
        motion.controller,
        speeds(&motion.largest_speed)
    );
    agreed(&question).unwrap_or(false)
}

/// That there is somebody who can be asked.
pub(crate) fn somebody() -> Result<(), String> {
    if std::io::stdin().is_terminal() {
        return Ok(());
    }
    Err("--confirm asks on the terminal before each run, and standard input is none: call it from a terminal"
        .to_owned())
}

/// A line of text; none if nobody is there, or nothing is said.
pub(crate) fn text_asked(question: &str) -> Option<String> {
    if !(std::io::stdin().is_terminal() && terminal::watched()) {
        return None;
    }
    let answer = answer::to(&format!("{question} "))?;
    Some(answer.trim().to_owned()).filter(|answer| !answer.is_empty())
}

/// Yes or no; none if nobody is there.
pub(crate) fn agreed(question: &str) -> Option<bool> {
    if !(std::io::stdin().is_terminal() && terminal::watched()) {
        return None;
    }
    let answer = text_asked(&format!("{question} [y/N]")).unwrap_or_default();
    Some(matches!(answer.to_lowercase().as_str(), "y" | "yes"))
}

/// Words as a shell would take them, near enough for a person to read.
fn shown(command: &[String]) -> String {
    let plain = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() || "/._-+=:,@%".contains(c));
    let quoted = |word: &String| if plain(word) { word.clone() } else { format!("{word:?}") };
    command.iter().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    #[test]
    fn words_are_shown_apart() {
        let command = ["sh", "-c", "rm -r \"x\"", ""].map(str::to_owned);
        assert_eq!(super::shown(&command), "sh -c \"rm -r \\\"x\\\"\" \"\"");
    }
}
