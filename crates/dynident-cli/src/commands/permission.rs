use super::{answer, interruption, known_in, message_of};
use crate::terminal;
use dynident::iteration::{NextMotion, RunPurpose};
use dynident::model::Robot;
use dynident::study::{RobotChoice, Study};
use dynident::{Error, LoadSettings, ProgramPermission, ProgramRequest, XacroSettings, load_robot};
use dynident_text::one_line;
use std::cell::RefCell;
use std::collections::HashMap;
use std::io::IsTerminal;
use std::path::Path;

/// Options of every command that may start a program.
#[derive(clap::Args)]
pub(crate) struct ProgramOptions {
    /// Start the programs that the files need without asking: xacro for a robot file with macros, and the robot program
    /// of a study. Use it only for files that you trust.
    #[arg(long)]
    allow_command: bool,
}

/// Options of every command that reads a robot file without a study.
#[derive(clap::Args)]
pub(crate) struct XacroOptions {
    #[command(flatten)]
    pub(crate) programs: ProgramOptions,
    /// An argument of xacro, for a robot file with macros; may be given several times.
    #[arg(long = "xacro", value_name = "KEY=VALUE", value_parser = argument)]
    arguments: Vec<(String, String)>,
    /// Time limit of xacro, s.
    #[arg(long, value_name = "S", default_value_t = XacroSettings::DEFAULT_LIMIT_S)]
    xacro_limit_s: f64,
}

fn argument(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("give KEY=VALUE, such as ur_type=ur5e")?;
    Ok((key.strip_suffix(':').unwrap_or(key).to_owned(), value.to_owned()))
}

impl XacroOptions {
    /// The settings of the xacro call.
    pub(crate) fn settings(&self) -> XacroSettings {
        XacroSettings { arguments: self.arguments.iter().cloned().collect(), limit_s: self.xacro_limit_s }
    }

    /// Reads a robot file. xacro is started if permitted.
    pub(crate) fn load_robot(&self, path: &Path) -> Result<Robot, String> {
        let decisions = self.programs.decisions();
        let loaded = decisions.with(|programs| {
            interruption::while_program_runs(|is_stopped| {
                load_robot(path, &LoadSettings { xacro: self.settings(), programs, is_stopped: Some(is_stopped) })
            })
        });
        loaded.map_err(message_of)
    }
}

impl ProgramOptions {
    pub(crate) fn decisions(&self) -> Decisions {
        Decisions { is_allowed: self.allow_command, made: RefCell::default() }
    }

    /// Reads a study. xacro is started for its robot file if needed and permitted.
    pub(crate) fn load_study(&self, path: &Path, data: Option<&Path>) -> Result<Study, String> {
        let mut study = Study::load(path).map_err(message_of)?;
        let expanded = self.decisions().with(|programs| {
            interruption::while_program_runs(|is_stopped| study.expand_robot(path, data, programs, Some(is_stopped)))
        });
        expanded.map_err(known_in(path))?;
        Ok(study)
    }
}

pub(crate) struct Decisions {
    is_allowed: bool,
    made: RefCell<HashMap<Vec<String>, bool>>,
}

impl Decisions {
    /// Calls `job` and permits it the programs that these decisions allow.
    pub(crate) fn with<R>(&self, job: impl FnOnce(ProgramPermission<'_>) -> R) -> R {
        job(ProgramPermission::Ask(&|request| self.decide(request)))
    }

    /// Decides whether the robot program of a study may be started, before the job begins.
    pub(crate) fn decide_on_robot(&self, study: &Study, path: &Path) -> Result<(), String> {
        let robot = study.iteration.as_ref().map(|section| &section.robot);
        let Some(RobotChoice::Process(process)) = robot else { return Ok(()) };
        let permitted = self.with(|programs| process.permitted(programs));
        let refused = |source| message_of(Error::NotPermitted { path: path.to_owned(), source });
        permitted.map(drop).map_err(refused)
    }

    /// Decides whether a program may be started. It is shown once, and started if an option or the user's answer
    /// allows it.
    pub(crate) fn decide(&self, request: &ProgramRequest) -> bool {
        if let Some(&decision) = self.made.borrow().get(&request.command) {
            return decision;
        }
        let command = request.command_line();
        let question = permission_question(request);
        let decision = self.is_allowed || agreed(&question).unwrap_or(false);
        if decision {
            terminal::remark(&format!("starting {}: {command}", request.purpose));
        }
        self.made.borrow_mut().insert(request.command.clone(), decision);
        decision
    }
}

/// Length of a command above which its first characters may scroll off the screen, characters.
const LONG_COMMAND_CHARACTERS: usize = 500;

/// The question whether a program may be started. The command is on one line. For a long command the last line of the
/// question contains its program and length, so that a hostile command cannot scroll its first characters away and
/// end with a fake question.
fn permission_question(request: &ProgramRequest) -> String {
    let command = request.command_line();
    let command = one_line(&command);
    let length = command.chars().count();
    let program = request.command.first().map_or("", String::as_str);
    let which = if length > LONG_COMMAND_CHARACTERS {
        format!("The command has {length} characters; its program is {}. ", one_line(program))
    } else {
        String::new()
    };
    format!("{}:\n  {command}\n{which}Start it?", request.purpose)
}

pub(crate) fn for_motion(motion: &NextMotion) -> bool {
    let (leg, legs) = motion.leg;
    let of = if legs > 1 { format!(", trajectory {} of {legs}", leg + 1) } else { String::new() };
    let model = if motion.model_based { "with the newest model" } else { "without a model" };
    let share = if motion.speed < 1.0 { format!(" at {} of its speed", motion.speed) } else { String::new() };
    let what = match motion.purpose {
        RunPurpose::WarmUp { pass, of } => format!("warm-up pass {pass} of {of} before run {}", motion.run),
        RunPurpose::HeldOut => format!("the held-out motion after run {}", motion.run),
        RunPurpose::Run => format!("run {}", motion.run),
    };
    let speeds = |of: &[(String, f64)]| -> String {
        of.iter().map(|(joint, speed)| format!("{joint} {speed:.2}")).collect::<Vec<_>>().join(", ")
    };
    let ways = motion.ways.as_ref().map_or_else(String::new, |ways| {
        let over = |way: usize| match ways.over_postures[way] {
            0 => String::new(),
            1 => " through one via posture".to_owned(),
            several => format!(" through {several} via postures"),
        };
        format!(
            "\n  from home {:.1} s{}, back {:.1} s{}; largest velocities on these paths: {}",
            ways.approach_s,
            over(0),
            ways.return_s,
            over(1),
            speeds(&ways.largest_speed)
        )
    });
    let question = format!(
        "{what}{of}: {:.1} s{share} with controller {} {model}; largest velocities, rad/s (m/s): {}{ways}\nIs the robot clear?",
        motion.duration_s,
        motion.controller,
        speeds(&motion.largest_speed)
    );
    agreed(&question).unwrap_or(false)
}

pub(crate) fn somebody() -> Result<(), String> {
    if std::io::stdin().is_terminal() {
        return Ok(());
    }
    Err("--confirm needs a terminal, but standard input is not a terminal: run the command in a terminal".to_owned())
}

/// Asks for a line of text; `None` without a terminal, or for an empty answer.
pub(crate) fn text_asked(question: &str) -> Option<String> {
    if !(std::io::stdin().is_terminal() && terminal::watched()) {
        return None;
    }
    let answer = answer::to(&format!("{question} "))?;
    Some(answer.trim().to_owned()).filter(|answer| !answer.is_empty())
}

/// Asks a yes-or-no question; `None` without a terminal.
pub(crate) fn agreed(question: &str) -> Option<bool> {
    if !(std::io::stdin().is_terminal() && terminal::watched()) {
        return None;
    }
    let answer = text_asked(&format!("{question} [y/N]")).unwrap_or_default();
    Some(matches!(answer.to_lowercase().as_str(), "y" | "yes"))
}

#[cfg(test)]
mod tests {
    use super::permission_question;
    use dynident::{ProgramPurpose, ProgramRequest};

    #[test]
    fn a_command_cannot_hide_its_beginning() {
        let question = |command: &[&str]| {
            permission_question(&ProgramRequest::new(
                ProgramPurpose::Robot,
                command.iter().map(|word| (*word).to_owned()),
            ))
        };
        assert_eq!(question(&["python3", "robot.py"]), "the program of the robot:\n  python3 robot.py\nStart it?");
        let lines = question(&["sh", "-c", &format!("evil{}python3 robot.py\nStart it?", "\n".repeat(50))]);
        assert_eq!(lines.lines().count(), 3, "{lines}");
        let blanks = question(&["sh", "-c", &format!("evil{}python3 robot.py", " ".repeat(5000))]);
        assert!(blanks.ends_with("\nThe command has 5028 characters; its program is sh. Start it?"), "{blanks}");
    }
}
