//! The `dynident` command as a library, used by the binary and the Python package. Each subcommand has a file in
//! `commands/`; this file parses the command line and converts the outcome to an exit status.
//!
//! ```
//! assert_eq!(dynident_cli::run(["dynident", "--version"].map(Into::into)), 0);
//! ```

mod book;
mod commands;
mod live;
mod packed;
mod progress;
mod summary;
mod terminal;

pub use commands::docs::{DOCS_SCHEMA, DocsFile, DocsMessage, DocsPage};
pub use commands::init::{INIT_SCHEMA, InitFile};

use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;
use std::io::Write;

/// Robot dynamic identification: from logs to a validated dynamic model.
#[derive(Parser)]
#[command(
    name = "dynident",
    version,
    about = "Robot dynamic identification: from a URDF and logs to a dynamic model with error bars.",
    long_about = "Robot dynamic identification: from a URDF and logs to a dynamic model with error bars.\n\n\
        Steps:\n  \
        1. dynident inspect arm.urdf             content and problems of the robot description\n  \
        2. dynident new --robot arm.urdf --log run.csv    writes study.toml: robot, logs, columns\n  \
        3. dynident check study.toml             find mistakes in study, robot and logs, and the keys to change\n  \
        4. dynident identify study.toml --out R  fit, test on held-out logs, write R/result.json and R/identified.urdf\n  \
        5. dynident validate R/result.json --study other.toml\n  \
        6. load R/identified.urdf into your controller or simulator\n\n\
        dynident iterate runs a robot repeatedly, each time with a better model; simulate runs it once.\n\
        dynident reproduce reproduces the paper behind this program; dynident benchmark compares estimators.\n\
        dynident docs prints the pages of the documentation and explains messages.\n\
        dynident init writes an example to start with; dynident --version --verbose shows details of this program."
)]
struct Arguments {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Options of every command.
#[derive(clap::Args)]
struct Common {
    /// Print one JSON object on standard output; messages go to standard error.
    #[arg(long, global = true)]
    json: bool,
    /// Print only problems and errors.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Number of threads; results are the same for any number. Default: number of processors.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Subcommand)]
enum Command {
    /// Read and audit a robot description (URDF, MJCF, SDF, or D-H table in TOML).
    Inspect(commands::inspect::Options),
    /// Show the content of a recording: format, channels with rates and ranges, and a suggested [format].
    Log(commands::log::Options),
    /// Write a study from a robot and its recordings, each line with its evidence, and examine it.
    New(commands::new::Options),
    /// Compute the dynamics of a robot for a table of states, as CSV with 17 digits.
    Evaluate(commands::evaluate::Options),
    /// Find the motion within all limits that excites a study's robot best.
    Design(commands::design::Options),
    /// Examine a study with its robot and logs before the fit; reports mistakes and the lines to write.
    Check(commands::check::Options),
    /// Fit a study's model to its logs and validate it on the held-out logs.
    Identify(commands::identify::Options),
    /// Reduce logs to factors: small files from which a model is identified without the logs.
    Reduce(commands::reduce::Options),
    /// Merge factors of several logs into one file, in any order.
    Merge(commands::merge::Options),
    /// Validate a model on other logs.
    Validate(commands::validate::Options),
    /// Write a model as C, C++, Rust, Python, MATLAB, MJCF, URDF, SDF, ROS 2 parameters or JSON, or a payload.
    Export(commands::export::Options),
    /// Simulate a robot that runs a trajectory with a controller; writes a log and the truth.
    Simulate(commands::simulate::Options),
    /// Run, identify and load the better model, until tracking error and parameters converge.
    Iterate(commands::iterate::Options),
    /// Reproduce the paper behind this program: every table and figure, with a report.
    Reproduce(commands::reproduce::Options),
    /// Compare estimators on simulated recordings with known truth: error over the Cramér-Rao bound, coverage of error
    /// bars.
    Benchmark(commands::benchmark::Options),
    /// Put results side by side: parameters, bodies, friction, and which parts of the robot changed.
    Compare(commands::compare::Options),
    /// Show a robot in three dimensions with its motions, or a result, as one page for the browser.
    View(commands::view::Options),
    /// Write a figure for a paper, its data, or a table: residuals, parameters, friction, convergence.
    Plot(commands::plot::Options),
    /// Write an example into a new folder: a robot, two short logs and their study.
    Init(commands::init::Options),
    /// Print a page of the documentation, or explain the code of a message.
    Docs(commands::docs::Options),
    /// Print a JSON schema: `schema study` for editors that check study files.
    Schema(commands::schema::Options),
    /// Print a shell script that completes commands, options and files.
    Completions(commands::completions::Options),
    /// Write the manual pages: `dynident.1`, and one for each command.
    #[command(hide = true)]
    Man(commands::manual::Options),
}

enum Verdict {
    /// Success: exit status 0.
    Good,
    /// The command was executed, but its result is negative: exit status 1.
    Negative,
    /// Interrupted by Ctrl-C after a clean stop: exit status 130.
    Interrupted,
}

/// Runs the command line `arguments`, beginning with the program name, and returns the exit status: 0 for success, 1
/// for a negative result, 2 for an error, 130 after Ctrl-C. Results go to standard output, messages to standard
/// error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if commands::version::is_requested(&arguments) {
        return ended(terminal::print(&commands::version::text()).map(|()| Verdict::Good));
    }
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            return if error.use_stderr() {
                refused(&error);
                2
            } else {
                ended(terminal::written(error.print().and_then(|()| std::io::stdout().flush())).map(|()| Verdict::Good))
            };
        }
    };
    let threads = arguments
        .common
        .threads
        .map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let context = commands::Context { json: arguments.common.json, quiet: arguments.common.quiet, threads };
    let outcome = commands::with_threads(threads, || match arguments.command {
        Command::Inspect(options) => commands::inspect::run(&options, &context),
        Command::Log(options) => commands::log::run(&options, &context),
        Command::New(options) => commands::new::run(&options, &context),
        Command::Evaluate(options) => commands::evaluate::run(&options, &context),
        Command::Design(options) => commands::design::run(&options, &context),
        Command::Check(options) => commands::check::run(&options, &context),
        Command::Identify(options) => commands::identify::run(&options, &context),
        Command::Reduce(options) => commands::reduce::run(&options, &context),
        Command::Merge(options) => commands::merge::run(&options, &context),
        Command::Validate(options) => commands::validate::run(&options, &context),
        Command::Export(options) => commands::export::run(&options, &context),
        Command::Simulate(options) => commands::simulate::run(&options, &context),
        Command::Iterate(options) => commands::iterate::run(&options, &context),
        Command::Reproduce(options) => commands::reproduce::run(&options, &context),
        Command::Benchmark(options) => commands::benchmark::run(&options, &context),
        Command::Compare(options) => commands::compare::run(&options, &context),
        Command::View(options) => commands::view::run(&options, &context),
        Command::Plot(options) => commands::plot::run(&options, &context),
        Command::Init(options) => commands::init::run(&options, &context),
        Command::Docs(options) => commands::docs::run(&options, &context),
        Command::Schema(options) => commands::schema::run(&options, &context),
        Command::Completions(options) => commands::completions::run(&options, Arguments::command(), &context),
        Command::Man(options) => commands::manual::run(&options, Arguments::command(), &context),
    });
    ended(outcome)
}

/// Prints an error in the command line. Colours are used unless an argument contains terminal control characters.
fn refused(error: &clap::Error) {
    let text = error.render().to_string();
    if terminal::readable(&text) == text {
        // An error of printing, for example on a closed terminal, is ignored.
        let _ = error.print();
    } else {
        terminal::complain(text.strip_prefix("error: ").unwrap_or(&text));
    }
}

fn ended(outcome: Result<Verdict, String>) -> u8 {
    match outcome {
        Ok(Verdict::Good) => 0,
        Ok(Verdict::Negative) => 1,
        Ok(Verdict::Interrupted) => commands::interruption::STATUS,
        Err(message) => {
            terminal::complain(&message);
            2
        }
    }
}
