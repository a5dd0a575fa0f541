//! **The `dynident` command**, as a library: what the binary and the Python package run. One file per subcommand under
//! `commands/`; this file reads the command line and turns the outcome into an exit status.
//!
//! ```
//! assert_eq!(dynident_cli::run(["dynident", "--version"].map(Into::into)), 0);
//! ```

mod commands;
mod progress;
mod summary;
mod terminal;

use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;
use std::io::Write;

/// Robot dynamic identification: logs to a dynamic model that can be trusted.
#[derive(Parser)]
#[command(
    name = "dynident",
    version,
    about = "Robot dynamic identification: from a URDF and logs to a dynamic model with error bars.",
    long_about = "Robot dynamic identification: from a URDF and logs to a dynamic model with error bars.\n\n\
        The path:\n  \
        1. dynident inspect arm.urdf             what the description says, and what is wrong with it\n  \
        2. dynident new --robot arm.urdf --log run.csv    writes study.toml: robot, logs, columns\n  \
        3. dynident check study.toml             do study, robot and logs fit together? names mistakes and their keys\n  \
        4. dynident identify study.toml --out R  fit, test on held-out logs, write R/result.json and R/identified.urdf\n  \
        5. dynident validate R/result.json --study other.toml\n  \
        6. load R/identified.urdf into your controller or simulator\n\n\
        dynident iterate runs a robot again and again, each time with the better model; simulate runs it once.\n\
        dynident reproduce works through the paper behind this program; dynident benchmark compares estimators."
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
    /// One machine-readable object on standard output; messages go to standard error.
    #[arg(long, global = true)]
    json: bool,
    /// Print results and errors only.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Threads to use; results are the same for any number. By default as many as there are processors.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Subcommand)]
enum Command {
    /// Read and audit a robot description (URDF, MJCF, SDF, or D-H table in TOML).
    Inspect(commands::inspect::Options),
    /// What a recording holds: format, channels with rates and ranges, and how a study could begin.
    Log(commands::log::Options),
    /// Write a study from a robot and its recordings, every line with what speaks for it, and examine it.
    New(commands::new::Options),
    /// Dynamics of a robot for a table of states, as CSV with 17 digits.
    Evaluate(commands::evaluate::Options),
    /// Find the motion that says most about a study's robot, inside every limit.
    Design(commands::design::Options),
    /// Examine a study against its robot and its logs before any fit is believed; names mistakes and what to write.
    Check(commands::check::Options),
    /// Fit a study's model to its logs and test it on the held-out ones.
    Identify(commands::identify::Options),
    /// Reduce logs to their factors: small files from which a model is identified without the logs.
    Reduce(commands::reduce::Options),
    /// Put factors of many logs into one file, in any order.
    Merge(commands::merge::Options),
    /// Test a finished model on other logs.
    Validate(commands::validate::Options),
    /// Write a finished model as C, C++, Rust, Python, MATLAB, MJCF, URDF, SDF, ROS 2 parameters or JSON, or a payload.
    Export(commands::export::Options),
    /// Let a simulated robot run a trajectory under a controller: a log, and the truth beside it.
    Simulate(commands::simulate::Options),
    /// Run, identify, load the better model and run again, until all has settled.
    Iterate(commands::iterate::Options),
    /// Reproduce the paper behind this program: every table and figure, as a page to look at.
    Reproduce(commands::reproduce::Options),
    /// Compare estimators on simulated recordings with known truth: error over the Cramér-Rao bound, coverage of error
    /// bars.
    Benchmark(commands::benchmark::Options),
    /// Print what lets a shell complete commands, options and files.
    Completions(commands::completions::Options),
    /// Write the manual pages: `dynident.1`, and one for each command.
    #[command(hide = true)]
    Man(commands::manual::Options),
}

/// How a command ended when it did what it was asked to.
enum Verdict {
    /// All is well: exit status 0.
    Good,
    /// Done, but the verdict is negative: exit status 1.
    Negative,
    /// Stopped by Ctrl-C, in good order: exit status 130.
    Interrupted,
}

/// Runs the command line `arguments`, the name of the program first, and returns the exit status: 0 if all is well, 1
/// for a negative verdict, 2 for what cannot be done, 130 after Ctrl-C. Results go to standard output, messages to
/// standard error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
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
        Command::Completions(options) => commands::completions::run(&options, Arguments::command(), &context),
        Command::Man(options) => commands::manual::run(&options, Arguments::command(), &context),
    });
    ended(outcome)
}

/// What is wrong with the command line. In colours, unless it holds an argument that would steer the terminal.
fn refused(error: &clap::Error) {
    let text = error.render().to_string();
    if terminal::readable(&text) == text {
        // Nothing is left to report if the terminal has gone.
        let _ = error.print();
    } else {
        terminal::complain(text.strip_prefix("error: ").unwrap_or(&text));
    }
}

/// The exit status.
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
