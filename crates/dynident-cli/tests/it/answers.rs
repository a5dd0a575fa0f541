//! Questions on a terminal: input typed before a question is ignored, and Ctrl-C ends the wait.

use crate::programs::{self, EXPANDS, starts, with_xacro};
use crate::robots_outside::{robot, study};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

struct OnTerminal {
    program: Child,
    keyboard: File,
    screen: Arc<Mutex<String>>,
}

impl OnTerminal {
    fn iterate(study: &Path) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
        command.arg("iterate").arg(study).arg("--out").arg(study.with_file_name("result"));
        command.args(["--allow-command", "--confirm"]);
        Self::start(command)
    }

    fn start(mut command: Command) -> Self {
        let keyboard = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&keyboard).unwrap();
        unlockpt(&keyboard).unwrap();
        let name = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
        let terminal = || Stdio::from(File::options().read(true).write(true).open(&name).unwrap());
        let program = command.stdin(terminal()).stdout(terminal()).stderr(terminal()).spawn().unwrap();
        let keyboard = File::from(keyboard);
        let screen = Arc::new(Mutex::new(String::new()));
        let (mut seen, shown) = (keyboard.try_clone().unwrap(), Arc::clone(&screen));
        std::thread::spawn(move || {
            let mut bytes = [0; 1024];
            // On Linux, reading fails when the program has ended.
            while let Ok(count @ 1..) = seen.read(&mut bytes) {
                shown.lock().unwrap().push_str(&String::from_utf8_lossy(&bytes[..count]));
            }
        });
        Self { program, keyboard, screen }
    }

    fn types(&mut self, keys: &str) {
        self.keyboard.write_all(keys.as_bytes()).unwrap();
    }

    fn screen(&self) -> String {
        self.screen.lock().unwrap().clone()
    }

    /// Waits until the words are on the screen `times` times.
    fn awaits(&mut self, words: &str, times: usize) {
        for _ in 0..6000 {
            if self.screen().matches(words).count() >= times {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("{words} not {times} times on the screen: {}", self.screen());
    }

    fn ends(&mut self) -> Option<i32> {
        for _ in 0..6000 {
            if let Some(status) = self.program.try_wait().unwrap() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        self.program.kill().unwrap();
        panic!("it waits still: {}", self.screen());
    }
}

/// The robot stops the first run, so that a second question follows.
const STOPS: &str =
    r#"printf x >>"$1/moved"; sleep 0.3; printf '%s\n' '{"type":"end","status":"stopped","reason":"as asked"}'"#;

/// A robot file with macros: the command is shown, and xacro starts after a yes. `new` reads the robot several times,
/// and asks once.
#[test]
fn xacro_starts_after_a_yes_on_the_terminal() {
    let folder = programs::folder(EXPANDS);
    let mut refused = OnTerminal::start(with_xacro(folder.path(), &["check", "good.toml"]));
    refused.awaits("Start it? [y/N]", 1);
    assert!(refused.screen().contains("the program that expands the robot file:\r\n  xacro arm.urdf\r\n"));
    refused.types("\n");
    assert_eq!(refused.ends(), Some(2), "{}", refused.screen());
    assert_eq!(starts(folder.path()), [""; 0]);

    let new = ["new", "--robot", "arm.urdf", "--log", "log.csv", "--out", "new.toml"];
    let mut permitted = OnTerminal::start(with_xacro(folder.path(), &new));
    permitted.awaits("Start it? [y/N]", 1);
    permitted.types("y\n");
    permitted.awaits("note: starting the program that expands the robot file: xacro arm.urdf", 1);
    while !folder.path().join("new.toml").exists() {
        // Uncertain lines of the new study.
        permitted.types("\n");
        std::thread::sleep(Duration::from_millis(200));
        assert!(
            permitted.program.try_wait().unwrap().is_none_or(|status| status.code() != Some(2)),
            "{}",
            permitted.screen()
        );
    }
    permitted.ends();
    assert_eq!(starts(folder.path()), ["arm.urdf"]);
    assert_eq!(permitted.screen().matches("Start it?").count(), 1);
}

/// An additional Enter, or an answer typed ahead while the robot moves, does not answer the next question.
#[test]
fn what_was_typed_before_a_question_is_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    robot(folder.path(), STOPS);
    let mut terminal = OnTerminal::iterate(&study(folder.path(), ""));
    terminal.awaits("Is the robot clear?", 1);
    terminal.types("y\ny\n\ny\n");
    terminal.awaits("Is the robot clear?", 2);
    // Long enough for an answer typed ahead to have an effect.
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(std::fs::read_to_string(folder.path().join("moved")).unwrap(), "x", "{}", terminal.screen());
    assert!(terminal.program.try_wait().unwrap().is_none(), "{}", terminal.screen());
    terminal.types("n\n");
    assert_eq!(terminal.ends(), Some(1), "{}", terminal.screen());
    assert_eq!(std::fs::read_to_string(folder.path().join("moved")).unwrap(), "x");
}

/// Ctrl-C at a question: no Enter is needed, nothing moves, and a message is shown.
#[test]
fn an_interruption_ends_the_wait_for_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    robot(folder.path(), STOPS);
    let mut terminal = OnTerminal::iterate(&study(folder.path(), ""));
    terminal.awaits("[y/N]", 1);
    let id = terminal.program.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert_eq!(terminal.ends(), Some(130), "{}", terminal.screen());
    terminal.awaits("is treated as answered with no", 1);
    assert!(!folder.path().join("moved").exists());
}
